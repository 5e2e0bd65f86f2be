"""Distances between Gaussians, and of mixtures of them."""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.base.arrays import grown_ints
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Ints, Mixture
from vedette.kernels.gaussian.linalg import cholesky, log_det_from_factor, log_sum, solve_lower
from vedette.kernels.gaussian.marks import mode_of
from vedette.kernels.gaussian.reduction import ReductionWork

_SLACK = 1.0 + 1e-9  # for what rounding does to a distance


class NearPairs(NamedTuple):
    """The pairs of two lists of Gaussians within a gate, in the order of the first list, then of the second."""

    firsts: Ints  # (num,) place in the first list
    seconds: Ints  # (num,) place in the second
    squares: Floats  # (num,) d'S^-1 d, where S = P_a + P_b
    log_dets: Floats  # (num,) log det S


@inlined
def _may_be_near(
    means: Floats, covs: Floats, a: int, other_means: Floats, other_covs: Floats, b: int, gate: float
) -> bool:
    """Return True if no single axis puts a pair outside the gate: d'S^-1 d is at least d_i^2 / S_ii."""
    for i in range(means.shape[1]):
        off = means[a, i] - other_means[b, i]
        if off * off > gate * (covs[a, i, i] + other_covs[b, i, i]):
            return False
    return True


@borrowing
def l1_bound(mean: Floats, cov: Floats, other_mean: Floats, other_cov: Floats, factor: Floats, offset: Floats) -> float:
    """Upper bound on the L1 distance of two Gaussians.

    It is 2 sqrt(1 - b^2), with their Bhattacharyya coefficient:

        b = (det P_a det P_b)^(1/4) / det((P_a + P_b) / 2)^(1/2) exp(-d' (P_a + P_b)^-1 d / 4).

    At most 2, which stands for covariances that are not positive definite. factor: (dim, dim) and offset: (dim,) to
    work in.
    """
    dim, log_coefficient = len(mean), 0.0
    if not cholesky(cov, factor):
        return 2.0
    log_coefficient += 0.25 * log_det_from_factor(factor)
    if not cholesky(other_cov, factor):
        return 2.0
    log_coefficient += 0.25 * log_det_from_factor(factor)
    for i in range(dim):
        offset[i] = mean[i] - other_mean[i]
        for j in range(i + 1):
            factor[i, j] = 0.5 * (cov[i, j] + other_cov[i, j])
    if not cholesky(factor, factor):
        return 2.0
    log_coefficient -= 0.5 * log_det_from_factor(factor)
    solve_lower(factor, offset, offset)
    for i in range(dim):
        log_coefficient -= 0.125 * offset[i] * offset[i]
    return 2.0 * math.sqrt(max(0.0, -math.expm1(2.0 * log_coefficient)))


@kernel
def _candidates(means: Floats, covs: Floats, other_means: Floats, other_covs: Floats, gate: float) -> Ints:
    """Return the number of pairs (num,) that may be near, row by row."""
    num, filled = len(other_means), 0
    found = np.empty(4 * len(means), np.int64)
    for a in range(len(means)):
        if filled + num > len(found):
            found = grown_ints(found, filled + num)
        for b in range(num):
            if _may_be_near(means, covs, a, other_means, other_covs, b, gate):
                found[filled] = a * num + b
                filled += 1
    return found[:filled]


@borrowing
def _distance(
    mean: Floats, cov: Floats, other_mean: Floats, other_cov: Floats, total: Floats, factor: Floats, offset: Floats
) -> tuple[float, float]:
    """Return d'S^-1 d and log det S, infinite if S is not positive definite. The last three are working arrays."""
    for i in range(len(mean)):
        offset[i] = mean[i] - other_mean[i]
        for j in range(len(mean)):
            total[i, j] = cov[i, j] + other_cov[i, j]
    if not cholesky(total, factor):
        return math.inf, math.inf
    solve_lower(factor, offset, offset)
    squared = 0.0
    for i in range(len(mean)):
        squared += offset[i] * offset[i]
    return squared, log_det_from_factor(factor)


@borrowing
def reduction_bound(
    mixture: Mixture, width: int, reduced: Mixture, first: int, last: int, work: ReductionWork
) -> float:
    """Upper bound on the L1 distance of the first `width` components, of any scale, from `reduced[first:last]`.

    Each component counts for the nearest of the reduced ones of its mode: with weights w_c, v_k and k(c) it is

        sum_c w_c |N_c - M_k(c)| + sum_k |v_k - sum of the w_c with k(c) = k|.
    """
    num, total, left = last - first, log_sum(mixture.log_weights[:width]), work.weights
    if num == width or total == -math.inf:
        return 0.0  # nothing was dropped or merged
    error = 0.0
    for k in range(num):
        left[k] = math.exp(reduced.log_weights[first + k])
    for c in range(width):
        weight, nearest, least = math.exp(mixture.log_weights[c] - total), 0, math.inf
        if weight == 0.0:
            continue
        for k in range(num):
            if mode_of(mixture.marks, c) != mode_of(reduced.marks, first + k):
                continue
            mean, cov = reduced.means[first + k], reduced.covs[first + k]
            apart = l1_bound(mixture.means[c], mixture.covs[c], mean, cov, work.factor, work.difference)
            if apart < least:
                nearest, least = k, apart
        if least == math.inf:  # none of its mode is left
            error += weight
            continue
        left[nearest] -= weight
        error += weight * least
    for k in range(num):
        error += abs(left[k])
    return min(error, 2.0)


@kernel
def pair_distances(means: Floats, covs: Floats, other_means: Floats, other_covs: Floats) -> tuple[Floats, Floats]:
    """(n, m) squared distances d'S^-1 d of two lists of Gaussians, and log det S, where S = P_a + P_b.

    means: (n, dim), covs: (n, dim, dim). other_means: (m, dim), other_covs: (m, dim, dim). Infinite where S is not
    positive definite.
    """
    n, m, dim = len(means), len(other_means), means.shape[1]
    squares, log_dets = np.empty((n, m)), np.empty((n, m))
    total, factor, offset = np.empty((dim, dim)), np.empty((dim, dim)), np.empty(dim)
    for a in range(n):
        for b in range(m):
            squares[a, b], log_dets[a, b] = _distance(
                means[a], covs[a], other_means[b], other_covs[b], total, factor, offset
            )
    return squares, log_dets


@kernel
def near_pairs(means: Floats, covs: Floats, other_means: Floats, other_covs: Floats, gate: float) -> NearPairs:
    """Return the pairs with d'S^-1 d up to `gate` and a positive definite S.

    means: (n, dim), covs: (n, dim, dim). other_means: (m, dim), other_covs: (m, dim, dim).
    """
    dim = means.shape[1]
    found = _candidates(means, covs, other_means, other_covs, _SLACK * gate)
    firsts, seconds = np.empty(len(found), np.int64), np.empty(len(found), np.int64)
    squares, log_dets, filled = np.empty(len(found)), np.empty(len(found)), 0
    total, factor, offset = np.empty((dim, dim)), np.empty((dim, dim)), np.empty(dim)
    for pair in found:
        a, b = pair // len(other_means), pair % len(other_means)
        squared, log_det = _distance(means[a], covs[a], other_means[b], other_covs[b], total, factor, offset)
        if squared <= gate and squared < math.inf:
            firsts[filled], seconds[filled] = a, b
            squares[filled], log_dets[filled] = squared, log_det
            filled += 1
    return NearPairs(firsts[:filled], seconds[:filled], squares[:filled], log_dets[:filled])
