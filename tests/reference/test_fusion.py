"""The grid fusion oracle against closed forms for single Gaussians."""

from __future__ import annotations

import numpy as np
import pytest

from reference import fusion
from reference.grid import Grid

GRID = Grid([-14.0], [16.0], 120)
A, B = (0, 0), (0, 1)


def _gaussian(mean: float):
    return [(1.0, np.array([mean]), np.eye(1))]


def test_two_gaussians_by_hand():
    # N(x; 0, 1)^(1/2) N(x; 2, 1)^(1/2) = exp(-2^2 / 8) N(x; 1, 1).
    integral, mean, cov = fusion.fuse_densities([_gaussian(0.0), _gaussian(2.0)], [0.5, 0.5], GRID)
    assert integral == pytest.approx(np.exp(-0.5), rel=1e-12)
    assert mean == pytest.approx([1.0], abs=1e-12)
    assert cov == pytest.approx(np.eye(1), abs=1e-12)


def test_label_sets_by_hand():
    first = [(0.2, {}), (0.5, {A: _gaussian(0.0)}), (0.3, {A: _gaussian(0.0), B: _gaussian(4.0)})]
    second = [(0.1, {}), (0.4, {A: _gaussian(2.0)}), (0.5, {A: _gaussian(2.0), B: _gaussian(4.0)})]
    fused = fusion.fuse_glmb([first, second], [0.5, 0.5], GRID)
    shrink = np.exp(-0.5)
    weights = np.array([np.sqrt(0.2 * 0.1), np.sqrt(0.5 * 0.4) * shrink, np.sqrt(0.3 * 0.5) * shrink])
    got = [fused[labels].weight for labels in [(), (A,), (A, B)]]
    assert got == pytest.approx(weights / weights.sum(), rel=1e-12)
    assert fused[A, B].moments[A][0] == pytest.approx([1.0], abs=1e-12)
    assert fused[A, B].moments[B][0] == pytest.approx([4.0], abs=1e-12)


def test_existence_is_the_mean_of_log_odds_for_equal_densities():
    first, second = {A: (0.98, _gaussian(0.0))}, {A: (0.1, _gaussian(0.0))}
    existence, mean, _ = fusion.fuse_lmb([first, second], [0.5, 0.5], GRID)[A]
    odds = np.sqrt(0.98 / 0.02 * 0.1 / 0.9)
    assert existence == pytest.approx(odds / (1.0 + odds), rel=1e-12)
    assert mean == pytest.approx([0.0], abs=1e-12)
