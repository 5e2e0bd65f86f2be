"""Scans: their statistics, their order, and the numbers they draw."""

from __future__ import annotations

import math

import numpy as np
import pytest

from vedette import models
from vedette.errors import InputError, ModelError
from vedette.simulation import CLUTTER, simulate_scan

REGION = models.Region(-1000.0, 1000.0, -1000.0, 1000.0)
POSE = np.array([-745.0, 830.0, 0.0])
STATES = np.array([[-55.0, 875.0, 15.0, -6.0], [-180.0, -205.0, -5.5, -19.0], [340.0, -5.0, 10.0, 6.0]])


def sensor(*, rate=25.0, detection=None, noise=None):
    return models.SensorModel(
        models.bearing_range(),
        noise or models.range_dependent_noise(10.0, 5e-5, math.pi / 180, 5e-6),
        detection or models.constant_detection(0.8),
        models.region_clutter(rate, REGION, "bearing_range"),
    )


def scans(count, **options):
    rng = np.random.default_rng(11)
    return [simulate_scan(STATES, POSE, sensor(**options), rng=rng) for _ in range(count)]


def test_detections_and_clutter_come_as_often_as_they_should():
    num = 600
    taken = scans(num)
    detected = np.array([[np.sum(scan.origins == target) for target in range(3)] for scan in taken])
    assert set(np.unique(detected)) == {0, 1}
    np.testing.assert_allclose(detected.mean(axis=0), 0.8, atol=4 * math.sqrt(0.16 / num))
    clutter = np.array([np.sum(scan.origins == CLUTTER) for scan in taken])
    assert clutter.mean() == pytest.approx(25.0, abs=4 * math.sqrt(25.0 / num))
    assert clutter.var() == pytest.approx(25.0, rel=0.3)
    assert all(len(scan.measurements) == len(scan.origins) for scan in taken)


def test_noise_has_the_covariance_at_the_true_state():
    model = sensor(rate=0.0, detection=models.constant_detection(1.0))
    rng = np.random.default_rng(2)
    exact = model.measurement.measure(STATES, POSE)
    covs = model.noise.covs(STATES, POSE, 2)
    errors = np.empty((1500, 3, 2))
    for row in errors:
        scan = simulate_scan(STATES, POSE, model, rng=rng)
        row[scan.origins] = scan.measurements - exact[scan.origins]
    for target in range(3):
        stds = np.sqrt(np.diag(covs[target]))
        whitened = errors[:, target] / stds
        np.testing.assert_allclose(whitened.T @ whitened / 1500, np.eye(2), atol=0.15)


def test_order_tells_nothing():
    places = [float(np.mean(scan.origins[: len(scan.origins) // 2] >= 0)) for scan in scans(400)]
    shares = [float(np.mean(scan.origins >= 0)) for scan in scans(400)]
    assert np.mean(places) == pytest.approx(np.mean(shares), abs=0.015)


def test_bearings_stay_on_the_circle():
    behind = np.tile([-900.0, 830.0, 0.0, 0.0], (200, 1))
    model = sensor(rate=0.0, detection=models.constant_detection(1.0))
    bearings = simulate_scan(behind, POSE, model, rng=np.random.default_rng(3)).measurements[:, 0]
    assert ((bearings > -math.pi) & (bearings <= math.pi)).all()
    assert (bearings < -3.0).any()
    assert (bearings > 3.0).any()


def test_ids_go_with_their_measurements():
    model = sensor(detection=models.constant_detection(1.0))
    scan = simulate_scan(STATES, POSE, model, ids=[7, 3, 9], rng=np.random.default_rng(4))
    assert sorted(scan.origins[scan.origins >= 0]) == [3, 7, 9]
    exact = model.measurement.measure(STATES, POSE)
    for place, name in enumerate((7, 3, 9)):
        measured = scan.measurements[scan.origins == name][0]
        assert np.abs(measured - exact[place]).max() < 5 * 80.0
        assert abs(measured[0] - exact[place, 0]) < 0.2


def test_the_pose_does_not_change_what_is_drawn():
    """Two sensors with the same generator but other places leave it in the same state: paired luck later on."""
    near, far = np.random.default_rng(5), np.random.default_rng(5)
    model = sensor(detection=models.limited_range(0.9, 700.0))
    first = simulate_scan(STATES, POSE, model, rng=near)
    second = simulate_scan(STATES, [900.0, -900.0, 1.0], model, rng=far)
    assert (first.origins >= 0).sum() != (second.origins >= 0).sum()
    assert near.uniform() == far.uniform()


def test_same_seed_same_scan():
    for first, second in zip(scans(3), scans(3), strict=True):
        np.testing.assert_array_equal(first.measurements, second.measurements)
        np.testing.assert_array_equal(first.origins, second.origins)


def test_scans_without_targets():
    scan = simulate_scan(np.empty((0, 4)), POSE, sensor(rate=0.0), rng=np.random.default_rng(0))
    assert scan.measurements.shape == (0, 2)
    assert scan.origins.shape == (0,)


@models.model_function("measurement_noise_cov")
def no_covariance(state, pose, params, out):
    for i in range(2):
        for j in range(2):
            out[i, j] = params[0]


@models.model_function("prob_detection")
def too_sure(state, pose, params):
    return 2.0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"noise": models.NoiseModel(no_covariance, np.array([-1.0]))}, "noise model at state .*positive definite"),
        ({"noise": models.NoiseModel(no_covariance, np.array([np.inf]))}, "model at state "),
        ({"detection": models.DetectionModel(too_sure)}, "detection model at state .*a probability; got 2.0"),
    ],
)
@pytest.mark.filterwarnings("ignore:invalid value")
def test_models_that_give_nonsense(options, message):
    with pytest.raises(ModelError, match=message):
        scans(1, **options)


@pytest.mark.parametrize(
    ("states", "pose", "ids", "field"),
    [
        (STATES[0], POSE, None, "truth_states"),
        (STATES * np.nan, POSE, None, "truth_states"),
        (STATES, POSE[:2], None, "pose"),
        (STATES, POSE, [1, 2], "ids"),
    ],
)
def test_bad_input(states, pose, ids, field):
    with pytest.raises(InputError, match=field):
        simulate_scan(states, pose, sensor(), ids=ids, rng=np.random.default_rng(0))
