"""Measurements that can be in the gate of each row, found without comparing all measurements with all rows.

A gate is an ellipsoid of squared Mahalanobis distance g about the expected measurement, with the innovation covariance
S: along each axis a its half-width is sqrt(g S_aa). Measurements are sorted along the axis on which gates are smallest
relative to the spread of the scan. A row considers those between the ends of its gates there, and compares the other
axes.
"""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.association.predicted import Rows
from vedette.kernels.base.arrays import grown_ints
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Ints, Measurements
from vedette.kernels.gaussian.mixtures import descending_order
from vedette.kernels.gaussian.scratch import wrap

# Margin of the ends of gates for rounding of distances.
_SLACK = 1.0 + 1e-9


class Near(NamedTuple):
    """The measurements that are compared with each row."""

    offsets: Ints  # (num_rows + 1,) into the next array; (0,) if every row is compared with all
    measurements: Ints  # of each row in increasing order


@kernel
def all_measurements() -> Near:
    """Return `Near` in which every row is compared with every measurement."""
    return Near(np.empty(0, np.int64), np.empty(0, np.int64))


@kernel
def _largest_variances(measurements: Measurements) -> Floats:
    """Return the largest variance of each component of the noise that measurements bring, shape (meas_dim,)."""
    out = np.zeros(measurements.values.shape[1])
    for a in range(len(out)):
        own, added = 0.0, 0.0
        for j in range(len(measurements.noise)):
            own = max(own, measurements.noise[j, a, a])
        for j in range(len(measurements.added_noise)):
            added = max(added, measurements.added_noise[j, a, a])
        out[a] = own + added
    return out


@kernel
def _gate_reaches(rows: Rows, measurements: Measurements, gate: float) -> Floats:
    """Half-width of the gate of each component along each axis, shape (num_components, meas_dim).

    With the noise of the model and the largest that a measurement brings.
    """
    factor = rows.innovation.factor
    num, dim = rows.innovation.predicted.shape
    out, own = np.empty((num, dim)), _largest_variances(measurements)
    for c in range(num):
        for a in range(dim):
            variance = own[a]
            for k in range(a + 1):
                variance += factor[c, a, k] * factor[c, a, k]
            out[c, a] = _SLACK * math.sqrt(gate * variance)
    return out


@borrowing
def _finest_axis(scan: Floats, reaches: Floats) -> int:
    """Return the axis along which the scan spreads over the largest number of gates."""
    best, most = 0, -1.0
    for a in range(reaches.shape[1]):
        low, high, reach = math.inf, -math.inf, 0.0
        for j in range(scan.shape[0]):
            low, high = min(low, scan[j, a]), max(high, scan[j, a])
        for c in range(reaches.shape[0]):
            reach += reaches[c, a]
        if low <= high and 0.0 < reach < math.inf and (high - low) / reach > most:
            best, most = a, (high - low) / reach
    return best


@inlined
def _first_from(values: Floats, least: float) -> int:
    """Return the place of the first of increasing values that is not below `least`."""
    low, high = 0, values.shape[0]
    while low < high:
        middle = (low + high) // 2
        if values[middle] < least:
            low = middle + 1
        else:
            high = middle
    return low


@inlined
def _may_be_gated(rows: Rows, row: int, measurement: Floats, periods: Floats, reaches: Floats) -> bool:
    """Return True if a measurement is within the gate of some component of the row along every axis."""
    for c in range(rows.offsets[row], rows.offsets[row + 1]):
        inside = True
        for a in range(reaches.shape[1]):
            off = wrap(measurement[a] - rows.innovation.predicted[c, a], periods[a])
            if not abs(off) <= reaches[c, a]:
                inside = False
                break
        if inside:
            return True
    return False


@inlined
def _sort(values: Ints, first: int, last: int) -> None:
    for i in range(first + 1, last):
        value, slot = values[i], i
        while slot > first and values[slot - 1] > value:
            values[slot] = values[slot - 1]
            slot -= 1
        values[slot] = value


@inlined
def _ends(rows: Rows, row: int, axis: int, periods: Floats, reaches: Floats) -> tuple[float, float]:
    """Return the interval of the gates of a row on the axis, or everything if it may wrap around."""
    low, high = math.inf, -math.inf
    for c in range(rows.offsets[row], rows.offsets[row + 1]):
        low = min(low, rows.innovation.predicted[c, axis] - reaches[c, axis])
        high = max(high, rows.innovation.predicted[c, axis] + reaches[c, axis])
    if low < -0.5 * periods[axis] or high > 0.5 * periods[axis]:
        return -math.inf, math.inf
    return low, high


@kernel
def _increasing(scan: Floats, axis: int) -> tuple[Ints, Floats]:
    """Return the measurements in increasing order along an axis, and their values there."""
    values = np.empty(len(scan))
    for j in range(len(scan)):
        values[j] = -scan[j, axis]
    order = descending_order(values)
    for j in range(len(scan)):
        values[j] = scan[order[j], axis]
    return order, values


@kernel
def near_measurements(rows: Rows, measurements: Measurements, periods: Floats, gate: float) -> Near:
    """Return the measurements that may be in the gates of each row: all that are, and few others."""
    scan = measurements.values
    num, num_rows = len(scan), len(rows.log_absent)
    reaches = _gate_reaches(rows, measurements, gate)
    axis = _finest_axis(scan, reaches)
    order, values = _increasing(scan, axis)
    offsets, found, filled = np.zeros(num_rows + 1, np.int64), np.empty(4 * num_rows + num, np.int64), 0
    for row in range(num_rows):
        low, high = _ends(rows, row, axis, periods, reaches)
        if filled + num > len(found):
            found = grown_ints(found, filled + num)
        at = _first_from(values, low)
        while at < num and values[at] <= high:
            if _may_be_gated(rows, row, scan[order[at]], periods, reaches):
                found[filled] = order[at]
                filled += 1
            at += 1
        _sort(found, offsets[row], filled)
        offsets[row + 1] = filled
    return Near(offsets, found)
