"""Marks of Gaussian components: their optional columns made, copied, merged, pooled, updated and joined.

All other code treats the marks of components as one bundle.

The class of a target does not change, and neither its motion nor its detection depends on it. A component is then a
product of a Gaussian and class probabilities, and a measurement with likelihood ratio r(k) of its features for class k
(over those of a false measurement) gives it the factor sum of r(k) p(k), and the probabilities r(k) p(k) over that sum.

The mode of a component is drawn at its first prediction (`vedette.kernels.gaussian.modes`). Until then it is
distributed as at birth, which is what a component without the column says too.
"""

import math
from collections.abc import Iterable

import numpy as np

from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Ints, Marks, Measurements
from vedette.kernels.gaussian.linalg import normalise_logs

NOT_DRAWN = -1  # as a mode


@kernel
def marks_like(marks: Marks, num: int) -> Marks:
    """Room for this number of components, with the columns of `marks`."""
    return Marks(np.empty((num, marks.log_class_probs.shape[1])), np.empty((num, marks.modes.shape[1]), np.int64))


@kernel
def marks_like_both(first: Marks, second: Marks, num: int) -> Marks:
    """Room for this number of components, with the columns that either has."""
    return marks_with_modes(first, num) if have_modes(second) else marks_like(first, num)


@kernel
def marks_with_modes(marks: Marks, num: int) -> Marks:
    """Room for this number of components, with the columns of `marks` and that of modes."""
    return Marks(np.empty((num, marks.log_class_probs.shape[1])), np.empty((num, 1), np.int64))


@kernel
def room_for_updated_marks(measurements: Measurements, num: int) -> Marks:
    """Room for this number of components, with the columns that measurements change."""
    return Marks(np.empty((num, measurements.class_ratios.shape[1])), np.empty((num, 0), np.int64))


@kernel
def marks_between(marks: Marks, first: int, last: int) -> Marks:
    """Marks of components `first:last`, as views."""
    return Marks(marks.log_class_probs[first:last], marks.modes[first:last])


@inlined
def mode_of(marks: Marks, c: int) -> int:
    """Return the mode of component `c`, or `NOT_DRAWN`."""
    return marks.modes[c, 0] if marks.modes.shape[1] > 0 else NOT_DRAWN


@inlined
def set_mode(marks: Marks, c: int, mode: int) -> None:
    """Write the mode of component `c`, if the marks have the column."""
    if marks.modes.shape[1] > 0:
        marks.modes[c, 0] = mode


@inlined
def has_room(marks: Marks, order: Ints, k: int, most: int) -> bool:
    """Return True if the component at `order[k]` is among the first `most` of its mode in that order."""
    before = k
    if have_modes(marks):
        before = 0
        for i in range(k):
            before += mode_of(marks, order[i]) == mode_of(marks, order[k])
    return before < most


@inlined
def most_kept(marks: Marks, num: int, most: int) -> int:
    """Return the largest number of `num` components that a cap of `most`, of each mode, may leave."""
    return num if have_modes(marks) and most > 1 else min(num, max(1, most))


@inlined
def have_modes(marks: Marks) -> bool:
    """Return True if the components have the column of modes."""
    return marks.modes.shape[1] > 0


@inlined
def copy_marks(marks: Marks, source: int, out: Marks, target: int) -> None:
    """Copy the marks of component `source` to place `target`, in the columns that `out` has."""
    copy_updated_marks(marks, source, out, target)
    set_mode(out, target, mode_of(marks, source))


@inlined
def copy_updated_marks(marks: Marks, source: int, out: Marks, target: int) -> None:
    """Copy the marks that measurements change, in the columns that both have."""
    for k in range(min(marks.log_class_probs.shape[1], out.log_class_probs.shape[1])):
        out.log_class_probs[target, k] = marks.log_class_probs[source, k]


@inlined
def may_merge(marks: Marks, first: int, second: int) -> bool:
    """True if two components may become one: of any classes, whose probabilities have a mean, and of one mode."""
    return mode_of(marks, first) == mode_of(marks, second)


@borrowing
def merge_marks(marks: Marks, chosen: Ints, weights: Floats, count: int, out: Marks, target: int) -> None:
    """Write the marks of the first `count` of `chosen`, merged under linear weights.

    They are the mean class probabilities, and the mode. Of components of several modes the next is drawn as at birth.
    """
    set_mode(out, target, _common_mode(marks, chosen, count))
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
    """Write the marks of the product of powers of the first `count` of `chosen`, and return the log of its factor.

    The product of components of different modes is 0. One whose mode is not drawn yet goes with each.
    """
    mode, log_factor = NOT_DRAWN, 0.0
    for i in range(count):
        if not may_pool(marks, chosen[i], mode):
            log_factor = -math.inf
        mode = max(mode, mode_of(marks, chosen[i]))
    set_mode(out, target, mode)
    if out.log_class_probs.shape[1] == 0:
        return log_factor
    for k in range(out.log_class_probs.shape[1]):
        out.log_class_probs[target, k] = 0.0
        for i in range(count):
            out.log_class_probs[target, k] += powers[i] * marks.log_class_probs[chosen[i], k]
    return log_factor + _normalise_classes(out.log_class_probs[target])


@inlined
def update_marks(marks: Marks, c: int, measurements: Measurements, j: int, out: Marks, target: int) -> float:
    """Write the marks of component `c` after measurement `j`, and return the log of the factor of its weight."""
    if out.log_class_probs.shape[1] == 0:
        return 0.0
    for k in range(out.log_class_probs.shape[1]):
        out.log_class_probs[target, k] = marks.log_class_probs[c, k] + measurements.class_ratios[j, k]
    return _normalise_classes(out.log_class_probs[target])


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


def unmarked(num: int = 0) -> Marks:
    """Marks of this number of components, with no column in use."""
    return Marks(np.empty((num, 0)), np.empty((num, 0), np.int64))


no_marks = kernel(unmarked)  # for kernels


# From Python, on arrays of the library's own.


def taken_marks(marks: Marks, places: Ints | slice) -> Marks:
    """The marks at `places`, in that order."""
    return Marks(marks.log_class_probs[places], marks.modes[places])


def joined_marks(marks: Iterable[Marks]) -> Marks:
    """The marks of all bundles, in their order."""
    classes, modes = zip(*marks, strict=True)
    try:
        return Marks(np.concatenate(classes), np.concatenate(modes))
    except ValueError:  # some have no column of modes
        none = [np.full((len(each), 1 - each.shape[1]), NOT_DRAWN) for each in modes]
        return Marks(np.concatenate(classes), np.concatenate([*map(np.hstack, zip(modes, none, strict=True))]))
