"""What is printed, wherever it goes: names of any kind, encodings without their letters, full disks, closed pipes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from cli.test_small_scenes import SCENE
from vedette.cli import app
from vedette.cli.output import wrap_line
from vedette.scenarios import Scenario, load_scenario
from vedette.scenarios.dumping import dump_scenario
from vedette.scenarios.overrides import replace_fields

PROGRAM = [sys.executable, "-c", "from vedette.cli import app; app()"]
ODD = r"[/bold]x [red] :cat: é 猫 $x \frac"
WAIT = 600.0  # s; each takes some seconds

posix = pytest.mark.skipif(os.name == "nt", reason="of POSIX systems")


@pytest.fixture
def odd(tmp_path: Path) -> Path:
    """A scenario of few scans with a name that markup, encodings and mathematical text each stumble over."""
    fields = {"name": ODD, "sensors.0.name": ODD, "time.num_steps": 3, "ospa.first_scan": None, "ospa.last_scan": None}
    fields |= {"birth.steps": [1], "targets.tracks": [{"state": [x, 0.0, 1.0, 1.0]} for x in (0.0, 300.0)]}
    path = tmp_path / "odd.yaml"
    path.write_text(dump_scenario(replace_fields(load_scenario("linear-10"), fields).model), encoding="utf-8")
    assert Scenario(load_scenario(path).model).name == ODD
    return path


def program(*arguments: object, **options: object) -> subprocess.CompletedProcess[bytes]:
    command = [*PROGRAM, *(str(each) for each in arguments)]
    settings = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "timeout": WAIT, "check": False, **options}
    return subprocess.run(command, **settings)  # type: ignore[call-overload]


def test_names_are_text_and_no_markup(odd: Path, tmp_path: Path) -> None:
    spec = tmp_path / "spec.toml"
    name = ODD.replace("\\", "\\\\")
    variants = "".join(f'[[variants]]\nname = "{name}{end}"\n[variants.set]\n' for end in (" 1", " 2"))
    spec.write_text(
        f'name = "{name}"\nscenarios = ["odd.yaml"]\nplanners = ["stationary"]\nruns = 1\n{variants}', "utf-8"
    )
    for command in (
        ("show", odd, "--out", tmp_path / "picture.svg"),
        ("run", odd, "--planner", "stationary"),
        ("campaign", spec, "--workers", 1, "--out", tmp_path / "results"),
        ("results", tmp_path / "results"),
        ("report", tmp_path / "results"),
    ):
        result = CliRunner().invoke(app, [str(each) for each in command])
        assert result.exit_code == 0, result.output
    shown = CliRunner().invoke(app, ["show", str(odd)])
    assert ODD in shown.output


@pytest.mark.parametrize(("encoding", "first"), [("ascii", "[/bold]x [red] :cat: ? ? $x"), ("latin-1", "é ?")])
def test_letters_that_an_encoding_lacks_are_question_marks(odd: Path, encoding: str, first: str) -> None:
    done = program("show", odd, env={**os.environ, "PYTHONIOENCODING": encoding})
    assert done.returncode == 0, done.stderr
    assert first in done.stdout.decode(encoding).splitlines()[0]
    assert done.stderr == b""


@posix
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no full device")
@pytest.mark.parametrize(
    "command", [("list",), ("schema",), ("show", "paper-a"), ("show", "paper-a", "--with-defaults")]
)
def test_a_full_device_is_one_line(command: tuple[str, ...]) -> None:
    with Path("/dev/full").open("wb") as full:
        done = program(*command, stdout=full)
    assert (done.returncode, done.stderr) == (1, b"the output cannot be written: No space left on device\n")


@posix
@pytest.mark.parametrize("command", [("schema",), ("show", "paper-a")])
def test_a_reader_that_goes_away_hears_nothing_more(command: tuple[str, ...]) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    try:
        done = program(*command, stdout=writer)
    finally:
        os.close(writer)
    assert (done.returncode, done.stderr) == (1, b"")


def test_a_long_line_is_broken_between_words_on_a_terminal() -> None:
    text = "\ninterrupted: trial-results keeps every run that is finished; the same command goes on"
    broken = "\ninterrupted: trial-results keeps every\nrun that is finished; the same command\ngoes on"
    assert wrap_line(text, 40) == broken
    assert wrap_line(text, 100) == text
    for kept in ("  vedette campaign SPEC --runs=2 --out trial-shards --shard 2/2", "a: 1\n" + 50 * "b", 50 * "x"):
        assert wrap_line(kept, 40) == kept


@posix
def test_a_terminal_of_60_columns_breaks_no_word(tmp_path: Path) -> None:
    import pty

    (tmp_path / "s.yaml").write_text(SCENE)
    leader, follower = pty.openpty()
    done = program("check", tmp_path / "s.yaml", stdout=follower, env={**os.environ, "COLUMNS": "60"})
    os.close(follower)
    lines = os.read(leader, 10_000).decode().split("\r\n")
    os.close(leader)
    assert done.returncode == 0
    assert max(map(len, lines[1:])) <= 60  # the first is the path, which has no place to break
    assert " ".join(lines).split()[-3:] == ["sequential,", "1", "decision)"]


@posix
def test_too_many_open_files_are_one_line(tmp_path: Path) -> None:
    import resource

    spec = tmp_path / "spec.toml"
    spec.write_text('name = "few"\nscenarios = ["linear-10"]\nplanners = ["stationary"]\nruns = 9\n')

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_NOFILE, (20, 20))

    done = program("campaign", spec, "--workers", 2, "--out", tmp_path / "results", preexec_fn=limit)
    assert done.returncode == 1
    lines = done.stderr.decode().splitlines()
    assert "files may be open at once for 2 workers; the limit is 20" in lines[-1]
    assert len(lines) < 5, lines
