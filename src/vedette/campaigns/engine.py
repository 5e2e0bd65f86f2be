"""How the work is done: by this process, or by workers to which it hands out the tasks."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Protocol

from vedette.campaigns.tasks import FailedRun, Task, TaskOutcome, TaskQueue, WorkerDied, perform
from vedette.errors import VedetteError

_TRIES_ALONE = 2
_MOST_TOGETHER, _SECONDS_TOGETHER = 20, 1.0  # that a transaction is of: what a kill may lose of one process


class Workers(Protocol):
    """Who does tasks that are handed out. They may come and go, and die."""

    def room(self) -> int:
        """How many tasks may be under way, so that no worker idles while results travel."""
        ...

    def submit(self, task: Task) -> None:
        """Hand out a task."""
        ...

    def next(self) -> list[tuple[Task, TaskOutcome | WorkerDied]]:
        """The tasks that have ended by now with what they gave back, once there is one.

        `WorkerDied` where a worker died of it, and so did the next that it was given to; or may have died of it.

        Raises `VedetteError` where nobody is left to do the work, or a worker cannot do that of this version.
        """
        ...


def in_process(queue: TaskQueue) -> Iterator[TaskOutcome]:
    """Every run, one after the other, by this process; those of a second come together.

    Raises `KeyboardInterrupt`, once those that are finished have been given back.
    """
    batch: TaskOutcome = ()
    since = time.monotonic()
    try:
        while (task := queue.take()) is not None:
            batch += queue.learn(task, perform(task))
            if len(batch) >= _MOST_TOGETHER or time.monotonic() - since > _SECONDS_TOGETHER:
                yield batch
                batch, since = (), time.monotonic()
    except KeyboardInterrupt:
        yield batch
        raise
    if batch:
        yield batch


def on_workers(workers: Workers, queue: TaskQueue) -> Iterator[TaskOutcome]:
    """Every run, in the order of finishing; those that have finished by the same time come together.

    The runs of a worker that died are done again by another.

    Raises as `Workers.next`.
    """
    suspects: list[Task] = []
    batch: TaskOutcome = ()
    under_way = 0
    while True:
        while under_way < (room := workers.room()) and (task := queue.take(room)) is not None:
            workers.submit(task)
            under_way += 1
        if batch:  # while the next are being done
            yield batch
        if not under_way:
            break
        batch = ()
        for ended, outcome in _next(workers):
            under_way -= 1
            if isinstance(outcome, WorkerDied):
                suspects += ended.alone()
                outcome = ()
            batch += queue.learn(ended, outcome)
    for task in suspects:
        yield queue.learn(task, _alone(workers, task))


def _alone(workers: Workers, task: Task) -> TaskOutcome:
    """What a task of one run gives back when no other one can bring its worker down.

    A task counts as suspect too when it only waited at a worker that another one killed, or another took its memory.
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
