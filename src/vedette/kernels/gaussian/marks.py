"""Marks of Gaussian components: made, copied, merged, pooled and updated.

All other code treats the marks of components as rows of one array. Its columns are the mode of motion and the log
probability of each class of target.

The class of a target does not change, and neither its motion nor its detection depends on it. A component is then a
product of a Gaussian and class probabilities, and a measurement with likelihood ratio r(k) of its features for class k
(over those of a false measurement) gives it the factor sum of r(k) p(k), and the probabilities r(k) p(k) over that sum.

The mode of a component is drawn at its first prediction (`vedette.kernels.gaussian.modes`). Until then it is
distributed as at birth.
"""

import math

import numpy as np

from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import CLASSES, MODE, Floats, Ints, Marks, Measurements, Sensor
from vedette.kernels.gaussian.linalg import normalise_logs

NOT_DRAWN = -1  # as a mode


def unmarked(num: int = 0) -> Marks:
    """Marks of this number of components, without modes and classes."""
    return np.full((num, CLASSES), float(NOT_DRAWN))


no_marks = kernel(unmarked)  # for kernels


@kernel
def marks_like(marks: Marks, num: int) -> Marks:
    """Room for this number of components, with the columns of `marks`."""
    return np.empty((num, marks.shape[1]))


@kernel
def room_for_updated_marks(measurements: Measurements, num: int) -> Marks:
    """Room for this number of components, with the columns that measurements change."""
    return np.empty((num, CLASSES + measurements.class_ratios.shape[1]))


@inlined
def mode_of(marks: Marks, c: int) -> int:
    """Return the mode of component `c`, or `NOT_DRAWN`."""
    return int(marks[c, MODE])


@inlined
def detection_factor(sensor: Sensor, marks: Marks, c: int) -> float:
    """Return the factor of the mode of component `c` on the probability of detection, 1 without a mode."""
    mode = mode_of(marks, c)
    return float(sensor.mode_factors[mode]) if mode >= 0 and len(sensor.mode_factors) > 0 else 1.0


@inlined
def set_mode(marks: Marks, c: int, mode: int) -> None:
    """Write the mode of component `c`."""
    marks[c, MODE] = mode


@inlined
def has_room(marks: Marks, order: Ints, k: int, most: int) -> bool:
    """Return True if the component at `order[k]` is among the first `most` of its mode in that order.

    Without a mode it must be among the first of all.
    """
    mode, before = mode_of(marks, order[k]), k
    if mode != NOT_DRAWN:
        before = 0
        for i in range(k):
            before += mode_of(marks, order[i]) == mode
    return before < most


@inlined
def copy_marks(marks: Marks, source: int, out: Marks, target: int) -> None:
    """Copy the marks of component `source` to place `target`, in the columns that `out` has."""
    copy_updated_marks(marks, source, out, target)
    out[target, MODE] = marks[source, MODE]


@inlined
def copy_updated_marks(marks: Marks, source: int, out: Marks, target: int) -> None:
    """Copy the marks that measurements change, in the columns that both have."""
    for k in range(CLASSES, min(marks.shape[1], out.shape[1])):
        out[target, k] = marks[source, k]


@inlined
def may_merge(marks: Marks, first: int, second: int) -> bool:
    """True if two components may become one: of any classes, whose probabilities have a mean, and of one mode."""
    return marks[first, MODE] == marks[second, MODE]


@borrowing
def merge_marks(marks: Marks, chosen: Ints, weights: Floats, count: int, out: Marks, target: int) -> None:
    """Write the marks of the first `count` of `chosen`, merged under linear weights.

    They are the mean class probabilities, and the mode. Of components of several modes the next is drawn as at birth.
    """
    set_mode(out, target, _common_mode(marks, chosen, count))
    if out.shape[1] == CLASSES:
        return
    total = 0.0
    for i in range(count):
        total += weights[i]
    for k in range(CLASSES, out.shape[1]):
        peak, mean = -math.inf, 0.0
        for i in range(count):
            peak = max(peak, marks[chosen[i], k])
        if peak > -math.inf:
            for i in range(count):
                share = weights[i] / total if total > 0.0 else 1.0 / count
                mean += share * math.exp(marks[chosen[i], k] - peak)
        out[target, k] = peak + math.log(mean) if mean > 0.0 else -math.inf


@borrowing
def pool_marks(marks: Marks, chosen: Ints, powers: Floats, count: int, out: Marks, target: int) -> float:
    """Write the marks of the product of powers of the first `count` of `chosen`, and return the log of its factor.

    The product of components of different modes is 0. One whose mode is not drawn yet goes with each.
    """
    mode, log_factor = NOT_DRAWN, 0.0
    for i in range(count):
        if not may_pool(marks, chosen[i], mode):
            log_factor = -math.inf
        mode = max(mode, mode_of(marks, chosen[i]))
    set_mode(out, target, mode)
    if out.shape[1] == CLASSES:
        return log_factor
    for k in range(CLASSES, out.shape[1]):
        out[target, k] = 0.0
        for i in range(count):
            out[target, k] += powers[i] * marks[chosen[i], k]
    return log_factor + _normalise_classes(out[target, CLASSES:])


@inlined
def update_marks(marks: Marks, c: int, measurements: Measurements, j: int, out: Marks, target: int) -> float:
    """Write the marks of component `c` after measurement `j`, and return the log of the factor of its weight."""
    if out.shape[1] == CLASSES:
        return 0.0
    for k in range(CLASSES, out.shape[1]):
        out[target, k] = marks[c, k] + measurements.class_ratios[j, k - CLASSES]
    return _normalise_classes(out[target, CLASSES:])


@inlined
def may_pool(marks: Marks, c: int, mode: int) -> bool:
    """Return True if the product of component `c` with one of this mode is not 0."""
    own = mode_of(marks, c)
    return own in (mode, NOT_DRAWN) or mode == NOT_DRAWN


@inlined
def _common_mode(marks: Marks, chosen: Ints, count: int) -> int:
    mode = mode_of(marks, chosen[0])
    for i in range(1, count):
        if mode_of(marks, chosen[i]) != mode:
            return NOT_DRAWN
    return mode


@inlined
def _normalise_classes(log_class_probs: Floats) -> float:
    """Normalise probabilities in place, all equal if their sum is 0, and return the log of the sum."""
    log_sum = normalise_logs(log_class_probs)
    if log_sum == -math.inf:
        for k in range(len(log_class_probs)):
            log_class_probs[k] = -math.log(len(log_class_probs))
    return log_sum


# From Python, on arrays of the library's own.


def marks_of(log_class_probs: Floats | None = None, modes: Ints | None = None) -> Marks:
    """Return the marks of components of these log class probabilities, (num, num_classes), and modes, (num,).

    Without either there are no classes, or no mode is drawn yet. At least one is expected.
    """
    num = max(len(given) for given in (log_class_probs, modes) if given is not None)
    classes = np.empty((num, 0)) if log_class_probs is None else log_class_probs
    return np.column_stack([np.full(num, NOT_DRAWN) if modes is None else modes, classes]).astype(np.float64)
