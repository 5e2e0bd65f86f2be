"""Workers of a dask cluster that runs already."""

from __future__ import annotations

import asyncio
import logging
import math
import re
import threading
import time
from asyncio import CancelledError as AsyncCancelledError
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from typing import TYPE_CHECKING

from vedette.campaigns.tasks import Outcome, Task, WorkerDied, perform
from vedette.errors import InputError, VedetteError
from vedette.reading import said

if TYPE_CHECKING:
    from distributed import Client, Future

_TASKS_A_THREAD = 2  # one that waits, so that none idles while results travel
_CONNECT_SECONDS = 10.0
_REFRESH_SECONDS = 2.0  # between looks at which workers there are
_POLL_SECONDS = 0.02
_ADDRESS = re.compile(r"(tcp|tls)://[^\s/]+:[0-9]+")


@contextmanager
def remote_workers(address: str, tell: Callable[[str], None]) -> Iterator[RemoteWorkers]:
    """The workers of a scheduler that runs already.

    Args:
        address: of the scheduler.
        tell: is told, in words, when there is no worker to do the work.

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
        yield RemoteWorkers(client, tell)


class RemoteWorkers:
    """See `vedette.campaigns.engine.Workers`."""

    def __init__(self, client: Client, tell: Callable[[str], None]) -> None:
        from distributed import as_completed

        self._client = client
        self._tell = tell
        self._looked_at = -math.inf
        self._waiting = False
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

    def next(self) -> tuple[Task, Outcome | WorkerDied]:
        """See `Workers`."""
        while not self._done.has_ready():
            self._look()
            time.sleep(_POLL_SECONDS)
        future = next(self._done)
        return self._tasks.pop(future), self._outcome(future)

    def _outcome(self, future: Future) -> Outcome | WorkerDied:
        from distributed import KilledWorker

        while True:
            try:
                outcome: Outcome = future.result(timeout=_REFRESH_SECONDS)
            except TimeoutError:  # the worker died before it handed the results over: the task is done again
                self._look()
            except KilledWorker:
                return WorkerDied()
            except (CancelledError, AsyncCancelledError):
                raise VedetteError("the scheduler is gone, and with it the tasks that were under way") from None
            else:
                return outcome

    def _look(self) -> None:
        """Count the workers, now and then."""
        now = time.monotonic()
        if now - self._looked_at < _REFRESH_SECONDS or self._client.status != "running":
            return
        self._looked_at = now
        try:
            threads: dict[str, int] = self._client.nthreads()
        except OSError:  # the connection is lost: the tasks under way say so
            return
        self._num_threads = max(1, sum(threads.values()))
        if bool(threads) == self._waiting:
            self._waiting = not threads
            self._tell("waiting: there is no worker" if self._waiting else f"going on: workers: {len(threads)}")


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
