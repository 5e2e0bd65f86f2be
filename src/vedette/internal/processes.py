"""Child processes that share modules loaded once by a server process, ignore Ctrl-C, and end with this process."""

import contextlib
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import resource_tracker
from multiprocessing.context import BaseContext
from pathlib import Path
from typing import Any

# On other platforms, forking a process that has loaded many system libraries is unsafe or impossible.
_METHOD = "forkserver" if sys.platform == "linux" else "spawn"
# Modules that the workers of a campaign need, including Numba.
_LOADED = ("vedette.campaigns.local", "vedette.kernels.base.dispatchers", "scipy.optimize")
_SOURCE = Path(__file__).resolve().parents[2]
# One thread each, as there are as many processes as processors.
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def context() -> BaseContext:
    """Return the start method of child processes.

    Use `as_children` around every start, and call `end_with_parent` first in each process.
    """
    return multiprocessing.get_context(_METHOD)


def load_ahead(*more: str) -> None:
    """Start the server process from which children are forked. It loads their modules while this process continues.

    Args:
        more: modules to load in addition to those that the workers of a campaign need.

    If the platform has no fork server, or this program already has one, each child loads its own modules.
    """
    if _METHOD == "forkserver":
        from multiprocessing import forkserver

        context().set_forkserver_preload([*_LOADED, *more])
        before = os.environ.get("PYTHONPATH")
        if _SOURCE.name == "src":  # the path may have been relative to another working directory
            os.environ["PYTHONPATH"] = os.pathsep.join([str(_SOURCE), *([before] if before else [])])
        try:
            with as_children():
                forkserver.ensure_running()
        finally:
            os.environ.pop("PYTHONPATH", None)
            if before is not None:
                os.environ["PYTHONPATH"] = before


@contextmanager
def as_children(*, of_server: bool = False) -> Iterator[None]:
    """Context manager: processes started inside ignore Ctrl-C, and their linear algebra uses one thread.

    The main process stops them. Ctrl-C inside is deferred to the end.

    Args:
        of_server: the processes belong to `context` and start after `load_ahead`. If there is a fork server, it already
            ignores Ctrl-C.
    """
    ours = {name: "1" for name in _THREADS if name not in os.environ}
    before = signal.getsignal(signal.SIGINT)
    defers = threading.current_thread() is threading.main_thread() and callable(before)
    came: list[tuple[Any, ...]] = []
    if defers:
        signal.signal(signal.SIGINT, lambda *of: came.append(of))
    os.environ.update(ours)
    try:
        with contextlib.nullcontext() if of_server and _METHOD == "forkserver" else _interrupts_blocked():
            yield
    finally:
        for name in ours:
            os.environ.pop(name, None)
        if defers:
            signal.signal(signal.SIGINT, before)
        if came and callable(before):
            before(*came[-1])


@contextmanager
def _interrupts_blocked() -> Iterator[None]:
    """Block Ctrl-C in this thread: new processes inherit this, while this one receives the signal afterwards."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    resource_tracker.ensure_running()  # its start, which would be inside, unblocks Ctrl-C
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def let_go_of_results(pool: ProcessPoolExecutor) -> None:
    """Close this process's write end of the result pipe of a pool whose processes have started. They have their own.

    While it is open, a reader waits for ever for the rest of a message from a killed process.
    """
    pool._result_queue._writer.close()  # type: ignore[attr-defined]


def end_with_parent() -> None:
    """Make this process end when its parent has ended, for whatever reason."""
    threading.Thread(target=_wait_and_end, daemon=True).start()


def _wait_and_end() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
