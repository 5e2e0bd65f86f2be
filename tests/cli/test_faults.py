"""Faults injected into whole programs: signals at random times, dead workers, damaged caches, deleted folders.

The programs end without a traceback, and the same command then ends well. `--fault-rounds` sets the number of faults.
"""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from live.examples import write_live
from recordings import write_recording
from short_runs import short_paper_e
from vedette.campaigns import open_results
from vedette.simulation.storage import UNFINISHED, load_run
from waiting import PATIENCE, heed_interrupts, wait_until

pytestmark = [pytest.mark.slow, pytest.mark.skipif(sys.platform != "linux", reason="signals and /proc")]

SPEC = """
name = "small"
scenarios = ["short.yaml"]
planners = ["idm", "stationary"]
runs = 20
"""
COMMANDS = {
    "run": ["run", "short.yaml", "--planner", "idm", "--out", "out"],
    "track": ["track", "scans.csv", "--sensors", "radars.yaml", "--out", "out"],
    "campaign": ["campaign", "spec.toml", "--out", "out", "--workers", "2"],
}


@pytest.fixture
def rounds(request: pytest.FixtureRequest) -> int:
    return int(request.config.getoption("--fault-rounds"))


@pytest.fixture
def place(tmp_path: Path) -> Iterator[Path]:
    (tmp_path / "short.yaml").write_text(short_paper_e(), encoding="utf-8")
    (tmp_path / "spec.toml").write_text(SPEC)
    write_recording(tmp_path, seconds=60.0)
    started.clear()
    yield tmp_path
    for process in started:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()


started: list[subprocess.Popen[bytes]] = []


def start(place: Path, words: list[str], **environment: str) -> subprocess.Popen[bytes]:
    process = subprocess.Popen(
        [sys.executable, "-m", "vedette", *words],
        cwd=place,
        env={**os.environ, **environment},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        start_new_session=True,
        preexec_fn=heed_interrupts,
    )
    started.append(process)
    return process


def end(process: subprocess.Popen[bytes], *statuses: int) -> str:
    """What it printed, once it has ended with one of the statuses and without a traceback."""
    text = process.communicate(timeout=PATIENCE)[0].decode()
    assert process.returncode in statuses, (process.returncode, text)
    assert "Traceback" not in text, text
    return text


def children(process: int) -> list[int]:
    """The children of a process, and theirs."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            if int(path.read_text().rpartition(")")[2].split()[1]) == process:
                found += [int(path.parent.name), *children(int(path.parent.name))]
    return found


@pytest.mark.parametrize("name", COMMANDS)
def test_signals_at_random_times(place: Path, rounds: int, name: str) -> None:
    moment, began = random.Random(name), time.monotonic()
    end(start(place, COMMANDS[name]), 0)
    seconds = time.monotonic() - began
    for _ in range(rounds):
        shutil.rmtree(place / "out", ignore_errors=True)
        for kind in (signal.SIGKILL, signal.SIGTERM, signal.SIGINT):
            process = start(place, COMMANDS[name])
            with suppress(subprocess.TimeoutExpired):
                process.wait(moment.uniform(0.5, 1.0) * seconds)
            process.send_signal(kind)
            # -2, -15: before the program is there; 1: the folder is complete already
            end(process, 0, 1, 130, -kind)
        told = end(start(place, COMMANDS[name]), 0, 1)
        assert (place / "out").is_dir(), told
        if name == "campaign":
            assert not open_results(place / "out").missing("idm")
        else:
            assert load_run(place / "out").num_scans > 0
            assert not (place / "out" / UNFINISHED).exists()
            assert (place / "out/figures/tracks.png").exists()
        assert not [path for path in (place / "out").rglob(".*")]


@pytest.mark.parametrize("kind", [signal.SIGINT, signal.SIGTERM])
def test_live_ends_with_a_last_snapshot(place: Path, rounds: int, kind: signal.Signals) -> None:
    lines = write_live(place, seconds=60.0)[:5]
    words = ["live", "--sensors", "radars.yaml", "--snapshot", "state", "--snapshot-interval", "1000"]
    for _ in range(rounds):
        process = start(place, words)
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(b"".join(line + b"\n" for line in lines))
        process.stdin.flush()
        while b'"line"' not in (line := process.stdout.readline()):
            assert line, "ended without an answer"
        process.send_signal(kind)
        end(process, 130)
        assert (place / "state").stat().st_size > 0


def test_killed_workers_are_replaced(place: Path, rounds: int) -> None:
    moment = random.Random(1)
    for _ in range(rounds):
        shutil.rmtree(place / "out", ignore_errors=True)
        process = start(place, COMMANDS["campaign"])
        wait_until((place / "out/campaign.sqlite").exists, "a start")
        time.sleep(moment.uniform(0.0, 1.0))
        for worker in children(process.pid)[-1:]:
            with suppress(ProcessLookupError):
                os.kill(worker, signal.SIGKILL)
        end(process, 0, 1)
        end(start(place, COMMANDS["campaign"]), 0)
        assert not open_results(place / "out").missing("idm")


@pytest.mark.parametrize("name", COMMANDS)
def test_folders_deleted_in_mid_run(place: Path, rounds: int, name: str) -> None:
    moment, began = random.Random(name), time.monotonic()
    end(start(place, COMMANDS[name]), 0)
    seconds = time.monotonic() - began
    for _ in range(rounds):
        shutil.rmtree(place / "out", ignore_errors=True)
        process = start(place, COMMANDS[name])
        with suppress(subprocess.TimeoutExpired):
            process.wait(moment.uniform(0.5, 1.0) * seconds)
        shutil.rmtree(place / "out", ignore_errors=True)
        end(process, 0, 1)
    shutil.rmtree(place / "out", ignore_errors=True)
    end(start(place, COMMANDS[name]), 0)


def test_two_cold_starts_at_once_and_a_damaged_cache(place: Path, rounds: int) -> None:
    """Slow even among these: everything is compiled twice."""
    moment, cache = random.Random(2), place / "cache"
    words = COMMANDS["run"][:-1]
    for process in [start(place, [*words, name], VEDETTE_CACHE_DIR=str(cache)) for name in ("first", "second")]:
        end(process, 0)
    entries = sorted(cache.rglob("*.nbc"))
    assert entries
    for _ in range(rounds):
        for path in moment.sample(entries, 5):
            content = bytearray(path.read_bytes())
            content[moment.randrange(len(content))] ^= 0xFF
            path.write_bytes(content[: moment.randrange(len(content))] if moment.random() < 0.5 else content)
        end(start(place, [*words, "again", "--overwrite"], VEDETTE_CACHE_DIR=str(cache)), 0)
    runs = [load_run(place / name) for name in ("first", "second", "again")]
    assert len({run.estimates[-1].means.tobytes() for run in runs}) == 1
