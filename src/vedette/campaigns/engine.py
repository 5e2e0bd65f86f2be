"""Execution of tasks: in this process, or by workers."""

import time
from collections.abc import Iterator
from typing import Protocol

from vedette.campaigns.tasks import FailedRun, Task, TaskOutcome, TaskQueue, WorkerDied, perform
from vedette.errors import VedetteError

_TRIES_ALONE = 2
_MOST_TOGETHER, _SECONDS_TOGETHER = 20, 1.0  # size and duration of a transaction: what a killed process may lose


class Workers(Protocol):
    """Workers that execute tasks. Workers may join, leave or fail at any time."""

    def room(self) -> int:
        """Return how many tasks may be in progress, so that no worker idles while results travel."""

    def submit(self, task: Task) -> None:
        """Hand out a task."""

    def next(self) -> list[tuple[Task, TaskOutcome | WorkerDied]]:
        """Return the tasks that have ended, with their outcomes. Waits for at least one.

        The outcome is `WorkerDied` if two workers in a row died, or may have died, of the task.

        Raises `VedetteError` if no worker is left, or a worker has another version.
        """


def in_process(queue: TaskQueue) -> Iterator[TaskOutcome]:
    """Yield the outcome of every run, executed by this process one after the other.

    Runs of the same second are yielded together.

    Raises `KeyboardInterrupt` after yielding the finished runs.
    """
    batch: TaskOutcome = ()
    since = time.monotonic()
    try:
        while (task := queue.take()) is not None:
            batch += queue.note_outcome(task, perform(task))
            if len(batch) >= _MOST_TOGETHER or time.monotonic() - since > _SECONDS_TOGETHER:
                yield batch
                batch, since = (), time.monotonic()
    except KeyboardInterrupt:
        yield batch
        raise
    if batch:
        yield batch


def on_workers(workers: Workers, queue: TaskQueue) -> Iterator[TaskOutcome]:
    """Yield the outcome of every run in order of completion, with runs that end at the same time in one batch.

    Runs of a worker that died are repeated by another.

    Raises as `Workers.next`.
    """
    suspects: list[Task] = []
    batch: TaskOutcome = ()
    under_way = 0
    while True:
        while under_way < (room := workers.room()) and (task := queue.take(room)) is not None:
            workers.submit(task)
            under_way += 1
        if batch:  # while the next tasks are executed
            yield batch
        if not under_way:
            break
        batch = ()
        for ended, outcome in _next(workers):
            under_way -= 1
            if isinstance(outcome, WorkerDied):
                suspects += ended.alone()
                outcome = ()
            batch += queue.note_outcome(ended, outcome)
    for task in suspects:
        yield queue.note_outcome(task, _alone(workers, task))


def _alone(workers: Workers, task: Task) -> TaskOutcome:
    """Return the outcome of a task of one run while no other task is in progress that could kill its worker.

    A task also counts as suspect if it only waited at a worker that another task killed or starved of memory.
    """
    for _ in range(_TRIES_ALONE):
        workers.submit(task)
        ((_, outcome),) = _next(workers)
        if not isinstance(outcome, WorkerDied):
            return outcome
    return (FailedRun(task.cell.name, task.runs[0], "every worker that took it died (out of memory?)"),)


def _next(workers: Workers) -> list[tuple[Task, TaskOutcome | WorkerDied]]:
    try:
        return workers.next()
    except VedetteError:
        raise
    except Exception as error:
        raise VedetteError(
            f"a worker could not do its work: {type(error).__name__}: {error}; is the same vedette installed there?"
        ) from error
