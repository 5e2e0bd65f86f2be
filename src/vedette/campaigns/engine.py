"""Who does the work: this process, workers on this machine, or a cluster; dask.distributed hands out the tasks."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from vedette.campaigns.tasks import Failed, Landed, Task, TaskQueue, perform
from vedette.errors import InputError, VedetteError
from vedette.evaluation.runs import children_ignore_interrupts

if TYPE_CHECKING:
    from distributed import Client, Future

# Tasks that wait at a worker, so that none idles while results travel.
_TASKS_A_THREAD = 2
_CONNECT_SECONDS = 10.0
_REFRESH_SECONDS = 2.0


def in_process(queue: TaskQueue) -> Iterator[Landed | Failed]:
    """Every run, one after the other, by this process."""
    while (task := queue.take()) is not None:
        yield from _learnt(queue, perform(task))


@contextmanager
def local_workers(num_workers: int) -> Iterator[Client]:
    """As many worker processes on this machine; one that dies is replaced."""
    from distributed import Client, LocalCluster

    with TemporaryDirectory(prefix="vedette-workers-", ignore_cleanup_errors=True) as scratch:
        with children_ignore_interrupts():
            cluster = LocalCluster(
                n_workers=num_workers,
                threads_per_worker=1,
                processes=True,
                host="127.0.0.1",
                dashboard_address=None,
                memory_limit=None,
                local_directory=scratch,
                silence_logs=logging.CRITICAL,
                preload=["vedette.campaigns.worker"],
            )
        with cluster, Client(cluster, set_as_default=False) as client:
            yield client


@contextmanager
def remote_workers(address: str) -> Iterator[Client]:
    """The workers of a scheduler that runs already.

    Raises:
        InputError: nothing answers at the address.
    """
    from distributed import Client

    for logger in ("distributed", "distributed.client"):  # a lost scheduler is said once, by the error
        logging.getLogger(logger).setLevel(logging.CRITICAL)
    try:
        client = Client(address, set_as_default=False, timeout=_CONNECT_SECONDS)
    except (OSError, ValueError) as error:
        raise InputError(
            f"scheduler: expected the address of a running dask scheduler, such as tcp://host:8786; got {address}: "
            f"{error}"
        ) from None
    with client:
        yield client


def on_workers(client: Client, queue: TaskQueue) -> Iterator[Landed | Failed]:
    """Every run, in the order of finishing. The runs of a worker that died are done again by another.

    Raises:
        VedetteError: the scheduler is gone, or a worker cannot do the work of this version.
    """
    flow = _Flow(client, queue)
    while (done := flow.next()) is not None:
        future, task = done
        if future.status == "finished":
            yield from _learnt(queue, future.result())
        elif future.status == "error":
            yield from _failed(flow, task, future.exception())
        else:
            raise VedetteError("the scheduler is gone, and with it the tasks that were under way")


class _Flow:
    """Tasks under way: never more than keep the workers busy."""

    def __init__(self, client: Client, queue: TaskQueue) -> None:
        from distributed import as_completed

        self._client = client
        self._queue = queue
        self._tasks: dict[Future, Task] = {}
        self._done = as_completed(loop=client.loop)
        self._room, self._room_known = _TASKS_A_THREAD, -_REFRESH_SECONDS

    def submit(self, task: Task) -> None:
        future = self._client.submit(perform, task, pure=False)
        self._tasks[future] = task
        self._done.add(future)

    def next(self) -> tuple[Future, Task] | None:
        """A task that has ended; None when all have."""
        while len(self._tasks) < self._capacity() and (task := self._queue.take()) is not None:
            self.submit(task)
        if not self._tasks:
            return None
        future = next(self._done)
        return future, self._tasks.pop(future)

    def _capacity(self) -> int:
        """Workers may come and go."""
        now = time.monotonic()
        if now - self._room_known > _REFRESH_SECONDS and self._client.status == "running":
            threads: dict[str, int] = self._client.nthreads()
            self._room, self._room_known = _TASKS_A_THREAD * max(1, sum(threads.values())), now
        return self._room


def _failed(flow: _Flow, task: Task, error: Any) -> Iterator[Failed]:
    """What becomes of a task that no worker could do: its runs one by one, and then nothing."""
    from distributed import KilledWorker

    if isinstance(error, VedetteError):
        raise error
    if not isinstance(error, KilledWorker):
        raise VedetteError(
            f"a worker could not do its work: {type(error).__name__}: {error}; is the same vedette installed there?"
        ) from None
    if len(task.runs) > 1:
        for single in task.alone():
            flow.submit(single)
        return
    yield Failed(task.cell.name, task.runs[0], "every worker that took it died (out of memory?)")


def _learnt(queue: TaskQueue, results: tuple[Landed | Failed, ...]) -> Iterator[Landed | Failed]:
    for result in results:
        if isinstance(result, Landed):
            queue.learn(result)
        yield result
