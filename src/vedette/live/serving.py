"""What takes lines of many clients, and a server of TCP, that nobody can fill, stop or enter without a token."""

from __future__ import annotations

import asyncio
import contextlib
import hmac
import ipaddress
import json
import socket
from collections.abc import Callable, Iterable
from typing import Protocol

from vedette.errors import InputError
from vedette.live.lines import CHUNK, LineSplitter
from vedette.live.loop import Answer, encoded
from vedette.live.messages import MOST_BYTES

MOST_CLIENTS = 128  # pages, too
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
    """`InputError` for an address that others can reach, without a token; or that there is not."""
    try:
        found = {str(info[4][0]) for info in socket.getaddrinfo(host, None)}
    except (OSError, UnicodeError) as error:
        raise InputError(f"--listen: expected an address of this machine; got {host!r}: {error}") from None
    if token is None and not all(map(is_loopback, found)):
        raise InputError(f"--listen: expected a loopback address such as 127.0.0.1, or --token; got {host}")


class Client(Protocol):
    """Who sends lines and gets answers."""

    name: str

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
    their turns; nothing is piled up. One that does not read its answers is put out.

    Args:
        take: what is done with a line; its answers.
        token: that a client must know; None: none.
        tell: is told who comes, and who is put out and why.
    """

    def __init__(
        self, take: Callable[[bytes], Iterable[Answer]], token: str | None, tell: Callable[[str], object]
    ) -> None:
        self._take, self._token, self.tell = take, token, tell
        self._clients: set[Client] = set()
        self._num_open, self.num_taken = 0, 0
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

    def open(self) -> bool:
        """Count one that comes, and whether there is room for it; each is to `leave`."""
        self._num_open += 1
        return self._num_open <= MOST_CLIENTS

    def leave(self, client: Client | None = None) -> None:
        """One that came has gone."""
        self._num_open -= 1
        if client is not None:
            self._clients.discard(client)

    def enter(self, client: Client) -> None:
        """From now on it has the answers."""
        self._clients.add(client)

    async def answer(self, line: bytes, sender: Client | None) -> None:
        """Take a line, and let the others have their turn."""
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
            self._clients.discard(client)
            client.abort()


class _TcpClient:
    def __init__(self, writer: asyncio.StreamWriter) -> None:
        self.name = "{}:{}".format(*writer.get_extra_info("peername")[:2])
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
        client, exchange = _TcpClient(writer), self._exchange
        try:
            if not exchange.open():
                await _refuse(writer, f"expected at most {MOST_CLIENTS} clients; got one more")
            elif not await self._may_enter(reader):
                await _refuse(writer, 'expected {"token": ...} first; got none, or another')
                exchange.tell(f"{client.name} had no token")
            else:
                exchange.enter(client)
                await self._serve(reader, client, writer)
        except (ConnectionError, asyncio.CancelledError):  # it is gone, or the server is
            pass
        finally:
            exchange.leave(client)
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
