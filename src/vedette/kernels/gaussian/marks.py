"""Marks of Gaussian components: their optional columns made, copied, merged, pooled, updated and joined.

All other code treats the marks of components as one bundle.

The class of a target does not change, and neither its motion nor its detection depends on it. A component is then a
product of a Gaussian and class probabilities, and a measurement with likelihood ratio r(k) of its features for class k
(over those of a false measurement) gives it the factor sum of r(k) p(k), and the probabilities r(k) p(k) over that sum.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Ints, Marks, Measurements
from vedette.kernels.gaussian.linalg import normalise_logs


@kernel
def marks_like(marks: Marks, num: int) -> Marks:
    """Room for this number of components, with the columns of `marks`."""
    return Marks(np.empty((num, marks.log_class_probs.shape[1])))


@kernel
def room_for_updated_marks(measurements: Measurements, num: int) -> Marks:
    """Room for this number of components, with the columns that measurements change."""
    return Marks(np.empty((num, measurements.class_ratios.shape[1])))


@kernel
def marks_between(marks: Marks, first: int, last: int) -> Marks:
    """Marks of components `first:last`, as views."""
    return Marks(marks.log_class_probs[first:last])


@inlined
def copy_marks(marks: Marks, source: int, out: Marks, target: int) -> None:
    """Copy the marks of component `source` to place `target`, in the columns that both have."""
    for k in range(min(marks.log_class_probs.shape[1], out.log_class_probs.shape[1])):
        out.log_class_probs[target, k] = marks.log_class_probs[source, k]


@inlined
def may_merge(marks: Marks, first: int, second: int) -> bool:
    """Return True if two components may become one: of any classes, as probabilities of classes have a mean."""
    return True


@borrowing
def merge_marks(marks: Marks, chosen: Ints, weights: Floats, count: int, out: Marks, target: int) -> None:
    """Write the marks of the first `count` of `chosen`, merged under linear weights: the mean class probabilities."""
    if out.log_class_probs.shape[1] == 0:
        return
    total, logs = 0.0, marks.log_class_probs
    for i in range(count):
        total += weights[i]
    for k in range(out.log_class_probs.shape[1]):
        peak, mean = -math.inf, 0.0
        for i in range(count):
            peak = max(peak, logs[chosen[i], k])
        if peak > -math.inf:
            for i in range(count):
                share = weights[i] / total if total > 0.0 else 1.0 / count
                mean += share * math.exp(logs[chosen[i], k] - peak)
        out.log_class_probs[target, k] = peak + math.log(mean) if mean > 0.0 else -math.inf


@borrowing
def pool_marks(marks: Marks, chosen: Ints, powers: Floats, count: int, out: Marks, target: int) -> float:
    """Write the marks of the product of powers of the first `count` of `chosen`, and return the log of its factor."""
    if out.log_class_probs.shape[1] == 0:
        return 0.0
    for k in range(out.log_class_probs.shape[1]):
        out.log_class_probs[target, k] = 0.0
        for i in range(count):
            out.log_class_probs[target, k] += powers[i] * marks.log_class_probs[chosen[i], k]
    return _normalise_classes(out.log_class_probs[target])


@inlined
def update_marks(marks: Marks, c: int, measurements: Measurements, j: int, out: Marks, target: int) -> float:
    """Write the marks of component `c` after measurement `j`, and return the log of the factor of its weight."""
    if out.log_class_probs.shape[1] == 0:
        return 0.0
    for k in range(out.log_class_probs.shape[1]):
        out.log_class_probs[target, k] = marks.log_class_probs[c, k] + measurements.class_ratios[j, k]
    return _normalise_classes(out.log_class_probs[target])


@inlined
def _normalise_classes(log_class_probs: Floats) -> float:
    """Normalise probabilities in place, all equal if their sum is 0, and return the log of the sum."""
    log_sum = normalise_logs(log_class_probs)
    if log_sum == -math.inf:
        for k in range(len(log_class_probs)):
            log_class_probs[k] = -math.log(len(log_class_probs))
    return log_sum


def unmarked(num: int = 0) -> Marks:
    """Marks of this number of components, with no column in use."""
    return Marks(np.empty((num, 0)))


no_marks = kernel(unmarked)  # for kernels


# From Python, on arrays of the library's own.


def taken_marks(marks: Marks, places: Ints | slice) -> Marks:
    """The marks at `places`, in that order."""
    return Marks(*(column[places] for column in marks))


def joined_marks(marks: Iterable[Marks]) -> Marks:
    """The marks of all bundles, in their order."""
    return Marks(*map(np.concatenate, zip(*marks, strict=True)))
