"""Integrals of many information rows at once: rows as columns, side by side, so that the compiler uses wide registers.

See `vedette.kernels.gaussian.information` for what a row holds. Of `num` rows an array (row_size(dim), num) has every
entry of all of them next to each other.
"""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.elementary import Bits, exponentials, logs_of_one_and, make_bits
from vedette.kernels.base.types import Floats
from vedette.kernels.gaussian.linalg import LOG_2PI

# Its exponential times any factor, which is within exp(-288) and exp(288), is a double, and far beyond 1e16.
_LARGEST_EXPONENT = 400.0


class Integrals(NamedTuple):
    """Integrals factor * exp(exponent): without a logarithm. The factor is within 1e-125 and 1e125."""

    factors: Floats  # (num,) NaN where the integral is none
    exponents: Floats  # (num,)
    inverses: Floats  # (num,) working array, as the others
    bits: Bits
    more_bits: Bits


@kernel
def make_integrals(num: int) -> Integrals:
    return Integrals(np.empty(num), np.empty(num), np.empty(num), make_bits(num), make_bits(num))


@inlined
def _eliminate(rows: Floats, dim: int, out: Integrals) -> None:
    """Eliminate all rows as in `information.log_integral`. Write the inverse product of the pivots to the factors."""
    product, inverses, num, diagonal = out.factors, out.inverses, rows.shape[1], 0
    for s in range(num):
        product[s] = 1.0
    for k in range(dim):
        pivots = rows[diagonal]
        for s in range(num):
            inverses[s] = 1.0 / pivots[s] if pivots[s] > 0.0 else math.nan
            product[s] *= inverses[s]
        start = diagonal + 1
        for i in range(k + 1, dim + 1):
            left, above = rows[start + k], diagonal + 1
            for j in range(k + 1, i + 1):
                entries, others = rows[start + j], rows[above + k]
                for s in range(num):
                    entries[s] -= left[s] * inverses[s] * others[s]
                above += j + 1
            start += i + 1
        diagonal += k + 2


@borrowing
def _take_logs(rows: Floats, dim: int, out: Integrals) -> None:
    """Move the logarithms of products of pivots outside the range of a double to the exponents."""
    for s in range(rows.shape[1]):
        if out.factors[s] <= 1e-250 or out.factors[s] >= 1e250:
            out.factors[s], diagonal = 1.0, 0
            for k in range(dim):
                out.exponents[s] -= 0.5 * math.log(rows[diagonal, s])
                diagonal += k + 2


@borrowing
def integrate_rows(rows: Floats, dim: int, out: Integrals) -> None:
    """Write the integrals of rows (row_size(dim), num) over all states, or NaN if Y is not positive definite.

    `rows` are used up: entry (dim + 1) (dim + 2) / 2 - 1 of each holds s - y'Y^-1 y afterwards.
    """
    # A constant size is unrolled by the compiler, which halves the cost of the two usual ones.
    if dim == 4:
        _eliminate(rows, 4, out)
    elif dim == 5:
        _eliminate(rows, 5, out)
    else:
        _eliminate(rows, dim, out)
    factors, exponents, rest = out.factors, out.exponents, rows[(dim + 1) * (dim + 2) // 2 - 1]
    constant = 0.5 * dim * LOG_2PI
    outside = 0
    for s in range(len(rest)):
        outside += 1 if factors[s] <= 1e-250 or factors[s] >= 1e250 else 0
        exponents[s] = constant - 0.5 * rest[s]
    if outside > 0:
        _take_logs(rows, dim, out)
    for s in range(len(rest)):
        factors[s] = math.sqrt(factors[s])


@borrowing
def logs_of_one_and_integrals(integrals: Integrals, out: Floats) -> None:
    """out (num,) = log(1 + integral). The integrals are used up."""
    factors, exponents = integrals.factors, integrals.exponents
    for s in range(len(out)):
        # Beyond the largest exponent the 1 is lost beside the integral, or the integral beside the 1.
        kept = min(max(exponents[s], -_LARGEST_EXPONENT), _LARGEST_EXPONENT)
        out[s] = 0.0 if exponents[s] <= kept else exponents[s] - kept
        exponents[s] = kept
    exponentials(exponents, integrals.bits)
    for s in range(len(out)):
        exponents[s] *= factors[s]
    logs_of_one_and(exponents, integrals.bits, integrals.more_bits)
    for s in range(len(out)):
        out[s] += exponents[s]
