"""Distribution of the total number of targets of independent densities."""

import numpy as np

from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Floats, Ints

# Smaller probabilities become 0: they are negligible in any sum, and subnormal numbers are slow.
_LEAST = 1e-280


@kernel
def convolved(probabilities: Floats, offsets: Ints) -> Floats:
    """Return the distribution of the sum of independent numbers.

    Number `i` is n with probability `probabilities[offsets[i] + n]`, n from 0 up to the run's end.
    Probabilities below 1e-280 become 0.
    """
    num = len(offsets) - 1
    found, last = np.zeros(offsets[num] - num + 1), np.zeros(offsets[num] - num + 1)
    found[0] = 1.0
    # Entries outside `low:high` are zero.
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
