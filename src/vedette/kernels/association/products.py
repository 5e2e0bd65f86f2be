"""Products of the hypotheses of several independent factors, heaviest first."""

import numpy as np

from vedette.kernels.association.children import Parents
from vedette.kernels.base.arrays import grown_floats, grown_ints
from vedette.kernels.base.compile import borrowing, kernel
from vedette.kernels.base.types import Ints
from vedette.kernels.gaussian.mixtures import descending_order


@borrowing
def _merge_rows(rows: Ints, first: int, middle: int, last: int) -> None:
    """Merge two adjacent runs of increasing rows into one."""
    for i in range(middle, last):
        row, slot = rows[i], i
        while slot > first and rows[slot - 1] > row:
            rows[slot] = rows[slot - 1]
            slot -= 1
        rows[slot] = row


@kernel
def product_of(first: Parents, second: Parents, max_hypotheses: int) -> Parents:
    """Return the products of the hypotheses of two factors, heaviest first.

    Both factors must have their hypotheses heaviest first, and rows in increasing order. A pair of which
    `max_hypotheses` others are surely heavier is left out, but never one with the heaviest hypothesis of the other
    factor: a hypothesis that a factor has kept for the sake of one track is not lost before the scan.
    """
    room = max(len(first.log_weights), len(second.log_weights))
    lefts, rights, log_weights, num = np.empty(room, np.int64), np.empty(room, np.int64), np.empty(room), 0
    for a in range(len(first.log_weights)):
        for b in range(len(second.log_weights)):
            # (a + 1) (b + 1) pairs are at least as heavy as this one.
            if a > 0 and b > 0 and (a + 1) * (b + 1) > max_hypotheses:
                break
            lefts, rights = grown_ints(lefts, num + 1), grown_ints(rights, num + 1)
            log_weights = grown_floats(log_weights, num + 1)
            lefts[num], rights[num] = a, b
            log_weights[num] = first.log_weights[a] + second.log_weights[b]
            num += 1
    order = descending_order(log_weights[:num])
    offsets, size = np.zeros(num + 1, np.int64), 0
    for pair in order:
        size += first.offsets[lefts[pair] + 1] - first.offsets[lefts[pair]]
        size += second.offsets[rights[pair] + 1] - second.offsets[rights[pair]]
    rows, sorted_weights, filled = np.empty(size, np.int64), np.empty(num), 0
    for h in range(num):
        left, right = lefts[order[h]], rights[order[h]]
        for i in range(first.offsets[left], first.offsets[left + 1]):
            rows[filled] = first.rows[i]
            filled += 1
        middle = filled
        for i in range(second.offsets[right], second.offsets[right + 1]):
            rows[filled] = second.rows[i]
            filled += 1
        _merge_rows(rows, offsets[h], middle, filled)
        offsets[h + 1], sorted_weights[h] = filled, log_weights[order[h]]
    return Parents(offsets, rows, sorted_weights)
