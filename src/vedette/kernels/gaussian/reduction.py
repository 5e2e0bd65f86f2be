"""Gaussian mixtures and intensities with fewer components: pruning, merging and capping."""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Ints, Mixture
from vedette.kernels.gaussian.components import (
    components_between,
    components_like,
    copy_component,
    merge_all,
    merge_components,
    own_components,
)
from vedette.kernels.gaussian.linalg import cholesky, log_det_from_factor, log_sum, solve_lower
from vedette.kernels.gaussian.marks import has_room, may_merge
from vedette.kernels.gaussian.mixtures import sort_descending

# Twice the Kullback-Leibler divergence up to which components of an intensity are merged, and the factor by which this
# grows until few enough are left.
_REACH, _GROWTH = 0.1, 3.0
_LIGHTEST = 1e-9  # share of the intensity below which a component is dropped, and its number shared out


class MixtureCaps(NamedTuple):
    """Limits of mixture reduction."""

    log_min_weight: float  # components below this, relative to the mixture's total weight, are dropped
    merge_distance: float  # Mahalanobis distance within which components are merged; 0 merges none
    max_components: int  # kept of each mode; 1 is one Gaussian of the moments of all components, the light ones too


@inlined
def most_kept(num: int, caps: MixtureCaps) -> int:
    """Return the largest number of `num` components that the caps, which count for each mode, may leave."""
    return num if caps.max_components > 1 else min(num, 1)


class ReductionWork(NamedTuple):
    """Work arrays of the reduction of mixtures of up to num components."""

    left: Floats  # (num,) log weights of the components that are still in play
    order: Ints  # (num,)
    buffer: Ints  # (num,) to sort in
    near: Ints  # (num,)
    weights: Floats  # (num,)
    merged: Mixture  # of num components
    factor: Floats  # (state_dim, state_dim)
    other_factor: Floats  # (state_dim, state_dim)
    difference: Floats  # (state_dim,)


@kernel
def make_reduction_work(num: int, like: Mixture) -> ReductionWork:
    """Work arrays for mixtures of up to `num` components. like: components with the same columns."""
    state_dim = like.means.shape[1]
    return ReductionWork(
        np.empty(num),
        np.empty(num, np.int64),
        np.empty(num, np.int64),
        np.empty(num, np.int64),
        np.empty(num),
        components_like(like, num),
        np.empty((state_dim, state_dim)),
        np.empty((state_dim, state_dim)),
        np.empty(state_dim),
    )


@inlined
def _shape_divergence(n: int, factor: Floats, cov: Floats, other_factor: Floats, column: Floats) -> float:
    """Twice the Kullback-Leibler divergence of N(m, cov) from N(m, L L'), or inf if `cov` is not positive definite.

    factor: L. other_factor: (n, n) and column: (n,) to work in.
    """
    if not cholesky(cov, other_factor):
        return math.inf
    trace = 0.0
    for j in range(n):
        for i in range(n):
            column[i] = other_factor[i, j] if i >= j else 0.0
        solve_lower(factor, column, column)
        for i in range(j, n):
            trace += column[i] * column[i]
    return trace - n - log_det_from_factor(other_factor) + log_det_from_factor(factor)


@borrowing
def _near(heaviest: int, wide: Mixture, width: int, reach: float, of_shapes: bool, work: ReductionWork) -> int:
    """Components (-> work.near, `heaviest` first) in play that are similar to `heaviest`, and their number."""
    means, covs, near = wide.means, wide.covs, work.near
    factor, difference, n = work.factor, work.difference, wide.means.shape[1]
    near[0] = heaviest
    count = 1
    # Distances are measured under the heaviest component's covariance, as its neighbours are to fit into it.
    if not reach > 0.0 or not cholesky(covs[heaviest], factor):
        return count
    for c in range(width):
        if c == heaviest or work.left[c] == -math.inf or not may_merge(wide.marks, heaviest, c):
            continue
        squared = 0.0
        for i in range(n):  # as `solve_lower`, until the distance is known to be too great
            total = means[c, i] - means[heaviest, i]
            for k in range(i):
                total -= factor[i, k] * difference[k]
            difference[i] = total / factor[i, i]
            squared += difference[i] * difference[i]
            if squared >= reach:
                break
        if squared < reach and of_shapes:
            squared += _shape_divergence(n, factor, covs[c], work.other_factor, difference)
        if squared < reach:
            near[count] = c
            count += 1
    return count


@borrowing
def _merge(wide: Mixture, width: int, log_floor: float, reach: float, of_shapes: bool, work: ReductionWork) -> int:
    """Greedy merging (-> work.merged) of similar components, heaviest first. Returns how many there are then.

    Those below `log_floor` are left out, except the heaviest. Components merge whose squared Mahalanobis distance is
    below `reach`, or, of shapes, twice their Kullback-Leibler divergence: the distance and the difference of the
    covariances.
    """
    log_weights, left, order, merged = wide.log_weights, work.left, work.order, 0
    sort_descending(log_weights, width, order, work.buffer)
    for c in range(width):
        left[c] = log_weights[c] if c == order[0] or log_weights[c] >= log_floor else -math.inf
    for i in range(width):
        heaviest = order[i]
        if left[heaviest] == -math.inf:
            continue
        count = _near(heaviest, wide, width, reach, of_shapes, work)
        total = 0.0
        for k in range(count):
            work.weights[k] = math.exp(left[work.near[k]] - log_weights[heaviest])
            total += work.weights[k]
            left[work.near[k]] = -math.inf
        out = work.merged
        merge_components(wide, work.near, work.weights, count, out, merged)
        out.log_weights[merged] = log_weights[heaviest] + math.log(total)
        merged += 1
    return merged


@borrowing
def reduce_into(wide: Mixture, width: int, caps: MixtureCaps, work: ReductionWork, out: Mixture, filled: int) -> int:
    """Append the first `width` components within the caps, heaviest first, total weight kept. Return the new end.

    Light components are dropped. Then, greedily from the heaviest, all components within the merging distance of it
    (under its covariance) are merged by moment matching. Then the heaviest of each mode stay.
    """
    total = log_sum(wide.log_weights[:width])
    if caps.max_components == 1 or width <= 1 or total == -math.inf:
        if width == 0:
            return filled
        merge_all(wide, width, work.near, work.weights, total, out, filled)
        return filled + 1
    reach = caps.merge_distance * caps.merge_distance
    num_merged = _merge(wide, width, total + caps.log_min_weight, reach, False, work)
    sort_descending(work.merged.log_weights, num_merged, work.order, work.buffer)
    kept = 0
    for k in range(num_merged):
        if has_room(work.merged.marks, work.order, k, caps.max_components):
            copy_component(work.merged, work.order[k], out, filled + kept)
            kept += 1
    # What was dropped is shared out, so that reducing does not lose a target.
    shift = total - log_sum(out.log_weights[filled : filled + kept])
    for k in range(kept):
        out.log_weights[filled + k] += shift
    return filled + kept


@kernel
def reduce_mixture(mixture: Mixture, caps: MixtureCaps) -> Mixture:
    """The reduced mixture, see `reduce_into`, in new arrays."""
    num = len(mixture.log_weights)
    out = components_like(mixture, most_kept(num, caps))
    last = reduce_into(mixture, num, caps, make_reduction_work(num, mixture), out, 0)
    return components_between(out, 0, last)


@kernel
def _merged(mixture: Mixture, reach: float) -> Mixture:
    work = make_reduction_work(len(mixture.log_weights), mixture)
    return own_components(work.merged, _merge(mixture, len(mixture.log_weights), -math.inf, reach, True, work))


@kernel
def reduce_intensity(intensity: Mixture, max_components: int) -> Mixture:
    """The intensity in at most `max_components` components of the same total weight.

    Similar components are merged, and where there are still too many, less and less similar ones. Components lighter
    than a billionth of the intensity are dropped.
    """
    found, reach = _merged(intensity, _REACH), _REACH
    while len(found.log_weights) > max_components:
        reach *= _GROWTH
        found = _merged(found, reach)
    return reduce_mixture(found, MixtureCaps(math.log(_LIGHTEST), 0.0, len(found.log_weights)))
