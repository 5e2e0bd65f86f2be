"""Lines of many clients: an exchange that no client can fill, stop or enter without a token, and a TCP server."""

from __future__ import annotations

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
from vedette.live.lines import CHUNK, LineSplitter
from vedette.live.loop import Answer, encoded
from vedette.live.messages import MOST_BYTES
from vedette.live.remarks import Remarks
from vedette.simulation.journal import error_cause

MOST_CLIENTS = 128  # pages, too
MOST_OF_ADDRESS = 64  # of these
MOST_WAITING = 32  # beside these, that have not entered
BACKLOG = 16  # connections accepted before any of them is counted
IDLE_SECONDS = 60.0  # after which a silent client makes way where there is no room
WRONG_SECONDS = 1.0  # that the answer to a wrong token takes
LEAST_TOKEN = 16  # letters
MOST_UNREAD = 8_000_000  # bytes of answers that a client leaves lying
ENTER_WITHIN = 10.0  # s, with its token or handshake
_LONGEST_TOKEN = 4096  # bytes of its line


def is_loopback(address: str) -> bool:
    """Whether it is a number of this machine that no other can reach."""
    try:
        return ipaddress.ip_address(address.partition("%")[0]).is_loopback
    except ValueError:
        return False


def check_address(host: str, token: str | None) -> None:
    """`InputError` for an address that others can reach, without a token; or that there is not; or for a token that can
    be guessed.
    """
    if token is not None and len(token.strip()) < LEAST_TOKEN:
        raise InputError(f"--token: expected at least {LEAST_TOKEN} letters; got {len(token.strip())}")
    try:
        found = {str(info[4][0]) for info in socket.getaddrinfo(host, None)}
    except (OSError, UnicodeError) as error:
        raise InputError(f"--listen: expected an address of this machine; got {host!r}: {error}") from None
    if token is None and not all(map(is_loopback, found)):
        raise InputError(f"--listen: expected a loopback address such as 127.0.0.1, or --token; got {host}")


class Client(Protocol):
    """A connection that sends lines and receives answers."""

    name: str
    address: str  # the name without the port

    def send(self, text: bytes) -> None:
        """Send without waiting; what is not read stays in a buffer."""
        ...

    def unread(self) -> int:
        """Return the bytes in that buffer."""
        ...

    def is_gone(self) -> bool:
        """Return True once the connection has ended or is ending."""
        ...

    def abort(self) -> None:
        """End the connection."""
        ...


def name_of(transport: asyncio.BaseTransport) -> tuple[str, str]:
    """Return the name and the address of the other end, which may be gone before it was accepted."""
    host, port = (transport.get_extra_info("peername") or ("a client that is gone", 0))[:2]
    return f"{host}:{port}", str(host)


class Exchange:
    """Takes lines of many clients in turn, and answers: estimates and plans to all, an error to who caused it.

    A client that sends faster than lines are taken is made to wait, by the flow control of TCP, while the others have
    their turns; nothing is piled up. One that does not read its answers is put out. A client enters after its token or
    its handshake. Of more than `MOST_WAITING` that have not entered, the first of the address with the most is put
    out. Of those that have entered, one that has been silent for `IDLE_SECONDS` makes way where there is no room.

    Args:
        take: what is done with a line; its answers.
        token: that a client must know; None: none.
        tell: receives remarks about clients, of one kind and address one a minute.
    """

    def __init__(
        self, take: Callable[[bytes], Iterable[Answer]], token: str | None, tell: Callable[[str], object]
    ) -> None:
        self._take, self._token, self.tell = take, token, tell
        self.remark = Remarks(tell)
        self._waiting: dict[Client, None] = {}  # in the order in which they came
        self._entered: dict[Client, float] = {}  # when each sent its last line; pages: never silent
        self.num_taken = 0
        self.changed = asyncio.Event()

    @property
    def needs_token(self) -> bool:
        """Whether clients must know one."""
        return self._token is not None

    def is_token(self, given: object) -> bool:
        """Whether a client may enter by this; with no token, by anything."""
        if self._token is None:
            return True
        return isinstance(given, str) and hmac.compare_digest(
            given.encode("utf-8", "replace"), self._token.encode("utf-8", "replace")
        )

    def open(self, client: Client) -> None:
        """Note a connection that has not entered; it is to `leave`. Another one may be put out for it."""
        self._waiting[client] = None
        if len(self._waiting) > MOST_WAITING:
            ((address, _),) = Counter(each.address for each in self._waiting).most_common(1)
            first = next(each for each in self._waiting if each.address == address)
            del self._waiting[first]
            self.remark(first, "had not entered, and made way")
            first.abort()

    def enter(self, client: Client, *, is_page: bool = False) -> str:
        """Let a client in, which from now on receives the answers; or return why there is no room for it."""
        num_of_address = sum(each.address == client.address for each in self._entered)
        if num_of_address >= MOST_OF_ADDRESS and not self._make_way(client.address):
            return f"expected at most {MOST_OF_ADDRESS} clients of one address; got one more"
        if len(self._entered) >= MOST_CLIENTS and not self._make_way(None):
            return f"expected at most {MOST_CLIENTS} clients; got one more"
        self._waiting.pop(client, None)
        self._entered[client] = math.inf if is_page else asyncio.get_running_loop().time()
        return ""

    def _make_way(self, address: str | None) -> bool:
        """Put out the client, of an address or of any, that has been silent for longest; false where none has."""
        now = asyncio.get_running_loop().time()
        silent = [
            (since, own)
            for own, since in self._entered.items()
            if now - since >= IDLE_SECONDS and address in (None, own.address)
        ]
        if not silent:
            return False
        since, client = min(silent, key=itemgetter(0))
        self.remark(client, "was silent", f" for {now - since:.0f} s, and made way")
        del self._entered[client]
        client.abort()
        return True

    def leave(self, client: Client) -> None:
        """Forget a connection that has ended."""
        self._waiting.pop(client, None)
        self._entered.pop(client, None)

    async def refuse_token(self, client: Client) -> None:
        """Remark on a wrong token, and make the client wait."""
        if client.is_gone():  # put out before it had said anything
            return
        self.remark(client, "had no token")
        await asyncio.sleep(WRONG_SECONDS)

    async def answer(self, line: bytes, sender: Client | None) -> None:
        """Take a line, and let the others have their turn."""
        if sender in self._entered:
            self._entered[sender] = asyncio.get_running_loop().time()
        for answer in self._take(line):
            text = encoded(answer)
            for client in ([sender] if sender else []) if "error" in answer else list(self._entered):
                self._send(client, text)
        self.num_taken += 1
        self.changed.set()
        await asyncio.sleep(0.0)

    def _send(self, client: Client, text: bytes) -> None:
        if client.is_gone():  # its task has not come to it yet
            return
        client.send(text)
        if client.unread() > MOST_UNREAD:
            self.remark(client, "does not read its answers, and was put out")
            self._entered.pop(client, None)
            client.abort()


class _TcpClient:
    def __init__(self, writer: asyncio.StreamWriter) -> None:
        self.name, self.address = name_of(writer.transport)
        self.send, self.abort, self.is_gone = writer.write, writer.transport.abort, writer.transport.is_closing
        self.unread = writer.transport.get_write_buffer_size


class TcpServer:
    """Lines of clients over TCP, each of which sends `{"token": "..."}` first where one is needed."""

    def __init__(self, exchange: Exchange) -> None:
        self._exchange = exchange

    async def listen(self, host: str, port: int) -> asyncio.Server:
        """Raises `InputError` for an address that cannot be had."""
        try:
            return await asyncio.start_server(self._meet, host, port, backlog=BACKLOG)
        except OSError as error:
            raise taken(error) from None

    async def _meet(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Serve a client to its end. Nothing is awaited after it, as a cancelled task of a stream is a traceback."""
        client = _TcpClient(writer)
        self._exchange.open(client)
        try:
            await self._let_in(reader, client, writer)
        except (ConnectionError, asyncio.CancelledError):  # it is gone, or the server is
            pass
        except Exception as error:  # such as a record that cannot be written
            self._exchange.remark(client, "was put out", f": {error_cause(error)}")
        finally:
            self._exchange.leave(client)
            writer.close()
            asyncio.get_running_loop().call_later(ENTER_WITHIN, client.abort)  # one that reads nothing more

    async def _let_in(self, reader: asyncio.StreamReader, client: _TcpClient, writer: asyncio.StreamWriter) -> None:
        if not await self._may_enter(reader):
            await self._exchange.refuse_token(client)
            await _refuse(writer, 'expected {"token": ...} first; got none, or another')
        elif fault := self._exchange.enter(client):
            await _refuse(writer, fault)
        else:
            await self._serve(reader, client, writer)

    async def _may_enter(self, reader: asyncio.StreamReader) -> bool:
        if not self._exchange.needs_token:
            return True
        try:
            line = await asyncio.wait_for(reader.readuntil(b"\n"), ENTER_WITHIN)
            said = json.loads(line[:_LONGEST_TOKEN])
        except (TimeoutError, asyncio.IncompleteReadError, asyncio.LimitOverrunError, ValueError, RecursionError):
            return False
        return isinstance(said, dict) and self._exchange.is_token(said.get("token"))

    async def _serve(self, reader: asyncio.StreamReader, client: Client, writer: asyncio.StreamWriter) -> None:
        splitter, is_first = LineSplitter(MOST_BYTES), True
        while data := await reader.read(CHUNK):
            for line in splitter.feed(data):
                # A web page of somebody else's can have a browser send lines here, under such a first one.
                if is_first and line.rpartition(b" ")[2].startswith(b"HTTP/"):
                    self._exchange.remark(client, "spoke HTTP, and was put out")
                    return await _refuse(writer, "expected lines of JSON; got HTTP, for which there is ws://")
                is_first = False
                await self._exchange.answer(line, client)
        for line in splitter.rest():
            await self._exchange.answer(line, client)


async def _refuse(writer: asyncio.StreamWriter, text: str) -> None:
    if writer.transport.is_closing():
        return
    writer.write(encoded({"error": text}))
    with contextlib.suppress(ConnectionError):
        await writer.drain()


def taken(error: OSError) -> InputError:
    """What is said of an address that cannot be had."""
    return InputError(f"--listen: expected an address that is free; {error.strerror or error}")
