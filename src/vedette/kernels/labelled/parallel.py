"""Parallel update of single-Gaussian tracks: p+ prod_s (p_s / p+)^(v_s), from posteriors of one common prediction p+.

Everything is done in the coordinates u = C^-1 (x - m+) in which the prediction N(m+, C C') is the standard normal.
There a posterior N(m_s, P_s) has information I + A_s, A_s = C' (P_s^-1 - P+^-1) C, and mean z_s = C^-1 (m_s - m+), and

    log (p_s / p+)(u) = ln|I + A_s| / 2 - u'A_s u / 2 + eta_s'u - eta_s'z_s / 2,    eta_s = (I + A_s) z_s.

A posterior that is the prediction has A_s = 0 and z_s = 0 to the last bit, since L^-1 L and L^-1 0 come out exact.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vedette.kernels.base.compile import borrowing, kernel
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.gaussian.eigen import clip_negative
from vedette.kernels.gaussian.linalg import cholesky, log_det_from_factor, solve_lower, solve_upper
from vedette.kernels.gaussian.mixtures import require_gaussians


class _Work(NamedTuple):
    """Working arrays of one label."""

    root: Floats  # (dim, dim) C
    factor: Floats  # (dim, dim) of what is factored just now
    whitened: Floats  # (dim, dim) L_s^-1 C
    gain: Floats  # (dim, dim) A_s
    rotated: Floats  # (dim, dim)
    vectors: Floats  # (dim, dim)
    offset: Floats  # (dim,) z_s
    pull: Floats  # (dim,) eta_s
    information: Floats  # (dim, dim) I + sum_s v_s A_s
    total_pull: Floats  # (dim,) sum_s v_s eta_s


@kernel
def _make_work(dim: int) -> _Work:
    square = (dim, dim)
    return _Work(
        np.empty(square),
        np.empty(square),
        np.empty(square),
        np.empty(square),
        np.empty(square),
        np.empty(square),
        np.empty(dim),
        np.empty(dim),
        np.empty(square),
        np.empty(dim),
    )


@borrowing
def _gain(cov: Floats, work: _Work) -> bool:
    """A_s of a posterior of this covariance, its negative eigenvalues clipped at 0. False where it is not definite."""
    n = len(cov)
    if not cholesky(cov, work.factor):
        return False
    for j in range(n):
        for i in range(j, n):
            total = work.root[i, j]
            for k in range(j, i):
                total -= work.factor[i, k] * work.whitened[k, j]
            work.whitened[i, j] = total / work.factor[i, i]
    for i in range(n):
        for j in range(i + 1):
            total = -1.0 if i == j else 0.0
            for k in range(i, n):
                total += work.whitened[k, i] * work.whitened[k, j]
            work.gain[i, j] = total
            work.gain[j, i] = total
    clip_negative(work.gain, work.rotated, work.vectors)
    return True


@borrowing
def _add(weight: float, mean: Floats, cov: Floats, predicted: Floats, work: _Work) -> tuple[bool, float]:
    """Add v_s A_s and v_s eta_s; whether the posterior is a Gaussian, and ln|I + A_s| / 2 - eta_s'z_s / 2."""
    n = len(mean)
    if not _gain(cov, work):
        return False, 0.0
    for i in range(n):
        work.offset[i] = mean[i] - predicted[i]
    solve_lower(work.root, work.offset, work.offset)
    quadratic = 0.0
    for i in range(n):
        work.pull[i] = work.offset[i]
        for j in range(n):
            work.pull[i] += work.gain[i, j] * work.offset[j]
        quadratic += work.pull[i] * work.offset[i]
        work.total_pull[i] += weight * work.pull[i]
    for i in range(n):
        for j in range(n):
            work.information[i, j] += weight * work.gain[i, j]
        work.gain[i, i] += 1.0
    if not cholesky(work.gain, work.factor):
        return False, 0.0
    return True, 0.5 * (log_det_from_factor(work.factor) - quadratic)


@borrowing
def _solve(predicted: Floats, work: _Work, mean: Floats, cov: Floats) -> tuple[bool, float]:
    """m+ + C A^-1 eta and C A^-1 C'; whether A is definite, and eta'A^-1 eta / 2 - ln|A| / 2."""
    n = len(mean)
    if not cholesky(work.information, work.factor):
        return False, 0.0
    solve_lower(work.factor, work.total_pull, work.offset)
    quadratic = 0.0
    for i in range(n):
        quadratic += work.offset[i] * work.offset[i]
    solve_upper(work.factor, work.offset, work.offset)
    for i in range(n):
        mean[i] = predicted[i]
        for k in range(i + 1):
            mean[i] += work.root[i, k] * work.offset[k]
        # Row i of (F^-1 C')', where A = F F'.
        for k in range(n):
            total = work.root[i, k] if k <= i else 0.0
            for m in range(k):
                total -= work.factor[k, m] * work.whitened[i, m]
            work.whitened[i, k] = total / work.factor[k, k]
    for i in range(n):
        for j in range(i + 1):
            total = 0.0
            for k in range(n):
                total += work.whitened[i, k] * work.whitened[j, k]
            cov[i, j] = total
            cov[j, i] = total
    return True, 0.5 * (quadratic - log_det_from_factor(work.factor))


@kernel
def update_in_parallel(
    means: Floats, covs: Floats, chosen: Ints, weights: Floats, own_means: Floats, own_covs: Floats
) -> tuple[Floats, Floats, Floats]:
    """Fused mean, covariance and log of the integral of p+ prod_s (p_s / p+)^(v_s) of each label.

    means: (num, dim), covs: (num, dim, dim) of the prediction. chosen: (num, S) the sensors' posteriors in `own_means`
    and `own_covs`, -1 for one that has nothing to say. weights: (S,) the exponents v_s, non-negative. A label of which
    nobody says anything keeps its prediction as it is.

    Raises FloatingPointError where a covariance is not positive definite, NumericalError where a fused one is not.
    """
    num, dim = means.shape
    out_means, out_covs, log_integrals = means.copy(), covs.copy(), np.zeros(num)
    work = _make_work(dim)
    for item in range(num):
        if not cholesky(covs[item], work.root):
            raise FloatingPointError("covariance of a predicted track is not positive definite")
        for i in range(dim):
            work.total_pull[i] = 0.0
            for j in range(dim):
                work.information[i, j] = 1.0 if i == j else 0.0
        for s in range(len(weights)):
            track = chosen[item, s]
            if track < 0 or weights[s] == 0.0:
                continue
            positive, gained = _add(weights[s], own_means[track], own_covs[track], means[item], work)
            if not positive:
                raise FloatingPointError("covariance of a track is not positive definite")
            log_integrals[item] += weights[s] * gained
        if _is_standard(work.information, work.total_pull):
            continue
        positive, gained = _solve(means[item], work, out_means[item], out_covs[item])
        if not positive:
            raise FloatingPointError("the product of the track densities of a label is not integrable")
        log_integrals[item] += gained
    require_gaussians(out_means, out_covs)
    return out_means, out_covs, log_integrals


@borrowing
def _is_standard(information: Floats, pull: Floats) -> bool:
    """Whether this is the standard normal: nothing was added to the prediction."""
    for i in range(len(pull)):
        if pull[i] != 0.0:
            return False
        for j in range(len(pull)):
            if information[i, j] != (1.0 if i == j else 0.0):
                return False
    return True


__all__ = ["update_in_parallel"]
