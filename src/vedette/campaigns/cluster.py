"""Workers of a running dask cluster."""

from __future__ import annotations

import asyncio
import json
import logging
import math
import re
import threading
import time
from asyncio import CancelledError as AsyncCancelledError
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from vedette.campaigns.tasks import Task, TaskOutcome, WorkerDied, perform
from vedette.errors import InputError, VedetteError
from vedette.internal.reading import error_summary
from vedette.internal.text import pluralise, shown

if TYPE_CHECKING:
    from distributed import Client, Future

_TASKS_A_THREAD = 2  # one waits, so that no worker idles while results travel
_CONNECT_SECONDS = 10.0
_REFRESH_SECONDS = 2.0  # between updates of the list of workers
_POLL_SECONDS = 0.02
_ADDRESS = re.compile(r"(tcp|tls)://[^\s/]+:[0-9]+")


@contextmanager
def remote_workers(address: str, tell: Callable[[str], None], quorum: int = 1) -> Iterator[RemoteWorkers]:
    """Context manager with the workers of a running scheduler.

    Args:
        address: address of the scheduler, or the file that it writes.
        tell: receives messages when workers join or leave.
        quorum: number of workers to wait for at the start.

    Raises:
        InputError: the address is invalid, or no scheduler answers there.
    """
    expected = "scheduler: expected the address of a running dask scheduler, such as tcp://host:8786"
    if address.endswith(".json"):
        address = _address_in(Path(address))
    if not _ADDRESS.fullmatch(address):
        raise InputError(f"{expected}; got {address!r}")
    from distributed import Client

    for logger in ("distributed", "distributed.client"):  # the error reports a lost scheduler once
        logging.getLogger(logger).setLevel(logging.CRITICAL)
    _check_scheduler(address, f"{expected}; no scheduler answers at {address}")
    try:
        client = Client(address, set_as_default=False, timeout=_CONNECT_SECONDS)
    except (OSError, ValueError) as error:
        raise InputError(f"{expected}; nothing answers at {address}: {error}") from None
    with client:
        workers = RemoteWorkers(client, tell)
        workers.wait_for(quorum)
        yield workers


class RemoteWorkers:
    """Workers of a dask cluster, see `vedette.campaigns.engine.Workers`."""

    def __init__(self, client: Client, tell: Callable[[str], None]) -> None:
        from distributed import as_completed

        self._client = client
        self._tell = tell
        self._looked_at = -math.inf
        self._there: frozenset[str] = frozenset()
        self._num_threads = 1
        self._tasks: dict[Future, Task] = {}
        self._done = as_completed(loop=client.loop)

    def room(self) -> int:
        """See `Workers`."""
        self._look()
        return _TASKS_A_THREAD * self._num_threads

    def submit(self, task: Task) -> None:
        """See `Workers`."""
        future = self._client.submit(perform, task, pure=False)
        self._tasks[future] = task
        self._done.add(future)

    def wait_for(self, quorum: int) -> None:
        """Wait until this number of workers is connected."""
        self._look()
        if len(self._there) < quorum:
            self._tell(f"waiting: {len(self._there)} of {pluralise(quorum, 'worker')} there")
        while len(self._there) < quorum:
            time.sleep(_POLL_SECONDS)
            self._look()

    def next(self) -> list[tuple[Task, TaskOutcome | WorkerDied]]:
        """See `Workers`."""
        while not self._done.has_ready():
            self._look()
            time.sleep(_POLL_SECONDS)
        futures = self._done.next_batch(block=False)
        return [(self._tasks.pop(future), self._outcome(future)) for future in futures]

    def _outcome(self, future: Future) -> TaskOutcome | WorkerDied:
        from distributed import KilledWorker

        while True:
            try:
                outcome: TaskOutcome = future.result(timeout=_REFRESH_SECONDS)
            except TimeoutError:  # the worker died before it sent the results: dask repeats the task
                self._look()
            except KilledWorker:
                return WorkerDied()
            except (CancelledError, AsyncCancelledError):
                raise VedetteError("the scheduler is gone, and with it the tasks that were under way") from None
            else:
                return outcome

    def _look(self) -> None:
        """Update the list of workers every few seconds, and report those that joined or left."""
        now = time.monotonic()
        if now - self._looked_at < _REFRESH_SECONDS or self._client.status != "running":
            return
        self._looked_at = now
        try:
            threads: dict[str, int] = self._client.nthreads()
        except OSError:  # the connection is lost: the tasks in progress report it
            return
        self._num_threads = max(1, sum(threads.values()))
        before, self._there = self._there, frozenset(threads)
        if gone := len(before - self._there):
            left = f"{pluralise(len(threads), 'worker')} left" if threads else "waiting: there is no worker"
            self._tell(f"{pluralise(gone, 'worker')} gone, whose work is done again; {left}")
        elif len(threads) != len(before):
            self._tell(f"{pluralise(len(threads), 'worker')}")


def _address_in(file: Path) -> str:
    """Return the address in a scheduler file. Raises `InputError` if there is none within the time limit."""
    problem = "it is not there"
    for _ in range(round(_CONNECT_SECONDS / _POLL_SECONDS)):
        try:
            address = json.loads(file.read_text("utf-8"))["address"]
            if isinstance(address, str):
                return address
            problem = f"its address is {shown(address)}"
        except FileNotFoundError:
            pass
        except (OSError, ValueError, LookupError, TypeError) as error:  # or the file is being written
            problem = error_summary(error)
        time.sleep(_POLL_SECONDS)
    raise InputError(f"scheduler: expected a file that a dask scheduler writes (--scheduler-file); {file}: {problem}")


def _check_scheduler(address: str, refusal: str) -> None:
    """Raise `InputError` unless a dask scheduler answers at the address in time.

    A dask client would wait for ever for a silent server, and print tracebacks for one that answers something else.
    """
    answers: list[object] = []

    async def ask() -> object:
        arguments = Security().get_connection_args("client")
        async with rpc(address, timeout=_CONNECT_SECONDS, connection_args=arguments) as remote:
            return await remote.identity()

    def wait() -> None:
        try:
            answers.append(asyncio.run(asyncio.wait_for(ask(), _CONNECT_SECONDS)))
        except Exception as error:  # an unknown server may cause any error
            answers.append(error)

    from distributed.core import rpc
    from distributed.security import Security

    thread = threading.Thread(target=wait, daemon=True)  # in a thread, as this one may have a running event loop
    thread.start()
    thread.join(2.0 * _CONNECT_SECONDS)
    answer = answers[0] if answers else TimeoutError()
    if isinstance(answer, TimeoutError):
        raise InputError(f"{refusal}: it is silent for {_CONNECT_SECONDS:g} s")
    if isinstance(answer, OSError):
        raise InputError(f"{refusal}: {error_summary(answer)}")
    if not isinstance(answer, dict) or answer.get("type") != "Scheduler":
        raise InputError(f"{refusal}, but something else does")
