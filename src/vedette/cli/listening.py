"""Sources of lines of `vedette live`: standard input, and clients over TCP or WebSockets."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from vedette.cli.errors import usage_error
from vedette.cli.output import echo, note
from vedette.internal.extras import require_packages

if TYPE_CHECKING:
    from vedette.live import LineServer, PersistentLoop
    from vedette.reports.live import LiveScreen


class Source(NamedTuple):
    """A source of lines: stdin, tcp or ws, with its address."""

    kind: str
    host: str = ""
    port: int = 0


def parse_sources(addresses: Sequence[str], token: str | None) -> list[Source]:
    """Return the sources of lines. Raise if an address needs a token or a package that is missing."""
    from vedette.live.server import check_address

    sources = [_parse_source(address) for address in addresses]
    for source in sources:
        if source.kind != "stdin":
            check_address(source.host, token)
    if any(source.kind == "ws" for source in sources):
        require_packages("vedette live --listen ws://", "websockets", "jinja2", "matplotlib", "pyarrow")
    return sources


def _parse_source(address: str) -> Source:
    if address == "stdin":
        return Source(address)
    kind, _, place = address.rpartition("://")
    host, _, port = place.rstrip("/").rpartition(":")
    if kind not in ("tcp", "ws") or not host or not port.isdecimal() or int(port) > 65535:
        raise usage_error(f"expected stdin, tcp://HOST:PORT or ws://HOST:PORT; got {address!r}", "--listen")
    return Source(kind, host.strip("[]"), int(port))


def print_answers(answers: Iterable[dict[str, Any]]) -> None:
    """Print each answer as a line of JSON, and findings of the fit on the terminal, too."""
    from vedette.live import encode_line

    for answer in answers:
        echo(encode_line(answer).decode(), nl=False)
        for word, text in ((kind, each) for kind in ("new", "gone") for each in answer.get("fit", {}).get(kind, ())):
            note(f"fit, {word}: {text}")


async def listen_to(
    persistent: PersistentLoop, screen: LiveScreen | None, sources: Sequence[Source], token: str | None
) -> None:
    """Process lines until standard input ends, or until Ctrl-C if there are clients. Do not wait for them."""
    import asyncio

    from vedette.live import LineServer, iter_lines

    def process(line: bytes) -> Iterable[dict[str, Any]]:
        answers = persistent.process(line)
        print_answers(answers)
        if screen is not None:
            screen.note(answers)
        return answers

    line_server = LineServer(process, token, note)
    async with contextlib.AsyncExitStack() as servers:
        for source in sources:
            if source.kind != "stdin":
                servers.callback(await _start_server(source, line_server, screen))
        if any(source.kind == "stdin" for source in sources):
            async for line in iter_lines(sys.stdin.buffer):
                await line_server.answer(line, None)
        if any(source.kind != "stdin" for source in sources):
            await asyncio.Event().wait()


async def _start_server(source: Source, line_server: LineServer, screen: LiveScreen | None) -> Callable[[], None]:
    """Start a server of clients, print its address, and return the function that closes it."""
    from vedette.live import TcpServer

    server: Any
    if source.kind == "ws" and screen is not None:
        from vedette.live.web import WebServer

        server = await WebServer(line_server, screen, source.host).listen(source.port)
    else:
        server = await TcpServer(line_server).listen(source.host, source.port)
    host, port = server.sockets[0].getsockname()[:2]
    address = f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
    note(f"listens on {source.kind}://{address}" + (f"; the page is http://{address}/" if source.kind == "ws" else ""))
    close: Callable[[], None] = server.close
    return close
