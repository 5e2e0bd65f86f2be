"""Numbers of targets of independent densities together: their distribution, and the best way to share out a number."""

from __future__ import annotations

import math

import numpy as np

from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Floats, Ints

# Probabilities below are 0: far below what sums to one can show, and numbers smaller yet are slow.
_LEAST = 1e-280


@kernel
def convolved(probabilities: Floats, offsets: Ints) -> Floats:
    """Distribution of the sum of independent numbers.

    Number `i` is n with probability `probabilities[offsets[i] + n]`, n from 0 up to the run's end.
    Probabilities below 1e-280 become 0.
    """
    num = len(offsets) - 1
    found, last = np.zeros(offsets[num] - num + 1), np.zeros(offsets[num] - num + 1)
    found[0] = 1.0
    # Places outside `low:high` hold zeros.
    low, high = 0, 1
    for i in range(num):
        width = offsets[i + 1] - offsets[i]
        for n in range(low, high):
            last[n] = found[n]
            found[n] = 0.0
        for k in range(width):
            share = probabilities[offsets[i] + k]
            if share > 0.0:
                for n in range(low, high):
                    found[n + k] += share * last[n]
        high += width - 1
        while found[low] < _LEAST and low + 1 < high:
            found[low] = 0.0
            low += 1
        while found[high - 1] < _LEAST and low + 1 < high:
            high -= 1
            found[high] = 0.0
    return found


@kernel
def best_of_pairs(values: Floats, offsets: Ints) -> tuple[Floats, Ints, Ints]:
    """The largest sums of neighbours: of runs 0 and 1, of 2 and 3, ...; a last one without a partner stays.

    Run `i` has the value of n at `values[offsets[i] + n]`. Returns the same of the pairs, their offsets, and at each
    place how much of n the first of the pair takes; of equal sums the one where it takes the least.
    """
    num = len(offsets) - 1
    num_pairs = (num + 1) // 2
    sums, taken = np.full(len(values), -math.inf), np.zeros(len(values), np.int64)
    ends, end = np.zeros(num_pairs + 1, np.int64), 0
    for p in range(num_pairs):
        low, middle, high = offsets[2 * p], offsets[2 * p + 1], offsets[min(2 * p + 2, num)]
        if 2 * p + 1 == num:
            for n in range(middle - low):
                sums[end + n], taken[end + n] = values[low + n], n
            end += middle - low
        else:
            for i in range(middle - low):
                for j in range(high - middle):
                    total = values[low + i] + values[middle + j]
                    if total > sums[end + i + j]:
                        sums[end + i + j], taken[end + i + j] = total, i
            end += high - low - 1
        ends[p + 1] = end
    return sums[:end].copy(), ends, taken[:end].copy()
