"""Exchange of lines with many clients, protected against overload and clients without a token, and a TCP server."""

import asyncio
import contextlib
import hmac
import ipaddress
import json
import math
import socket
from collections import Counter
from collections.abc import Callable, Iterable
from operator import itemgetter
from typing import Protocol

from vedette.errors import InputError
from vedette.live.answers import Answer, encode_line
from vedette.live.lines import CHUNK, LineSplitter
from vedette.live.messages import MAX_LINE_BYTES
from vedette.live.remarks import Remarks
from vedette.simulation.journal import error_cause

MAX_CLIENTS = 128  # including pages
MAX_CLIENTS_PER_ADDRESS = 64  # clients per address
MAX_WAITING = 32  # further connections that have not entered
BACKLOG = 16  # connections accepted before any of them is counted
IDLE_SECONDS = 60.0  # silence after which a client may be disconnected to make room
FIRST_LINE_SECONDS = 10.0  # the same for a client that has not sent a valid line
WRONG_TOKEN_DELAY = 1.0  # delay of the answer to a wrong token
MIN_TOKEN_LENGTH = 16  # letters
MAX_UNREAD_BYTES = 8_000_000  # bytes of answers that a client has not read
ENTRY_TIMEOUT = 10.0  # s, for the token or handshake
_MAX_TOKEN_LINE = 4096  # bytes of the line with the token


def is_loopback(address: str) -> bool:
    """Return True if the address is a numeric loopback address, which other machines cannot reach."""
    try:
        return ipaddress.ip_address(address.partition("%")[0]).is_loopback
    except ValueError:
        return False


def check_address(host: str, token: str | None) -> None:
    """Raise `InputError` for an unknown address, a short token, or no token at an address that others can reach."""
    if token is not None and len(token.strip()) < MIN_TOKEN_LENGTH:
        raise InputError(f"--token: expected at least {MIN_TOKEN_LENGTH} letters; got {len(token.strip())}")
    try:
        addresses = {str(info[4][0]) for info in socket.getaddrinfo(host, None)}
    except (OSError, UnicodeError) as error:
        raise InputError(f"--listen: expected an address of this machine; got {host!r}: {error}") from None
    if token is None and not all(map(is_loopback, addresses)):
        raise InputError(f"--listen: expected a loopback address such as 127.0.0.1, or --token; got {host}")


class Client(Protocol):
    """A connection that sends lines and receives answers."""

    name: str
    address: str  # the name without the port

    def send(self, text: bytes) -> None:
        """Send without waiting. Unread bytes stay in a buffer."""

    def unread(self) -> int:
        """Return the bytes in that buffer."""

    def is_gone(self) -> bool:
        """Return True once the connection has ended or is ending."""

    def abort(self) -> None:
        """End the connection."""


def peer_name(transport: asyncio.BaseTransport) -> tuple[str, str]:
    """Return the name and the address of the other end, which may have gone before it was accepted."""
    host, port = (transport.get_extra_info("peername") or ("a client that is gone", 0))[:2]
    return f"{host}:{port}", str(host)


class LineServer:
    """Exchange that processes the lines of many clients: estimates and plans go to all, an error only to its sender.

    A client that sends faster than lines are processed waits, by the flow control of TCP, while other clients are
    served. No queue builds up. A client that does not read its answers is disconnected. A client enters after its token
    or its handshake. If more than `MAX_WAITING` have not entered, the first client of the address with the most of
    them is disconnected. If there is no room, a client that was silent for `IDLE_SECONDS`, or has not sent a valid line
    within `FIRST_LINE_SECONDS`, is disconnected.

    Args:
        process: function that processes a line and returns its answers.
        token: token that clients must send. None: no token.
        report: receives remarks about clients, at most one per kind, address and minute.
    """

    def __init__(
        self, process: Callable[[bytes], Iterable[Answer]], token: str | None, report: Callable[[str], object]
    ) -> None:
        self._process, self._token, self.report = process, token, report
        self.remark = Remarks(report)
        self._waiting: dict[Client, None] = {}  # in order of arrival
        self._entered: dict[Client, float] = {}  # time of each client's last valid line; inf for pages
        self._senders = set[Client]()  # clients that have sent a valid line
        self.num_processed = 0
        self.changed = asyncio.Event()

    @property
    def needs_token(self) -> bool:
        """True if clients must send a token."""
        return self._token is not None

    def is_token(self, given: object) -> bool:
        """Return True if `given` is the token, or if no token is needed."""
        if self._token is None:
            return True
        return isinstance(given, str) and hmac.compare_digest(
            given.encode("utf-8", "replace"), self._token.encode("utf-8", "replace")
        )

    def open(self, client: Client) -> None:
        """Register a connection that has not entered. Another one may be disconnected. It must `leave` at its end."""
        self._waiting[client] = None
        if len(self._waiting) > MAX_WAITING:
            ((address, _),) = Counter(each.address for each in self._waiting).most_common(1)
            first = next(each for each in self._waiting if each.address == address)
            del self._waiting[first]
            self.remark(first, "had not entered, and made way")
            first.abort()

    def enter(self, client: Client, *, is_page: bool = False) -> str:
        """Let a client in, which receives all answers from now on, and return "", or the reason if there is no room."""
        num_from_address = sum(each.address == client.address for each in self._entered)
        if num_from_address >= MAX_CLIENTS_PER_ADDRESS and not self._disconnect_idle(client.address):
            return f"expected at most {MAX_CLIENTS_PER_ADDRESS} clients of one address; got one more"
        if len(self._entered) >= MAX_CLIENTS and not self._disconnect_idle(None):
            return f"expected at most {MAX_CLIENTS} clients; got one more"
        self._waiting.pop(client, None)
        self._entered[client] = math.inf if is_page else asyncio.get_running_loop().time()
        return ""

    def _disconnect_idle(self, address: str | None) -> bool:
        """Disconnect the client, of this or any address, that was silent longest, and return False if none was."""
        now = asyncio.get_running_loop().time()
        silent = [
            (since, entered)
            for entered, since in self._entered.items()
            if now - since >= (IDLE_SECONDS if entered in self._senders else FIRST_LINE_SECONDS)
            and address in (None, entered.address)
        ]
        if not silent:
            return False
        since, client = min(silent, key=itemgetter(0))
        self.remark(client, "was silent", f" for {now - since:.0f} s, and made way")
        del self._entered[client]
        client.abort()
        return True

    def leave(self, client: Client) -> None:
        """Remove a connection that has ended."""
        self._waiting.pop(client, None)
        self._entered.pop(client, None)
        self._senders.discard(client)

    async def refuse_token(self, client: Client) -> None:
        """Make a remark on a wrong token, and delay the answer."""
        if client.is_gone():  # disconnected before it sent anything
            return
        self.remark(client, "had no token")
        await asyncio.sleep(WRONG_TOKEN_DELAY)

    async def answer(self, line: bytes, sender: Client | None) -> None:
        """Process a line, send its answers, and let other clients be served."""
        answers = list(self._process(line))
        if sender in self._entered and not any("error" in answer for answer in answers):
            self._entered[sender] = asyncio.get_running_loop().time()
            self._senders.add(sender)
        for answer in answers:
            text = encode_line(answer)
            for client in ([sender] if sender else []) if "error" in answer else list(self._entered):
                self._send(client, text)
        self.num_processed += 1
        self.changed.set()
        await asyncio.sleep(0.0)

    def _send(self, client: Client, text: bytes) -> None:
        if client.is_gone():  # its task has not removed it yet
            return
        client.send(text)
        if client.unread() > MAX_UNREAD_BYTES:
            self.remark(client, "does not read its answers, and was put out")
            self._entered.pop(client, None)
            client.abort()


class _TcpClient:
    def __init__(self, writer: asyncio.StreamWriter) -> None:
        self.name, self.address = peer_name(writer.transport)
        self.send, self.abort, self.is_gone = writer.write, writer.transport.abort, writer.transport.is_closing
        self.unread = writer.transport.get_write_buffer_size


class TcpServer:
    """TCP server of a line server. Each client first sends `{"token": "..."}` if a token is needed."""

    def __init__(self, line_server: LineServer) -> None:
        self._line_server = line_server

    async def listen(self, host: str, port: int) -> asyncio.Server:
        """Start to listen. Raises `InputError` if the address is not available."""
        try:
            return await asyncio.start_server(self._handle, host, port, backlog=BACKLOG)
        except OSError as error:
            raise address_in_use(error) from None

    async def _handle(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Serve a client to its end. Nothing is awaited after it, as a cancelled stream task prints a traceback."""
        client = _TcpClient(writer)
        self._line_server.open(client)
        try:
            await self._admit(reader, client, writer)
        except (ConnectionError, asyncio.CancelledError):  # the client or the server has ended
            pass
        except Exception as error:  # such as a record that cannot be written
            self._line_server.remark(client, "was put out", f": {error_cause(error)}")
        finally:
            self._line_server.leave(client)
            writer.close()
            asyncio.get_running_loop().call_later(ENTRY_TIMEOUT, client.abort)  # a client that reads nothing more

    async def _admit(self, reader: asyncio.StreamReader, client: _TcpClient, writer: asyncio.StreamWriter) -> None:
        if not await self._has_token(reader):
            await self._line_server.refuse_token(client)
            await _refuse(writer, 'expected {"token": ...} first; got none, or another')
        elif fault := self._line_server.enter(client):
            await _refuse(writer, fault)
        else:
            await self._serve(reader, client, writer)

    async def _has_token(self, reader: asyncio.StreamReader) -> bool:
        if not self._line_server.needs_token:
            return True
        try:
            line = await asyncio.wait_for(reader.readuntil(b"\n"), ENTRY_TIMEOUT)
            message = json.loads(line[:_MAX_TOKEN_LINE])
        except (TimeoutError, asyncio.IncompleteReadError, asyncio.LimitOverrunError, ValueError, RecursionError):
            return False
        return isinstance(message, dict) and self._line_server.is_token(message.get("token"))

    async def _serve(self, reader: asyncio.StreamReader, client: Client, writer: asyncio.StreamWriter) -> None:
        splitter, is_first = LineSplitter(MAX_LINE_BYTES), True
        while data := await reader.read(CHUNK):
            for line in splitter.feed(data):
                # A foreign web page can make a browser send lines here, after a first line of this form.
                if is_first and line.rpartition(b" ")[2].startswith(b"HTTP/"):
                    self._line_server.remark(client, "spoke HTTP, and was put out")
                    return await _refuse(writer, "expected lines of JSON; got HTTP, for which there is ws://")
                is_first = False
                await self._line_server.answer(line, client)
        for line in splitter.rest():
            await self._line_server.answer(line, client)


async def _refuse(writer: asyncio.StreamWriter, text: str) -> None:
    if writer.transport.is_closing():
        return
    writer.write(encode_line({"error": text}))
    with contextlib.suppress(ConnectionError):
        await writer.drain()


def address_in_use(error: OSError) -> InputError:
    """Return the error for an address that is not available."""
    return InputError(f"--listen: expected an address that is free; {error.strerror or error}")
