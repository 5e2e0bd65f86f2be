"""What takes lines of many clients, and a server of TCP, that nobody can fill, stop or enter without a token."""

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

MOST_CLIENTS = 128  # pages, too
MOST_OF_ADDRESS = 64  # of these
MOST_WAITING = 32  # of these, that have not entered
IDLE_SECONDS = 60.0  # after which a silent client makes way where there is no room
WRONG_SECONDS = 1.0  # that the answer to a wrong token takes
LEAST_TOKEN = 16  # letters
MOST_UNREAD = 8_000_000  # bytes of answers that a client leaves lying
TOKEN_WITHIN = 10.0  # s
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
    """Who sends lines and gets answers."""

    name: str

    @property
    def address(self) -> str:
        """Where it comes from, without the port."""
        ...

    def send(self, text: bytes) -> None:
        """Without waiting; what is not read lies in a buffer."""
        ...

    def unread(self) -> int:
        """Bytes that lie there."""
        ...

    def abort(self) -> None:
        """End the connection."""
        ...


class Exchange:
    """Takes lines of many clients in turn, and answers: estimates and plans to all, an error to who caused it.

    A client that sends faster than lines are taken is made to wait, by the flow control of TCP, while the others have
    their turns; nothing is piled up. One that does not read its answers is put out. Where there is no room, the client
    that has been silent for longest makes way, if that is `IDLE_SECONDS` or more.

    Args:
        take: what is done with a line; its answers.
        token: that a client must know; None: none.
        tell: is told who comes, and who is put out and why.
    """

    def __init__(
        self, take: Callable[[bytes], Iterable[Answer]], token: str | None, tell: Callable[[str], object]
    ) -> None:
        self._take, self._token, self.tell = take, token, tell
        self._clients: dict[Client, float] = {}  # when each sent its last line
        self._open: Counter[str] = Counter()  # by address
        self._refused: dict[str, float] = {}  # when an address was last told of
        self._num_waiting, self.num_taken = 0, 0
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

    def open(self, address: str) -> str:
        """Count one that comes, and say why there is no room for it, or nothing; each is to `leave`."""
        self._open[address] += 1
        self._num_waiting += 1
        if self._num_waiting > MOST_WAITING:
            return f"expected at most {MOST_WAITING} clients that have not entered; got one more"
        if self._open[address] > MOST_OF_ADDRESS and not self._make_way(address):
            return f"expected at most {MOST_OF_ADDRESS} clients of one address; got one more"
        if self._open.total() > MOST_CLIENTS and not self._make_way(None):
            return f"expected at most {MOST_CLIENTS} clients; got one more"
        return ""

    def _make_way(self, address: str | None) -> bool:
        """Put out the client, of an address or of any, that has been silent for longest; false where none has."""
        now = asyncio.get_running_loop().time()
        silent = [
            (since, own)
            for own, since in self._clients.items()
            if now - since >= IDLE_SECONDS and address in (None, own.address)
        ]
        if not silent:
            return False
        since, client = min(silent, key=itemgetter(0))
        self.tell(f"{client.name} was silent for {now - since:.0f} s, and made way")
        del self._clients[client]
        client.abort()
        return True

    def leave(self, client: Client, *, entered: bool) -> None:
        """One that came has gone. entered: whether it was let in."""
        self._open[client.address] -= 1
        if not self._open[client.address]:
            del self._open[client.address]
        if not entered:
            self._num_waiting -= 1
        self._clients.pop(client, None)

    def let_in(self) -> None:
        """One that came waits no longer; it is `entered` for `leave`."""
        self._num_waiting -= 1

    def enter(self, client: Client) -> None:
        """From now on it has the answers."""
        self._clients[client] = asyncio.get_running_loop().time()

    async def refuse_token(self, name: str) -> None:
        """Tell of a wrong token, of an address once in a while, and let who guesses wait."""
        now, address = asyncio.get_running_loop().time(), name.rpartition(":")[0]
        if now - self._refused.get(address, -math.inf) >= IDLE_SECONDS:
            self.tell(f"{name} had no token")
            if len(self._refused) >= MOST_CLIENTS:
                self._refused.clear()
            self._refused[address] = now
        await asyncio.sleep(WRONG_SECONDS)

    async def answer(self, line: bytes, sender: Client | None) -> None:
        """Take a line, and let the others have their turn."""
        if sender in self._clients:
            self._clients[sender] = asyncio.get_running_loop().time()
        for answer in self._take(line):
            text = encoded(answer)
            for client in ([sender] if sender else []) if "error" in answer else list(self._clients):
                self._send(client, text)
        self.num_taken += 1
        self.changed.set()
        await asyncio.sleep(0.0)

    def _send(self, client: Client, text: bytes) -> None:
        client.send(text)
        if client.unread() > MOST_UNREAD:
            self.tell(f"{client.name} does not read its answers, and was put out")
            self._clients.pop(client, None)
            client.abort()


class _TcpClient:
    def __init__(self, writer: asyncio.StreamWriter) -> None:
        self.name = "{}:{}".format(*writer.get_extra_info("peername")[:2])
        self.address = self.name.rpartition(":")[0]
        self.send, self.abort = writer.write, writer.transport.abort
        self.unread = writer.transport.get_write_buffer_size


class TcpServer:
    """Lines of clients over TCP, each of which sends `{"token": "..."}` first where one is needed."""

    def __init__(self, exchange: Exchange) -> None:
        self._exchange = exchange

    async def listen(self, host: str, port: int) -> asyncio.Server:
        """Raises `InputError` for an address that cannot be had."""
        try:
            return await asyncio.start_server(self._meet, host, port)
        except OSError as error:
            raise taken(error) from None

    async def _meet(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        client, exchange, entered = _TcpClient(writer), self._exchange, False
        try:
            if fault := exchange.open(client.address):
                await _refuse(writer, fault)
            elif not await self._may_enter(reader):
                await exchange.refuse_token(client.name)
                await _refuse(writer, 'expected {"token": ...} first; got none, or another')
            else:
                entered = True
                exchange.let_in()
                exchange.enter(client)
                await self._serve(reader, client, writer)
        except (ConnectionError, asyncio.CancelledError):  # it is gone, or the server is
            pass
        finally:
            exchange.leave(client, entered=entered)
            writer.close()
            with contextlib.suppress(OSError):
                await writer.wait_closed()

    async def _may_enter(self, reader: asyncio.StreamReader) -> bool:
        if not self._exchange.needs_token:
            return True
        try:
            line = await asyncio.wait_for(reader.readuntil(b"\n"), TOKEN_WITHIN)
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
                    self._exchange.tell(f"{client.name} spoke HTTP, and was put out")
                    return await _refuse(writer, "expected lines of JSON; got HTTP, for which there is ws://")
                is_first = False
                await self._exchange.answer(line, client)
        for line in splitter.rest():
            await self._exchange.answer(line, client)


async def _refuse(writer: asyncio.StreamWriter, text: str) -> None:
    writer.write(encoded({"error": text}))
    with contextlib.suppress(ConnectionError):
        await writer.drain()


def taken(error: OSError) -> InputError:
    """What is said of an address that cannot be had."""
    return InputError(f"--listen: expected an address that is free; {error.strerror or error}")
