"""Workers: what they are given is done once, whatever happens to them, and their number changes no byte."""

from __future__ import annotations

import os
import re
import signal
import struct
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from functools import partial
from itertools import chain
from multiprocessing import active_children
from pathlib import Path
from typing import Any

import pytest

from campaigns.examples import small_campaign
from vedette.campaigns import engine, local
from vedette.campaigns.cluster import remote_workers
from vedette.campaigns.engine import in_process, on_workers
from vedette.campaigns.local import local_workers
from vedette.campaigns.rows import Row, pack
from vedette.campaigns.tasks import CompletedRun, FailedRun, Task, TaskOutcome, TaskQueue, WorkerDied, perform
from vedette.errors import InputError, VedetteError
from waiting import wait_for_port, wait_until

pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::DeprecationWarning")
RUNS = 30


def payloads(results: Iterable[CompletedRun | FailedRun]) -> dict[tuple[str, int], Row]:
    done = list(results)
    landed = [result for result in done if isinstance(result, CompletedRun)]
    assert len(landed) == len(done), [r for r in done if isinstance(r, FailedRun)]
    assert len({(result.cell, result.run) for result in landed}) == len(landed)
    # The timings are of the clock.
    return {(each.cell, each.run): replace(each.row, timings=pack("", 0, b"")) for each in landed}


@pytest.fixture(scope="module")
def alone() -> dict[tuple[str, int], Row]:
    return payloads(chain.from_iterable(in_process(TaskQueue(small_campaign(runs=RUNS), ()))))


def on_local_workers(num_workers: int = 2, tell: Callable[[str], None] = print) -> Iterator[CompletedRun | FailedRun]:
    with local_workers(num_workers, tell) as workers:
        yield from chain.from_iterable(on_workers(workers, TaskQueue(small_campaign(runs=RUNS), ())))


def test_workers_change_no_byte_even_when_one_is_killed(alone: dict[tuple[str, int], Row]) -> None:
    before = set(active_children())
    results, told = [], list[str]()
    for result in on_local_workers(tell=told.append):
        results.append(result)
        if len(results) == 10:
            (set(active_children()) - before).pop().kill()
    assert payloads(results) == alone
    assert set(active_children()) <= before
    assert told == ["a worker has died (signal 9, out of memory?): another takes its place, and what it had not done"]


def test_a_task_that_kills_its_workers_is_told_and_the_others_are_done(
    alone: dict[tuple[str, int], Row], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its own runs alone, one after the other, with those that can be done."""
    monkeypatch.setattr(local, "perform", partial(deadly, tmp_path / "deaths"))
    results = list(on_local_workers())
    failed = [result for result in results if isinstance(result, FailedRun)]
    assert failed == [FailedRun("stationary", 7, "every worker that took it died (out of memory?)")]
    expected = {key: value for key, value in alone.items() if key != ("stationary", 7)}
    assert payloads(result for result in results if isinstance(result, CompletedRun)) == expected
    assert len((tmp_path / "deaths").read_text()) == 2 + 2 * 2  # as one of a task, and alone


def deadly(deaths: Path, task: Task) -> Any:
    """As `perform`, but one run takes its worker's life."""
    if task.cell.name == "stationary" and 7 in task.runs:
        with deaths.open("a") as file:
            file.write("x")
        os.kill(os.getpid(), signal.SIGKILL)
    return perform(task)


def test_a_task_that_was_done_when_its_worker_died_is_not_done_again(
    alone: dict[tuple[str, int], Row], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor taken for what it died of: nobody looks before the next task is handed out."""
    queue = TaskQueue(small_campaign(runs=RUNS), ())
    first, second = queue.take(), queue.take()
    assert first is not None
    assert second is not None
    with local_workers(1, print) as workers:
        workers.submit(first)
        (worker,) = workers._workers
        (done,) = worker.tasks
        done.result()
        for process in worker.processes:
            process.kill()
        wait_until(lambda: not active_children(), "the end of the worker")
        # A thread of the pool sees it later; a task that the pool takes until then is one that its worker died of.
        wait_until(lambda: bool(worker.pool._broken), "the pool's notice of it")
        workers.submit(second)
        ended = workers.next()
        while len(ended) < 2:
            ended += workers.next()
        assert [task for task, _ in ended] == [first, second]
        assert workers._killers == set()
    landed = [result for _, outcome in ended if not isinstance(outcome, WorkerDied) for result in outcome]
    assert payloads(landed).items() <= alone.items()


def test_a_worker_that_is_killed_in_the_middle_of_a_message_is_waited_for_by_nobody(
    alone: dict[tuple[str, int], Row], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Results of a hundred kilobytes go through a pipe in pieces, and Ctrl-C comes in between."""
    monkeypatch.setattr(local, "perform", partial(half_said, tmp_path / "once"))
    assert payloads(on_local_workers()) == alone
    assert (tmp_path / "once").exists()


def half_said(once: Path, task: Task) -> Any:
    """As `perform`, but the first worker that is asked for a certain run ends while it says so."""
    if task.cell.name == "stationary" and 7 in task.runs and not once.exists():
        once.touch()
        frame = sys._getframe()
        while "result_queue" not in frame.f_locals:
            assert frame.f_back is not None
            frame = frame.f_back
        os.write(frame.f_locals["result_queue"]._writer.fileno(), struct.pack("!i", 100_000) + b"half of it")
        os.kill(os.getpid(), signal.SIGKILL)
    return perform(task)


def test_workers_that_end_while_they_start_are_told_of(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(local, "_initialise_worker", partial(os._exit, 3))
    with pytest.raises(VedetteError, match="the worker processes ended while they started"):
        list(on_local_workers())


def test_what_is_finished_when_ctrl_c_comes_is_given_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """Though it waits for others, to be kept together."""

    def until(task: Task) -> TaskOutcome:
        if task.runs[0] == 2:
            raise KeyboardInterrupt
        return (FailedRun(task.cell.name, task.runs[0], "made up"),)

    monkeypatch.setattr(engine, "perform", until)
    results = in_process(TaskQueue(small_campaign(runs=3), ()))
    assert [(each.cell, each.run) for each in next(results)] == [
        ("idm", 0),
        ("stationary", 0),
        ("idm", 1),
        ("stationary", 1),
    ]
    with pytest.raises(KeyboardInterrupt):
        next(results)


@contextmanager
def dask(*arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    process = subprocess.Popen(
        [sys.executable, "-m", "dask", *arguments, "--no-dashboard"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        if arguments[0] == "scheduler":
            wait_for_port(int(arguments[-1]))
        yield process
    finally:
        process.kill()
        process.wait()


def test_a_cluster_of_its_own_does_the_same(alone: dict[tuple[str, int], Row], free_port: int) -> None:
    address = f"tcp://127.0.0.1:{free_port}"
    with (
        dask("scheduler", "--host", "127.0.0.1", "--port", str(free_port)),
        dask("worker", address, "--nthreads", "1", "--nworkers", "2"),
        remote_workers(address, print) as workers,
    ):
        results = on_workers(workers, TaskQueue(small_campaign(runs=RUNS), ()))
        assert payloads(chain.from_iterable(results)) == alone


def test_workers_are_waited_for_and_missed(
    alone: dict[tuple[str, int], Row], free_port: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the file that the scheduler writes; they are looked at often here."""
    monkeypatch.setattr("vedette.campaigns.cluster._REFRESH_SECONDS", 0.2)
    file, told, results = tmp_path / "scheduler.json", list[str](), list[CompletedRun | FailedRun]()
    known = ("--scheduler-file", str(file))
    with (
        dask("scheduler", "--host", "127.0.0.1", *known, "--port", str(free_port)),
        dask("worker", *known, "--nthreads", "1"),
        ExitStack() as second,
    ):

        def tell(text: str) -> None:
            told.append(text)
            if text.startswith("waiting: "):
                second.enter_context(dask("worker", *known, "--nthreads", "1", "--no-nanny"))

        with remote_workers(str(file), tell, 2) as workers:
            for result in chain.from_iterable(on_workers(workers, TaskQueue(small_campaign(runs=RUNS), ()))):
                results.append(result)
                if len(results) == 5:
                    second.close()
    assert payloads(results) == alone
    assert any(re.fullmatch("waiting: [01] of 2 workers there", text) for text in told)
    assert "1 worker gone, whose work is done again; 1 worker left" in told


@pytest.mark.parametrize(("text", "told"), [(None, "it is not there"), ("{", "Expecting"), ("{}", "address")])
def test_a_file_that_no_scheduler_wrote(
    text: str | None, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("vedette.campaigns.cluster._CONNECT_SECONDS", 0.1)
    file = tmp_path / "scheduler.json"
    if text is not None:
        file.write_text(text)
    expected = pytest.raises(InputError, match=rf"scheduler: expected a file that .*scheduler\.json: .*{told}")
    with expected, remote_workers(str(file), print):
        pass


def test_a_scheduler_that_is_killed_is_said_to_be_gone(free_port: int) -> None:
    address = f"tcp://127.0.0.1:{free_port}"
    landed = []

    def run_until_it_dies() -> None:
        with remote_workers(address, print) as workers:
            for result in chain.from_iterable(on_workers(workers, TaskQueue(small_campaign(runs=RUNS), ()))):
                landed.append(result)
                if len(landed) == 5:
                    scheduler.kill()
                    scheduler.wait()

    with (
        dask("scheduler", "--host", "127.0.0.1", "--port", str(free_port)) as scheduler,
        dask("worker", address, "--nthreads", "1"),
        pytest.raises(VedetteError, match="the scheduler is gone"),
    ):
        run_until_it_dies()
    assert 5 <= len(landed) < 2 * RUNS


def test_an_address_where_nothing_answers(free_port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vedette.campaigns.cluster._CONNECT_SECONDS", 0.5)
    for address in (f"tcp://127.0.0.1:{free_port}", "nonsense://x", ""):
        expected = pytest.raises(InputError, match="scheduler: expected the address of a running dask scheduler")
        with expected, remote_workers(address, print):
            pass
