"""Components of Gaussian mixtures with all their columns: made, copied, viewed, taken, joined and merged.

Code that changes the weight or the moments of a component copies it first, so that its other columns come along.
"""

from collections.abc import Sequence

import numpy as np

from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import MODE, Floats, Ints, Marks, Mixture
from vedette.kernels.gaussian.marks import NOT_DRAWN, copy_marks, marks_like, merge_marks, unmarked
from vedette.kernels.gaussian.mixtures import choose_all, match_components


@kernel
def make_components(num: int, dim: int, marks: Marks) -> Mixture:
    """Room for this number of components, of states of `dim` components and with columns as in `marks`."""
    return Mixture(np.empty(num), np.empty((num, dim)), np.empty((num, dim, dim)), marks_like(marks, num))


@kernel
def components_like(mixture: Mixture, num: int) -> Mixture:
    """Room for this number of components, with states and marks as in `mixture`."""
    return make_components(num, mixture.means.shape[1], mixture.marks)


@inlined
def copy_gaussian(means: Floats, covs: Floats, source: int, out_means: Floats, out_covs: Floats, target: int) -> None:
    """Copy mean and covariance `source` to place `target`. (Written out: array assignment takes seconds to compile.)"""
    n = means.shape[1]
    for i in range(n):
        out_means[target, i] = means[source, i]
        for j in range(n):
            out_covs[target, i, j] = covs[source, i, j]


@inlined
def copy_component(mixture: Mixture, source: int, out: Mixture, target: int) -> None:
    """Copy component `source` to place `target`, in the columns of marks that `out` has."""
    out.log_weights[target] = mixture.log_weights[source]
    copy_gaussian(mixture.means, mixture.covs, source, out.means, out.covs, target)
    copy_marks(mixture.marks, source, out.marks, target)


@inlined
def copy_components(mixture: Mixture, first: int, last: int, out: Mixture, start: int) -> int:
    """Copy components `first:last` to the places from `start` on. Returns the end of what is filled."""
    for c in range(first, last):
        copy_component(mixture, c, out, start + c - first)
    return start + last - first


@kernel
def components_between(mixture: Mixture, first: int, last: int) -> Mixture:
    """Components `first:last`, as views."""
    log_weights, means, covs, marks = mixture
    return Mixture(log_weights[first:last], means[first:last], covs[first:last], marks[first:last])


@inlined
def borrowed_components(mixture: Mixture, num: int) -> Mixture:
    """The first `num` components, as views for kernels that only borrow arrays. Their marks are not cut."""
    return Mixture(mixture.log_weights[:num], mixture.means[:num], mixture.covs[:num], mixture.marks)


@kernel
def own_components(mixture: Mixture, num: int) -> Mixture:
    """The first `num` components in arrays of their own."""
    log_weights, means, covs, marks = mixture
    return Mixture(log_weights[:num].copy(), means[:num].copy(), covs[:num].copy(), marks[:num].copy())


@kernel
def grown_components(mixture: Mixture, filled: int, needed: int) -> Mixture:
    """The first `filled` components with room for at least `needed`, or the same bundle where there is room already."""
    room = len(mixture.log_weights)
    if needed <= room:
        return mixture
    longer = components_like(mixture, max(needed, 2 * room))
    copy_components(mixture, 0, filled, longer, 0)
    return longer


@kernel
def stacked_mixtures(first: Mixture, second: Mixture) -> Mixture:
    """The components of both, in their order."""
    num, more = len(first.log_weights), len(second.log_weights)
    out = components_like(first, num + more)
    copy_components(first, 0, num, out, 0)
    copy_components(second, 0, more, out, num)
    return out


@inlined
def merge_components(mixture: Mixture, chosen: Ints, weights: Floats, count: int, out: Mixture, target: int) -> None:
    """Write the moments and merged marks of the first `count` of `chosen` as one component.

    See `match_components`. Its weight is not written.
    """
    match_components(chosen, weights, count, mixture.means, mixture.covs, out.means[target], out.covs[target])
    merge_marks(mixture.marks, chosen, weights, count, out.marks, target)


@borrowing
def merge_all(
    mixture: Mixture, count: int, components: Ints, weights: Floats, log_weight: float, out: Mixture, target: int
) -> None:
    """Write the first `count` components merged into one of the given weight. components, weights: work."""
    out.log_weights[target] = log_weight
    choose_all(mixture.log_weights, count, components, weights)
    merge_components(mixture, components, weights, count, out, target)


# From Python, on arrays of the library's own.


def components_of(log_weights: Floats, means: Floats, covs: Floats, marks: Marks | None = None) -> Mixture:
    """New components of these weights, moments and marks. None: neither modes nor classes."""
    return Mixture(log_weights, means, covs, unmarked(len(log_weights)) if marks is None else marks)


def without_modes(mixture: Mixture) -> Mixture:
    """The components without their modes."""
    marks = mixture.marks.copy()
    marks[:, MODE] = NOT_DRAWN
    return mixture._replace(marks=marks)


def taken_components(mixture: Mixture, places: Ints | slice) -> Mixture:
    """The components at `places`, in that order."""
    return Mixture(*(column[places] for column in mixture))


def joined_components(mixtures: Sequence[Mixture]) -> Mixture:
    """The components of all mixtures, in their order."""
    return Mixture(*map(np.concatenate, zip(*mixtures, strict=True)))
