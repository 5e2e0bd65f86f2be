"""Vectorised exponentials, logarithms and angles: polynomials in loops that the compiler vectorises.

Within two units in the last place of the exact values. Calling the system's function for each number would prevent
vectorisation of the whole loop.
"""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Ints

# Adding it to a number below 2^51 leaves the nearest integer in the last bits.
_ROUNDER = 1.5 * 2.0**52
_ROUNDER_BITS = int(np.float64(_ROUNDER).view(np.int64))
_ONE_BITS = int(np.float64(1.0).view(np.int64))
_ROOT_HALF_BITS = int(np.float64(math.sqrt(0.5)).view(np.int64))
_MANTISSA_BITS = 52

_PER_LOG_2 = 1.0 / math.log(2.0)
# log 2 in two parts; products of the first with exponents are exact.
_LOG_2_HIGH = 6.93147180369123816490e-01
_LOG_2_LOW = 1.90821492927058770002e-10

# Inverse factorials.
_INVERSE_9, _INVERSE_10, _INVERSE_11 = 1.0 / 362880.0, 1.0 / 3628800.0, 1.0 / 39916800.0
_INVERSE_12, _INVERSE_13 = 1.0 / 479001600.0, 1.0 / 6227020800.0

LARGEST_EXPONENT = 700.0

# Angles in two parts; the second is the rounding error of the first.
_HALF_PI_HIGH, _HALF_PI_LOW = 1.57079632679489655800e00, 6.12323399573676603587e-17
_ATAN_HALF_HIGH, _ATAN_HALF_LOW = 4.63647609000806093515e-01, 2.26987774529616870924e-17


class Bits(NamedTuple):
    """Working arrays of `num` numbers, and the same memory as integers."""

    numbers: Floats  # (num,)
    bits: Ints  # (num,)


@kernel
def make_bits(num: int) -> Bits:
    numbers = np.empty(num)
    return Bits(numbers, numbers.view(np.int64))


@borrowing
def exponentials(values: Floats, work: Bits) -> None:
    """Set values = exp(values), for values within `LARGEST_EXPONENT` of zero, or NaN."""
    numbers, bits, num = work.numbers, work.bits, values.shape[0]
    # exp x = 2^k exp r with the integer k nearest to x / log 2, and |r| <= log(2) / 2.
    for s in range(num):
        numbers[s] = values[s] * _PER_LOG_2 + _ROUNDER
    for s in range(num):
        k = numbers[s] - _ROUNDER
        r = (values[s] - k * _LOG_2_HIGH) - k * _LOG_2_LOW
        # Taylor's series, odd and even terms apart; the first term left out is below 1e-17.
        z = r * r
        odd = 1.0 / 6.0 + z * (
            1.0 / 120.0 + z * (1.0 / 5040.0 + z * (_INVERSE_9 + z * (_INVERSE_11 + z * _INVERSE_13)))
        )
        even = 0.5 + z * (1.0 / 24.0 + z * (1.0 / 720.0 + z * (1.0 / 40320.0 + z * (_INVERSE_10 + z * _INVERSE_12))))
        values[s] = 1.0 + (r + z * (even + r * odd))
    for s in range(num):
        bits[s] = (bits[s] << _MANTISSA_BITS) + _ONE_BITS
    for s in range(num):
        values[s] *= numbers[s]


@inlined
def _split(bits: Ints, more: Ints, num: int) -> None:
    """Split numbers 2^k m, m between sqrt(1/2) and sqrt(2): bits become those of m, and more those of k + _ROUNDER."""
    for s in range(num):
        k = (bits[s] - _ROOT_HALF_BITS) >> _MANTISSA_BITS
        more[s] = k + _ROUNDER_BITS
        bits[s] -= k << _MANTISSA_BITS


@inlined
def _log_near_one(f: float) -> float:
    """Return log(1 + f) = 2 artanh(f / (2 + f)), by its series with the coefficients of fdlibm (e_log.c)."""
    root = f / (2.0 + f)
    z = root * root
    w = z * z
    odd = z * (
        6.666666666666735130e-01
        + w * (2.857142874366239149e-01 + w * (1.818357216161805012e-01 + w * 1.479819860511658591e-01))
    )
    even = w * (3.999999999940941908e-01 + w * (2.222219843214978396e-01 + w * 1.531383769920937332e-01))
    half = 0.5 * f * f
    return f - (half - root * (half + odd + even))


@borrowing
def logs_of_one_and(values: Floats, work: Bits, more: Bits) -> None:
    """Set values = log(1 + values), for finite values of at least zero, or NaN."""
    numbers, num = work.numbers, values.shape[0]
    for s in range(num):
        numbers[s] = 1.0 + values[s]
    _split(work.bits, more.bits, num)
    for s in range(num):
        x, k = values[s], more.numbers[s] - _ROUNDER
        whole = 1.0 + x
        lost = (x - (whole - 1.0)) / whole  # correction of the rounding error of 1 + x
        values[s] = k * _LOG_2_HIGH + (_log_near_one(numbers[s] - 1.0) + (k * _LOG_2_LOW + lost))


@borrowing
def logs(values: Floats, work: Bits, more: Bits) -> None:
    """Set values = log(values), for finite values above 1e-300, or NaN for values that are not positive."""
    numbers, num = work.numbers, values.shape[0]
    for s in range(num):
        numbers[s] = values[s]
    _split(work.bits, more.bits, num)
    for s in range(num):
        k = more.numbers[s] - _ROUNDER
        none = 0.0 if values[s] > 0.0 else math.nan
        values[s] = k * _LOG_2_HIGH + (_log_near_one(numbers[s] - 1.0) + (k * _LOG_2_LOW + none))


@borrowing
def directions(y: Floats, x: Floats, out: Floats) -> None:
    """Set out = atan2(y, x) for finite numbers, in [-pi, pi], or 0 if both are 0.

    With the coefficients of fdlibm (s_atan.c). The arc tangent of the quotient t of the smaller by the larger is
    atan(c) + atan((t - c) / (1 + c t)), with c the one of 0, 1/2 and 1 that leaves the smallest remainder.
    """
    for s in range(out.shape[0]):
        across, along = abs(y[s]), abs(x[s])
        small, large = (across, along) if across < along else (along, across)
        high, middle = 16.0 * small >= 11.0 * large, 16.0 * small >= 7.0 * large
        above = small - large if high else (2.0 * small - large if middle else small)
        below = small + large if high else (2.0 * large + small if middle else large)
        base = 0.5 * _HALF_PI_HIGH if high else (_ATAN_HALF_HIGH if middle else 0.0)
        rest = 0.5 * _HALF_PI_LOW if high else (_ATAN_HALF_LOW if middle else 0.0)
        r = above / (below if below > 0.0 else 1.0)
        z = r * r
        w = z * z
        odd = 9.09088713343650656196e-02 + w * (
            6.66107313738753120669e-02 + w * (4.97687799461593236017e-02 + w * 1.62858201153657823623e-02)
        )
        odd = z * (3.33333333333329318027e-01 + w * (1.42857142725034663711e-01 + w * odd))
        even = -7.69187620504482999495e-02 + w * (-5.83357013379057348645e-02 + w * -3.65315727442169155270e-02)
        even = w * (-1.99999999998764832476e-01 + w * (-1.11111104054623557880e-01 + w * even))
        angle = base - ((r * (odd + even) - rest) - r)
        angle = _HALF_PI_HIGH - (angle - _HALF_PI_LOW) if across > along else angle
        angle = 2.0 * _HALF_PI_HIGH - (angle - 2.0 * _HALF_PI_LOW) if x[s] < 0.0 else angle
        angle = angle if large > 0.0 else 0.0
        out[s] = -angle if y[s] < 0.0 else angle
