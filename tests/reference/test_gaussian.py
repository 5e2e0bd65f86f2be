"""The Kalman filter oracles against numbers worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from reference import gaussian

ONE = np.eye(1)


def test_scalar_filter_by_hand():
    mean, cov = gaussian.ekf_predict(np.array([1.0]), ONE, lambda x: 2.0 * x, lambda x: 2.0 * ONE, 4.0 * ONE)
    assert mean == pytest.approx([2.0])
    assert cov == pytest.approx(8.0 * ONE)
    # Innovation variance 8 + 8, gain 1/2, residual 5 - 2.
    mean, cov, likelihood = gaussian.ekf_update(
        mean, cov, np.array([5.0]), lambda x: x, lambda x: ONE, 8.0 * ONE, [False]
    )
    assert mean == pytest.approx([3.5])
    assert cov == pytest.approx(4.0 * ONE)
    assert likelihood == pytest.approx(np.exp(-9.0 / 32.0) / np.sqrt(32.0 * np.pi))


@pytest.mark.parametrize("kappa", [0.0, 1.0])
def test_sigma_points_are_exact_for_linear_functions(kappa):
    rng = np.random.default_rng(5)
    f, h, root = rng.normal(size=(3, 3)), rng.normal(size=(2, 3)), rng.normal(size=(3, 3))
    mean, cov, noise = rng.normal(size=3), root @ root.T + np.eye(3), np.diag([1.0, 2.0, 3.0])
    linear = gaussian.ekf_predict(mean, cov, lambda x: f @ x, lambda x: f, noise)
    sigma = gaussian.sigma_predict(mean, cov, lambda x: f @ x, noise, kappa=kappa)
    for a, b in zip(linear, sigma, strict=True):
        assert a == pytest.approx(b)
    z, r = np.array([0.3, -1.0]), np.diag([0.5, 0.1])
    linear_update = gaussian.ekf_update(mean, cov, z, lambda x: h @ x, lambda x: h, r, [False, False])
    sigma_update = gaussian.sigma_update(mean, cov, z, lambda x: h @ x, r, [False, False], kappa=kappa)
    for c, d in zip(linear_update, sigma_update, strict=True):
        assert c == pytest.approx(d)


def test_unscented_square_by_hand():
    # E[x^2] = 1 for a standard normal; points 0, +-sqrt(2) with weights 1/2, 1/4, 1/4 give 1 and E[x^4] - 1 = 1.
    mean, cov = gaussian.sigma_predict(np.zeros(1), ONE, lambda x: x**2, 0.0 * ONE, kappa=1.0)
    assert mean == pytest.approx([1.0])
    assert cov == pytest.approx(ONE)


def test_wrap():
    wrapped = gaussian.wrap(np.array([np.pi + 0.1, -np.pi, 9.0]), [True, True, False])
    assert wrapped == pytest.approx([0.1 - np.pi, np.pi, 9.0])
