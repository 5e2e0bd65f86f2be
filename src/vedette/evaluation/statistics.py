"""Means over runs, and differences between strategies that were run on the same random numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from vedette.errors import InputError
from vedette.kernels.base.types import Floats
from vedette.models.arguments import as_array

CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class Summary:
    """Mean over runs with its uncertainty. All arrays have the shape of one run's values (0-d for one number a run).

    Attributes:
        mean: sample mean.
        standard_error: sample standard deviation over the root of the number of runs; NaN for a single run.
        low, high: 95 % confidence interval of the mean by Student's t; NaN for a single run.
        num_runs: number of runs.
    """

    mean: Floats
    standard_error: Floats
    low: Floats
    high: Floats
    num_runs: int


@dataclass(frozen=True, slots=True)
class PairedDifference:
    """How much more one strategy costs than another, run by run.

    Attributes:
        summary: of the differences, first minus second; positive where the second is better.
        share_won: share of the runs in which the second is better (strictly lower).
        share_tied: share of the runs in which both are equal.
    """

    summary: Summary
    share_won: float
    share_tied: float


def summarise(values: ArrayLike) -> Summary:
    """Mean, standard error and 95 % interval over the first axis.

    Args:
        values: (num_runs, ...) one entry a run.

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
    reach = stdtrit(num_runs - 1, 0.5 + CONFIDENCE / 2.0) * error
    return Summary(mean, error, np.asarray(mean - reach), np.asarray(mean + reach), num_runs)


def paired_difference(first: ArrayLike, second: ArrayLike) -> PairedDifference:
    """Compare two strategies whose entries with the same index were run on the same random numbers; lower is better.

    Args:
        first, second: (num_runs,) one number a run.

    Raises `InputError` if the lengths differ, for no run, or for a value that is not finite.
    """
    a, b = (
        as_array("first, second", values, "fiu", "numbers, one a run").astype(np.float64) for values in (first, second)
    )
    if a.ndim != 1 or a.shape != b.shape:
        raise InputError(f"first, second: expected equally many numbers, one a run; got shapes {a.shape} and {b.shape}")
    summary = summarise(a - b)
    return PairedDifference(summary, float((b < a).mean()), float((b == a).mean()))
