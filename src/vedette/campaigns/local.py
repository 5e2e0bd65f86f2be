"""Workers on this machine: processes of the standard library's pools."""

import os
import signal
import time
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing import active_children
from multiprocessing.process import BaseProcess

from vedette.campaigns.tasks import Task, TaskOutcome, WorkerDied, perform
from vedette.errors import VedetteError
from vedette.internal.processes import as_children, context, end_with_parent, let_go_of_results, load_ahead
from vedette.internal.reading import error_summary

_TASKS_A_WORKER = 2  # one waits, so that no worker idles while results travel
_WAIT_SECONDS = 0.2  # a wait without timeout cannot be interrupted on all platforms
_START_SECONDS = 120.0
_MOST_FAILED_STARTS = 3  # consecutive failures
_FILES, _FILES_A_WORKER = 40, 10  # open files, with a margin: measured 16 with one worker, 72 with eight


@contextmanager
def local_workers(num_workers: int, tell: Callable[[str], None]) -> "Iterator[LocalWorkers]":
    """Context manager with `num_workers` worker processes on this machine. One that dies is replaced.

    tell: receives messages about workers that died.

    Raises:
        VedetteError: the processes cannot be started.
    """
    _raise_file_limit(num_workers)
    workers = LocalWorkers(tell)
    try:
        workers.start(num_workers)
        yield workers
    finally:
        workers.end()


def _raise_file_limit(num_workers: int) -> None:
    """Raise this process's limit of open files if it is too low, as far as the operating system allows.

    Raises `VedetteError` if that is not enough.
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


@dataclass(slots=True, eq=False)
class _Worker:
    """A process in a pool of its own, so that its death does not affect the others."""

    pool: ProcessPoolExecutor
    begun: Future[int]
    processes: set[BaseProcess]  # one process, or none if it has died already
    tasks: dict[Future[TaskOutcome], Task] = field(default_factory=dict)  # in order of execution

    @classmethod
    def start(cls) -> "_Worker":
        pool = ProcessPoolExecutor(1, context(), initializer=_initialise_worker)
        others = set(active_children())
        try:
            load_ahead()
            with as_children(of_server=True):
                begun = pool.submit(os.getpid)
        except OSError as error:
            raise VedetteError(
                f"workers: expected that another process can be started; "
                f"{error_summary(error)} (--workers 1 needs none)"
            ) from error
        let_go_of_results(pool)
        return cls(pool, begun, set(active_children()) - others)

    def has_begun(self) -> bool:
        return self.begun.done() and self.begun.exception() is None

    def death_reason(self) -> str:
        """Return in words how the process died."""
        status = next((process.exitcode for process in self.processes), None)
        if status is None or status >= 0:
            return f"exit status {status}"
        return f"signal {-status}{', out of memory?' if status == -signal.SIGKILL else ''}"

    def end(self) -> None:
        for process in self.processes:
            process.kill()
        self.pool.shutdown(cancel_futures=True)


class LocalWorkers:
    """Worker processes on this machine, see `vedette.campaigns.engine.Workers`."""

    def __init__(self, tell: Callable[[str], None]) -> None:
        self._tell = tell
        self._since = time.monotonic()
        self._failed_starts = 0
        self._killers: set[Task] = set()
        self._ended: list[tuple[Task, TaskOutcome | WorkerDied]] = []
        self._workers: list[_Worker] = []

    def start(self, num_workers: int) -> None:
        """Start this number of processes. Raises `VedetteError` if the operating system refuses."""
        for _ in range(num_workers):
            self._workers.append(_Worker.start())

    def room(self) -> int:
        """See `Workers`."""
        return _TASKS_A_WORKER * len(self._workers)

    def submit(self, task: Task) -> None:
        """See `Workers`."""
        while True:
            worker = min(self._workers, key=lambda each: len(each.tasks))
            try:
                worker.tasks[worker.pool.submit(perform, task)] = task
                return
            except BrokenProcessPool:
                self._replace(worker)

    def next(self) -> list[tuple[Task, TaskOutcome | WorkerDied]]:
        """See `Workers`."""
        while not self._ended:
            wait([each for worker in self._workers for each in worker.tasks], _WAIT_SECONDS, FIRST_COMPLETED)
            for worker in list(self._workers):
                self._collect(worker)
                if any(each.done() for each in worker.tasks):
                    self._replace(worker)
            if time.monotonic() - self._since > _START_SECONDS and not any(map(_Worker.has_begun, self._workers)):
                raise _not_started()
        ended, self._ended = self._ended, []
        return ended

    def end(self) -> None:
        """Kill the processes, whatever they are doing."""
        for worker in self._workers:
            worker.end()

    def _collect(self, worker: _Worker) -> None:
        """Collect the results of a worker. If it died, its unfinished tasks are left."""
        for future in [each for each in worker.tasks if each.done()]:
            error = future.exception()
            if error is None:
                self._failed_starts = 0
                self._ended.append((worker.tasks.pop(future), future.result()))
            elif not isinstance(error, BrokenProcessPool):
                raise error

    def _replace(self, dead: _Worker) -> None:
        """Replace a worker that died by another, which gets its unfinished tasks."""
        dead.end()
        self._collect(dead)
        left = list(dead.tasks.values())
        if dead.has_begun():
            self._failed_starts = 0
            if left and left[0] in self._killers:
                self._killers.remove(left[0])
                self._ended.append((left.pop(0), WorkerDied()))
            else:
                self._killers.update(left[:1])
            self._tell(f"a worker has died ({dead.death_reason()}): another takes its place, and what it had not done")
        else:
            self._failed_starts += 1
            if self._failed_starts >= _MOST_FAILED_STARTS:
                raise _not_started()
        self._workers[self._workers.index(dead)] = _Worker.start()
        self._since = time.monotonic()
        for task in left:
            self.submit(task)


def _initialise_worker() -> None:
    """Initialise a worker process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the fork server may not ignore it
    end_with_parent()


def _not_started() -> VedetteError:
    return VedetteError(
        "the worker processes ended while they started; in a script of your own, put the call that runs the "
        'campaign under `if __name__ == "__main__":`'
    )
