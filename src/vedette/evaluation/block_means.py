"""Means over successive values, whose errors are correlated: by blocks of them."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vedette.kernels.base.types import Floats

SURE = 4.5  # standard deviations of a finding: a probability of 7e-6 by chance
BLOCK = 10  # successive values in one block
_MIN_BLOCKS = 5


class BlockMean(NamedTuple):
    """Mean of some values, its standard error, the number of blocks, and the degrees of freedom of the error."""

    value: float
    error: float
    num: int
    freedom: float

    def away_from(self, value: float) -> float:
        """Return the distance to a value in standard deviations of a normal distribution, or 0 for few blocks.

        It has the same tail probability as Student's distribution (Wallace 1959, eq. 2.3).
        """
        if self.num < _MIN_BLOCKS:
            return 0.0
        ratio = min(abs(self.value - value) / max(self.error, 1e-300), 1e9)
        scale = (8.0 * self.freedom + 1.0) / (8.0 * self.freedom + 3.0)
        return scale * math.sqrt(self.freedom * math.log1p(ratio**2 / self.freedom))

    def minus(self, other: "BlockMean") -> "BlockMean":
        """Return the difference to the mean of other blocks, which vary alike. It counts with the fewer blocks."""
        both, freedom = (self, other), self.freedom + other.freedom
        variance = sum(each.freedom * max(each.num, 1) * each.error**2 for each in both) / freedom
        error = math.sqrt(variance * sum(1.0 / max(each.num, 1) for each in both))
        return BlockMean(self.value - other.value, error, min(self.num, other.num), freedom)

    def is_surely(self, value: float, least: float) -> bool:
        """Return True if the mean surely differs from a value, and by more than `least`."""
        return abs(self.value - value) > least and self.away_from(value) > SURE


def blocks(tracks: Sequence[Floats]) -> Floats:
    """Return the sums and numbers of blocks of successive values of a track, (num_blocks, 2)."""
    whole = [np.pad(each, (0, -len(each) % BLOCK), constant_values=np.nan).reshape(-1, BLOCK) for each in tracks]
    values = np.concatenate([np.empty((0, BLOCK)), *whole])
    return np.column_stack([np.nansum(values, axis=1), np.isfinite(values).sum(axis=1)])


def mean_of(sums: Floats, *, drifts: bool = False) -> BlockMean:
    """Return the mean of all values in blocks, (num_blocks, 2).

    drifts: True to take its error from the differences of successive blocks (von Neumann 1941), as the mean may change.
    """
    size, freedom = max(float(sums[:, 1].sum()), 1.0), max(len(sums) - 1.0, 1.0)
    value = float(sums[:, 0].sum()) / size
    residuals = sums[:, 0] - value * sums[:, 1]
    squares = np.diff(residuals) ** 2 / 2.0 if drifts else residuals**2
    error = math.sqrt(float(squares.sum()) / freedom * len(sums)) / size
    return BlockMean(value, error, len(sums), (2.0 / 3.0 if drifts else 1.0) * freedom)
