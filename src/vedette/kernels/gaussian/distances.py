"""Distances between Gaussians, all pairs of two lists."""

from __future__ import annotations

import numpy as np

from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Floats
from vedette.kernels.gaussian.linalg import cholesky, log_det_from_factor, solve_lower


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


__all__ = ["pair_distances"]
