"""Lines out of bytes of whatever source, and a server of them that nobody can fill, stop or enter without a token."""

from __future__ import annotations

import asyncio
import contextlib
import hmac
import ipaddress
import json
import socket
from collections.abc import Callable, Iterable

from vedette.errors import InputError
from vedette.live.loop import Answer, encoded
from vedette.live.messages import MOST_BYTES

MOST_CLIENTS = 32
MOST_UNREAD = 8_000_000  # bytes of answers that a client leaves lying
TOKEN_WITHIN = 10.0  # s
_LONGEST_TOKEN = 4096  # bytes of its line
_CHUNK = 1 << 16


class LineSplitter:
    """Lines of bytes as they come, in bounded memory: of a longer line no more than `most + 1` bytes are kept."""

    def __init__(self, most: int) -> None:
        self._most, self._part = most, bytearray()

    def feed(self, data: bytes) -> list[bytes]:
        """The lines that these bytes end, stripped; without empty ones."""
        found = []
        *ended, last = data.split(b"\n")
        for piece in ended:
            self._keep(piece)
            found.append(bytes(self._part).strip())
            self._part.clear()
        self._keep(last)
        return [line for line in found if line]

    def rest(self) -> list[bytes]:
        """The last line, where it has no end."""
        return self.feed(b"\n")

    def _keep(self, piece: bytes) -> None:
        self._part += piece[: self._most + 1 - len(self._part)]


def check_address(host: str, token: str | None) -> None:
    """`InputError` for an address that others can reach, without a token; or that there is not."""
    try:
        found = {str(info[4][0]) for info in socket.getaddrinfo(host, None)}
    except (OSError, UnicodeError) as error:
        raise InputError(f"--listen: expected an address of this machine; got {host!r}: {error}") from None
    if token is None and not all(ipaddress.ip_address(each.partition("%")[0]).is_loopback for each in found):
        raise InputError(f"--listen: expected a loopback address such as 127.0.0.1, or --token; got {host}")


class Server:
    """Takes lines of many clients in turn, and answers: estimates and plans to all, an error to who caused it.

    A client that sends faster than lines are taken is made to wait, by the flow control of TCP, while the others have
    their turns; nothing is piled up. One that does not read its answers is put out.

    Args:
        take: what is done with a line; its answers.
        token: that a client must send first, as `{"token": "..."}`; None: none.
        tell: is told who comes, and who is put out and why.
    """

    def __init__(
        self, take: Callable[[bytes], Iterable[Answer]], token: str | None, tell: Callable[[str], object]
    ) -> None:
        self._take, self._token, self._tell = take, token, tell
        self._clients: set[asyncio.StreamWriter] = set()
        self._num_open = 0

    async def listen(self, host: str, port: int) -> asyncio.Server:
        """Raises `InputError` for an address that cannot be had; see `check_address`."""
        check_address(host, self._token)
        try:
            return await asyncio.start_server(self._meet, host, port)
        except OSError as error:
            raise InputError(f"--listen: expected an address that is free; {error.strerror or error}") from None

    async def _meet(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        name = "{}:{}".format(*writer.get_extra_info("peername")[:2])
        self._num_open += 1
        try:
            if self._num_open > MOST_CLIENTS:
                await self._refuse(writer, f"expected at most {MOST_CLIENTS} clients; got one more")
            elif not await self._may_enter(reader):
                await self._refuse(writer, 'expected {"token": ...} first; got none, or another')
                self._tell(f"{name} had no token")
            else:
                self._clients.add(writer)
                await self._serve(reader, writer)
        except (ConnectionError, asyncio.CancelledError):  # it is gone, or the server is
            pass
        finally:
            self._num_open -= 1
            self._clients.discard(writer)
            writer.close()
            with contextlib.suppress(OSError):
                await writer.wait_closed()

    async def _may_enter(self, reader: asyncio.StreamReader) -> bool:
        if self._token is None:
            return True
        try:
            line = await asyncio.wait_for(reader.readuntil(b"\n"), TOKEN_WITHIN)
            said = json.loads(line[:_LONGEST_TOKEN])
        except (TimeoutError, asyncio.IncompleteReadError, asyncio.LimitOverrunError, ValueError, RecursionError):
            return False
        given = said.get("token") if isinstance(said, dict) else None
        return isinstance(given, str) and hmac.compare_digest(
            given.encode("utf-8", "replace"), self._token.encode("utf-8", "replace")
        )

    async def _refuse(self, writer: asyncio.StreamWriter, text: str) -> None:
        writer.write(encoded({"error": text}))
        with contextlib.suppress(ConnectionError):
            await writer.drain()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        splitter = LineSplitter(MOST_BYTES)
        while data := await reader.read(_CHUNK):
            for line in splitter.feed(data):
                await self._answer(line, writer)
        for line in splitter.rest():
            await self._answer(line, writer)

    async def _answer(self, line: bytes, sender: asyncio.StreamWriter) -> None:
        for answer in self._take(line):
            text = encoded(answer)
            for client in [sender] if "error" in answer else list(self._clients):
                self._send(client, text)
        await asyncio.sleep(0.0)  # the others' turn

    def _send(self, client: asyncio.StreamWriter, text: bytes) -> None:
        client.write(text)
        if client.transport.get_write_buffer_size() > MOST_UNREAD:
            name = "{}:{}".format(*client.get_extra_info("peername")[:2])
            self._tell(f"{name} does not read its answers, and was put out")
            self._clients.discard(client)
            client.transport.abort()


__all__ = ["LineSplitter", "Server", "check_address"]
