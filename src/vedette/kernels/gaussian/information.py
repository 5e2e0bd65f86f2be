"""Gaussians in information form, packed so that a product is an addition and an integral is one elimination.

A power w of a Gaussian, as a function of u = x - reference, is exp(y'u - u'Yu / 2 - s / 2). Its *information row*
holds

    lower triangle of [[Y, y], [y', s]] row by row, then w:   row_size(dim) = (dim + 1) (dim + 2) / 2 + 1 numbers.

Multiplying such functions adds their rows (about one reference), raising one to a power scales its row. For N(m, P)
with d = m - reference: Y = P^-1, y = Y d, s = d'Yd + log det(2 pi P), w = 1. The reference keeps what must cancel
small: taken near the densities, log integrals are as exact at coordinates of 1e6 m as at the origin.
"""

import math

from vedette.kernels.base.compile import borrowing, inlined
from vedette.kernels.base.types import Floats
from vedette.kernels.gaussian.linalg import (
    LOG_2PI,
    cholesky,
    inverse_from_factor,
    log_det_from_factor,
    solve_lower,
    solve_upper,
)


@borrowing
def row_size(dim: int) -> int:
    """Length of the information row of a state of `dim` components."""
    return (dim + 1) * (dim + 2) // 2 + 1


@inlined
def to_information(
    mean: Floats, cov: Floats, reference: Floats, power: float, row: Floats, factor: Floats, inverse: Floats
) -> bool:
    """Information row of N(mean, cov)^power about `reference`, into `row`. False where `cov` is not positive definite.

    factor, inverse: (dim, dim) working arrays. They hold the Cholesky factor L and L^-1 afterwards.
    """
    n = mean.shape[0]
    if not cholesky(cov, factor):
        return False
    at, squared, last = 0, 0.0, n * (n + 1) // 2
    for i in range(n):
        row[last + i] = 0.0
        # L^-1 row by row, and with it L^-1 d: Y d = L^-T (L^-1 d), and d'Yd = |L^-1 d|^2.
        scale, whitened = 1.0 / factor[i, i], 0.0
        for j in range(i):
            total = 0.0
            for k in range(j, i):
                total -= factor[i, k] * inverse[k, j]
            inverse[i, j] = total * scale
            whitened += inverse[i, j] * (mean[j] - reference[j])
        inverse[i, i] = scale
        whitened += scale * (mean[i] - reference[i])
        squared += whitened * whitened
        for j in range(i + 1):
            row[last + j] += power * inverse[i, j] * whitened
    for i in range(n):
        for j in range(i + 1):
            total = 0.0
            for k in range(i, n):
                total += inverse[k, i] * inverse[k, j]
            row[at] = power * total
            at += 1
    row[last + n] = power * (squared + log_det_from_factor(factor) + n * LOG_2PI)
    row[last + n + 1] = power
    return True


@inlined
def log_integral(row: Floats, dim: int) -> float:
    """Return the log integral of `row` over all states, or NaN if its Y is not positive definite.

    `row` is used up: afterwards it holds the elimination, with the pivots of Y and s - y'Y^-1 y on its diagonal.
    """
    det, diagonal = 1.0, 0
    for k in range(dim):
        # Symmetric elimination of [[Y, y], [y', s]]: the last diagonal entry becomes s - y'Y^-1 y.
        pivot = row[diagonal]
        if not pivot > 0.0:
            return math.nan
        det *= pivot
        inverse = 1.0 / pivot
        start = diagonal + 1
        for i in range(k + 1, dim + 1):
            scale = row[start + k] * inverse
            above = diagonal + 1
            for j in range(k + 1, i + 1):
                row[start + j] -= scale * row[above + k]
                above += j + 1
            start += i + 1
        diagonal += k + 2
    # One logarithm instead of one a pivot, unless the product leaves the range of a double.
    if 1e-250 < det < 1e250:
        log_det = math.log(det)
    else:
        log_det, at = 0.0, 0
        for k in range(dim):
            log_det += math.log(row[at])
            at += k + 2
    return float(0.5 * (dim * LOG_2PI - log_det - row[diagonal]))


@borrowing
def log_value(row: Floats, offset: Floats) -> float:
    """Return the log value of `row` at the state reference + `offset`."""
    n = offset.shape[0]
    at, quadratic, linear, last = 0, 0.0, 0.0, n * (n + 1) // 2
    for i in range(n):
        total = 0.5 * row[at + i] * offset[i]
        for j in range(i):
            total += row[at + j] * offset[j]
        quadratic += total * offset[i]
        linear += row[last + i] * offset[i]
        at += i + 1
    return float(linear - quadratic - 0.5 * row[last + n])


@borrowing
def to_moments(row: Floats, reference: Floats, mean: Floats, cov: Floats, factor: Floats) -> bool:
    """Write mean and covariance of the normalised Gaussian of `row`. Returns False if Y is not positive definite.

    factor: (dim, dim) working array.
    """
    n = reference.shape[0]
    at, last = 0, n * (n + 1) // 2
    for i in range(n):
        for j in range(i + 1):
            cov[i, j] = row[at]
            cov[j, i] = row[at]
            at += 1
        mean[i] = row[last + i]
    if not cholesky(cov, factor):
        return False
    solve_lower(factor, mean, mean)
    solve_upper(factor, mean, mean)
    for i in range(n):
        mean[i] += reference[i]
    inverse_from_factor(factor, cov)
    return True
