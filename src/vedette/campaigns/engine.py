"""How the work is done: by this process, or by workers to which dask.distributed hands out the tasks."""

from __future__ import annotations

import math
import time
from asyncio import CancelledError as AsyncCancelledError
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from typing import TYPE_CHECKING, Any

from vedette.campaigns.tasks import Failed, Landed, Task, TaskQueue, perform
from vedette.errors import VedetteError

if TYPE_CHECKING:
    from distributed import Client, Future

# Tasks that wait at a worker, so that none idles while results travel.
_TASKS_A_THREAD = 2
_REFRESH_SECONDS = 2.0  # between looks at which workers there are
_POLL_SECONDS = 0.02
_SETTLE_SECONDS = 60.0
_TRIES_ALONE = 2


def in_process(queue: TaskQueue) -> Iterator[Landed | Failed]:
    """Every run, one after the other, by this process."""
    while (task := queue.take()) is not None:
        yield from _learnt(queue, perform(task))


def on_workers(
    client: Client, queue: TaskQueue, tell: Callable[[str], None], first: Iterable[Task] = ()
) -> Iterator[Landed | Failed]:
    """Every run, in the order of finishing. The runs of a worker that died are done again by another.

    Args:
        client: of the scheduler.
        queue: what is to be done.
        tell: is told, in words, when there is no worker to do the work.
        first: tasks to be done before any other, as the kernels that they compile serve the rest.

    Raises:
        VedetteError: the scheduler is gone, or a worker cannot do the work of this version.
    """
    flow = _Flow(client, queue, _Workers(client, tell))
    suspects: list[Task] = []
    for task in first:
        flow.submit(task)
    yield from _finished(flow, queue, suspects, more=False)
    yield from _finished(flow, queue, suspects, more=True)
    for task in suspects:
        outcome = flow.alone(task)
        if _is_fatal(outcome):
            yield Failed(task.cell.name, task.runs[0], "every worker that took it died (out of memory?)")
        else:
            yield from _learnt(queue, _results_of(outcome))


def _finished(flow: _Flow, queue: TaskQueue, suspects: list[Task], *, more: bool) -> Iterator[Landed | Failed]:
    """The runs of the tasks under way, and of more from the queue if that is wanted."""
    while (done := flow.next(more=more)) is not None:
        task, outcome = done
        if _is_fatal(outcome):
            suspects += task.alone()
        else:
            yield from _learnt(queue, _results_of(outcome))


def _is_fatal(outcome: Any) -> bool:
    """Whether a task ended because the workers that had it died."""
    from distributed import KilledWorker

    return isinstance(outcome, KilledWorker)


def _results_of(outcome: Any) -> tuple[Landed | Failed, ...]:
    """What a task gave back; errors that end the campaign are raised."""
    if isinstance(outcome, CancelledError | AsyncCancelledError):
        raise VedetteError("the scheduler is gone, and with it the tasks that were under way")
    if isinstance(outcome, VedetteError):
        raise outcome
    if isinstance(outcome, Exception):
        raise VedetteError(
            f"a worker could not do its work: {type(outcome).__name__}: {outcome}; is the same vedette installed there?"
        )
    results: tuple[Landed | Failed, ...] = outcome
    return results


class _Workers:
    """The workers that there are: they may come and go."""

    def __init__(self, client: Client, tell: Callable[[str], None]) -> None:
        self._client = client
        self._tell = tell
        self._looked_at = -math.inf
        self._waiting = False
        self.num_threads = 1

    def look(self) -> None:
        """Count them, now and then; replace those of this machine that were given up."""
        now = time.monotonic()
        if now - self._looked_at < _REFRESH_SECONDS or self._client.status != "running":
            return
        self._looked_at = now
        try:
            threads: dict[str, int] = self._client.nthreads()
        except OSError:  # the connection is lost: the tasks under way say so
            return
        self.num_threads = max(1, sum(threads.values()))
        local = self._client.cluster
        if local is not None and len(threads) < len(local.worker_spec):
            # A worker that dies while it starts is not replaced by its nanny.
            local.scale(len(local.worker_spec))
        if bool(threads) == self._waiting:
            self._waiting = not threads
            self._tell("waiting: there is no worker" if self._waiting else f"going on: workers: {len(threads)}")

    def settle(self) -> None:
        """Wait until the workers that died on this machine are replaced, but not for ever."""
        local, begin = self._client.cluster, time.monotonic()
        while local is not None and time.monotonic() - begin < _SETTLE_SECONDS:
            if len(self._client.nthreads()) >= len(local.worker_spec):
                return
            self.look()
            time.sleep(_POLL_SECONDS)


class _Flow:
    """Tasks under way: never more than keep the workers busy."""

    def __init__(self, client: Client, queue: TaskQueue, workers: _Workers) -> None:
        from distributed import as_completed

        self._client = client
        self._queue = queue
        self._workers = workers
        self._tasks: dict[Future, Task] = {}
        self._done = as_completed(loop=client.loop)

    def submit(self, task: Task) -> None:
        """Hand out a task."""
        future = self._client.submit(perform, task, pure=False)
        self._tasks[future] = task
        self._done.add(future)

    def next(self, *, more: bool) -> tuple[Task, Any] | None:
        """A task that has ended with what it gave back, or the exception that it ended by; None when all have ended.

        more: whether to hand out tasks of the queue.
        """
        self._workers.look()
        room = _TASKS_A_THREAD * self._workers.num_threads if more else 0
        while len(self._tasks) < room and (task := self._queue.take()) is not None:
            self.submit(task)
        if not self._tasks:
            return None
        while not self._done.has_ready():
            self._workers.look()
            time.sleep(_POLL_SECONDS)
        future = next(self._done)
        return self._tasks.pop(future), self._outcome(future)

    def alone(self, task: Task) -> Any:
        """What a task gives back, or the exception that it ends by, when no other one can bring its worker down.

        A task counts as suspect too when it only waited at a worker that another one killed.
        """
        outcome: Any = None
        for _ in range(_TRIES_ALONE):
            self._workers.settle()
            self.submit(task)
            done = self.next(more=False)
            assert done is not None
            outcome = done[1]
            if not _is_fatal(outcome):
                break
        return outcome

    def _outcome(self, future: Future) -> Any:
        while True:
            try:
                return future.result(timeout=_REFRESH_SECONDS)
            except TimeoutError:  # the worker died before it handed the results over: the task is done again
                self._workers.look()
            except (Exception, AsyncCancelledError) as error:
                return error


def _learnt(queue: TaskQueue, results: tuple[Landed | Failed, ...]) -> Iterator[Landed | Failed]:
    for result in results:
        if isinstance(result, Landed):
            queue.learn(result)
        yield result
