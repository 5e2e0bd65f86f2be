"""Exponentials, logarithms and integrals of many numbers at once: against extended precision and one row at a time."""

from __future__ import annotations

import math

import numpy as np
import pytest

from vedette.kernels.base.elementary import directions, exponentials, logs, logs_of_one_and, make_bits
from vedette.kernels.gaussian.information import log_integral, row_size
from vedette.kernels.gaussian.integrals import integrate_rows, logs_of_one_and_integrals, make_integrals

# As many as fill wide registers and leave a rest.
NUM = 1003


@pytest.mark.parametrize("largest", [1e-12, 1.0, 30.0, 700.0])
def test_exponentials_are_exact_to_two_units_in_the_last_place(largest: float) -> None:
    given = np.random.default_rng(0).uniform(-largest, largest, NUM)
    values = given.copy()
    exponentials(values, make_bits(NUM))
    expected = np.exp(given.astype(np.longdouble))
    assert np.abs(values / expected - 1.0).max() <= 2.0 * np.finfo(float).eps


@pytest.mark.parametrize("span", [(-300.0, -20.0), (-20.0, 0.0), (-1.0, 1.0), (0.0, 300.0)])
def test_logarithms_are_exact_to_two_units_in_the_last_place(span: tuple[float, float]) -> None:
    given = 10.0 ** np.random.default_rng(1).uniform(*span, NUM)
    values = given.copy()
    logs_of_one_and(values, make_bits(NUM), make_bits(NUM))
    expected = np.log1p(given.astype(np.longdouble))
    assert np.abs(values / expected - 1.0).max() <= 2.0 * np.finfo(float).eps


@pytest.mark.parametrize("span", [(-300.0, 0.0), (-0.1, 0.1), (0.0, 300.0)])
def test_logarithms_of_any_positive_number_are_exact_to_two_units_in_the_last_place(span: tuple[float, float]) -> None:
    given = 10.0 ** np.random.default_rng(2).uniform(*span, NUM)
    values = given.copy()
    logs(values, make_bits(NUM), make_bits(NUM))
    expected = np.log(given.astype(np.longdouble))
    assert np.abs(values / expected - 1.0).max() <= 2.0 * np.finfo(float).eps
    for none in (-1.0, 0.0, math.nan):
        values = np.array([none])
        logs(values, make_bits(1), make_bits(1))
        assert math.isnan(values[0])


@pytest.mark.parametrize("flatness", [1.0, 1e-3, 1e-200, 1e200])
def test_directions_are_exact_to_two_units_in_the_last_place(flatness: float) -> None:
    x, y = np.random.default_rng(3).normal(size=(2, NUM))
    y *= flatness
    out = np.empty(NUM)
    directions(y, x, out)
    expected = np.arctan2(y.astype(np.longdouble), x.astype(np.longdouble))
    assert np.abs(out / expected - 1.0).max() <= 2.0 * np.finfo(float).eps


def test_directions_along_the_axes() -> None:
    x, y = np.array([1.0, 0.0, -1.0, 0.0, 0.0, 1.0, -1.0]), np.array([0.0, 1.0, 0.0, -1.0, 0.0, 1.0, -1.0])
    out = np.empty(len(x))
    directions(y, x, out)
    np.testing.assert_array_equal(out, np.arctan2(y, x))


def test_zero_and_nan_stay_what_they_are() -> None:
    values = np.array([0.0, math.nan, 0.0])
    exponentials(values, make_bits(3))
    np.testing.assert_array_equal(values, [1.0, math.nan, 1.0])
    values = np.array([0.0, math.nan, 0.0])
    logs_of_one_and(values, make_bits(3), make_bits(3))
    np.testing.assert_array_equal(values, [0.0, math.nan, 0.0])


@pytest.mark.parametrize("dim", [2, 4, 5, 6])
@pytest.mark.parametrize("scale", [1.0, 1e-80, 1e80])
def test_integrals_are_those_of_one_row_at_a_time(dim: int, scale: float) -> None:
    """Also where the product of the pivots is no double, where a matrix is not definite, and for extreme exponents."""
    rng, num = np.random.default_rng(dim), 11
    rows = np.empty((row_size(dim), num))
    for s in range(num):
        root = rng.normal(size=(dim + 1, dim + 1))
        matrix = scale * (root @ root.T + np.eye(dim + 1))
        matrix[dim, dim] = [1.0, -3000.0, 3000.0][s % 3]
        rows[:-1, s] = matrix[np.tril_indices(dim + 1)]
    rows[0, 4], rows[-1] = -1.0, 1.0
    expected = np.array([log_integral(rows[:, s].copy(), dim) for s in range(num)])
    integrals, logs = make_integrals(num), np.empty(num)
    integrate_rows(rows, dim, integrals)
    np.testing.assert_allclose(integrals.exponents + np.log(integrals.factors), expected, rtol=1e-12, atol=1e-12)
    logs_of_one_and_integrals(integrals, logs)
    with np.errstate(invalid="ignore"):
        np.testing.assert_allclose(logs, np.logaddexp(0.0, expected), rtol=1e-12, atol=1e-15)
    assert np.isnan(logs).tolist() == [s == 4 for s in range(num)]
