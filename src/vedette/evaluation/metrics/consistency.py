"""Consistency of estimates with their covariances: normalised estimation error squared (NEES).

Y. Bar-Shalom, X.-R. Li and T. Kirubarajan, "Estimation with Applications to Tracking and Navigation", Wiley 2001,
section 5.4.2: the error, its average over runs, and the chi-square test of both.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from vedette.densities.checks import check_covariances
from vedette.evaluation.metrics.matching import Matching
from vedette.evaluation.statistics import CONFIDENCE
from vedette.kernels.base.types import Bools, Floats, Ints
from vedette.models.arguments import as_array, dimension, float_array, reject
from vedette.simulation.truth import Truth


def nees(errors: ArrayLike, covs: ArrayLike) -> Floats:
    """Normalised estimation error squared, e' P^-1 e, (num,).

    If the covariances are right and the errors Gaussian, each follows a chi-square distribution with `dim` degrees of
    freedom, whose mean is `dim`.

    Args:
        errors: (num, dim) estimates minus true values.
        covs: (num, dim, dim) covariances of the estimates.

    Raises:
        InputError: shapes that do not match, or a number that is not finite.
        NumericalError: a covariance is not symmetric and positive definite.
    """
    differences = float_array("errors", errors, (None, None))
    num, dim = differences.shape
    matrices = float_array("covs", covs, (num, dim, dim))
    check_covariances("covs", matrices)
    whitened = np.linalg.solve(np.linalg.cholesky(matrices), differences[:, :, None])[:, :, 0]
    return np.asarray((whitened**2).sum(axis=1))


def nees_of_matching(truth: Truth, matching: Matching, *, position_only: bool) -> Floats:
    """NEES of each matched pair, (num_pairs,), for the full state or only the position.

    NaN for the full state if estimated and true states differ in dimension, so that their difference is not defined.
    Raises `NumericalError` as `nees` does.
    """
    states, means, covs = truth.states[matching.truth_rows], matching.means, matching.covs
    if position_only:
        return nees(means[:, :2] - states[:, :2], covs[:, :2, :2])
    if means.shape[1] != states.shape[1]:
        return np.full(len(means), np.nan)
    return nees(means - states, covs)


@dataclass(frozen=True, slots=True, eq=False)
class AverageNees:
    """NEES averaged over runs (ANEES), with the interval of the average of a consistent filter.

    Divided by `dim` it is the ANEES of Li, Zhao and Jilkov (2001), which is 1 if the covariances are correct.

    Attributes:
        mean: (...) average over all pairs of all runs, or NaN without pairs.
        lower, upper: (...) two-sided chi-square interval of the average, or NaN without pairs.
        count: (...) number of pairs.
        dim: degrees of freedom of one pair, and the expected average.
    """

    mean: Floats
    lower: Floats
    upper: Floats
    count: Ints
    dim: int

    @property
    def consistent(self) -> Bools:
        """True where the average lies in the interval, (...), False without pairs."""
        return np.asarray((self.lower <= self.mean) & (self.mean <= self.upper))


def average_nees(means: ArrayLike, counts: ArrayLike, *, dim: int, confidence: float = CONFIDENCE) -> AverageNees:
    """Return the NEES averaged over runs, with its interval.

    Args:
        means: (num_runs, ...) mean over the pairs of each run, for example at each scan, or NaN without pairs.
        counts: (num_runs, ...) number of pairs of each mean.
        dim: dimension of the error: that of the state, or 2 for the position.
        confidence: probability that the average of a consistent filter lies in the interval, above 0 and below 1.

    The interval assumes independent pairs. Runs are independent, and pairs of the same scan are nearly so if targets
    are well separated, but scans of one run are not. Average over runs at each scan, and over time only to compare.
    Raises `InputError` for arguments out of range, or a missing mean for a number of pairs above 0.
    """
    values = as_array("means", means, "fiu", "numbers, an entry a run").astype(np.float64)
    numbers = as_array("counts", counts, "fiu", "numbers, an entry a run")
    if values.ndim == 0 or values.shape != numbers.shape or (numbers < 0).any():
        raise reject("counts", f"numbers of at least 0 in the shape of means, {values.shape}", counts)
    if not np.isfinite(values[numbers > 0]).all():
        raise reject("means", "a finite number wherever there is a pair", means)
    count = numbers.sum(axis=0).astype(np.int64)
    total = np.where(numbers > 0, values * numbers, 0.0).sum(axis=0)
    lower, upper = nees_interval(count, dim=dim, confidence=confidence)
    return AverageNees(np.where(count > 0, total / np.maximum(count, 1), np.nan), lower, upper, count, dim)


def nees_interval(counts: ArrayLike, *, dim: int, confidence: float = CONFIDENCE) -> tuple[Floats, Floats]:
    """Return the bounds of the mean of `counts` independent NEES of dimension `dim` with that confidence.

    The sum of the NEES is chi-square distributed with counts * dim degrees of freedom. Both tails have the same
    probability. Returns two arrays in the shape of counts, NaN where it is 0.
    Raises `InputError` for arguments out of range.
    """
    from scipy.special import gammaincinv

    dimension("dim", dim)
    if not 0.0 < confidence < 1.0:
        raise reject("confidence", "a probability above 0 and below 1", confidence)
    numbers = np.where(np.asarray(counts) > 0, counts, np.nan)
    tails = (0.5 - confidence / 2.0, 0.5 + confidence / 2.0)
    lower, upper = (np.asarray(2.0 * gammaincinv(0.5 * numbers * dim, tail) / numbers, np.float64) for tail in tails)
    return lower, upper
