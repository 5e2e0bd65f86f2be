"""Sockets and pages at one address: who may come, and that nobody is in the way of the others."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import Awaitable, Callable
from typing import Any

import pytest
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.protocol import State

from live.test_server import take
from vedette.live import LineServer, TcpServer, server, web
from vedette.live.web import WebServer

Connect = Callable[..., Awaitable[ClientConnection]]
Scene = Callable[[str, Connect], Awaitable[None]]


@pytest.fixture(autouse=True)
def soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "WRONG_TOKEN_DELAY", 0.001)


class Numbered:
    """A screen that counts its frames."""

    page = b"<!doctype html><title>page</title>"

    def __init__(self) -> None:
        self.num = 0

    def frame(self) -> bytes:
        self.num += 1
        return b'{"number":%d}' % self.num


def served(scene: Scene, token: str | None = None, screen: Any = None, answers: Any = take) -> list[str]:
    """What was told in a scene of clients of one server."""
    told, came = list[str](), list[ClientConnection]()

    async def play() -> None:
        server = await WebServer(LineServer(answers, token, told.append), screen or Numbered(), "127.0.0.1").listen(0)
        host, port = server.sockets[0].getsockname()[:2]

        async def client(path: str = "/", **options: Any) -> ClientConnection:
            came.append(await connect(f"ws://{host}:{port}{path}", compression=None, proxy=None, **options))
            return came[-1]

        await scene(f"{host}:{port}", client)
        for each in came:
            each.transport.abort()
        server.close()
        await server.wait_closed()

    asyncio.run(play())
    return told


async def got(address: str, path: str = "/", **headers: str) -> tuple[int, str]:
    """Status and body of a page."""
    reader, writer = await asyncio.open_connection(*address.split(":"))
    lines = {"Host": address, **headers}
    text = f"GET {path} HTTP/1.1\r\n" + "".join(f"{name}: {value}\r\n" for name, value in lines.items()) + "\r\n"
    writer.write(text.encode())
    answer = (await reader.read()).decode()
    writer.close()
    return int(answer.split()[1]), answer.partition("\r\n\r\n")[2]


async def refused(client: Connect, path: str = "/", **options: Any) -> int:
    with pytest.raises(InvalidStatus) as fault:
        await client(path, **options)
    return fault.value.response.status_code


async def heard(socket: ClientConnection) -> Any:
    return json.loads(await socket.recv())


def test_answers_go_to_all_clients_and_errors_to_their_sender() -> None:
    async def scene(address: str, client: Connect) -> None:
        one, other = await client(), await client()
        await one.send("bad\nword\nanother")
        await one.send(b"bytes")
        assert [await heard(one) for _ in range(4)] == [
            {"error": "bad"}, {"line": "word"}, {"line": "another"}, {"line": "bytes"},
        ]  # fmt: skip
        assert await heard(other) == {"line": "word"}

    assert served(scene) == []


def test_the_page_is_served_and_nothing_else() -> None:
    async def scene(address: str, client: Connect) -> None:
        status, body = await got(address)
        assert (status, body) == (200, Numbered.page.decode())
        assert (await got(address, "/etc/passwd"))[0] == 404
        assert await refused(client, "/other") == 404

    served(scene)


@pytest.mark.parametrize(
    "origin", ["http://elsewhere.example", "null", "http://127.0.0.1:1", "http://localhost", "http://[", "file://"]
)
def test_foreign_pages_are_rejected(origin: str) -> None:
    async def scene(address: str, client: Connect) -> None:
        for path in ("/", "/page"):
            assert await refused(client, path, origin=origin) == 403
        for path in ("/", "/page"):
            own = await client(path, origin=f"http://{address}")
            await own.close()

    (told,) = served(scene)
    assert "was refused" in told


@pytest.mark.parametrize("host", ["elsewhere.example", "127.0.0.1.elsewhere.example", "", "0.0.0.0", "["])
def test_other_names_of_this_machine_are_rejected(host: str) -> None:
    """A name that somebody else lets point here would make his page one of ours."""

    async def scene(address: str, client: Connect) -> None:
        assert (await got(address, Host=host))[0] == 403
        assert (await got(address, Host="localhost:1"))[0] == 200

    served(scene)


def test_without_the_token_there_is_neither_page_nor_socket() -> None:
    async def scene(address: str, client: Connect) -> None:
        for path in ("/", "/?token=guess", "/?token=", "/page", "/page?token=guess"):
            assert (await got(address, path, Host="any.example"))[0] == 401
            assert await refused(client, path) == 401
        assert (await got(address, "/?token=s%26cret", Host="any.example"))[0] == 200
        await client("/page?token=s%26cret")
        known = await client(additional_headers={"Authorization": "Bearer s&cret"})
        await known.send("word")
        assert await heard(known) == {"line": "word"}

    assert all("had no token" in text for text in served(scene, "s&cret"))


def test_a_message_that_is_too_long_disconnects_only_its_sender() -> None:
    async def scene(address: str, client: Connect) -> None:
        one, other = await client(), await client()
        with contextlib.suppress(ConnectionClosed):
            await one.send("x" * 1_000_001)
            await one.recv()
        await other.send("on")
        assert await heard(other) == {"line": "on"}

    (text,) = served(scene)
    assert "sent a message of more than 1000000 bytes, and was put out" in text


def test_unreadable_lines_are_reported() -> None:
    def fail(line: bytes) -> tuple[dict[str, Any], ...]:
        raise OSError("no space left")

    async def scene(address: str, client: Connect) -> None:
        one = await client()
        await one.send("word")
        with pytest.raises(ConnectionClosed):
            await one.recv()

    (text,) = served(scene, answers=fail)
    assert "was put out: OSError: no space left" in text


def test_clients_that_do_not_read_are_disconnected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "MAX_UNREAD_BYTES", 100_000)

    async def scene(address: str, client: Connect) -> None:
        deaf, one = await client(max_queue=1), await client()
        word = "w" * 50_000
        for _ in range(1000):
            await one.send(word)
            await one.recv()
        assert deaf.transport is not None

    assert any("does not read its answers, and was put out" in text for text in served(scene))


def test_a_client_beyond_the_limit_is_rejected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "MAX_CLIENTS", 1)

    async def scene(address: str, client: Connect) -> None:
        await client()
        with pytest.raises(ConnectionClosed, match="expected at most 1 clients"):
            await (await client()).recv()

    served(scene)


def test_silent_sockets_make_way_before_their_handshake(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "MAX_WAITING", 2)

    async def scene(address: str, client: Connect) -> None:
        silent = [await asyncio.open_connection(*address.split(":")) for _ in range(4)]
        one = await client()
        await one.send("word")
        assert await heard(one) == {"line": "word"}
        for reader, _ in silent[:3]:
            assert not await reader.read()
        for _, writer in silent:
            writer.close()

    (text,) = served(scene)
    assert text.endswith("had not entered, and made way")


def test_a_slow_page_gets_the_latest_frame_and_the_number_missed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(web, "FRAMES_PER_SECOND", 1e6)

    async def scene(address: str, client: Connect) -> None:
        source = await client()

        async def taken(num: int) -> None:
            for _ in range(num):
                await source.send("word")
                await source.recv()

        slow = await client("/page")
        assert (await heard(slow))["skipped"] == 0
        fast = await client("/page")
        await fast.recv()
        await taken(500)
        assert slow.state is fast.state is State.OPEN
        await slow.send("next")
        late = await heard(slow)
        while late["skipped"] < 490:  # at most what was under way when it asked
            await slow.send("next")
            late = await heard(slow)
        opened_late = await client("/page")
        assert (await heard(opened_late))["frame"]["number"] >= late["frame"]["number"]

    assert served(scene) == []


def test_without_pages_nothing_is_drawn_and_screen_errors_are_reported() -> None:
    class Faulty(Numbered):
        def frame(self) -> bytes:
            self.num += 1
            raise RuntimeError("no colours")

    screen = Faulty()

    async def scene(address: str, client: Connect) -> None:
        source = await client()
        for _ in range(20):
            await source.send("word")
            await source.recv()
        assert screen.num == 0
        page = await client("/page")
        assert (await heard(page))["frame"] is None
        await source.send("on")
        assert await heard(source) == {"line": "on"}

    assert any("no frame for the pages" in text and "no colours" in text for text in served(scene, screen=screen))


def test_a_browser_cannot_send_lines_to_tcp_under_http() -> None:
    told, taken = list[str](), list[bytes]()

    def note(line: bytes) -> tuple[dict[str, Any], ...]:
        taken.append(line)
        return ()

    async def play() -> None:
        server = await TcpServer(LineServer(note, None, told.append)).listen("127.0.0.1", 0)
        async with server:
            reader, writer = await asyncio.open_connection(*server.sockets[0].getsockname()[:2])
            writer.write(b'POST / HTTP/1.1\r\nHost: x\r\n\r\n{"sensor": 1, "time": 0, "measurements": []}\r\n')
            assert "got HTTP" in json.loads(await reader.readline())["error"]
            writer.close()

    asyncio.run(play())
    assert taken == []
    assert "spoke HTTP" in told[0]
