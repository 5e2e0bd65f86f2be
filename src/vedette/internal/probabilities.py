"""Logistic functions and the quantile of the chi-squared distribution.

SciPy has them too, but importing `scipy.special` takes as long as the first scan of a run.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray


def expit(log_odds: ArrayLike) -> NDArray[np.float64]:
    """Return the probability with these log-odds, exact to rounding at both ends, 0 and 1 at the infinities."""
    log_odds = np.asarray(log_odds, np.float64)
    small = np.exp(-np.abs(log_odds))
    found: NDArray[np.float64] = np.where(log_odds < 0.0, small, 1.0) / (1.0 + small)
    return found


def log_expit(log_odds: ArrayLike) -> NDArray[np.float64]:
    """Return the logarithm of the probability with these log-odds."""
    log_odds = np.asarray(log_odds, np.float64)
    found: NDArray[np.float64] = np.minimum(log_odds, 0.0) - np.log1p(np.exp(-np.abs(log_odds)))
    return found


def logit(probability: float) -> float:
    """Return the log-odds of a probability, infinite for 0 and 1."""
    if probability <= 0.0 or probability >= 1.0:
        return math.copysign(math.inf, probability - 0.5)
    return math.log(probability / (1.0 - probability))


def chi_squared_quantile(dim: int, probability: float) -> float:
    """Return the quantile at `probability` of the chi-squared distribution with `dim` degrees of freedom.

    Newton's method on the log of the tail, kept inside a bracket, exact to about 1e-15 / probability.
    """
    if probability <= 0.0 or probability >= 1.0:
        return math.inf if probability >= 1.0 else 0.0
    wanted, value, low, high = math.log1p(-probability), float(dim), 0.0, math.inf
    for _ in range(200):
        tail, density = _chi_squared(dim, value)
        excess = math.log(tail) - wanted
        low, high = (value, high) if excess > 0.0 else (low, value)
        new = value + excess * tail / density
        if not low < new < high:
            new = 2.0 * value if math.isinf(high) else 0.5 * (low + high)
        if abs(new - value) <= 2e-16 * value:
            break
        value = new
    return value


def _chi_squared(dim: int, value: float) -> tuple[float, float]:
    """Tail above a positive value, and density there (Abramowitz and Stegun 1964, eq. 26.4.4 and 26.4.5)."""
    half = 0.5 * value
    power = 0.5 * (dim % 2)
    tail = math.erfc(math.sqrt(half)) if dim % 2 else 0.0
    while power < 0.5 * dim:
        term = math.exp(power * math.log(half) - half - math.lgamma(power + 1.0))
        tail += term
        power += 1.0
    return tail, 0.5 * math.exp((0.5 * dim - 1.0) * math.log(half) - half - math.lgamma(0.5 * dim))
