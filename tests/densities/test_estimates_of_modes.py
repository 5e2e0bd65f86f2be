"""Estimates of densities without labels whose targets have modes of motion."""

from __future__ import annotations

import numpy as np
import pytest

from vedette.densities import IidCluster, MultiBernoulli, Poisson, marks_of, unlabelled_estimate

MEANS = np.array([[0.0, 0.0], [0.1, 0.0], [50.0, 0.0], [50.1, 0.0]])
PARTS = MEANS, np.tile(np.eye(2), (4, 1, 1)), marks_of(modes=np.array([0, 1, 0, 1]))
HALVES = np.log(np.full(4, 0.5))


@pytest.mark.parametrize(
    "density",
    [
        Poisson(HALVES, *PARTS),
        IidCluster(np.log([1e-9, 1e-9, 1.0 - 2e-9]), np.log(np.full(4, 0.25)), *PARTS),
        MultiBernoulli(np.array([5.0, 5.0]), np.array([0, 2, 4]), HALVES, *PARTS),
    ],
    ids=lambda density: type(density).__name__,
)
def test_a_target_of_several_modes_is_one(density):
    np.testing.assert_allclose(unlabelled_estimate(density, 1).means[:, 0], [0.05, 50.05])
