"""Simulated scans from true measurements (random numbers are drawn outside), and checks of scans."""

import math

import numpy as np

from vedette.kernels.base.compile import inlined, kernel
from vedette.kernels.base.types import Bools, Floats, Ints

CLUTTER = -1  # origin of a measurement behind which there is no target


@inlined
def _within(value: float, period: float) -> float:
    """The same value in (-period / 2, period / 2], rounded as NumPy's remainder rounds."""
    half = 0.5 * period
    if value > half or value <= -half:
        return half - np.remainder(half - value, period)
    return value


@kernel
def wrap_columns(values: Floats, periods: Floats) -> None:
    """Wrap (n, dim) values to (-period / 2, period / 2] in place. Those already there keep every bit."""
    for i in range(len(values)):
        for j in range(len(periods)):
            values[i, j] = _within(values[i, j], periods[j])


@kernel
def add_noise(measured: Floats, noise: Floats, periods: Floats) -> int:
    """Add z_i += v_i in place, wrapped. Returns the first row that is not finite, where it stops, or -1.

    periods: (dim,) of the components, see `Sensor`.
    """
    num, dim = measured.shape
    for i in range(num):
        for j in range(dim):
            measured[i, j] += noise[i, j]
        for j in range(dim):
            if not math.isfinite(measured[i, j]):
                return i
            measured[i, j] = _within(measured[i, j], periods[j])
    return -1


@kernel
def seen_with(chances: Floats, luck: Floats) -> tuple[Bools, int]:
    """Return detections (num,), luck below probability, and the index of the first invalid probability, or -1."""
    seen = np.empty(len(chances), np.bool_)
    for i in range(len(chances)):
        if not 0.0 <= chances[i] <= 1.0:
            return seen, i
        seen[i] = luck[i] < chances[i]
    return seen, -1


@kernel
def mixed_scan(measured: Floats, ids: Ints, seen: Bools, clutter: Floats, order: Ints) -> tuple[Floats, Ints]:
    """Return the measurements of detected targets and the clutter, in the given joint order.

    Returns (n, meas_dim) measurements and the (n,) ids of the targets behind them, or `CLUTTER`.
    """
    num, row = len(measured), 0
    count = np.count_nonzero(seen) + len(clutter)
    mixed, origins = np.empty((count, measured.shape[1])), np.empty(count, np.int64)
    for place in order:
        if place < num and not seen[place]:
            continue
        mixed[row] = measured[place] if place < num else clutter[place - num]
        origins[row] = ids[place] if place < num else CLUTTER
        row += 1
    return mixed, origins


@kernel
def examined_scan(scan: Floats, least: Floats, periods: Floats) -> tuple[int, bool, float, bool]:
    """The first row that is not finite, or -1; whether any component is below its least value; the largest component
    that repeats, in half periods; whether two rows begin with the same number.

    scan: (num, meas_dim).
    """
    is_below, largest = False, 0.0
    for i in range(scan.shape[0]):
        for j in range(scan.shape[1]):
            if not math.isfinite(scan[i, j]):
                return i, is_below, largest, False
        for j in range(least.shape[0]):
            is_below = is_below or scan[i, j] < least[j]
            largest = max(largest, abs(scan[i, j]) / (0.5 * periods[j]))
    column, is_repeated = np.sort(scan[:, 0]), False
    for i in range(1, len(column)):
        is_repeated = is_repeated or column[i] == column[i - 1]
    return -1, is_below, largest, is_repeated
