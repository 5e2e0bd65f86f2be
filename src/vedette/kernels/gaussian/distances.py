"""Distances between Gaussians of two lists, of those pairs that are near each other."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vedette.kernels.base.arrays import grown_ints
from vedette.kernels.base.compile import inlined, kernel
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.gaussian.linalg import cholesky, log_det_from_factor, solve_lower

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
    """Whether no axis by itself puts a pair out of the gate: d'S^-1 d is at least d_i^2 / S_ii."""
    for i in range(means.shape[1]):
        off = means[a, i] - other_means[b, i]
        if off * off > gate * (covs[a, i, i] + other_covs[b, i, i]):
            return False
    return True


@kernel
def _candidates(means: Floats, covs: Floats, other_means: Floats, other_covs: Floats, gate: float) -> Ints:
    """(num,) pairs that may be near, counted row by row."""
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


@kernel
def near_pairs(means: Floats, covs: Floats, other_means: Floats, other_covs: Floats, gate: float) -> NearPairs:
    """The pairs with d'S^-1 d up to `gate`; none whose S is not positive definite.

    means: (n, dim), covs: (n, dim, dim). other_means: (m, dim), other_covs: (m, dim, dim).
    """
    dim = means.shape[1]
    found = _candidates(means, covs, other_means, other_covs, _SLACK * gate)
    firsts, seconds = np.empty(len(found), np.int64), np.empty(len(found), np.int64)
    squares, log_dets, filled = np.empty(len(found)), np.empty(len(found)), 0
    total, factor, offset = np.empty((dim, dim)), np.empty((dim, dim)), np.empty(dim)
    for pair in found:
        a, b = pair // len(other_means), pair % len(other_means)
        for i in range(dim):
            offset[i] = means[a, i] - other_means[b, i]
            for j in range(dim):
                total[i, j] = covs[a, i, j] + other_covs[b, i, j]
        if not cholesky(total, factor):
            continue
        solve_lower(factor, offset, offset)
        squared = 0.0
        for i in range(dim):
            squared += offset[i] * offset[i]
        if squared <= gate:
            firsts[filled], seconds[filled] = a, b
            squares[filled], log_dets[filled] = squared, log_det_from_factor(factor)
            filled += 1
    return NearPairs(firsts[:filled], seconds[:filled], squares[:filled], log_dets[:filled])


__all__ = ["NearPairs", "near_pairs"]
