"""The polynomials of the CPHD filter against sums over subsets."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import logit

from reference import unlabelled
from vedette.kernels.steps import cphd

pytestmark = pytest.mark.lanes

log_ratios = st.lists(st.one_of(st.floats(-900.0, 900.0), st.just(-math.inf)), max_size=7).map(np.array)
probabilities = st.floats(0.0, 1.0)


def log_sums(terms) -> float:
    return float(np.logaddexp.reduce(list(terms), initial=-np.inf))


def subsets(values, order: int) -> float:
    """Log elementary symmetric function of the exponentials of `values`."""
    if order > len(values):
        return -math.inf
    return log_sums(math.fsum(chosen) for chosen in itertools.combinations(values.tolist(), order))


def log_of(values) -> np.ndarray:
    with np.errstate(divide="ignore"):
        return np.log(np.asarray(values, float))


@given(log_ratios)
def test_symmetric_functions_are_sums_over_subsets(values) -> None:
    values = np.asarray(values, float)
    table = cphd.symmetric_functions(values)
    for k in range(len(values) + 1):
        expected = [subsets(values[:k], order) for order in range(len(values) + 1)]
        np.testing.assert_allclose(table[k], expected, rtol=1e-12, atol=1e-12)


@given(log_ratios, st.integers(0, 2**32 - 1))
def test_slopes_are_sums_over_subsets_of_the_others(values, seed: int) -> None:
    values = np.asarray(values, float)
    derivatives = 50.0 * np.random.default_rng(seed).normal(size=len(values) + 2)
    slopes = cphd.measurement_slopes(cphd.symmetric_functions(values), values, derivatives)
    for k in range(len(values)):
        others = np.delete(values, k)
        expected = log_sums(subsets(others, j) + derivatives[j + 1] for j in range(len(values)))
        assert slopes[k] == pytest.approx(expected, rel=1e-12, abs=1e-11)


@given(st.lists(probabilities, min_size=1, max_size=4), probabilities, st.lists(st.floats(1e-6, 0.999), max_size=3))
def test_predicted_numbers_are_sums_over_lives_and_births(weights, survival: float, existences) -> None:
    prior = np.asarray(weights) + 1e-3
    prior /= prior.sum()
    log_lived, log_died = log_of([survival, 1.0 - survival])
    got = cphd.predict_cardinality(log_of(prior), log_lived, log_died, logit(np.array(existences, float)))
    expected = unlabelled.predict_cardinality(prior, survival, existences)
    np.testing.assert_allclose(np.exp(got), expected, rtol=1e-9, atol=1e-15)


@given(st.lists(probabilities, min_size=1, max_size=6), probabilities, st.integers(0, 7))
def test_derivatives_of_the_generating_function(weights, missed: float, most: int) -> None:
    got = np.exp(cphd.cardinality_derivatives(log_of(weights), float(log_of(missed)), most))
    polynomial = np.polynomial.Polynomial(weights)
    for order in range(most + 1):
        expected = polynomial.deriv(order)(missed) if order else polynomial(missed)
        assert got[order] == pytest.approx(expected, rel=1e-10, abs=1e-300)


def test_hundreds_of_measurements_neither_overflow_nor_vanish() -> None:
    values = np.random.default_rng(1).normal(scale=200.0, size=300)
    table = cphd.symmetric_functions(values)
    assert np.isfinite(table[-1]).all()
    assert table[-1, -1] == pytest.approx(values.sum(), rel=1e-12)
    ordered = np.sort(values)[::-1]
    assert (table[-1, 1:] >= np.cumsum(ordered) - 1e-9).all()


def test_trimming_keeps_a_distribution_and_tells_what_it_cost() -> None:
    given_log = np.log([0.2, 0.5, 0.3 - 3e-7, 2e-7, 1e-7])
    trimmed, log_kept = cphd.trim_cardinality(given_log, math.log(1e6))
    assert len(trimmed) == 3
    assert np.exp(trimmed).sum() == pytest.approx(1.0, abs=1e-14)
    assert -math.expm1(log_kept) == pytest.approx(3e-7, rel=1e-6)
    whole, nothing = cphd.trim_cardinality(given_log, math.inf)
    assert len(whole) == 5
    assert nothing == pytest.approx(0.0, abs=1e-15)
    assert len(cphd.trim_cardinality(np.array([0.0, -math.inf, -math.inf]), math.inf)[0]) == 1
