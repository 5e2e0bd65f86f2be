"""Gaussian mixtures with fewer components: pruning, merging and capping."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.base.compile import borrowing, kernel
from vedette.kernels.base.types import Floats, Ints, Mixture
from vedette.kernels.gaussian.components import (
    components_between,
    components_like,
    copy_component,
    merge_all,
    merge_components,
)
from vedette.kernels.gaussian.linalg import cholesky, log_sum
from vedette.kernels.gaussian.marks import may_merge
from vedette.kernels.gaussian.mixtures import sort_descending


class MixtureCaps(NamedTuple):
    """Limits of mixture reduction."""

    log_min_weight: float  # components below this, relative to the mixture's total weight, are dropped
    merge_distance: float  # Mahalanobis distance within which components are merged; 0 merges none
    max_components: int  # kept; 1 is one Gaussian of the moments of all components, the light ones too


class ReductionWork(NamedTuple):
    """Work arrays of `reduce_into`, for mixtures of up to num components."""

    left: Floats  # (num,) log weights of the components that are still in play
    order: Ints  # (num,)
    buffer: Ints  # (num,) to sort in
    near: Ints  # (num,)
    weights: Floats  # (num,)
    merged: Mixture  # of num components
    factor: Floats  # (state_dim, state_dim)
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
        np.empty(state_dim),
    )


@borrowing
def _near(heaviest: int, wide: Mixture, width: int, merge_distance: float, work: ReductionWork) -> int:
    """Components (-> work.near, `heaviest` first) in play within `merge_distance` of `heaviest`, and their number."""
    means, covs, near = wide.means, wide.covs, work.near
    factor, difference, n = work.factor, work.difference, wide.means.shape[1]
    near[0] = heaviest
    count, most = 1, merge_distance * merge_distance
    # Distances are measured under the heaviest component's covariance, as its neighbours are to fit into it.
    if not merge_distance > 0.0 or not cholesky(covs[heaviest], factor):
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
            if squared >= most:
                break
        if squared < most:
            near[count] = c
            count += 1
    return count


@borrowing
def _merge(wide: Mixture, width: int, log_floor: float, merge_distance: float, work: ReductionWork) -> int:
    """Greedy merging (-> work.merged), heaviest component first, of those of at least `log_floor` (the heaviest always
    stays). Returns how many there are then.
    """
    log_weights, left, order, merged = wide.log_weights, work.left, work.order, 0
    sort_descending(log_weights, width, order, work.buffer)
    for c in range(width):
        left[c] = log_weights[c] if c == order[0] or log_weights[c] >= log_floor else -math.inf
    for i in range(width):
        heaviest = order[i]
        if left[heaviest] == -math.inf:
            continue
        count = _near(heaviest, wide, width, merge_distance, work)
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
    (under its covariance) are merged by moment matching. Then the heaviest stay.
    """
    total = log_sum(wide.log_weights[:width])
    if caps.max_components == 1 or width <= 1 or total == -math.inf:
        if width == 0:
            return filled
        merge_all(wide, width, work.near, work.weights, total, out, filled)
        return filled + 1
    num_merged = _merge(wide, width, total + caps.log_min_weight, caps.merge_distance, work)
    sort_descending(work.merged.log_weights, num_merged, work.order, work.buffer)
    kept = min(num_merged, caps.max_components)
    for k in range(kept):
        copy_component(work.merged, work.order[k], out, filled + k)
    # What was dropped is shared out, so that reducing does not lose a target.
    shift = total - log_sum(out.log_weights[filled : filled + kept])
    for k in range(kept):
        out.log_weights[filled + k] += shift
    return filled + kept


@kernel
def reduce_mixture(mixture: Mixture, caps: MixtureCaps) -> Mixture:
    """The reduced mixture, see `reduce_into`, in new arrays."""
    num = len(mixture.log_weights)
    most = min(num, max(1, caps.max_components))
    out = components_like(mixture, most)
    last = reduce_into(mixture, num, caps, make_reduction_work(num, mixture), out, 0)
    return components_between(out, 0, last)
