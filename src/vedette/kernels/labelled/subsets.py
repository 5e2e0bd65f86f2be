"""Choices of one cost from each of several lists in order of their sum, by best-first search."""

import math

import numpy as np

from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.gaussian.mixtures import descending_order


@kernel
def _sift_up(heap: Ints, sums: Floats, size: int) -> None:
    """Restore the heap (smallest sum first, then the smallest node) after an entry was added at its end."""
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
    """Restore the heap after an entry was replaced at its top."""
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
def smallest_sums(costs: Floats, offsets: Ints, max_sums: int) -> tuple[Ints, Ints, Ints, Ints, bool]:
    """Return the `max_sums` smallest sums of one cost from each of several lists, the smallest first.

    costs, offsets: list `i` is `costs[offsets[i]:offsets[i + 1]]`, from 0 up. An infinite cost is never taken. Returns
    chains of nodes: choice `k` takes place `places[node]` of list `lists[node]` for node = order[k], previous[node],
    previous[previous[node]], ... down to node 0, and the first of every other list, and True if all choices of finite
    costs are listed.
    """
    num_lists = len(offsets) - 1
    dearer, sizes, total = np.empty(num_lists), np.empty(num_lists, np.int64), 1
    for i in range(num_lists):
        size = 1
        while size < offsets[i + 1] - offsets[i] and costs[offsets[i] + size] < math.inf:
            size += 1
        sizes[i] = size
        dearer[i] = costs[offsets[i] + 1] if size > 1 else math.inf
        # Larger products are never listed.
        total = min(total * min(size, 1 << 31), 1 << 31)
    by_cost = descending_order(-dearer)
    num = 0
    while num < num_lists and dearer[by_cost[num]] < math.inf:
        num += 1
    limit = min(max(max_sums, 1), total)
    room = 3 * limit + 2
    lists, places = np.zeros(room, np.int64), np.zeros(room, np.int64)
    previous, ranks = np.zeros(room, np.int64), np.zeros(room, np.int64)
    sums, heap, order = np.zeros(room), np.empty(2 * limit + 2, np.int64), np.empty(limit, np.int64)
    order[0] = 0
    listed, nodes, size = 1, 1, 0
    if num > 0 and limit > 1:
        lists[1], places[1], sums[1], heap[0] = by_cost[0], 1, dearer[by_cost[0]], 1
        nodes, size = 2, 1
    while listed < limit:
        node = heap[0]
        order[listed] = node
        listed += 1
        size -= 1
        heap[0] = heap[size]
        _sift_down(heap, sums, size)
        # Each other choice is reached once: by a step in the next costlier list in addition to that in the last one so
        # far, or in its place if that is its first; or by one more step in the last one.
        for way in range(3):
            rank = ranks[node] + (1 if way < 2 else 0)
            if rank == num or (way == 1 and places[node] > 1):
                continue
            base = node if way == 0 else previous[node]
            place = places[node] + 1 if way == 2 else 1
            if place >= sizes[by_cost[rank]]:
                continue
            lists[nodes], places[nodes], previous[nodes], ranks[nodes] = by_cost[rank], place, base, rank
            sums[nodes] = sums[base] + costs[offsets[by_cost[rank]] + place]
            heap[size] = nodes
            nodes += 1
            size += 1
            _sift_up(heap, sums, size)
    return lists, places, previous, order, listed == total < 1 << 31
