"""Gaussians in information form against NumPy, and their exactness at large coordinates."""

from __future__ import annotations

import math

import numpy as np
import pytest

from densities.examples import random_covs
from vedette.kernels.gaussian.information import log_integral, log_value, row_size, to_information, to_moments

pytestmark = pytest.mark.lanes


def _row(mean, cov, reference, power=1.0):
    n = len(mean)
    row = np.empty(row_size(n))
    assert to_information(mean, cov, reference, power, row, np.empty((n, n)), np.empty((n, n)))
    return row


def _log_gaussian(x, mean, cov):
    d = x - mean
    return -0.5 * (d @ np.linalg.solve(cov, d) + np.linalg.slogdet(2.0 * math.pi * cov)[1])


@pytest.mark.parametrize("dim", range(1, 7))
def test_row_is_the_power_of_the_gaussian(dim):
    rng = np.random.default_rng(dim)
    mean, reference, x = rng.normal(size=(3, dim))
    cov = random_covs(rng, 1, dim)[0]
    row = _row(mean, cov, reference, 0.3)
    assert row[-1] == 0.3
    assert log_value(row, x - reference) == pytest.approx(0.3 * _log_gaussian(x, mean, cov), rel=1e-12)


@pytest.mark.parametrize("dim", range(1, 7))
def test_a_gaussian_integrates_to_one_and_gives_back_its_moments(dim):
    rng = np.random.default_rng(dim)
    mean, cov = 5.0 * rng.normal(size=dim), random_covs(rng, 1, dim)[0]
    row = _row(mean, cov, np.zeros(dim))
    out_mean, out_cov = np.empty(dim), np.empty((dim, dim))
    assert to_moments(row, np.zeros(dim), out_mean, out_cov, np.empty((dim, dim)))
    assert out_mean == pytest.approx(mean, rel=1e-10)
    assert out_cov == pytest.approx(cov, rel=1e-10)
    assert log_integral(row, dim) == pytest.approx(0.0, abs=1e-11)


@pytest.mark.parametrize("dim", range(1, 7))
def test_product_of_two_gaussians(dim):
    rng = np.random.default_rng(10 + dim)
    means, covs = rng.normal(size=(2, dim)), random_covs(rng, 2, dim)
    product = _row(means[0], covs[0], means[0]) + _row(means[1], covs[1], means[0])
    expected = _log_gaussian(means[0], means[1], covs[0] + covs[1])
    assert log_integral(product, dim) == pytest.approx(expected, rel=1e-11, abs=1e-11)


def test_large_coordinates_cost_no_digits():
    # Powers 1/2 of N(0, P), N(d, P): the integral of their product is exp(-d' P^-1 d / 8).
    cov = np.diag([1.0, 1.0, 0.5, 0.5])
    shift = np.array([3.0, -2.0, 0.5, 1.0])
    far = np.array([1.0e6, -1.0e6, 300.0, -300.0])
    product = _row(far, cov, far, 0.5) + _row(far + shift, cov, far, 0.5)
    expected = -shift @ np.linalg.solve(cov, shift) / 8.0
    assert log_integral(product.copy(), 4) == pytest.approx(expected, abs=1e-10)
    mean, out = np.empty(4), np.empty((4, 4))
    assert to_moments(product, far, mean, out, np.empty((4, 4)))
    assert mean - far == pytest.approx(shift / 2.0, abs=1e-9)


@pytest.mark.parametrize("scale", [1e-55, 1e70])
def test_determinants_beyond_the_range_of_floats(scale):
    row = _row(np.zeros(5), scale * np.eye(5), np.zeros(5))
    assert log_integral(row, 5) == pytest.approx(0.0, abs=1e-10)


def test_what_is_not_positive_definite_is_refused():
    bad = np.array([[1.0, 2.0], [2.0, 1.0]])
    row, work = np.empty(row_size(2)), np.empty((2, 2))
    assert not to_information(np.zeros(2), bad, np.zeros(2), 1.0, row, work, work.copy())
    row[:] = [1.0, 2.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    assert not to_moments(row, np.zeros(2), np.empty(2), np.empty((2, 2)), work)
    assert math.isnan(log_integral(row, 2))
