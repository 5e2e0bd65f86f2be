"""The command that tracks scans while they come in."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from live.examples import SYNCHRONOUS, line, walk
from vedette.cli import app

WORDS = ("live", "--sensors", "small.yaml")
WAIT = 600.0  # s


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "small.yaml").write_text(SYNCHRONOUS, "utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def call(*words: str, lines: list[bytes] | None = None) -> Result:
    return CliRunner().invoke(app, [*WORDS, *words], input=b"\n".join(lines or []), env={"COLUMNS": "200"})


def test_lines_in_lines_out(place: Path) -> None:
    lines = [*walk(8), b"{", line(1, 8.0)]
    result = call("--decide-every", "5", lines=lines)
    assert result.exit_code == 0, result.output
    answers = [json.loads(text) for text in result.stdout.splitlines()]
    assert sum("tracks" in answer for answer in answers) == 17
    assert [answer["plan"]["time"] for answer in answers if "plan" in answer] == [5.0]
    assert [answer["line"] for answer in answers if "error" in answer] == [17]
    assert "  survival    0.999 per second" in result.stderr
    document = json.loads(call("--decide-every", "5", "--json", lines=lines).stdout)
    assert (document["lines"], document["errors"], document["scans"], document["decisions"]) == (18, 1, 17, 1)


PROGRAM = [sys.executable, "-c", "from vedette.cli import app; app(prog_name='vedette')"]


def test_a_killed_loop_resumes_and_its_record_replays_to_the_same_bytes(place: Path) -> None:
    lines = walk(10)
    options = ("--decide-every", "4", "--planner", "idm")
    kept = [*PROGRAM, *WORDS, *options, "--snapshot", "state", "--snapshot-interval", "0", "--record", "came"]
    with subprocess.Popen(kept, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(b"\n".join(lines[:9]) + b"\n")
        process.stdin.flush()
        first = [process.stdout.readline() for _ in range(8)]  # the ninth is under way, or answered
        process.kill()
    num = len((place / "came").read_bytes().splitlines())
    assert num in (8, 9)
    rest = b"\n".join(lines[num:])
    second = subprocess.run(kept, input=rest, capture_output=True, timeout=WAIT, check=True)
    whole = call(*options, lines=lines)
    both = list(dict.fromkeys([*first, *second.stdout.splitlines(keepends=True)]))
    wanted = whole.stdout_bytes.splitlines(keepends=True)
    assert [text for text in wanted if text not in both] in ([], wanted[8:9])
    assert both[-1] == wanted[-1]
    assert call(*options, lines=(place / "came").read_bytes().splitlines()).stdout_bytes == whole.stdout_bytes
    assert os.listdir(place).count("state") == 1


@pytest.mark.parametrize(
    ("words", "status", "message"),
    [
        (("--listen", "here"), 2, "expected stdin, tcp://HOST:PORT or ws://HOST:PORT; got 'here'"),
        (("--listen", "tcp://127.0.0.1:70000"), 2, "expected stdin, tcp://HOST:PORT"),
        (("--listen", "tcp://0.0.0.0:0"), 1, "--listen: expected a loopback address such as 127.0.0.1, or --token"),
        (("--listen", "stdin", "--listen", "ws://0.0.0.0:0"), 1, "expected a loopback address such as 127.0.0.1"),
        (("--planner", "best"), 2, "expected one of"),
        (("--decide-every", "5", "--planner", "oracle"), 1, "expected one that does not know the targets"),
        (("--snapshot", "small.yaml"), 1, "small.yaml: expected a snapshot"),
        (("--record", "no/came"), 1, "no/came: expected a file that can be written"),
    ],
)
def test_wrong_options_are_reported(place: Path, words: tuple[str, ...], status: int, message: str) -> None:
    result = call(*words)
    assert (result.exit_code, message in result.output) == (status, True), result.output
