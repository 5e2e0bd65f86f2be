"""The quadrature oracle against closed forms small enough to write down."""

from __future__ import annotations

import math

import numpy as np
import pytest

from reference import set_integral
from reference.gaussian import gaussian_pdf
from reference.grid import Grid

GRID = Grid([-12.0], [14.0], 80)
A, B = (0, 0), (0, 1)


def _gaussian(mean: float, variance: float):
    return [(1.0, np.array([mean]), np.array([[variance]]))]


def _overlap(mean_a: float, variance_a: float, mean_b: float, variance_b: float) -> float:
    return gaussian_pdf(np.array([mean_a]), np.array([mean_b]), np.array([[variance_a + variance_b]]))


def test_two_targets_by_hand():
    first = [(0.3, {}), (0.7, {A: _gaussian(0.0, 1.0), B: _gaussian(2.0, 1.5)})]
    second = [(0.4, {A: _gaussian(0.0, 1.0)}), (0.6, {A: _gaussian(1.0, 2.0), B: _gaussian(2.0, 1.0)})]
    expected = 0.7 * 0.6 * 25.0 * _overlap(0.0, 1.0, 1.0, 2.0) * _overlap(2.0, 1.5, 2.0, 1.0)
    assert set_integral.inner_product(first, second, GRID, 5.0) == pytest.approx(expected, rel=1e-12)


def test_bernoulli_by_hand():
    def zeta(r_a: float, r_b: float, mean_a: float, mean_b: float) -> float:
        return (1.0 - r_a) * (1.0 - r_b) + 3.0 * r_a * r_b * _overlap(mean_a, 1.0, mean_b, 1.0)

    first, second = {A: (0.8, _gaussian(0.0, 1.0))}, {A: (0.5, _gaussian(1.0, 1.0))}
    expected = -math.log(zeta(0.8, 0.5, 0.0, 1.0) / math.sqrt(zeta(0.8, 0.8, 0.0, 0.0) * zeta(0.5, 0.5, 1.0, 1.0)))
    assert set_integral.lmb_cauchy_schwarz(first, second, GRID, 3.0) == pytest.approx(expected, rel=1e-12)
    assert set_integral.lmb_cauchy_schwarz(first, first, GRID, 3.0) == pytest.approx(0.0, abs=1e-13)


def test_poisson_is_half_the_squared_distance_of_intensities():
    first = [(1.5, np.zeros(1), np.eye(1))]
    second = [(0.5, np.ones(1), np.eye(1))]
    squared = 2.25 * _overlap(0.0, 1.0, 0.0, 1.0) + 0.25 * _overlap(0.0, 1.0, 0.0, 1.0)
    squared -= 2.0 * 0.75 * _overlap(0.0, 1.0, 1.0, 1.0)
    assert set_integral.poisson_cauchy_schwarz(first, second, GRID, 2.0) == pytest.approx(squared, rel=1e-10)


def test_grid_in_two_dimensions():
    grid = Grid([-9.0, -12.0], [10.0, 10.0], 50)
    mean, cov = np.array([0.5, -1.0]), np.array([[1.0, 0.4], [0.4, 1.5]])
    values = grid.values([(1.0, mean, cov)])
    assert grid.cell * values.sum() == pytest.approx(1.0, abs=1e-12)
    for got, expected in zip(grid.moments(values), (mean, cov), strict=True):
        assert got == pytest.approx(expected, abs=1e-10)
