"""Errors and misses that last: what a scan is worth, the models of filters, and the sequences of a simulation."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from vedette import models
from vedette.errors import InputError
from vedette.evaluation.observation_history import ObservationHistory
from vedette.filters import Limits, LmbFilter
from vedette.kernels.gaussian.components import components_of
from vedette.models.correlation import discounted, independent_share
from vedette.models.functions import model_function
from vedette.simulation.true_sensors import ErrorMemory, TrueSensor

ANYWHERE = models.Region(-1000.0, 1000.0, -1000.0, 1000.0)
STATES = np.array([[30.0, 40.0, 1.0, 0.0], [-200.0, 90.0, 0.0, 2.0], [1e-3, 0.0, 0.0, 0.0]])
POSE = np.zeros(3)


def sensor(noise: Any, detection: Any, measurement: Any = None) -> models.SensorModel:
    measured = measurement or models.bearing_range()
    return models.SensorModel(measured, noise, detection, models.region_clutter(1e-3, ANYWHERE, "bearing_range"))


@pytest.mark.parametrize(("interval", "lasts"), [(0.1, 0.5), (0.2, 10.0), (1.0, 1.0), (2.0, 0.1)])
def test_a_scan_is_worth_what_the_mean_of_many_errors_says(interval: float, lasts: float):
    num = 4000 * max(1, round(lasts / interval))
    lags = np.arange(1, num)
    variance_of_mean = (num + 2.0 * ((num - lags) * np.exp(-lags * interval / lasts)).sum()) / num**2
    assert independent_share(interval, lasts) == pytest.approx(1.0 / (num * variance_of_mean), rel=1e-3)


def test_without_a_correlation_time_a_scan_is_worth_a_scan():
    assert independent_share(0.1, 0.0) == 1.0
    given = sensor(models.constant_noise([0.01, 5.0]), models.constant_detection(0.9))
    assert discounted(given, 0.1, 0.0) is given


@pytest.mark.parametrize(
    "noise",
    [
        models.constant_noise([0.01, 5.0]),
        models.range_dependent_noise(sigma_range=5.0, eta_range=1e-4, sigma_bearing=0.01, eta_bearing=1e-5),
        models.range_dependent_noise(sigma_range=5.0, sigma_bearing=0.01, extent=4.0),
    ],
)
def test_the_noise_of_filters_is_that_over_the_share(noise: models.NoiseModel):
    share = independent_share(0.5, 3.0)
    wide = discounted(sensor(noise, models.constant_detection(0.9)), 0.5, 3.0)
    far = STATES[:2]  # nearer than the extent, an angle is bounded
    np.testing.assert_allclose(wide.noise.covs(far, POSE, 2), noise.covs(far, POSE, 2) / share, rtol=1e-12)


@model_function("measurement_noise_cov")
def own_noise(state: Any, pose: Any, params: Any, out: Any) -> None:
    out[0, 0], out[0, 1], out[1, 0], out[1, 1] = 1e-4, 0.0, 0.0, 25.0


@pytest.mark.parametrize(
    ("given", "noise_s", "words"),
    [
        (sensor(models.NoiseModel(own_noise), models.constant_detection(0.9)), 1.0, "noise: expected a built-in"),
        (sensor(models.constant_noise([0.01, 5.0]), models.constant_detection(0.9)), -1.0, "noise_s: expected"),
    ],
)
def test_what_cannot_be_discounted_is_refused(given: models.SensorModel, noise_s: float, words: str):
    with pytest.raises(InputError, match=words):
        discounted(given, 0.5, noise_s)


def sequences(true: TrueSensor, times: list[float], num: int = 40_000) -> tuple[np.ndarray, np.ndarray]:
    """Errors (num_times, num, 2) and visibility (num_times, num) of many targets."""
    rng, memory, ids, errors, visible = np.random.default_rng(3), ErrorMemory(), np.arange(num), [], []
    for time in times:
        errors.append(rng.standard_normal((num, 2)))
        visible.append(memory.lasting(true, time, ids, errors[-1], rng.random(num)))
    return np.array(errors), np.array(visible)


KNOWN = sensor(models.constant_noise([0.01, 5.0]), models.constant_detection(0.9))


def test_errors_are_correlated_by_the_time_between_scans_and_distributed_as_ever():
    times = [0.0, 0.5, 3.0]
    errors, visible = sequences(TrueSensor(KNOWN, noise_s=2.0), times)
    assert visible.all()
    tolerance = 5.0 / math.sqrt(errors.shape[1])
    np.testing.assert_allclose(errors.var(axis=1), 1.0, atol=2.0 * tolerance)
    for i in range(3):
        for j in range(i):
            expected = math.exp((times[j] - times[i]) / 2.0)
            assert np.corrcoef(errors[i, :, 0], errors[j, :, 0])[0, 1] == pytest.approx(expected, abs=tolerance)
    assert abs(np.corrcoef(errors[1, :, 0], errors[1, :, 1])[0, 1]) < tolerance


def test_targets_are_visible_as_a_chain_of_two_states_says():
    times, stays = [0.0, 0.5, 3.0, 3.0], (6.0, 2.0)
    errors, visible = sequences(TrueSensor(KNOWN, stays_s=stays), times)
    tolerance = 5.0 / math.sqrt(errors.shape[1])
    np.testing.assert_allclose(visible.mean(axis=1), 0.75, atol=tolerance)
    rates = np.array([[-1.0 / 6.0, 1.0 / 6.0], [0.5, -0.5]])
    for before, after in ((0, 1), (1, 2), (0, 2)):
        moved = expm(rates * (times[after] - times[before]))
        assert visible[after][visible[before]].mean() == pytest.approx(moved[0, 0], abs=2.0 * tolerance)
        assert visible[after][~visible[before]].mean() == pytest.approx(moved[1, 0], abs=2.0 * tolerance)
    np.testing.assert_array_equal(visible[3], visible[2])
    rng = np.random.default_rng(3)
    np.testing.assert_array_equal(errors[0], rng.standard_normal((len(errors[0]), 2)))  # errors do not last


def test_modes_of_targets_that_hide_are_independent_chains():
    motions = models.constant_velocity(1.0), models.constant_turn(0.2, 1.0)
    base = models.Modes(motions, (9.0, 4.0), names=("cruise", "turn"), detection_factors=[1.0, 0.5])
    stays = {"eo": (6.0, 2.0), "ir": (1.0, 3.0)}
    made, factors = models.hiding_modes(base, stays)
    chains = [np.array([[-1.0 / v, 1.0 / v], [1.0 / h, -1.0 / h]]) for v, h in stays.values()]
    product = np.kron(np.kron(expm(base.rates * 0.7), expm(chains[0] * 0.7)), expm(chains[1] * 0.7))
    np.testing.assert_allclose(expm(made.rates * 0.7), product, atol=1e-13)
    np.testing.assert_allclose(made.at_birth, np.kron(np.kron(base.at_birth, [0.75, 0.25]), [0.25, 0.75]), atol=1e-12)
    assert [made.motions.index(each) for each in made.motions] == [0] * 4 + [4] * 4
    assert made.names[:2] == ("cruise", "cruise, hidden from ir")
    assert made.names[-1] == "turn, hidden from eo, hidden from ir"
    assert factors["eo"].tolist() == [1.0, 1.0, 0.0, 0.0, 0.5, 0.5, 0.0, 0.0]
    assert factors["ir"].tolist() == [1.0, 0.0, 1.0, 0.0, 0.5, 0.0, 0.5, 0.0]
    assert made.detection_factors.tolist() == [1.0] * 4 + [0.5] * 4


def test_a_motion_of_one_mode_gets_two():
    made, factors = models.hiding_modes(models.constant_velocity(1.0), {"camera": (6.0, 2.0)})
    assert made.names == ("visible", "hidden from camera")
    assert factors["camera"].tolist() == [1.0, 0.0]
    np.testing.assert_allclose(made.rates, [[-1.0 / 6.0, 1.0 / 6.0], [0.5, -0.5]])


def test_factors_of_a_sensor_are_one_for_each_mode():
    wrong = replace(KNOWN, mode_factors=np.array([1.0, 0.0]))
    with pytest.raises(InputError, match=r"mode_factors: expected a factor for each of 1 modes"):
        models.sensor_of_filter(wrong, models.constant_velocity(1.0))
    with pytest.raises(InputError, match=r"mode_factors: expected numbers in \[0, 1\]; got \[1.5\]"):
        replace(KNOWN, mode_factors=np.array([1.5]))


def test_a_filter_keeps_the_probability_that_its_target_is_hidden():
    """Against the forward recursion of a hidden Markov chain, which begins with the second scan of a target."""
    place, dt, clutter = np.array([[100.0, 50.0]]), 0.5, 1e-6
    motion, factors = models.hiding_modes(models.constant_velocity(1e-3), {"camera": (6.0, 2.0)})
    birth = models.BirthModel(np.array([1.0 - 1e-9]), np.array([[100.0, 50.0, 0.0, 0.0]]), np.eye(4)[None] * 1e-4)
    camera = models.SensorModel(
        models.position(),
        models.constant_noise([5.0, 5.0]),
        models.constant_detection(0.8),
        models.region_clutter(clutter, ANYWHERE, "position"),
        mode_factors=factors["camera"],
    )
    targets = models.TargetModel(motion, models.constant_survival(1.0), replace(birth, steps=frozenset({1})))
    tracker, probs = LmbFilter(targets, camera, Limits.none()), np.array([0.75, 0.25])
    belief, chain = tracker.initial(), expm(motion.rates * dt)
    for step, is_detected in enumerate([True, False, False, True, False, False, False, True, True], start=1):
        scan = place if is_detected else np.empty((0, 2))
        belief, _ = tracker.step(belief, scan, np.zeros(3), dt, step, rng=np.random.default_rng(0))
        if step == 1:
            continue
        seen = 0.8 * np.array([1.0, 0.0])
        probs = (probs @ chain) * (seen if is_detected else 1.0 - seen)
        probs /= probs.sum()
        weights = np.exp(belief.tracks.log_weights)
        hidden = weights[belief.tracks.modes == 1].sum() / weights.sum()
        assert hidden == pytest.approx(probs[1], abs=1e-5)


def test_a_joined_track_of_a_target_that_may_hide_moves_by_its_mixed_motion():
    motion, _ = models.hiding_modes(models.constant_velocity(1.0), {"camera": (6.0, 2.0)})
    birth = models.BirthModel(np.array([0.5]), np.zeros((1, 4)), np.eye(4)[None])
    targets = models.TargetModel(motion, models.constant_survival(0.99), birth)
    scanned, times = np.ones((3, 1), np.bool_), np.array([0.0, 1.0, 2.0])
    history = ObservationHistory(targets, (KNOWN,), times, np.zeros((3, 1, 3)), scanned, 0.0)
    means = np.array([[0.0, 0.0, 5.0, 0.0], [9.0, 9.0, 0.0, 1.0]])
    before = components_of(np.zeros(2), means, np.array([np.eye(4)] * 2))
    after = history.predict(before, 0, 2)
    np.testing.assert_allclose(after.means, [[10.0, 0.0, 5.0, 0.0], [9.0, 11.0, 0.0, 1.0]], atol=1e-12)
    np.testing.assert_allclose(np.exp(after.log_weights), 0.99**2)
