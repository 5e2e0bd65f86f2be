"""Means over runs, and differences between strategies that were run on the same random numbers."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from vedette.errors import InputError
from vedette.kernels.base.types import Floats
from vedette.models.arguments import as_array

CONFIDENCE = 0.95
_RESAMPLES, _BLOCK = 9999, 10_000_000  # samples of the bootstrap; numbers drawn at once
# Largest error of a tail of Student's interval, to first order in the skewness of the values.
_MAX_TAIL_ERROR = 0.01
_MIN_RUNS = 8  # runs, below which the skewness cannot be estimated


@dataclass(frozen=True, slots=True)
class Summary:
    """Mean over runs with its uncertainty. All arrays have the shape of one run's values (0-d for one number a run).

    Attributes:
        mean: sample mean.
        standard_error: sample standard deviation over the root of the number of runs, or NaN for a single run.
        low, high: 95 % confidence interval of the mean by Student's t, or NaN for a single run.
        num_runs: number of runs.
    """

    mean: Floats
    standard_error: Floats
    low: Floats
    high: Floats
    num_runs: int


@dataclass(frozen=True, slots=True)
class PairedDifference:
    """Difference in cost between two strategies, run by run.

    Attributes:
        summary: of the differences, first minus second, positive if the second is better. Its interval is from a
            bootstrap if `is_skewed`.
        win_rate: share of the runs in which the second is better (strictly lower).
        tie_rate: share of the runs in which both are equal.
        p_value: two-sided, of a mean difference of 0, by the same method as the interval, or NaN for a single run.
        is_skewed: True if the differences are too skewed, for their number, for Student's t.
    """

    summary: Summary
    win_rate: float
    tie_rate: float
    p_value: float
    is_skewed: bool


def summarise(values: ArrayLike) -> Summary:
    """Return mean, standard error and 95 % interval over the first axis.

    Args:
        values: (num_runs, ...) one entry for each run.

    Raises `InputError` for no run, or a value that is not finite.
    """
    from scipy.special import stdtrit

    runs = as_array("values", values, "fiu", "numbers, an entry a run").astype(np.float64)
    if runs.ndim == 0 or len(runs) == 0:
        raise InputError(f"values: expected at least one run; got shape {runs.shape}")
    if not np.isfinite(runs).all():
        raise InputError(f"values: expected finite numbers; got {runs[~np.isfinite(runs)][0]}")
    num_runs = len(runs)
    mean = np.asarray(runs.mean(axis=0))
    if num_runs == 1:
        unknown = np.full(mean.shape, np.nan)
        return Summary(mean, unknown, unknown, unknown, 1)
    error = np.asarray(runs.std(axis=0, ddof=1) / np.sqrt(num_runs))
    half_width = stdtrit(num_runs - 1, 0.5 + CONFIDENCE / 2.0) * error
    return Summary(mean, error, np.asarray(mean - half_width), np.asarray(mean + half_width), num_runs)


def paired_difference(first: ArrayLike, second: ArrayLike) -> PairedDifference:
    """Compare two strategies whose entries with the same index were run on the same random numbers. Lower is better.

    Args:
        first, second: (num_runs,) one number a run.

    Raises `InputError` if the lengths differ, for no run, or for a value that is not finite.
    """
    a, b = (
        as_array("first, second", values, "fiu", "numbers, one a run").astype(np.float64) for values in (first, second)
    )
    if a.ndim != 1 or a.shape != b.shape:
        raise InputError(f"first, second: expected equally many numbers, one a run; got shapes {a.shape} and {b.shape}")
    summary, p_value, is_skewed = _test_mean(a - b)
    return PairedDifference(summary, float((b < a).mean()), float((b == a).mean()), p_value, is_skewed)


def holm(p_values: ArrayLike) -> Floats:
    """Return p-values corrected for their number: those below 0.05 hold together with 95 % confidence (Holm, 1979).

    Args:
        p_values: (num_tests,). NaN stays, and counts as no test.

    Raises `InputError` for values that are not probabilities.
    """
    values = as_array("p_values", p_values, "fiu", "numbers, one a test").astype(np.float64)
    is_test = ~np.isnan(values)
    if values.ndim != 1 or not ((values[is_test] >= 0.0) & (values[is_test] <= 1.0)).all():
        raise InputError(f"p_values: expected probabilities, one a test; got {p_values!r}")
    corrected = np.full(len(values), np.nan)
    order = np.flatnonzero(is_test)[np.argsort(values[is_test], kind="stable")]
    corrected[order] = np.minimum(np.maximum.accumulate(values[order] * np.arange(len(order), 0, -1)), 1.0)
    return corrected


def _test_mean(differences: Floats) -> tuple[Summary, float, bool]:
    """Return mean with its interval, the p-value of a mean of 0, and True if both are from a bootstrap."""
    from scipy.special import stdtr

    summary = summarise(differences)
    mean, error = float(summary.mean), float(summary.standard_error)
    if summary.num_runs == 1:
        return summary, np.nan, False
    if error == 0.0:
        return summary, float(mean == 0.0), False
    if summary.num_runs >= _MIN_RUNS and _tail_error(differences) > _MAX_TAIL_ERROR:
        statistics = _bootstrap_statistics(tuple(differences.tolist()))
        with np.errstate(invalid="ignore"):  # samples of one value only are infinite: then use Student's t
            low, high = np.quantile(statistics, ((1.0 + CONFIDENCE) / 2.0, (1.0 - CONFIDENCE) / 2.0))
        if np.isfinite(low) and np.isfinite(high):
            tail = min((statistics >= mean / error).sum(), (statistics <= mean / error).sum())
            skewed = replace(summary, low=np.asarray(mean - low * error), high=np.asarray(mean - high * error))
            return skewed, min(1.0, 2.0 * (float(tail) + 1.0) / (_RESAMPLES + 1.0)), True
    return summary, float(2.0 * stdtr(summary.num_runs - 1, -abs(mean) / error)), False


def _tail_error(values: Floats) -> float:
    """Return the error of a tail of Student's interval due to skewness: the first term of Edgeworth's expansion.

    P(T <= z) = Phi(z) + (2 z^2 + 1) phi(z) skewness / (6 sqrt(n)) (P. Hall, The Bootstrap and Edgeworth Expansion,
    1992, chapter 2).
    """
    centred = values - values.mean()
    skewness = (centred**3).mean() / (centred**2).mean() ** 1.5
    z = 1.96
    density = np.exp(-z * z / 2.0) / np.sqrt(2.0 * np.pi)
    return float(abs(skewness) * (2.0 * z * z + 1.0) * density / (6.0 * np.sqrt(len(values))))


@lru_cache(maxsize=32)  # each table, claim and caption of a comparison uses the same result
def _bootstrap_statistics(differences: tuple[float, ...]) -> Floats:
    """Return (mean* - mean) / error* of samples drawn from the values, shape (resamples,).

    Infinite if a sample is of one value. The same number of values has the same draws, so that tables are reproducible.
    """
    values = np.array(differences)
    rng, number = np.random.default_rng(0), len(values)
    statistics = np.empty(_RESAMPLES)
    block = max(1, _BLOCK // number)
    for start in range(0, _RESAMPLES, block):
        sample = values[rng.integers(number, size=(min(block, _RESAMPLES - start), number))]
        deviation = sample.mean(axis=1) - values.mean()
        error = sample.std(axis=1, ddof=1) / np.sqrt(number)
        with np.errstate(divide="ignore", invalid="ignore"):
            statistics[start : start + block] = np.where(deviation == 0.0, 0.0, deviation / error)
    return statistics
