"""The page of a live loop in a real browser: what comes is drawn, what is lost is said, and no other page gets in."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import IO, Any

import pytest
from typer.testing import CliRunner
from websockets.sync.client import connect

from cli.test_live import PROGRAM, WAIT, WORDS
from live.examples import SYNCHRONOUS, line, walk
from reports.browser import Browser, Page, chromium
from reports.test_browser import ink, state, text, wait_until
from vedette.cli import app

CHROMIUM = chromium()
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium or chrome on PATH to open the page in")
OPTIONS = ("--decide-every", "4", "--planner", "idm")


class Loop:
    """`vedette live` in a process of its own, at a port of its own or one that is told."""

    def __init__(self, folder: Path, port: int = 0, *options: str) -> None:
        listen = (*OPTIONS, "--listen", f"ws://127.0.0.1:{port}", *options)
        words = [*PROGRAM, *WORDS, *listen, "--snapshot", "state", "--snapshot-interval", "0", "--record", "came"]
        self.process = subprocess.Popen(words, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        errors: IO[bytes] | None = self.process.stderr
        assert errors is not None
        told = b""
        while b"listens on ws://" not in told:
            told = errors.readline()
            assert told, "it ended"
        self.port = int(told.split(b";")[0].rpartition(b":")[2])
        self.page = f"http://127.0.0.1:{self.port}/"

    def send(self, lines: list[bytes]) -> list[Any]:
        """Lines of which each has one answer, or a plan besides; all the answers."""
        found = list[bytes | str]()
        with connect(f"ws://127.0.0.1:{self.port}/", proxy=None) as socket:
            for one in lines:
                socket.send(one)
            while sum(b"plan" not in answer for answer in map(_bytes, found)) < len(lines):
                found.append(socket.recv(WAIT))
        return found

    def kill(self) -> None:
        self.process.kill()
        self.process.communicate()


def _bytes(answer: bytes | str) -> bytes:
    return answer.encode() if isinstance(answer, str) else answer


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "small.yaml").write_text(SYNCHRONOUS, "utf-8")
    return tmp_path


def told(page: Page, words: str, part: str) -> None:
    """Wait until a part of the page says this."""
    wait_until(page, f"document.querySelector('[data-part={part}]')?.textContent.includes({json.dumps(words)})")


def test_dates_are_its_clock(browser: Browser, folder: Path) -> None:
    loop = Loop(folder)
    try:
        page = browser.open(loop.page)
        told(page, "no scan yet: 0 estimates", "summary")
        loop.send([line(1, "2016-01-12T13:02:24Z", [[1.0, 2.0]]), line(2, "2016-01-12T13:02:25.5Z", [[1.0, 2.0]])])
        told(page, "2016-01-12 13:02:25.5 UTC: ", "summary")
        assert not text(page, "summary").startswith("t = ")
        assert page.complaints() == []
    finally:
        loop.kill()


def test_the_page_draws_scans_and_survives_a_kill(
    browser: Browser, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    loop, lines = Loop(folder), walk(12)
    try:
        page = browser.open(loop.page, width=1400)
        told(page, "Connected", "link")
        told(page, "no scan yet: 0 estimates", "summary")
        loop.send(lines[:12])
        told(page, "t = 5 s: 1 estimates", "summary")
        told(page, "Decision at", "decision")
        assert ink(page, "scene") > 20
        assert "health" in text(page, "health").lower()
        assert page.evaluate("document.querySelectorAll('[data-part=sensors] tr').length") == 2
        page.click("[data-part=play]")
        page.click("[data-part=back]")
        before = state(page)["step"]
        (error,) = loop.send([line(1, "never")])
        assert "error" in json.loads(error)
        loop.send(lines[12:16])
        told(page, "lines: 17, not taken: 1", "counts")
        told(page, "line 13", "fault")
        assert (state(page)["step"], text(page, "play")) == (before, "Follow")
        page.click("[data-part=play]")
        told(page, "t = 7 s: 1 estimates", "summary")
        assert page.complaints() == []
        assert page.requests() == [page.url]
        late = browser.open(loop.page, width=390)
        told(late, "t = 7 s: 1 estimates", "summary")
        assert late.evaluate("document.documentElement.scrollWidth") <= 390
        loop.kill()
        told(page, "Disconnected since", "link")
        assert state(page)["connected"] == "false"
        loop = Loop(folder, loop.port)
        told(page, "Connected", "link")
        page.call("Page.bringToFront")  # what nobody sees is not drawn
        loop.send(lines[16:])
        told(page, "t = 11 s: 1 estimates", "summary")
        assert int(page.evaluate("document.querySelector('[data-part=scrubber]').max")) >= 3  # what was drawn is kept
    finally:
        loop.kill()
    came = (folder / "came").read_bytes()
    assert came.splitlines() == [*lines[:12], line(1, "never"), *lines[12:]]
    monkeypatch.chdir(folder)
    first, again = (CliRunner().invoke(app, [*WORDS, *OPTIONS], input=came) for _ in range(2))
    assert first.stdout_bytes == again.stdout_bytes
    assert json.loads(first.stdout.splitlines()[-1])["time"] == 11.0


def test_a_foreign_page_gets_no_socket(browser: Browser, folder: Path) -> None:
    loop = Loop(folder)
    try:
        script = "new WebSocket('ws://127.0.0.1:PORT/PATH')".replace("PORT", str(loop.port))
        (folder / "foreign.html").write_text(
            "<!doctype html><title>foreign</title><script>"
            + "".join(
                f"Object.assign({script.replace('PATH', path)}, {{onopen: () => document.title += ' open', "
                "onclose: () => document.title += ' closed'});"
                for path in ("", "page")
            )
            + "</script>",
            "utf-8",
        )
        page = browser.open(folder / "foreign.html")
        wait_until(page, "document.title === 'foreign closed closed'")
        loop.send(walk(1))
    finally:
        loop.kill()


def test_the_page_wants_the_token_and_passes_it_on(browser: Browser, folder: Path) -> None:
    loop = Loop(folder, 0, "--token", "a-secret-of-words")
    try:
        assert browser.open(loop.page).evaluate("document.querySelector('#replay')") is None
        page = browser.open(loop.page, query="token=a-secret-of-words")
        told(page, "Connected", "link")
    finally:
        loop.kill()


def test_heights_are_drawn(browser: Browser, tmp_path: Path) -> None:
    """Flight levels beside the estimates, and their heights over time; without heights there is no chart."""
    text_of_file = SYNCHRONOUS.replace("constant_velocity, sigma_v", "constant_velocity_height, sigma_v")
    text_of_file = text_of_file.replace("kind: position}", "kind: position_altitude}")
    text_of_file = text_of_file.replace("std: [20.0, 20.0, 5.0, 5.0]", "std: [20.0, 20.0, 5.0, 5.0, 500.0, 3.0]")
    text_of_file = text_of_file.replace("std: [10.0, 10.0]", "std: [10.0, 10.0, 20.0]")
    (tmp_path / "small.yaml").write_text(text_of_file, "utf-8")
    loop, rows = Loop(tmp_path), list[bytes]()
    for k in range(8):
        place = [20.0 * k, -10.0 * k, 3000.0 + 5.0 * k]
        rows += [line(1, float(k), [place, [200.0, 300.0, 900.0]]), line(2, k + 0.5, [])]
    try:
        page = browser.open(loop.page, width=1200)
        told(page, "no scan yet: 0 estimates", "summary")
        assert page.evaluate("!document.querySelector('[data-part=heights]').hidden")
        loop.send(rows[:2])
        told(page, "t = 0.5 s", "summary")
        ink_at_first = ink(page, "heights")
        for one in rows[2:]:
            loop.send([one])
        told(page, "t = 7.5 s: 2 estimates", "summary")
        with connect(f"ws://127.0.0.1:{loop.port}/page", proxy=None) as socket:
            heights = json.loads(socket.recv(WAIT))["frame"]["heights"]
        assert sorted(round(height, -2) for height, _ in heights) == [900, 3000]
        assert all(0.0 < std < 30.0 for _, std in heights)
        assert page.complaints() == []
        assert ink(page, "heights") > ink_at_first + 20
    finally:
        loop.kill()


def test_without_heights_no_chart_of_them_is_drawn(browser: Browser, folder: Path) -> None:
    loop = Loop(folder)
    try:
        page = browser.open(loop.page)
        loop.send(walk(2))
        told(page, "t = 1 s", "summary")
        assert page.evaluate("document.querySelector('[data-part=heights]').hidden")
        assert page.complaints() == []
    finally:
        loop.kill()
