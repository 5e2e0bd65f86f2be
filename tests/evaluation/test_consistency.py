from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.stats import chi2

from vedette.errors import InputError, NumericalError
from vedette.evaluation import average_nees, nees, nees_interval
from vedette.kernels.base.types import Floats

DIM = 4
COV = np.array([[9.0, 2.0, 1.0, 0.0], [2.0, 4.0, 0.0, 0.5], [1.0, 0.0, 2.0, 0.1], [0.0, 0.5, 0.1, 1.0]])


def simulated(num_runs: int, num_pairs: int, scale: float = 1.0) -> tuple[Floats, Any]:
    """Means over pairs of errors drawn from COV that claim scale * COV, and their counts."""
    errors = np.random.default_rng(11).multivariate_normal(np.zeros(DIM), COV, num_runs * num_pairs)
    values = nees(errors, np.broadcast_to(scale * COV, (len(errors), DIM, DIM)))
    return values.reshape(num_runs, num_pairs).mean(axis=1), np.full(num_runs, num_pairs)


@given(hnp.arrays(np.float64, (5, DIM), elements=st.floats(-100.0, 100.0)), st.integers(0, 1000))
def test_is_the_squared_error_in_units_of_the_covariance(errors: Floats, seed: int) -> None:
    roots = np.random.default_rng(seed).normal(size=(5, DIM, DIM))
    covs = roots @ roots.transpose(0, 2, 1) + 0.1 * np.eye(DIM)
    expected = [error @ np.linalg.inv(cov) @ error for error, cov in zip(errors, covs, strict=True)]
    assert nees(errors, covs) == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_of_standard_deviations() -> None:
    assert nees([[3.0, 4.0]], [np.diag([9.0, 4.0])]) == pytest.approx([1.0 + 4.0])
    assert nees(np.empty((0, 2)), np.empty((0, 2, 2))).shape == (0,)


def test_errors_drawn_from_their_covariance_are_consistent() -> None:
    average = average_nees(*simulated(200, 5), dim=DIM)
    assert average.consistent
    assert average.count == 1000
    assert average.dim == DIM
    assert average.lower == pytest.approx(chi2.ppf(0.025, 4000) / 1000)
    assert average.upper == pytest.approx(chi2.ppf(0.975, 4000) / 1000)
    assert average.lower < DIM < average.upper


@pytest.mark.parametrize("scale", [0.8, 1.25])
def test_too_small_and_too_large_covariances_are_not(scale: float) -> None:
    average = average_nees(*simulated(200, 5, scale), dim=DIM)
    assert not average.consistent
    assert (average.mean > DIM) == (scale < 1.0)


def test_the_interval_holds_the_average_as_often_as_it_says() -> None:
    rng = np.random.default_rng(3)
    means = rng.chisquare(DIM, (20, 4000)).reshape(20, 4000)
    share = average_nees(means, np.ones((20, 4000), np.int64), dim=DIM, confidence=0.9).consistent.mean()
    assert share == pytest.approx(0.9, abs=4.0 * math.sqrt(0.09 / 4000))


def test_runs_are_weighted_by_their_pairs_and_those_without_are_left_out() -> None:
    means = np.array([[4.0, math.nan, math.nan], [1.0, 7.0, math.nan]])
    counts = np.array([[1, 0, 0], [3, 2, 0]])
    average = average_nees(means, counts, dim=DIM)
    assert average.mean == pytest.approx([1.75, 7.0, math.nan], nan_ok=True)
    assert average.count.tolist() == [4, 2, 0]
    assert np.isnan([average.lower[2], average.upper[2]]).all()
    assert average.consistent.tolist() == [True, True, False]


def test_the_interval_narrows_with_the_number() -> None:
    lower, upper = nees_interval([1, 10, 100, 0], dim=2)
    assert (np.diff(lower[:3]) > 0).all()
    assert (np.diff(upper[:3]) < 0).all()
    assert np.isnan([lower[3], upper[3]]).all()


def test_bad_input_is_named() -> None:
    with pytest.raises(InputError, match="covs: expected an array of shape"):
        nees([[1.0, 2.0]], [np.eye(3)])
    with pytest.raises(InputError, match="errors: expected finite numbers"):
        nees([[math.nan, 2.0]], [np.eye(2)])
    with pytest.raises(NumericalError, match=r"covs\[1\]: expected a positive definite matrix"):
        nees([[1.0, 2.0]] * 2, [np.eye(2), np.diag([1.0, 0.0])])
    with pytest.raises(InputError, match="counts: expected numbers of at least 0"):
        average_nees([1.0, 2.0], [1], dim=2)
    with pytest.raises(InputError, match="counts: expected numbers of at least 0"):
        average_nees([1.0, 2.0], [1, -1], dim=2)
    with pytest.raises(InputError, match="means: expected a finite number"):
        average_nees([1.0, math.nan], [1, 1], dim=2)
    with pytest.raises(InputError, match="dim: expected a whole number"):
        nees_interval(3, dim=0)
    with pytest.raises(InputError, match="confidence: expected a probability"):
        nees_interval(3, dim=2, confidence=1.0)
