"""True targets that change their mode of motion."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from vedette import models
from vedette.simulation import PoissonTargets, ScriptedTargets, UniformTargets
from vedette.simulation.true_motion import moved_target

STANDS = models.ornstein_uhlenbeck(0.0, 1e-3)
SAILS = models.constant_velocity(0.0)
FERRY = models.Modes((SAILS, STANDS), (20.0, 10.0), names=("sails", "stands"))
BEGIN = np.array([0.0, 0.0, 5.0, 0.0])


def test_modes_change_as_the_chain_says():
    rng, dt = np.random.default_rng(1), 7.0
    ended = np.array([moved_target(FERRY, BEGIN, 0, dt, rng)[1] for _ in range(4000)])
    expected = expm(FERRY.rates * dt)[0, 1]
    assert abs(ended.mean() - expected) < 4.0 * np.sqrt(expected * (1.0 - expected) / len(ended))


def test_a_target_that_stands_stays():
    rng = np.random.default_rng(2)
    stopped, mode = moved_target(FERRY, BEGIN, 1, 1e-9, rng)
    assert mode == 1
    stopped, _ = moved_target(models.Modes((STANDS, STANDS), (1.0, 1.0)), stopped, 0, 50.0, rng)
    assert np.linalg.norm(stopped[:2]) < 0.01


@pytest.mark.parametrize("num_others", [0, 3])
def test_a_scripted_target_does_not_depend_on_others(num_others):
    states = np.tile(BEGIN, (1 + num_others, 1))
    truth = ScriptedTargets(FERRY, states, process_noise=True).truth(np.arange(60.0), rng=np.random.default_rng(7))
    own = truth.states[truth.ids == 0]
    speeds = np.hypot(*own[:, 2:].T)
    assert 0.0 < np.mean(speeds < 0.1) < 1.0
    assert speeds.sum() == pytest.approx(np.hypot(*_alone()[:, 2:].T).sum())


def _alone() -> np.ndarray:
    return (
        ScriptedTargets(FERRY, BEGIN[None], process_noise=True)
        .truth(np.arange(60.0), rng=np.random.default_rng(7))
        .states
    )


def test_without_noise_a_target_keeps_the_first_mode():
    truth = ScriptedTargets(FERRY, BEGIN[None]).truth(np.arange(60.0), rng=np.random.default_rng(4))
    np.testing.assert_allclose(truth.states[-1], [5.0 * 59.0, 0.0, 5.0, 0.0])


def test_targets_that_are_drawn_change_their_modes():
    region = models.Region(-100.0, 100.0, -100.0, 100.0)
    for source in (
        UniformTargets(FERRY, 5, region, np.array([5.0, 5.0]), 0.02),
        PoissonTargets(FERRY, 0.5, BEGIN, np.diag([1.0, 1.0, 4.0, 4.0]), 0.02),
    ):
        truth = source.truth(np.arange(40.0), rng=np.random.default_rng(5))
        assert truth.states.shape[1] == 4
        assert 0.05 < np.mean(np.hypot(truth.states[:, 2], truth.states[:, 3]) < 0.1) < 0.95
