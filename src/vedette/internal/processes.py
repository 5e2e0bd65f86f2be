"""Processes beside this one: they share what one process has loaded, leave Ctrl-C to this one, and end with it."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing.context import BaseContext
from pathlib import Path
from typing import Any

# Elsewhere a fork of a process that has loaded half of the system's libraries is not safe, or there is none.
_METHOD = "forkserver" if sys.platform == "linux" else "spawn"
# What the workers of a campaign need, with Numba.
_LOADED = ("vedette.campaigns.local", "vedette.kernels.base.dispatchers", "scipy.optimize")
_SOURCE = Path(__file__).resolve().parents[2]
# One thread in each: as many processes as processors share the work already.
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def context() -> BaseContext:
    """How processes are started; with `as_children` around every start, and `end_with_parent` first of all in each."""
    return multiprocessing.get_context(_METHOD)


def load_ahead(*more: str) -> None:
    """Begin to load what processes of `context` need, while this one goes on, in one that they will be forks of.

    Args:
        more: modules beside those of the workers of a campaign.

    Where the platform has no such process, or this program has one already, each loads what it needs itself.
    """
    if _METHOD == "forkserver":
        from multiprocessing import forkserver

        context().set_forkserver_preload([*_LOADED, *more])
        before = os.environ.get("PYTHONPATH")
        if _SOURCE.name == "src":  # found by a path that may have been relative to where this process was
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
    """Processes started inside inherit that Ctrl-C is not for them, and that linear algebra has one thread.

    The main process stops them.

    Args:
        of_server: they are of `context`, after `load_ahead`. Where that has a process of which they are forks, that one
            is deaf to Ctrl-C already; it may take a second to load, and Ctrl-C waits for it instead of being lost.
    """
    ours = {name: "1" for name in _THREADS if name not in os.environ}
    in_main = threading.current_thread() is threading.main_thread()
    before = signal.getsignal(signal.SIGINT)
    came: list[tuple[Any, ...]] = []
    waits = of_server and _METHOD == "forkserver" and callable(before)
    if in_main:
        signal.signal(signal.SIGINT, (lambda *of: came.append(of)) if waits else signal.SIG_IGN)
    os.environ.update(ours)
    try:
        yield
    finally:
        for name in ours:
            os.environ.pop(name, None)
        if in_main:
            signal.signal(signal.SIGINT, before)
        if came and callable(before):
            before(*came[-1])


def let_go_of_results(pool: ProcessPoolExecutor) -> None:
    """Close this process's end of what the processes of a pool write to; they have started, and have their own.

    While it is open, half a message of one that was killed is waited for for ever.
    """
    pool._result_queue._writer.close()  # type: ignore[attr-defined]


def end_with_parent() -> None:
    """Have this process end when the one that started it has ended, however that came about."""
    threading.Thread(target=_wait_and_end, daemon=True).start()


def _wait_and_end() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
