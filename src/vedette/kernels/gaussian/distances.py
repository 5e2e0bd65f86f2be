"""Distances between Gaussians."""

from __future__ import annotations

import math

import numpy as np

from vedette.kernels.base.compile import borrowing, kernel
from vedette.kernels.base.types import Floats
from vedette.kernels.gaussian.linalg import cholesky, log_det_from_factor, solve_lower


@borrowing
def l1_bound(mean: Floats, cov: Floats, other_mean: Floats, other_cov: Floats, factor: Floats, offset: Floats) -> float:
    """Upper bound on the L1 distance of two Gaussians: 2 sqrt(1 - b^2), b their Bhattacharyya coefficient

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
def pair_distances(means: Floats, covs: Floats, other_means: Floats, other_covs: Floats) -> tuple[Floats, Floats]:
    """(n, m) squared distances d'S^-1 d of two lists of Gaussians, and log det S, where S = P_a + P_b.

    means: (n, dim), covs: (n, dim, dim). other_means: (m, dim), other_covs: (m, dim, dim). Infinite where S is not
    positive definite.
    """
    n, m, dim = len(means), len(other_means), means.shape[1]
    squares, log_dets = np.full((n, m), np.inf), np.full((n, m), np.inf)
    total, factor, offset = np.empty((dim, dim)), np.empty((dim, dim)), np.empty(dim)
    for a in range(n):
        for b in range(m):
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
            squares[a, b] = squared
            log_dets[a, b] = log_det_from_factor(factor)
    return squares, log_dets


__all__ = ["l1_bound", "pair_distances"]
