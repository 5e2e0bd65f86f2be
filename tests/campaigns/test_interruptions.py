"""Campaigns that are killed, for real: nothing is lost, and the same command ends with the same bytes."""

from __future__ import annotations

import hashlib
import os
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from campaigns.examples import SPEC as SPEC_DATA
from campaigns.examples import small_campaign
from vedette.campaigns.database import Reader
from vedette.campaigns.results import open_results
from vedette.campaigns.running import NullObserver, run_campaign
from vedette.errors import InputError
from waiting import PATIENCE, heed_interrupts, wait_for_port, wait_until

RUNS = 40
SPEC = f"""
name = "small"
scenarios = ["paper-a"]
planners = ["idm", "stationary"]
runs = {RUNS}

[set]
"time.num_steps" = 12
"control.decision_steps" = [10]
"control.num_samples" = 2
"ospa.last_scan" = 12
"""


def contents(folder: Path) -> dict[str, str]:
    """What a campaign leaves, but for the seconds that things took."""
    results = open_results(folder)
    runs = {f"{run.cell} {run.record.run}": run.checksum for run in results.runs()}
    files = {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted((folder / "tables").iterdir())
        if path.name != "timings.parquet"
    }
    assert files
    return {**runs, **files}


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    folder = tmp_path_factory.mktemp("undisturbed") / "results"
    outcome = run_campaign(small_campaign(runs=RUNS), folder)
    assert (outcome.num_completed, outcome.num_existing, outcome.failed) == (2 * RUNS, 0, ())
    return contents(folder)


@pytest.fixture
def program(tmp_path: Path) -> Iterator[Program]:
    started = Program(tmp_path)
    yield started
    started.end()


class Program:
    """The command line on one campaign and one folder, started again and again."""

    def __init__(self, place: Path) -> None:
        self.folder = place / "results"
        self._spec = place / "spec.toml"
        self._spec.write_text(SPEC)
        self._process: subprocess.Popen[str] | None = None

    def start(self, *options: str) -> subprocess.Popen[str]:
        command = [Path(sys.executable).with_name("vedette"), "campaign", self._spec, "--out", self.folder, *options]
        self._process = subprocess.Popen(
            [str(part) for part in command],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
            preexec_fn=heed_interrupts,
        )
        return self._process

    def wait_for(self, num_runs: int) -> None:
        """Until at least so many runs are in the store."""

        def are_there() -> bool:
            assert self._process is not None
            assert self._process.poll() is None, self._process.communicate()
            try:
                return len(Reader(self.folder).finished()) >= num_runs
            except InputError:  # the store is not made yet
                return False

        wait_until(are_there, f"{num_runs} runs in the store")

    def finish(self) -> str:
        """What it printed, once it has ended well."""
        assert self._process is not None
        with closing(self._process.stdout):  # type: ignore[type-var]
            out, _ = self._process.communicate(timeout=PATIENCE)
        assert self._process.returncode == 0, out
        return out

    def end(self) -> None:
        if self._process is not None and self._process.poll() is None:
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.communicate()


def assert_gone(group: int) -> None:
    """No process of the group is left, or will be in a moment."""

    def is_gone() -> bool:
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        return False

    wait_until(is_gone, "the end of the program's workers")


def test_the_program_killed_at_several_moments_ends_with_the_same_bytes(
    program: Program, undisturbed: dict[str, str]
) -> None:
    for workers, enough in ((1, 7), (2, 30)):
        process = program.start("--workers", str(workers))
        program.wait_for(enough)
        process.kill()  # the program alone: its workers are to notice
        process.communicate()
        assert_gone(process.pid)
    program.start("--workers", "1")
    assert f"{2 * RUNS} of {2 * RUNS} runs" in program.finish()
    assert contents(program.folder) == undisturbed


def test_ctrl_c_leaves_a_folder_to_go_on_with(program: Program, undisturbed: dict[str, str]) -> None:
    process = program.start("--workers", "2")
    program.wait_for(20)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to every process of the group
    out, _ = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130, out
    assert "the same command goes on from there" in out
    assert "Traceback" not in out
    assert_gone(process.pid)
    program.start("--workers", "1")
    assert f"small: {2 * RUNS} runs, " in program.finish()
    assert contents(program.folder) == undisturbed


def test_a_lost_scheduler_leaves_a_folder_to_go_on_with(
    program: Program, undisturbed: dict[str, str], free_port: int
) -> None:
    address = f"tcp://127.0.0.1:{free_port}"
    dask = [sys.executable, "-m", "dask"]
    place = ["--host", "127.0.0.1", "--port", str(free_port), "--no-dashboard"]
    scheduler, worker = (
        subprocess.Popen([*dask, *arguments], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        for arguments in (["scheduler", *place], ["worker", address, "--nthreads", "1", "--no-dashboard"])
    )
    try:
        wait_for_port(free_port)
        process = program.start("--scheduler", address)
        program.wait_for(15)
        scheduler.kill()
        out, _ = process.communicate(timeout=PATIENCE)
    finally:
        for each in (worker, scheduler):
            each.kill()
            each.wait()
    assert process.returncode == 1, out
    assert "the scheduler is gone" in out
    assert "Traceback" not in out
    program.start("--workers", "1")
    program.finish()
    assert contents(program.folder) == undisturbed


def test_a_finished_campaign_runs_nothing_and_more_runs_add_to_it(tmp_path: Path) -> None:
    first = run_campaign(small_campaign(runs=2), tmp_path / "results")
    again = run_campaign(small_campaign(runs=2), tmp_path / "results")
    more = run_campaign(small_campaign(runs=3), tmp_path / "results")
    assert [(outcome.num_completed, outcome.num_existing) for outcome in (first, again, more)] == [
        (4, 0),
        (0, 4),
        (2, 4),
    ]
    alone = run_campaign(small_campaign(runs=3), tmp_path / "alone")
    assert alone.num_completed == 6
    assert contents(tmp_path / "results") == contents(tmp_path / "alone")


def test_a_damaged_run_is_named_and_done_again_if_that_is_asked_for(tmp_path: Path) -> None:
    folder = tmp_path / "results"
    run_campaign(small_campaign(runs=2), folder)
    before = contents(folder)
    with closing(sqlite3.connect(folder / "campaign.sqlite")) as database, database:
        database.execute("UPDATE runs SET payload = x'00' WHERE cell = 'idm' AND run = 1")
    with pytest.raises(InputError, match=r"altered since: idm 1 \(have what is damaged redone"):
        run_campaign(small_campaign(runs=2), folder)
    told: list[str] = []
    outcome = run_campaign(small_campaign(runs=2), folder, redo_damaged=True, progress=Notes(told))
    assert (outcome.num_completed, told) == (1, ["damaged, and done again: idm 1"])
    assert contents(folder) == before


class Notes(NullObserver):
    """Keeps what is said."""

    def __init__(self, told: list[str]) -> None:
        self._told = told

    def note(self, text: str) -> None:
        self._told.append(text)


def test_altered_and_half_written_tables_are_put_right(tmp_path: Path) -> None:
    folder = tmp_path / "results"
    run_campaign(small_campaign(runs=2), folder)
    before = contents(folder)
    (folder / "tables" / "scans.parquet").write_text("garbage")
    (folder / "tables" / "truth.parquet").unlink()
    run_campaign(small_campaign(runs=2), folder)
    assert contents(folder) == before


@pytest.mark.parametrize("left", [None, b""])
def test_runs_that_were_lost_are_done_again_and_that_is_said(tmp_path: Path, left: bytes | None) -> None:
    folder = tmp_path / "results"
    told: list[str] = []
    run_campaign(small_campaign(runs=1), folder)
    (folder / "campaign.sqlite").unlink()
    if left is not None:
        (folder / "campaign.sqlite").write_bytes(left)
    assert run_campaign(small_campaign(runs=1), folder, progress=Notes(told)).num_completed == 2
    assert any("was not there, or empty: every run is done again" in text for text in told)


def test_ctrl_c_while_workers_start(program: Program, undisturbed: dict[str, str]) -> None:
    process = program.start("--workers", "2")
    program.wait_for(2)  # the first run of each kind is done, and the workers start
    time.sleep(0.7)
    os.killpg(process.pid, signal.SIGINT)
    out, _ = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130, out
    assert_gone(process.pid)


def test_a_script_without_a_guard_is_told_so(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "from vedette.campaigns import CampaignSpec, resolve, run_campaign\n"
        f"spec = CampaignSpec.model_validate({SPEC_DATA!r})\n"
        f"run_campaign(resolve(spec), {str(tmp_path / 'results')!r}, num_workers=2)\n"
    )
    result = subprocess.run([sys.executable, script], capture_output=True, text=True, check=False, timeout=PATIENCE)
    assert result.returncode != 0
    assert 'under `if __name__ == "__main__":`' in result.stderr
