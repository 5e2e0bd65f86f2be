"""Distribution of independent items over threads, in pieces. Kernels run without the interpreter lock."""

import os
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from threading import Lock

# s. Interruptions (Ctrl-C) are handled between two pieces, and between two waits.
_PIECE_TIME = 0.1
# Resolving the types of its bundles costs a kernel call up to 0.5 ms, so pieces are few and the first has one item.
_GROWTH = 8
_WAIT_TIME = 0.2


def processors() -> int:
    """Return the number of processors that this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1


def run_chunks(work: Callable[[int, int], None], num_items: int, num_threads: int, *, first_piece: int = 1) -> None:
    """Call `work(first, last)` for consecutive pieces so that every item in range(num_items) is covered once.

    Each item writes its own results, so results depend neither on the pieces nor on the number of threads. If several
    items raise, the exception of the first item is raised. An interruption is raised when the running pieces are
    finished. A piece takes about a tenth of a second, or as long as one item. first_piece: number of items in the first
    piece of a thread, more than one if items are known to be quick.
    """
    num_workers = max(1, min(num_threads, num_items))
    if num_workers == 1 and 0 < num_items <= first_piece:
        work(0, num_items)
        return
    pieces = _Pieces(work, num_items, num_workers, first_piece)
    if num_workers == 1:
        pieces.run()
    else:
        with ThreadPoolExecutor(num_workers - 1) as pool:  # this thread works too, as starting a thread takes 1 ms
            running = set[Future[None]]()
            try:
                while len(running) < num_workers - 1:
                    running.add(pool.submit(pieces.run))
                pieces.run()
                while running:  # a wait without timeout cannot be interrupted on all platforms
                    finished, running = wait(running, timeout=_WAIT_TIME)
                    for one in finished:
                        one.result()
            finally:
                pieces.stop()
    if pieces.faults:
        raise min(pieces.faults, key=lambda fault: fault[0])[1]


@dataclass(slots=True)
class _Pieces:
    """Queue of the remaining items, handed out in order.

    All items before one that fails have therefore started, and are finished.
    """

    work: Callable[[int, int], None]
    num_items: int
    num_workers: int
    first_piece: int
    next_item: int = 0
    faults: list[tuple[int, Exception]] = field(default_factory=list)
    lock: Lock = field(default_factory=Lock)

    def run(self) -> None:
        """Process pieces until none is left."""
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
        """Stop handing out pieces."""
        with self.lock:
            self.num_items = self.next_item

    def _take(self, most: int) -> tuple[int, int]:
        with self.lock:
            first = self.next_item
            fair = -(-(self.num_items - first) // self.num_workers)
            self.next_item = first + min(most, fair)
            return first, self.next_item
