"""Workers: what they are given is done once, whatever happens to them, and their number changes no byte."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from campaigns.examples import small_campaign
from vedette.campaigns.clients import local_workers, remote_workers
from vedette.campaigns.engine import in_process, on_workers
from vedette.campaigns.tasks import Failed, Landed, TaskQueue
from vedette.errors import InputError, VedetteError
from waiting import wait_for_port

pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::DeprecationWarning")
RUNS = 30


def payloads(results: Any) -> dict[tuple[str, int], bytes]:
    landed = list(results)
    assert all(isinstance(result, Landed) for result in landed), [r for r in landed if isinstance(r, Failed)]
    assert len({(result.cell, result.run) for result in landed}) == len(landed)
    return {(result.cell, result.run): result.payload + result.metrics for result in landed}


@pytest.fixture(scope="module")
def alone() -> dict[tuple[str, int], bytes]:
    return payloads(in_process(TaskQueue(small_campaign(runs=RUNS), ())))


def test_workers_change_no_byte_even_when_one_is_killed(alone: dict[tuple[str, int], bytes]) -> None:
    results = []
    with local_workers(2) as client:
        for result in on_workers(client, TaskQueue(small_campaign(runs=RUNS), ()), print):
            results.append(result)
            if len(results) == 10:
                os.kill(next(iter(client.run(os.getpid).values())), signal.SIGKILL)
    assert payloads(results) == alone


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


def test_a_cluster_of_its_own_does_the_same(alone: dict[tuple[str, int], bytes], free_port: int) -> None:
    address = f"tcp://127.0.0.1:{free_port}"
    with (
        dask("scheduler", "--host", "127.0.0.1", "--port", str(free_port)),
        dask("worker", address, "--nthreads", "1", "--nworkers", "2"),
        remote_workers(address) as client,
    ):
        assert payloads(on_workers(client, TaskQueue(small_campaign(runs=RUNS), ()), print)) == alone


def test_a_scheduler_that_is_killed_is_said_to_be_gone(free_port: int) -> None:
    address = f"tcp://127.0.0.1:{free_port}"
    landed = []

    def run_until_it_dies() -> None:
        with remote_workers(address) as client:
            for result in on_workers(client, TaskQueue(small_campaign(runs=RUNS), ()), print):
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
    monkeypatch.setattr("vedette.campaigns.clients._CONNECT_SECONDS", 0.5)
    for address in (f"tcp://127.0.0.1:{free_port}", "nonsense://x", ""):
        expected = pytest.raises(InputError, match="scheduler: expected the address of a running dask scheduler")
        with expected, remote_workers(address):
            pass
