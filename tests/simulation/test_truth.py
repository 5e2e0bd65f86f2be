"""Scripted targets and the container of truth."""

from __future__ import annotations

import math

import numpy as np
import pytest

from reference.user_models import nothing_like_a_state
from vedette import models
from vedette.errors import InputError, ModelError
from vedette.simulation import ScriptedTargets, Truth
from vedette.simulation.true_motion import semidefinite_factor

TIMES = np.arange(1.0, 41.0)
STARTS = np.array([[-55.0, 875.0, 15.0, -6.0], [-180.0, -205.0, -5.5, -19.0], [340.0, -5.0, 10.0, 6.0]])


def rng():
    return np.random.default_rng(7)


def test_straight_lines_without_process_noise():
    truth = ScriptedTargets(models.constant_velocity(5.0), STARTS).truth(TIMES, rng=rng())
    truth.validate()
    for scan, time in enumerate(TIMES):
        ids, states = truth.at(scan)
        np.testing.assert_array_equal(ids, [0, 1, 2])
        np.testing.assert_allclose(states[:, :2], STARTS[:, :2] + (time - 1.0) * STARTS[:, 2:], rtol=1e-12)
        np.testing.assert_array_equal(states[:, 2:], STARTS[:, 2:])


def test_targets_come_and_go():
    targets = ScriptedTargets(
        models.constant_velocity(5.0), STARTS, np.array([1.0, 10.5, 40.0]), np.array([5.0, np.inf, 99.0])
    )
    truth = targets.truth(TIMES, rng=rng())
    truth.validate()
    alive = {target: TIMES[[target in truth.at(k)[0] for k in range(40)]] for target in range(3)}
    np.testing.assert_array_equal(alive[0], TIMES[:5])
    np.testing.assert_array_equal(alive[1], TIMES[10:])
    np.testing.assert_array_equal(alive[2], [40.0])
    first = truth.at(10)[1][0]
    np.testing.assert_allclose(first[:2], STARTS[1, :2] + 0.5 * STARTS[1, 2:])


def test_start_times_from_another_sum_still_meet_their_scan():
    times = np.cumsum(np.full(30, 0.1))
    targets = ScriptedTargets(models.constant_velocity(5.0), STARTS[:1], np.array([0.1 * 3]), np.array([0.1 * 20]))
    truth = targets.truth(times, rng=rng())
    np.testing.assert_array_equal(np.flatnonzero(np.diff(truth.offsets)), np.arange(2, 20))
    np.testing.assert_array_equal(truth.states[0], STARTS[0])


def test_process_noise_has_the_models_covariance():
    motion, num = models.coordinated_turn(2.0, 0.1), 3000
    states = np.tile([0.0, 0.0, 10.0, 0.0, 0.05], (num, 1))
    _, moved = ScriptedTargets(motion, states, process_noise=True).truth([0.0, 2.0], rng=rng()).at(1)
    noise = moved - motion.propagate(states[0], 2.0)[0]
    expected = motion.noise_cov(states[0], 2.0)
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_allclose(noise.T @ noise / num / scale, expected / scale, atol=0.1)


def test_process_noise_target_by_target():
    targets = ScriptedTargets(models.constant_velocity(5.0), STARTS, process_noise=[False, True, False])
    still = ScriptedTargets(models.constant_velocity(5.0), STARTS).truth(TIMES, rng=rng())
    some = targets.truth(TIMES, rng=rng())
    differs = np.abs(some.at(39)[1] - still.at(39)[1]).max(axis=1) > 0.0
    np.testing.assert_array_equal(differs, [False, True, False])
    np.testing.assert_array_equal(some.states, targets.truth(TIMES, rng=rng()).states)


def test_first_states_are_drawn_anew_in_each_run():
    stds = np.array([[0.0, 0.0, 0.0, 0.0], [10.0, 20.0, 1.0, 2.0]])
    targets = ScriptedTargets(models.constant_velocity(5.0), STARTS[:2], initial_stds=stds)
    draws = np.random.default_rng(3)
    first = np.array([targets.truth(TIMES[:2], rng=draws).at(0)[1] for _ in range(2000)])
    np.testing.assert_array_equal(first[:, 0], np.broadcast_to(STARTS[0], (2000, 4)))
    np.testing.assert_allclose(first[:, 1].mean(axis=0), STARTS[1], atol=5.0 * stds[1].max() / np.sqrt(2000))
    np.testing.assert_allclose(first[:, 1].std(axis=0), stds[1], rtol=0.08)
    np.testing.assert_allclose(np.corrcoef(first[:, 1].T), np.eye(4), atol=0.1)
    truth = targets.truth(TIMES, rng=rng())
    start, end = truth.at(0)[1], truth.at(39)[1]
    np.testing.assert_allclose(end[:, :2], start[:, :2] + 39.0 * start[:, 2:])


def test_no_targets():
    truth = ScriptedTargets(models.constant_velocity(5.0), np.empty((0, 4))).truth(TIMES, rng=rng())
    truth.validate()
    assert truth.at(3)[1].shape == (0, 4)


@pytest.mark.parametrize("dt", [0.5, 2.0])
def test_semidefinite_factor(dt):
    for motion in (models.constant_velocity(5.0), models.coordinated_turn(5.0, 0.02)):
        cov = motion.noise_cov(np.zeros(motion.state_dim), dt)
        factor = semidefinite_factor(cov)
        np.testing.assert_allclose(factor @ factor.T, cov, rtol=1e-12)
    np.testing.assert_array_equal(semidefinite_factor(np.zeros((4, 4))), np.zeros((4, 4)))
    for bad in (np.diag([1.0, -1.0]), np.array([[1.0, math.nan], [math.nan, 1.0]])):
        with pytest.raises(InputError, match="positive semidefinite"):
            semidefinite_factor(bad)


@pytest.mark.parametrize("times", [[], [1.0, 1.0], [2.0, 1.0], [math.nan], 3.0])
def test_bad_scan_times(times):
    with pytest.raises(InputError, match="times: expected"):
        ScriptedTargets(models.constant_velocity(5.0), STARTS).truth(times, rng=rng())


def test_a_motion_that_ends_nowhere():
    cv = models.constant_velocity(5.0)
    motion = models.MotionModel(4, nothing_like_a_state, cv.process_noise_cov, noise_params=cv.noise_params)
    with pytest.raises(ModelError, match="expected a finite state"):
        ScriptedTargets(motion, STARTS).truth(TIMES, rng=rng())


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"times": np.array([2.0, 1.0])}, "times"),
        ({"offsets": np.array([0, 2])}, "Truth.offsets"),
        ({"offsets": np.array([0, 3, 2])}, "Truth.offsets"),
        ({"states": np.zeros((1, 4))}, "Truth.states"),
        ({"ids": np.array([0, -1])}, "Truth.ids"),
        ({"offsets": np.array([0, 2, 2]), "ids": np.array([4, 4])}, "Truth.ids"),
    ],
)
def test_validate(change, field):
    good = {"times": np.array([1.0, 2.0]), "offsets": np.array([0, 1, 2]), "ids": np.array([0, 0])}
    Truth(**good, states=np.zeros((2, 4))).validate()
    with pytest.raises(InputError, match=field):
        Truth(**{"states": np.zeros((2, 4)), **good, **change}).validate()


def test_no_such_scan():
    truth = ScriptedTargets(models.constant_velocity(5.0), STARTS).truth(TIMES, rng=rng())
    for scan in (-1, 40):
        with pytest.raises(InputError, match="a scan from 0 to 39"):
            truth.at(scan)
