"""Sharing independent items of work over threads; kernels run without the interpreter lock."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise


def run_chunks(work: Callable[[int, int], None], num_items: int, num_threads: int) -> None:
    """Call `work(first, last)` so that every item in range(num_items) is covered once.

    Each item writes its own results, so they do not depend on the number of threads. The first exception is raised.
    """
    num_chunks = max(1, min(num_threads, num_items))
    if num_chunks == 1:
        work(0, num_items)
        return
    bounds = [num_items * i // num_chunks for i in range(num_chunks + 1)]
    with ThreadPoolExecutor(num_chunks) as pool:
        for done in [pool.submit(work, first, last) for first, last in pairwise(bounds)]:
            done.result()
