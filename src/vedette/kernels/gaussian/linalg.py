"""Written-out linear algebra for the few-by-few matrices of tracking: Cholesky factors, triangular solves, products.

Inside a compiled loop these are two orders of magnitude faster than `@` and `np.linalg`, and quick to compile.
Triangular results use the lower triangle only. The strict upper triangle is left as it was.
"""

import math

from vedette.kernels.base.compile import borrowing, inlined
from vedette.kernels.base.types import Floats

LOG_2PI = math.log(2.0 * math.pi)


@inlined
def cholesky(matrix: Floats, factor: Floats) -> bool:
    """Lower Cholesky factor of `matrix` (its lower triangle is read). False where it is not positive definite."""
    if matrix.shape[0] == 4:  # a constant size is unrolled by the compiler
        return cholesky_of_size(matrix, factor, 4)
    return cholesky_of_size(matrix, factor, matrix.shape[0])


@inlined
def cholesky_of_size(matrix: Floats, factor: Floats, n: int) -> bool:
    """Write the Cholesky factor, see `cholesky`. The loops are unrolled if the caller's `n` is a constant."""
    for i in range(n):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= factor[i, k] * factor[j, k]
            if i == j:
                if not total > 0.0 or total == math.inf:
                    return False
                factor[i, i] = math.sqrt(total)
            else:
                factor[i, j] = total / factor[j, j]
    return True


@inlined
def log_det_from_factor(factor: Floats) -> float:
    """log det(L L') of a lower factor L."""
    product = 1.0
    for i in range(factor.shape[0]):
        product *= factor[i, i]
    # One logarithm instead of n, unless the product leaves the range of a double.
    if 1e-150 < product < 1e150:
        return 2.0 * math.log(product)
    total = 0.0
    for i in range(factor.shape[0]):
        total += math.log(factor[i, i])
    return 2.0 * total


@inlined
def solve_lower(factor: Floats, vector: Floats, out: Floats) -> None:
    """out = L^-1 vector. `out` may be `vector`."""
    for i in range(factor.shape[0]):
        total = vector[i]
        for k in range(i):
            total -= factor[i, k] * out[k]
        out[i] = total / factor[i, i]


@borrowing
def solve_upper(factor: Floats, vector: Floats, out: Floats) -> None:
    """out = L^-T vector. `out` may be `vector`."""
    n = factor.shape[0]
    for i in range(n - 1, -1, -1):
        total = vector[i]
        for k in range(i + 1, n):
            total -= factor[k, i] * out[k]
        out[i] = total / factor[i, i]


@borrowing
def inverse_from_factor(factor: Floats, out: Floats) -> None:
    """out = (L L')^-1, symmetric."""
    n = factor.shape[0]
    for column in range(n):
        for i in range(n):
            total = 1.0 if i == column else 0.0
            for k in range(i):
                total -= factor[i, k] * out[k, column]
            out[i, column] = total / factor[i, i]
        for i in range(n - 1, -1, -1):
            total = out[i, column]
            for k in range(i + 1, n):
                total -= factor[k, i] * out[k, column]
            out[i, column] = total / factor[i, i]
    for i in range(n):
        for j in range(i):
            out[i, j] = 0.5 * (out[i, j] + out[j, i])
            out[j, i] = out[i, j]


@inlined
def sandwich(jacobian: Floats, cov: Floats, noise: Floats, product: Floats, out: Floats, n: int) -> None:
    """out = jacobian cov jacobian' + noise."""
    for i in range(n):
        for j in range(n):
            total = 0.0
            for k in range(n):
                total += jacobian[i, k] * cov[k, j]
            product[i, j] = total
    for i in range(n):
        for j in range(i + 1):
            total = 0.5 * (noise[i, j] + noise[j, i])
            for k in range(n):
                total += product[i, k] * jacobian[j, k]
            out[i, j] = total
            out[j, i] = total


@inlined
def log_add(a: float, b: float) -> float:
    """log(exp(a) + exp(b)), exact for -inf."""
    if a < b:
        a, b = b, a
    if b == -math.inf:
        return a
    return a + math.log1p(math.exp(b - a))


@inlined
def log_or_minus_inf(value: float) -> float:
    return math.log(value) if value > 0.0 else -math.inf


@borrowing
def normalise_logs(values: Floats) -> float:
    """Make the exponentials sum to one and return the log of their sum, or -inf, without a change, for no values.

    Taken from the largest, not from the sum: logs of -1e12 keep their differences, and so still sum to one.
    """
    peak, total = -math.inf, 0.0
    for value in values:
        peak = max(peak, value)
    if peak == -math.inf:
        return peak
    for value in values:
        total += math.exp(value - peak)
    log_total = math.log(total)
    for i in range(len(values)):
        values[i] = (values[i] - peak) - log_total
    return peak + log_total


@borrowing
def log_sum(values: Floats) -> float:
    """log of the sum of exponentials, or -inf for no values."""
    peak = -math.inf
    for value in values:
        peak = max(peak, value)
    if peak == -math.inf:
        return peak
    total = 0.0
    for value in values:
        total += math.exp(value - peak)
    return peak + math.log(total)
