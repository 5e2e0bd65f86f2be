"""Lines out of bytes, and clients that nobody can keep from their answers."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vedette.errors import InputError
from vedette.live import LineServer, LineSplitter, TcpServer, remarks, server


@pytest.fixture(autouse=True)
def soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "WRONG_TOKEN_DELAY", 0.001)


@given(st.lists(st.binary(max_size=12).map(lambda b: b.replace(b"\n", b"x")), max_size=8), st.data())
def test_lines_do_not_depend_on_the_chunks_of_bytes(lines: list[bytes], data: st.DataObject) -> None:
    whole = b"\n".join(lines)
    splitter, found, place = LineSplitter(5), list[bytes](), 0
    while place < len(whole):
        size = data.draw(st.integers(1, 7))
        found += splitter.feed(whole[place : place + size])
        place += size
    found += splitter.rest()
    assert found == [cut for one in lines if (cut := one[:6].strip())]


class Client:
    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.reader, self.writer = reader, writer

    async def send(self, text: bytes) -> None:
        self.writer.write(text)
        await self.writer.drain()

    async def answer(self) -> Any:
        line = await self.reader.readline()
        return json.loads(line) if line else None

    async def hears(self, wanted: dict[str, str]) -> None:
        """Waits for an answer; there may be others before it."""
        while (came := await self.answer()) != wanted:
            assert came is not None


def take(line: bytes) -> tuple[dict[str, Any], ...]:
    return ({"error": "bad"},) if line == b"bad" else ({"line": line.decode()},)


def served(
    scene: Callable[[Callable[[], Awaitable[Client]]], Awaitable[None]], token: str | None = None, answers: Any = take
) -> list[str]:
    """What was told in a scene of clients of one server."""
    told, came = list[str](), list[Client]()

    async def play() -> None:
        server = await TcpServer(LineServer(answers, token, told.append)).listen("127.0.0.1", 0)

        async def client() -> Client:
            came.append(Client(*await asyncio.open_connection(*server.sockets[0].getsockname()[:2])))
            return came[-1]

        async with server:
            await scene(client)
            for each in came:
                each.writer.transport.abort()
            while len(asyncio.all_tasks()) > 1:
                await asyncio.sleep(0.0)

    asyncio.run(play())
    return told


def test_answers_go_to_all_clients_and_errors_to_their_sender() -> None:
    async def scene(client: Callable[[], Awaitable[Client]]) -> None:
        one, other = await client(), await client()
        await other.send(b"here\n")
        assert await other.answer() == {"line": "here"}
        await one.send(b"bad\nwo")
        await one.hears({"error": "bad"})
        await one.send(b"rd\n")
        assert await one.answer() == {"line": "word"}
        assert await other.answer() == {"line": "word"}
        one.writer.write(b"last, without an end")
        one.writer.write_eof()
        assert await other.answer() == {"line": "last, without an end"}
        other.writer.transport.abort()  # one that is gone is nobody's trouble
        third = await client()
        await third.send(b"on\n")
        assert await third.answer() == {"line": "on"}

    assert served(scene) == []


@pytest.mark.parametrize(
    "first",
    [b'{"token": "guess"}\n', b'{"token": 3}\n', b"secret\n", b"[]\n", b'{"token": ', b"x" * 200_000, b"\xff\n"],
    ids=range(7),
)
def test_clients_without_the_token_are_rejected(first: bytes) -> None:
    async def scene(client: Callable[[], Awaitable[Client]]) -> None:
        known, stranger = await client(), await client()
        await known.send(b'{"token": "secret"}\nword\n')
        assert await known.answer() == {"line": "word"}
        stranger.writer.write(first)
        stranger.writer.write_eof()
        try:
            assert "token" in (await stranger.answer())["error"]
            assert await stranger.answer() is None
        except ConnectionError:  # put out with bytes of its own unread
            pass
        await known.send(b"again\n")
        assert await known.answer() == {"line": "again"}

    assert ["had no token" in text for text in served(scene, "secret")] == [True]


def test_a_client_beyond_the_limit_is_rejected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "MAX_CLIENTS", 1)

    async def scene(client: Callable[[], Awaitable[Client]]) -> None:
        one = await client()
        await one.send(b"a\n")
        await one.answer()
        assert await (await client()).answer() == {"error": "expected at most 1 clients; got one more"}

    served(scene)


def test_clients_that_do_not_read_are_disconnected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "MAX_UNREAD_BYTES", 100_000)

    async def scene(client: Callable[[], Awaitable[Client]]) -> None:
        deaf, one = await client(), await client()
        await deaf.send(b"a\n")
        deaf.reader._transport.pause_reading()  # type: ignore[attr-defined]
        word = b"w" * 50_000
        for _ in range(1000):
            await one.send(word + b"\n")
            while (await one.answer())["line"] == "a":
                pass

    assert any("does not read its answers, and was put out" in text for text in served(scene))


@pytest.mark.parametrize("token", ["", " " * 20, "x" * 15, f" {'x' * 15} "])
def test_a_short_token_is_rejected(token: str) -> None:
    with pytest.raises(InputError, match="--token: expected at least 16 letters; got"):
        server.check_address("127.0.0.1", token)


def test_the_first_of_too_many_waiting_clients_is_disconnected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "MAX_WAITING", 2)

    async def scene(client: Callable[[], Awaitable[Client]]) -> None:
        silent = [await client() for _ in range(2)]
        known = await client()
        await known.send(b'{"token": "secret"}\nword\n')
        assert await known.answer() == {"line": "word"}
        silent += [await client() for _ in range(3)]
        for each in silent[:3]:
            assert not await each.reader.read()
        await known.send(b"again\n")
        assert await known.answer() == {"line": "again"}

    assert served(scene, "secret")[0].endswith("had not entered, and made way")


def test_a_client_of_the_address_with_most_waiting_is_disconnected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "MAX_WAITING", 2)
    exchange = LineServer(take, "secret", str)
    honest, *others = (Counted(f"{address}:{port}") for address, port in (("a", 1), ("b", 2), ("b", 3), ("b", 4)))
    for each in (honest, *others):
        exchange.open(each)
    assert [each.gone for each in (honest, *others)] == [False, True, True, False]


class Counted:
    """A client that is not there: what it was sent, and whether it was put out."""

    def __init__(self, name: str) -> None:
        self.name, self.address = name, name.rpartition(":")[0]
        self.sent, self.gone = list[bytes](), False

    def send(self, text: bytes) -> None:
        self.sent.append(text)

    def unread(self) -> int:
        return 0

    def is_gone(self) -> bool:
        return self.gone

    def abort(self) -> None:
        self.gone = True


def test_nothing_is_sent_to_a_closed_connection() -> None:
    """To write to it is a line of asyncio's log each time."""

    async def play() -> list[int]:
        exchange = LineServer(take, None, str)
        clients = Counted("a:1"), Counted("a:2")
        for each in clients:
            exchange.enter(each)
        clients[0].abort()
        await exchange.answer(b"word", clients[0])
        await exchange.answer(b"bad", clients[0])
        return [len(each.sent) for each in clients]

    assert asyncio.run(play()) == [0, 1]


def test_the_end_of_a_server_is_no_traceback_while_clients_close() -> None:
    faults = list[dict[str, Any]]()

    async def play() -> None:
        asyncio.get_running_loop().set_exception_handler(lambda loop, context: faults.append(context))
        server = await TcpServer(LineServer(take, None, str)).listen("127.0.0.1", 0)
        deaf = Client(*await asyncio.open_connection(*server.sockets[0].getsockname()[:2]))
        deaf.reader._transport.pause_reading()  # type: ignore[attr-defined]
        for _ in range(200):
            await deaf.send(b"w" * 50_000 + b"\n")
        deaf.writer.write_eof()
        while asyncio.all_tasks() - {asyncio.current_task()} and len(faults) < 1:
            await asyncio.sleep(0.01)
            for task in asyncio.all_tasks() - {asyncio.current_task()}:
                task.cancel()
        server.close()
        deaf.writer.transport.abort()
        await asyncio.sleep(0.0)

    asyncio.run(play())
    assert faults == []


def test_unreadable_lines_are_reported() -> None:
    def fail(line: bytes) -> tuple[dict[str, Any], ...]:
        raise OSError("no space left")

    async def scene(client: Callable[[], Awaitable[Client]]) -> None:
        one = await client()
        await one.send(b"word\n")
        assert await one.answer() is None

    (text,) = served(scene, answers=fail)
    assert "was put out: OSError: no space left" in text


def test_one_remark_of_a_kind_per_minute_is_passed_on(monkeypatch: pytest.MonkeyPatch) -> None:
    told, now = list[str](), [100.0]
    monkeypatch.setattr(remarks.time, "monotonic", lambda: now[0])
    remark = remarks.Remarks(told.append)
    for port in range(1000):
        remark(Counted(f"a:{port}"), "had no token")
    remark(Counted("a:1"), "was put out", ": a full disk")
    remark(Counted("b:1"), "had no token")
    now[0] += 60.0
    remark(Counted("a:7"), "had no token")
    assert told == [
        "a:0 had no token", "a:1 was put out: a full disk", "b:1 had no token",
        "a:7 had no token (and 999 more such lines were left out)",
    ]  # fmt: skip
    for number in range(1000):
        remark(Counted(f"{number}:1"), "had no token")
    assert len(told) < 30


@pytest.mark.parametrize("limit", ["MAX_CLIENTS", "MAX_CLIENTS_PER_ADDRESS"])
def test_the_client_that_was_silent_longest_is_disconnected(limit: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, limit, 2)
    monkeypatch.setattr(server, "IDLE_SECONDS", 0.0)

    async def scene(client: Callable[[], Awaitable[Client]]) -> None:
        first, second = await client(), await client()
        for each in (second, first):
            await each.send(b"word\n")
            await each.hears({"line": "word"})
        third = await client()
        await third.send(b"mine\n")
        assert await third.answer() == {"line": "mine"}
        assert first.writer.transport is not None

    assert [text.split(" was ")[1].split(" for ")[0] for text in served(scene)] == ["silent"]


def test_clients_without_a_valid_line_make_way_sooner(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "MAX_CLIENTS", 2)
    monkeypatch.setattr(server, "FIRST_LINE_SECONDS", 0.0)

    async def scene(client: Callable[[], Awaitable[Client]]) -> None:
        first = await client()
        await first.send(b"word\n")
        await first.hears({"line": "word"})
        for _ in range(3):
            silent = await client()
            await silent.send(b"bad\n")
            await silent.hears({"error": "bad"})
        last = await client()
        await last.send(b"mine\n")
        assert await last.answer() == {"line": "mine"}
        assert await first.answer() == {"line": "mine"}

    assert all(" was silent" in text for text in served(scene))


def test_wrong_tokens_are_delayed_and_reported_once(monkeypatch: pytest.MonkeyPatch) -> None:
    waited, wrong = list[float](), server.WRONG_TOKEN_DELAY

    async def scene(client: Callable[[], Awaitable[Client]]) -> None:
        monkeypatch.setattr(server.asyncio, "sleep", slept)
        for _ in range(3):
            stranger = await client()
            await stranger.send(b'{"token": "guess"}\n')
            assert "token" in (await stranger.answer())["error"]
        monkeypatch.undo()

    rest = asyncio.sleep

    async def slept(seconds: float) -> None:
        waited.append(seconds)
        await rest(0.0)

    assert ["had no token" in text for text in served(scene, "secret")] == [True]
    assert waited.count(wrong) == 3


@pytest.mark.parametrize(
    ("host", "token"), [("0.0.0.0", None), ("::", None), ("no.such.host.invalid", "a secret of words")]
)
def test_other_machines_need_a_token(host: str, token: str | None) -> None:
    with pytest.raises(InputError, match="--listen: expected a"):
        server.check_address(host, token)
    server.check_address("127.0.0.1", None)
    server.check_address("0.0.0.0", "a secret of words")
