"""Server of WebSocket clients, which send lines, and of web pages, which show the estimates, at one address.

`ws://HOST:PORT/` accepts messages of one or more lines and answers like the TCP server. `http://HOST:PORT/` is the
page, which gets its frames from `/page`. Browsers let any web page open sockets to this machine, so connections from
another page, or under another name of this machine, are refused.
"""

import asyncio
import logging
from http import HTTPStatus
from typing import Protocol
from urllib.parse import parse_qs, urlsplit

from websockets.asyncio.connection import broadcast
from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.datastructures import Headers, MultipleValuesError
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from vedette.live.lines import LineSplitter
from vedette.live.messages import MAX_LINE_BYTES
from vedette.live.server import BACKLOG, ENTRY_TIMEOUT, LineServer, address_in_use, is_loopback, peer_name
from vedette.simulation.journal import error_cause

FRAMES_PER_SECOND = 10.0
_LOG = logging.getLogger("vedette.live.web")
_LOG.addHandler(logging.NullHandler())  # faults of clients are reported as remarks, without a traceback
_HEADERS = {
    "Content-Type": "text/html; charset=utf-8",
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}


class Screen(Protocol):
    """Content of the web pages."""

    page: bytes

    def frame(self) -> bytes:
        """Return the current frame as JSON."""


class _WebClient:
    def __init__(self, socket: ServerConnection) -> None:
        self._socket = socket
        self.name, self.address = peer_name(socket.transport)
        self.unread, self.abort = socket.transport.get_write_buffer_size, socket.transport.abort
        self.is_gone, self.is_page = socket.transport.is_closing, False

    def send(self, text: bytes) -> None:
        if not self.is_page:
            broadcast([self._socket], text, text=True)


class _Socket(ServerConnection):
    """A connection that the line_server counts from its start, before its handshake."""

    line_server: LineServer
    client: _WebClient

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        super().connection_made(transport)
        self.client = _WebClient(self)
        self.line_server.open(self.client)

    def connection_lost(self, exc: Exception | None) -> None:
        super().connection_lost(exc)
        self.line_server.leave(self.client)


class WebServer:
    """WebSocket and page server of a line server.

    Frames are drawn at most ten times a second, once for all pages, and only if there are pages. A page gets the next
    frame after it has acknowledged the last one. A slow page misses some, and receives the number it missed.

    Args:
        line_server: processes the lines.
        screen: content of the pages.
        host: name of this machine that clients may use, in addition to loopback names. With a token, any name is valid.
    """

    def __init__(self, line_server: LineServer, screen: Screen, host: str) -> None:
        self._line_server, self._screen, self._host = line_server, screen, host
        self._frame, self._num_drawn, self._num_lines, self._num_pages = b"null", 0, 0, 0
        self._drawn = asyncio.Condition()

    async def listen(self, port: int) -> Server:
        """Start to listen. Raises `InputError` if the address is not available."""

        class ListeningSocket(_Socket):
            line_server = self._line_server

        try:
            server = await serve(
                self._handle,
                self._host,
                port,
                process_request=self._answer_request,
                create_connection=ListeningSocket,
                backlog=BACKLOG,
                open_timeout=ENTRY_TIMEOUT,
                max_size=MAX_LINE_BYTES,
                max_queue=4,
                compression=None,
                logger=_LOG,
            )
        except OSError as error:
            raise address_in_use(error) from None
        self._drawing = asyncio.create_task(self._draw())
        return server

    async def _answer_request(self, socket: ServerConnection, request: Request) -> Response | None:
        """Return the page or a refusal, or None to open a socket."""
        assert isinstance(socket, _Socket)
        address = urlsplit(request.path)
        if (fault := self._request_fault(request)) is not None:
            self._line_server.remark(socket.client, "was refused", f": {fault}")
            return socket.respond(HTTPStatus.FORBIDDEN, f"{fault}\n")
        if not self._line_server.is_token(_token(request, address.query)):
            await self._line_server.refuse_token(socket.client)
            return socket.respond(HTTPStatus.UNAUTHORIZED, "expected ?token=... in the address; got none, or another\n")
        if address.path not in ("/", "/page"):
            return socket.respond(HTTPStatus.NOT_FOUND, "expected /; got another address\n")
        if "Upgrade" in request.headers:
            return None
        page = self._screen.page
        headers = Headers(_HEADERS | {"Content-Length": str(len(page)), "Connection": "close"})
        return Response(HTTPStatus.OK, "OK", headers, page)

    def _request_fault(self, request: Request) -> str | None:
        """Return the fault of a request from another web page or for another name of this machine, or None if valid."""
        try:
            host, origin = request.headers.get("Host", ""), request.headers.get("Origin")
            name = urlsplit(f"//{host}").hostname or ""
            page = None if origin is None else urlsplit(origin).netloc
        except (MultipleValuesError, ValueError):
            return "expected one Host and at most one Origin; got others"
        if not (self._line_server.needs_token or name in ("localhost", self._host) or is_loopback(name)):
            return f"expected {self._host} or localhost as the host; got {name!r}"
        return None if page in (None, host) else f"expected no page but the one from here; got one of {origin!r}"

    async def _handle(self, socket: ServerConnection) -> None:
        assert isinstance(socket, _Socket)
        assert socket.request is not None
        client, line_server = socket.client, self._line_server
        client.is_page = urlsplit(socket.request.path).path == "/page"
        try:
            if fault := line_server.enter(client, is_page=client.is_page):
                await socket.close(1013, fault)
            elif client.is_page:
                await self._show(socket)
            else:
                await self._serve(socket, client)
        except ConnectionClosed as error:
            if error.sent is not None and error.sent.code == 1009:
                line_server.remark(client, f"sent a message of more than {MAX_LINE_BYTES} bytes, and was put out")
        except Exception as error:  # such as a record that cannot be written
            line_server.remark(client, "was put out", f": {error_cause(error)}")

    async def _serve(self, socket: ServerConnection, client: _WebClient) -> None:
        async for message in socket:
            splitter = LineSplitter(MAX_LINE_BYTES)
            data = message.encode() if isinstance(message, str) else message
            for line in [*splitter.feed(data), *splitter.rest()]:
                await self._line_server.answer(line, client)

    async def _show(self, socket: ServerConnection) -> None:
        """Send frames to a page: the latest one, each time it has acknowledged the one before."""
        drawn, shown, skipped = self._num_drawn, None, 0
        self._num_pages += 1
        self._line_server.changed.set()  # draw the current frame
        try:
            while True:
                await self._wait_for_frame(drawn)
                drawn, previous, shown = self._num_drawn, shown, self._num_lines
                skipped += 0 if previous is None else max(0, shown - previous - 1)
                await socket.send(b'{"skipped":%d,"frame":%b}' % (skipped, self._frame), text=True)
                await socket.recv()
        finally:
            self._num_pages -= 1

    async def _wait_for_frame(self, drawn: int) -> None:
        """Wait until more than `drawn` frames have been drawn."""
        async with self._drawn:
            await self._drawn.wait_for(lambda: self._num_drawn > drawn)

    async def _draw(self) -> None:
        """Draw the frames of all pages. A frame that fails is reported, and the next one is tried."""
        while True:
            await self._line_server.changed.wait()
            self._line_server.changed.clear()
            if not self._num_pages:
                continue
            try:
                self._frame = self._screen.frame()
            except Exception as error:
                self._line_server.report(f"no frame for the pages: {error_cause(error)}")
            async with self._drawn:
                self._num_drawn, self._num_lines = self._num_drawn + 1, self._line_server.num_processed
                self._drawn.notify_all()
            await asyncio.sleep(1.0 / FRAMES_PER_SECOND)


def _token(request: Request, query: str) -> str | None:
    kind, _, given = request.headers.get("Authorization", "").partition(" ")
    return given if kind == "Bearer" else parse_qs(query).get("token", [None])[0]
