"""Parallel update of tracks: p+ prod_s (p_s / p+)^(v_s), from posteriors p_s of one common Gaussian prediction p+.

All computations use the coordinates u = C^-1 (x - m+) in which the prediction N(m+, C C') is the standard normal.
There a posterior N(m_s, P_s) has information I + A_s, A_s = C' (P_s^-1 - P+^-1) C, and mean z_s = C^-1 (m_s - m+), and

    log (p_s / p+)(u) = ln|I + A_s| / 2 - u'A_s u / 2 + eta_s'u - eta_s'z_s / 2,    eta_s = (I + A_s) z_s.

A posterior that is the prediction has A_s = 0 and z_s = 0 to the last bit, since L^-1 L and L^-1 0 are exact.

A posterior that is a mixture contributes a sum of such terms, one per component. The product is then a mixture of one
component for each choice of a component at every sensor, of which the likeliest are followed.
"""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.base.compile import borrowing, kernel
from vedette.kernels.base.types import Floats, Ints, Tracks
from vedette.kernels.gaussian.eigen import clip_negative
from vedette.kernels.gaussian.linalg import cholesky, log_det_from_factor, log_sum, solve_lower, solve_upper
from vedette.kernels.gaussian.mixtures import descending_order, moment_match, require_gaussians

# Choices lighter than this share of the likeliest are dropped.
_LOG_LEAST = math.log(1e-6)


class _Work(NamedTuple):
    """Working arrays of one label."""

    root: Floats  # (dim, dim) C
    factor: Floats  # (dim, dim) of the current factorisation
    whitened: Floats  # (dim, dim) L_s^-1 C
    rotated: Floats  # (dim, dim)
    vectors: Floats  # (dim, dim)
    offset: Floats  # (dim,) z_s


class _GaussianFactors(NamedTuple):
    """Factors exp(log_weight - u'A u / 2 + eta'u) of the standard normal: of a sensor's components, or of choices."""

    gains: Floats  # (room, dim, dim) A
    pulls: Floats  # (room, dim) eta
    log_weights: Floats  # (room,)


@kernel
def _make_work(dim: int) -> _Work:
    square = (dim, dim)
    return _Work(
        np.empty(square), np.empty(square), np.empty(square), np.empty(square), np.empty(square), np.empty(dim)
    )


@kernel
def _make_factors(room: int, dim: int) -> _GaussianFactors:
    return _GaussianFactors(np.empty((room, dim, dim)), np.empty((room, dim)), np.empty(room))


@borrowing
def _gain(cov: Floats, work: _Work, gain: Floats) -> bool:
    """Write A_s (-> gain) of a component of this covariance, negative eigenvalues clipped at 0.

    True if it is definite.
    """
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
            gain[i, j] = total
            gain[j, i] = total
    clip_negative(gain, work.rotated, work.vectors)
    return True


@borrowing
def _factor_of_posterior(
    item: int, mean: Floats, cov: Floats, predicted: Floats, work: _Work, factors: _GaussianFactors
) -> bool:
    """Write the factor of a posterior's component, and its normaliser, in place `item`.

    Return True if it is a Gaussian.
    """
    n, gain, pull = len(mean), factors.gains[item], factors.pulls[item]
    if not _gain(cov, work, gain):
        return False
    for i in range(n):
        work.offset[i] = mean[i] - predicted[i]
    solve_lower(work.root, work.offset, work.offset)
    quadratic = 0.0
    for i in range(n):
        pull[i] = work.offset[i]
        for j in range(n):
            pull[i] += gain[i, j] * work.offset[j]
            work.whitened[i, j] = gain[i, j] + (1.0 if i == j else 0.0)
        quadratic += pull[i] * work.offset[i]
    if not cholesky(work.whitened, work.factor):
        return False
    factors.log_weights[item] = 0.5 * (log_det_from_factor(work.factor) - quadratic)
    return True


@borrowing
def _multiply(
    first: _GaussianFactors, a: int, second: _GaussianFactors, b: int, power: float, out: _GaussianFactors, item: int
) -> None:
    """Write the product of one factor and the power of another in place `item`."""
    n = first.pulls.shape[1]
    for i in range(n):
        out.pulls[item, i] = first.pulls[a, i] + power * second.pulls[b, i]
        for j in range(n):
            out.gains[item, i, j] = first.gains[a, i, j] + power * second.gains[b, i, j]
    out.log_weights[item] = first.log_weights[a] + power * second.log_weights[b]


@borrowing
def _copy(factors: _GaussianFactors, source: int, out: _GaussianFactors, item: int) -> None:
    n = factors.pulls.shape[1]
    for i in range(n):
        out.pulls[item, i] = factors.pulls[source, i]
        for j in range(n):
            out.gains[item, i, j] = factors.gains[source, i, j]
    out.log_weights[item] = factors.log_weights[source]


@borrowing
def _weigh(item: int, factors: _GaussianFactors, work: _Work) -> tuple[bool, float]:
    """Compute the factor of I + A (-> work) and F^-1 eta (-> work.offset).

    Return True if definite, and the log integral.
    """
    n = factors.pulls.shape[1]
    for i in range(n):
        for j in range(n):
            work.rotated[i, j] = factors.gains[item, i, j] + (1.0 if i == j else 0.0)
    if not cholesky(work.rotated, work.factor):
        return False, 0.0
    solve_lower(work.factor, factors.pulls[item], work.offset)
    quadratic = 0.0
    for i in range(n):
        quadratic += work.offset[i] * work.offset[i]
    return True, factors.log_weights[item] + 0.5 * (quadratic - log_det_from_factor(work.factor))


@borrowing
def _solve(
    item: int, predicted: Floats, factors: _GaussianFactors, work: _Work, mean: Floats, cov: Floats
) -> tuple[bool, float]:
    """Write m+ + C (I + A)^-1 eta and C (I + A)^-1 C'. Return True if that is definite, and the log of the integral."""
    n = len(mean)
    positive, log_integral = _weigh(item, factors, work)
    if not positive:
        return False, 0.0
    solve_upper(work.factor, work.offset, work.offset)
    for i in range(n):
        mean[i] = predicted[i]
        for k in range(i + 1):
            mean[i] += work.root[i, k] * work.offset[k]
        # Row i of (F^-1 C')', where I + A = F F'.
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
    return True, log_integral


@kernel
def _likeliest(num: int, factors: _GaussianFactors, work: _Work, most: int, out: _GaussianFactors) -> int:
    """Copy the likeliest `most` of the first `num` choices (-> out), with the weight of the others.

    Return their number.
    """
    weights = np.empty(num)
    for c in range(num):
        positive, weights[c] = _weigh(c, factors, work)
        if not positive:
            raise FloatingPointError("the product of the track densities of a label is not integrable")
    order, kept = descending_order(weights), 0
    while kept < min(num, most) and weights[order[kept]] >= weights[order[0]] + _LOG_LEAST:
        _copy(factors, order[kept], out, kept)
        kept += 1
    shift = log_sum(weights) - log_sum(weights[order[:kept]]) if kept < num else 0.0
    for c in range(kept):
        out.log_weights[c] += shift
    return kept


@kernel
def update_in_parallel(
    means: Floats, covs: Floats, chosen: Ints, weights: Floats, own: Tracks, max_choices: int
) -> tuple[Floats, Floats, Floats]:
    """Fused mean, covariance and log of the integral of p+ prod_s (p_s / p+)^(v_s) of each label.

    means: (num, dim), covs: (num, dim, dim) of the prediction. chosen: (num, S) the sensors' posteriors in `own`, -1
    for a sensor without information. weights: (S,) the exponents v_s, non-negative, for mixtures 1. max_choices:
    largest number of choices of one component per sensor that are followed. A label without information from any sensor
    keeps its prediction unchanged.

    Raises FloatingPointError if a covariance is not positive definite, NumericalError if a fused one is not.
    """
    num, dim, largest = len(means), means.shape[1], 1
    for track in range(len(own.labels)):
        largest = max(largest, own.offsets[track + 1] - own.offsets[track])
    out_means, out_covs, log_integrals = means.copy(), covs.copy(), np.zeros(num)
    work, factors, updated = _make_work(dim), _make_factors(largest, dim), own.components
    choices, longer = _make_factors(max_choices, dim), _make_factors(max_choices * largest, dim)
    for item in range(num):
        if not cholesky(covs[item], work.root):
            raise FloatingPointError("covariance of a predicted track is not positive definite")
        count = 1
        choices.gains[0], choices.pulls[0], choices.log_weights[0] = 0.0, 0.0, 0.0
        for s in range(len(weights)):
            track = chosen[item, s]
            if track < 0 or weights[s] == 0.0:
                continue
            first, size = own.offsets[track], own.offsets[track + 1] - own.offsets[track]
            for j in range(size):
                if not _factor_of_posterior(
                    j, updated.means[first + j], updated.covs[first + j], means[item], work, factors
                ):
                    raise FloatingPointError("covariance of a track is not positive definite")
                factors.log_weights[j] += updated.log_weights[first + j]
            for c in range(count):
                for j in range(size):
                    _multiply(choices, c, factors, j, weights[s], longer if size > 1 else choices, c * size + j)
            if size > 1:
                count = _likeliest(count * size, longer, work, max_choices, choices)
        if count > 1 or not _is_nothing(choices):
            log_integrals[item] = _merge(count, choices, means[item], work, out_means[item], out_covs[item])
    require_gaussians(out_means, out_covs)
    return out_means, out_covs, log_integrals


@kernel
def _merge(count: int, choices: _GaussianFactors, predicted: Floats, work: _Work, mean: Floats, cov: Floats) -> float:
    """Write the mean and covariance of the mixture of the choices, and return the log of its integral."""
    n = len(predicted)
    log_weights, means, covs = np.empty(count), np.empty((count, n)), np.empty((count, n, n))
    for c in range(count):
        positive, log_weights[c] = _solve(c, predicted, choices, work, means[c], covs[c])
        if not positive:
            raise FloatingPointError("the product of the track densities of a label is not integrable")
    moment_match(log_weights, means, covs, mean, cov)
    return log_sum(log_weights)


@borrowing
def _is_nothing(factors: _GaussianFactors) -> bool:
    """Return True if the first factor is 1, so that the prediction is unchanged."""
    n = factors.pulls.shape[1]
    for i in range(n):
        if factors.pulls[0, i] != 0.0:
            return False
        for j in range(n):
            if factors.gains[0, i, j] != 0.0:
                return False
    return True
