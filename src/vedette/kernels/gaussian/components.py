"""Components of Gaussian mixtures with all their columns: made, copied, viewed, taken, joined and merged.

Code that changes the weight or the moments of a component copies it first, so that its other columns come along.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Ints, Mixture
from vedette.kernels.gaussian.mixtures import match_all, match_components


@kernel
def make_components(num: int, state_dim: int) -> Mixture:
    """Room for this number of components."""
    return Mixture(np.empty(num), np.empty((num, state_dim)), np.empty((num, state_dim, state_dim)))


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
    """Copy component `source` to place `target`."""
    out.log_weights[target] = mixture.log_weights[source]
    copy_gaussian(mixture.means, mixture.covs, source, out.means, out.covs, target)


@inlined
def copy_components(mixture: Mixture, first: int, last: int, out: Mixture, start: int) -> int:
    """Copy components `first:last` to the places from `start` on; the end of what is filled."""
    for c in range(first, last):
        copy_component(mixture, c, out, start + c - first)
    return start + last - first


def _between(mixture: Mixture, first: int, last: int) -> Mixture:
    """Components `first:last`, as views."""
    return Mixture(mixture.log_weights[first:last], mixture.means[first:last], mixture.covs[first:last])


components_between = kernel(_between)
borrowed_components = inlined(_between)  # for kernels that only borrow arrays


@kernel
def own_components(mixture: Mixture, num: int) -> Mixture:
    """The first `num` components in arrays of their own."""
    return Mixture(mixture.log_weights[:num].copy(), mixture.means[:num].copy(), mixture.covs[:num].copy())


@kernel
def grown_components(mixture: Mixture, filled: int, needed: int) -> Mixture:
    """The first `filled` components with room for at least `needed`; the same bundle where there is room already."""
    room = len(mixture.log_weights)
    if needed <= room:
        return mixture
    longer = make_components(max(needed, 2 * room), mixture.means.shape[1])
    copy_components(mixture, 0, filled, longer, 0)
    return longer


@kernel
def stacked_mixtures(first: Mixture, second: Mixture) -> Mixture:
    """The components of both, in their order."""
    num, more = len(first.log_weights), len(second.log_weights)
    out = make_components(num + more, first.means.shape[1])
    copy_components(first, 0, num, out, 0)
    copy_components(second, 0, more, out, num)
    return out


@inlined
def merge_components(mixture: Mixture, chosen: Ints, weights: Floats, count: int, out: Mixture, target: int) -> None:
    """Write the moments of the first `count` of `chosen` as one component, see `match_components`; not its weight."""
    match_components(chosen, weights, count, mixture.means, mixture.covs, out.means[target], out.covs[target])


@borrowing
def merge_all(
    mixture: Mixture, count: int, components: Ints, weights: Floats, log_weight: float, out: Mixture, target: int
) -> None:
    """Write the moments of the first `count` components as one of the given weight. components, weights: work."""
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


# From Python, on arrays of the library's own.


def components_of(log_weights: Floats, means: Floats, covs: Floats) -> Mixture:
    """New components of these weights and moments."""
    return Mixture(log_weights, means, covs)


def taken_components(mixture: Mixture, places: Ints) -> Mixture:
    """The components at `places`, in that order."""
    return Mixture(*(column[places] for column in mixture))


def joined_components(mixtures: Sequence[Mixture]) -> Mixture:
    """The components of all mixtures, in their order."""
    return Mixture(*map(np.concatenate, zip(*mixtures, strict=True)))
