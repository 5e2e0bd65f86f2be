"""Workers to hand tasks to: processes on this machine, or those of a cluster."""

from __future__ import annotations

import asyncio
import logging
import re
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import active_children
from typing import TYPE_CHECKING

from vedette.campaigns.scratch import scratch_folder
from vedette.errors import InputError, VedetteError
from vedette.evaluation.runs import children_ignore_interrupts
from vedette.reading import said

if TYPE_CHECKING:
    from distributed import Client, LocalCluster

_CONNECT_SECONDS = 10.0
_SPAWN_SECONDS = 5.0
_START_SECONDS = 120.0
_POLL_SECONDS = 0.02
_FILES, _FILES_A_WORKER = 60, 24  # open at once, with room to spare: 33 were with one worker, 56 with three
_ADDRESS = re.compile(r"(tcp|tls)://[^\s/]+:[0-9]+")


@contextmanager
def local_workers(num_workers: int) -> Iterator[Client]:
    """As many worker processes on this machine, being started (see `wait_for_worker`); one that dies is replaced.

    They talk over the loopback device, where any process of the machine can knock, and whoever is let in can have them
    run code: so with credentials that are made here, for this once, and are in no file.

    Raises:
        VedetteError: they cannot be started.
    """
    _make_room_for_files(num_workers)
    import dask
    from distributed import Client, LocalCluster
    from distributed.security import Security

    with scratch_folder() as scratch:
        with dask.config.set({"distributed.scheduler.allowed-failures": 1}):
            cluster = LocalCluster(
                n_workers=0,
                threads_per_worker=1,
                processes=True,
                protocol="tls://",
                security=Security.temporary(),
                host="127.0.0.1",
                dashboard_address="127.0.0.1:0",
                memory_limit=None,
                local_directory=scratch,
                silence_logs=logging.CRITICAL,
                preload=["vedette.campaigns.worker"],
            )
        with cluster, Client(cluster, set_as_default=False) as client:
            _start(cluster, num_workers)
            yield client


def _make_room_for_files(num_workers: int) -> None:
    """Raise this process's limit of open files where it is too low, as far as the system lets it.

    Raises `VedetteError` where that is not enough: dask would tell of every file that it cannot open.
    """
    try:
        import resource
    except ImportError:  # Windows has no such limit
        return
    needed = _FILES + num_workers * _FILES_A_WORKER
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft == resource.RLIM_INFINITY or soft >= needed:
        return
    if hard != resource.RLIM_INFINITY and hard < needed:
        raise VedetteError(
            f"workers: expected that {needed} files may be open at once for {num_workers} workers; the limit is {hard} "
            "(ulimit -n; --workers 1 needs fewer)"
        )
    resource.setrlimit(resource.RLIMIT_NOFILE, (needed, hard))


def _start(cluster: LocalCluster, num_workers: int) -> None:
    """Start the processes; Ctrl-C is kept from them from their first moment."""
    begin = time.monotonic()
    with children_ignore_interrupts():
        cluster.scale(num_workers)
        while len(active_children()) < num_workers and time.monotonic() - begin < _SPAWN_SECONDS:
            time.sleep(_POLL_SECONDS)


def wait_for_worker(client: Client) -> None:
    """Wait until one of the workers that `local_workers` starts is there.

    Raises:
        VedetteError: they end while they start, or take far too long.
    """
    begin = time.monotonic()
    while not client.cluster.scheduler_info["workers"]:
        if not active_children() or time.monotonic() - begin > _START_SECONDS:
            raise VedetteError(
                "the worker processes ended while they started; in a script of your own, put the call that runs the "
                'campaign under `if __name__ == "__main__":`'
            )
        time.sleep(_POLL_SECONDS)


@contextmanager
def remote_workers(address: str) -> Iterator[Client]:
    """The workers of a scheduler that runs already.

    Raises:
        InputError: the address is none, or nothing answers there.
    """
    expected = "scheduler: expected the address of a running dask scheduler, such as tcp://host:8786"
    if not _ADDRESS.fullmatch(address):
        raise InputError(f"{expected}; got {address!r}")
    from distributed import Client

    for logger in ("distributed", "distributed.client"):  # a lost scheduler is said once, by the error
        logging.getLogger(logger).setLevel(logging.CRITICAL)
    _check_scheduler(address, f"{expected}; no scheduler answers at {address}")
    try:
        client = Client(address, set_as_default=False, timeout=_CONNECT_SECONDS)
    except (OSError, ValueError) as error:
        raise InputError(f"{expected}; nothing answers at {address}: {error}") from None
    with client:
        yield client


def _check_scheduler(address: str, refusal: str) -> None:
    """`InputError` unless what listens there says in time that it is a scheduler.

    A client of dask would wait for ever for what accepts and is silent, and leave traces where it answers otherwise.
    """
    answers: list[object] = []

    async def ask() -> object:
        arguments = Security().get_connection_args("client")
        async with rpc(address, timeout=_CONNECT_SECONDS, connection_args=arguments) as there:
            return await there.identity()

    def wait() -> None:
        try:
            answers.append(asyncio.run(asyncio.wait_for(ask(), _CONNECT_SECONDS)))
        except Exception as error:  # what answers may be anything, and so may what comes of it
            answers.append(error)

    from distributed.core import rpc
    from distributed.security import Security

    thread = threading.Thread(target=wait, daemon=True)  # a loop of its own, as this thread may have one
    thread.start()
    thread.join(2.0 * _CONNECT_SECONDS)
    answer = answers[0] if answers else TimeoutError()
    if isinstance(answer, TimeoutError):
        raise InputError(f"{refusal}: it is silent for {_CONNECT_SECONDS:g} s")
    if isinstance(answer, OSError):
        raise InputError(f"{refusal}: {said(answer)}")
    if not isinstance(answer, dict) or answer.get("type") != "Scheduler":
        raise InputError(f"{refusal}, but something else does")
