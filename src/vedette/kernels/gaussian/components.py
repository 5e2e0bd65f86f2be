"""Components of Gaussian mixtures with all their columns: made, copied, viewed, taken, joined and merged.

Code that changes the weight or the moments of a component copies it first, so that its other columns come along.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Ints, Mixture
from vedette.kernels.gaussian.classes import merge_classes
from vedette.kernels.gaussian.mixtures import match_all, match_components


@kernel
def make_components(num: int, state_dim: int, num_classes: int) -> Mixture:
    """Room for this number of components."""
    return Mixture(
        np.empty(num), np.empty((num, state_dim)), np.empty((num, state_dim, state_dim)), np.empty((num, num_classes))
    )


@kernel
def components_like(mixture: Mixture, num: int) -> Mixture:
    """Room for this number of components, with states and classes as in `mixture`."""
    return make_components(num, mixture.means.shape[1], mixture.log_class_probs.shape[1])


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
    """Copy component `source` to place `target`; without its classes where `out` has none."""
    out.log_weights[target] = mixture.log_weights[source]
    copy_gaussian(mixture.means, mixture.covs, source, out.means, out.covs, target)
    for k in range(out.log_class_probs.shape[1]):
        out.log_class_probs[target, k] = mixture.log_class_probs[source, k]


@inlined
def copy_components(mixture: Mixture, first: int, last: int, out: Mixture, start: int) -> int:
    """Copy components `first:last` to the places from `start` on; the end of what is filled."""
    for c in range(first, last):
        copy_component(mixture, c, out, start + c - first)
    return start + last - first


def _between(mixture: Mixture, first: int, last: int) -> Mixture:
    """Components `first:last`, as views."""
    return Mixture(
        mixture.log_weights[first:last],
        mixture.means[first:last],
        mixture.covs[first:last],
        mixture.log_class_probs[first:last],
    )


components_between = kernel(_between)
borrowed_components = inlined(_between)  # for kernels that only borrow arrays


@kernel
def own_components(mixture: Mixture, num: int) -> Mixture:
    """The first `num` components in arrays of their own."""
    classes = mixture.log_class_probs[:num]
    if classes.shape[1] > 0:  # an empty array costs as much to copy as one of numbers
        classes = classes.copy()
    return Mixture(mixture.log_weights[:num].copy(), mixture.means[:num].copy(), mixture.covs[:num].copy(), classes)


@kernel
def grown_components(mixture: Mixture, filled: int, needed: int) -> Mixture:
    """The first `filled` components with room for at least `needed`; the same bundle where there is room already."""
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
    """Write the moments and mean class probabilities of the first `count` of `chosen` as one component.

    See `match_components`; its weight is not written.
    """
    match_components(chosen, weights, count, mixture.means, mixture.covs, out.means[target], out.covs[target])
    if out.log_class_probs.shape[1] > 0:
        merge_classes(mixture.log_class_probs, chosen, weights, count, out.log_class_probs[target])


@borrowing
def merge_all(
    mixture: Mixture, count: int, components: Ints, weights: Floats, log_weight: float, out: Mixture, target: int
) -> None:
    """Write the first `count` components merged into one of the given weight. components, weights: work."""
    out.log_weights[target] = log_weight
    match_all(
        mixture.log_weights,
        mixture.means,
        mixture.covs,
        count,
        components,
        weights,
        out.means[target],
        out.covs[target],
    )
    if out.log_class_probs.shape[1] > 0:
        merge_classes(mixture.log_class_probs, components, weights, count, out.log_class_probs[target])


# From Python, on arrays of the library's own.


def components_of(log_weights: Floats, means: Floats, covs: Floats, log_class_probs: Floats | None = None) -> Mixture:
    """New components of these weights, moments and class probabilities; None: without classes."""
    classes = np.empty((len(log_weights), 0)) if log_class_probs is None else log_class_probs
    return Mixture(log_weights, means, covs, classes)


def without_classes(mixture: Mixture) -> Mixture:
    """The same components, of unknown class."""
    return components_of(mixture.log_weights, mixture.means, mixture.covs)


def taken_components(mixture: Mixture, places: Ints) -> Mixture:
    """The components at `places`, in that order."""
    return Mixture(*(column[places] for column in mixture))


def joined_components(mixtures: Sequence[Mixture]) -> Mixture:
    """The components of all mixtures, in their order."""
    return Mixture(*map(np.concatenate, zip(*mixtures, strict=True)))
