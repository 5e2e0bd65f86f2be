"""Sharing independent items of work over threads, in pieces; kernels run without the interpreter lock."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from threading import Lock

# s. An interruption (Ctrl-C) is answered between two pieces, and between two waits.
_PIECE_TIME = 0.1
# Naming the types of its bundles costs a call of a kernel up to half a millisecond: few pieces, the first of one item.
_GROWTH = 8
_WAIT_TIME = 0.2


def processors() -> int:
    """Processors that this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1


def run_chunks(work: Callable[[int, int], None], num_items: int, num_threads: int, *, first_piece: int = 1) -> None:
    """Call `work(first, last)`, piece after piece, so that every item in range(num_items) is covered once.

    Each item writes its own results, so they depend neither on the pieces nor on the number of threads. Of several
    exceptions that of the first item is raised. An interruption is raised when the pieces that have begun are done:
    each takes about a tenth of a second, or as long as its one item. first_piece: items of the first piece of a thread,
    more than one where they are known to be quick.
    """
    num_workers = max(1, min(num_threads, num_items))
    if num_workers == 1 and 0 < num_items <= first_piece:
        work(0, num_items)
        return
    pieces = _Pieces(work, num_items, num_workers, first_piece)
    if num_workers == 1:
        pieces.run()
    else:
        with ThreadPoolExecutor(num_workers - 1) as pool:  # this thread works, too: to start one takes a millisecond
            running = set[Future[None]]()
            try:
                while len(running) < num_workers - 1:
                    running.add(pool.submit(pieces.run))
                pieces.run()
                while running:  # without an end, a wait could not be interrupted everywhere
                    finished, running = wait(running, timeout=_WAIT_TIME)
                    for one in finished:
                        one.result()
            finally:
                pieces.stop()
    if pieces.faults:
        raise min(pieces.faults, key=lambda fault: fault[0])[1]


@dataclass(slots=True)
class _Pieces:
    """The items that are left, handed out in order; so all before one that fails have begun, and are finished."""

    work: Callable[[int, int], None]
    num_items: int
    num_workers: int
    first_piece: int
    next_item: int = 0
    faults: list[tuple[int, Exception]] = field(default_factory=list)
    lock: Lock = field(default_factory=Lock)

    def run(self) -> None:
        """Work on pieces until none is left."""
        most = self.first_piece
        while (piece := self._take(most))[0] < piece[1]:
            first, last = piece
            began = time.perf_counter()
            try:
                self.work(first, last)
            except Exception as fault:
                self.faults.append((first, fault))
                self.stop()
            rate = (last - first) / max(time.perf_counter() - began, 1e-9)
            most = max(1, min(_GROWTH * most, int(rate * _PIECE_TIME)))

    def stop(self) -> None:
        """Hand out no more."""
        with self.lock:
            self.num_items = self.next_item

    def _take(self, most: int) -> tuple[int, int]:
        with self.lock:
            first = self.next_item
            fair = -(-(self.num_items - first) // self.num_workers)
            self.next_item = first + min(most, fair)
            return first, self.next_item
