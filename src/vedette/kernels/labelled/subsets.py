"""Subsets of a few non-negative costs in order of their sum, by best-first search."""

from __future__ import annotations

import math

import numpy as np

from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.gaussian.mixtures import descending_order


@kernel
def _sift_up(heap: Ints, sums: Floats, size: int) -> None:
    """Restore the heap (smallest sum first, then the smallest node) after an entry was put at its end."""
    place = size - 1
    while place > 0:
        above = (place - 1) // 2
        a, b = heap[above], heap[place]
        if sums[a] < sums[b] or (sums[a] == sums[b] and a < b):
            return
        heap[above], heap[place] = b, a
        place = above


@kernel
def _sift_down(heap: Ints, sums: Floats, size: int) -> None:
    """Restore the heap after an entry was put at its top."""
    place = 0
    while 2 * place + 1 < size:
        below = 2 * place + 1
        if below + 1 < size:
            a, b = heap[below], heap[below + 1]
            if sums[b] < sums[a] or (sums[b] == sums[a] and b < a):
                below += 1
        a, b = heap[place], heap[below]
        if sums[a] < sums[b] or (sums[a] == sums[b] and a < b):
            return
        heap[place], heap[below] = b, a
        place = below


@kernel
def smallest_sums(costs: Floats, max_subsets: int) -> tuple[Ints, Ints, Ints, bool]:
    """The `max_subsets` subsets of smallest sum of costs, the smallest (the empty one) first.

    costs: (num,) non-negative; items of infinite cost are in no subset. Returns chains of nodes: subset `k` has the
    items `items[node]` for node = order[k], previous[node], previous[previous[node]], ... down to node 0, which is the
    empty subset; and whether all subsets of the items of finite cost are listed.
    """
    by_cost = descending_order(-costs)
    num = 0
    while num < len(costs) and costs[by_cost[num]] < math.inf:
        num += 1
    limit = max(max_subsets, 1)
    if num < 62:
        limit = min(limit, 1 << num)
    room = 2 * limit + 2
    items, previous, ranks = np.zeros(room, np.int64), np.zeros(room, np.int64), np.zeros(room, np.int64)
    sums, heap, order = np.zeros(room), np.empty(limit + 2, np.int64), np.empty(limit, np.int64)
    order[0] = 0
    listed, nodes, size = 1, 1, 0
    if num > 0 and limit > 1:
        items[1], sums[1], heap[0] = by_cost[0], costs[by_cost[0]], 1
        nodes, size = 2, 1
    while listed < limit:
        node = heap[0]
        order[listed] = node
        listed += 1
        size -= 1
        heap[0] = heap[size]
        _sift_down(heap, sums, size)
        rank = ranks[node] + 1
        if rank == num:
            continue
        # Each other subset is reached once: by adding the next dearer item, or by exchanging the dearest for it.
        for before in (node, previous[node]):
            items[nodes], previous[nodes], ranks[nodes] = by_cost[rank], before, rank
            sums[nodes] = sums[before] + costs[by_cost[rank]]
            heap[size] = nodes
            nodes += 1
            size += 1
            _sift_up(heap, sums, size)
    return items, previous, order, num < 62 and listed == 1 << num


__all__ = ["smallest_sums"]
