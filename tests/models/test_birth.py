"""The LMB birth model."""

from __future__ import annotations

import numpy as np

from vedette.models import BirthModel

MEANS = np.array([[1.0, 2.0, 0.0, 0.0], [3.0, 4.0, 0.0, 0.0]])
COVS = np.array([np.diag([50.0, 50.0, 25.0, 25.0]) ** 2] * 2)


def test_sites_and_steps():
    birth = BirthModel([0.02, 0.03], MEANS, COVS, steps=[1, 5])  # type: ignore[arg-type]
    assert (birth.num_sites, birth.state_dim) == (2, 4)
    assert [birth.is_active(step) for step in (0, 1, 2, 5)] == [False, True, False, True]
    assert birth.steps == frozenset({1, 5})


def test_every_step_and_never():
    assert BirthModel(np.array([0.02, 0.03]), MEANS, COVS).is_active(7)
    never = BirthModel.none(4)
    assert (never.num_sites, never.state_dim, never.is_active(1)) == (0, 4, False)
