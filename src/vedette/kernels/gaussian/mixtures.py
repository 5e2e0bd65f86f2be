"""Gaussian mixtures: their moments, the order of their weights, and whether their covariances are valid."""

import math

import numpy as np

from vedette.errors import NumericalError
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Ints

_RUN = 16  # values that are sorted by insertion before runs are merged


@inlined
def _is_definite(cov: Floats, factor: Floats, n: int) -> bool:
    """Return True if `cov` is positive definite beyond rounding, for any Cholesky factorisation.

    Its correlations are factored with a diagonal lessened by twice what n (n + 2) roundings may take from it.
    """
    least = 2.0 * n * (n + 2) * 2.0**-52
    for i in range(n):
        for j in range(i + 1):
            total = cov[i, j]
            for k in range(j):
                total -= factor[i, k] * factor[j, k]
            if i > j:
                factor[i, j] = total / factor[j, j]
                continue
            total -= least * cov[i, i]
            if not 0.0 < total < math.inf:
                return False
            factor[i, i] = math.sqrt(total)
    return True


@kernel
def require_gaussians(means: Floats, covs: Floats) -> None:
    """Raise `NumericalError` unless means are finite and covariances positive definite beyond their rounding."""
    num, n = means.shape
    factor = np.empty((n, n))
    for c in range(num):
        for i in range(n):
            if not math.isfinite(means[c, i]):
                raise NumericalError("mean of a track is not finite: the models or the scan lead beyond all numbers")
        # A constant size is unrolled by the compiler.
        definite = _is_definite(covs[c], factor, 4) if n == 4 else _is_definite(covs[c], factor, n)
        if not definite:
            raise NumericalError(
                "covariance of a track is not positive definite within the precision of a double: its axes differ by "
                "too many orders of magnitude (a long time step, far smaller noise, or targets far apart made one)"
            )


@kernel
def descending_order(values: Floats) -> Ints:
    """Indices that sort `values` from the largest down. Equal values keep their order. NaN is not allowed."""
    order = np.empty(len(values), np.int64)
    sort_descending(values, len(values), order, np.empty(len(values) if len(values) > _RUN else 0, np.int64))
    return order


@borrowing
def sort_descending(values: Floats, count: int, order: Ints, buffer: Ints) -> None:
    """Write the order of the first `count` values. buffer: as many places, or none for up to `_RUN` values."""
    for i in range(count):
        order[i] = i
    run = _RUN
    for low in range(0, count, run):
        for i in range(low + 1, min(low + run, count)):
            item, j = order[i], i
            while j > low and values[order[j - 1]] < values[item]:
                order[j] = order[j - 1]
                j -= 1
            order[j] = item
    while run < count:
        for i in range(count):
            buffer[i] = order[i]
        for low in range(0, count, 2 * run):
            _merge_runs(values, buffer, low, min(low + run, count), min(low + 2 * run, count), order)
        run *= 2


@borrowing
def _merge_runs(values: Floats, source: Ints, low: int, middle: int, high: int, out: Ints) -> None:
    i, j = low, middle
    for k in range(low, high):
        if j >= high or (i < middle and values[source[i]] >= values[source[j]]):
            out[k] = source[i]
            i += 1
        else:
            out[k] = source[j]
            j += 1


@borrowing
def match_components(
    components: Ints, weights: Floats, count: int, means: Floats, covs: Floats, out_mean: Floats, out_cov: Floats
) -> None:
    """Mean and covariance of the mixture of the first `count` of `components` (indices into `means` and `covs`).

    weights: (>= count,) linear, not necessarily normalised. Components count alike where all are zero.
    """
    n = means.shape[1]
    if count == 1:
        only = components[0]
        for i in range(n):
            out_mean[i] = means[only, i]
            for j in range(n):
                out_cov[i, j] = covs[only, i, j]
        return
    total = 0.0
    for c in range(count):
        total += weights[c]
    # Without any weight the plain mean: any density will do, as long as it is one.
    equal = 0.0 if total > 0.0 else 1.0
    scale = 1.0 / (total + equal * count)
    for i in range(n):
        first_moment = 0.0
        for c in range(count):
            first_moment += (weights[c] + equal) * means[components[c], i]
        out_mean[i] = scale * first_moment
    for i in range(n):
        for j in range(i + 1):
            second_moment = 0.0
            for c in range(count):
                item = components[c]
                spread = (means[item, i] - out_mean[i]) * (means[item, j] - out_mean[j])
                second_moment += (weights[c] + equal) * (covs[item, i, j] + spread)
            out_cov[i, j] = scale * second_moment
            out_cov[j, i] = out_cov[i, j]


@kernel
def moment_match(log_weights: Floats, means: Floats, covs: Floats, out_mean: Floats, out_cov: Floats) -> None:
    """Mean and covariance of a Gaussian mixture.

    log_weights: (num,) not necessarily normalised. Components count alike where all are -inf. means: (num, state_dim).
    covs: (num, state_dim, state_dim). out_mean: (state_dim,). out_cov: (state_dim, state_dim), symmetric.
    """
    count = len(log_weights)
    components, weights = np.empty(count, np.int64), np.empty(count)
    choose_all(log_weights, count, components, weights)
    match_components(components, weights, count, means, covs, out_mean, out_cov)


@borrowing
def choose_all(log_weights: Floats, count: int, components: Ints, weights: Floats) -> None:
    """Write the indices and linear weights of the first `count` components, relative to the heaviest of them."""
    peak = -math.inf
    for c in range(count):
        peak = max(peak, log_weights[c])
    for c in range(count):
        components[c] = c
        weights[c] = math.exp(log_weights[c] - peak) if peak > -math.inf else 0.0


@kernel
def heaviest_of_runs(log_weights: Floats, offsets: Ints, chosen: Ints) -> Ints:
    """Return the heaviest component (len(chosen),) of each chosen mixture, the first if equal. None is empty."""
    heaviest = np.empty(len(chosen), np.int64)
    for i in range(len(chosen)):
        best = offsets[chosen[i]]
        for c in range(best + 1, offsets[chosen[i] + 1]):
            if log_weights[c] > log_weights[best]:
                best = c
        heaviest[i] = best
    return heaviest
