"""Scans against plain NumPy, bit for bit, of all kinds of models and of a user's own."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest

from reference import scans as reference
from vedette import models
from vedette.errors import ModelError
from vedette.models import Bias, SensorModel
from vedette.models.measurement import wrap_angles
from vedette.simulation import CLUTTER, TrueSensor, simulate_scan, simulate_scans

pytestmark = pytest.mark.lanes

REGION = models.Region(-1000.0, 1000.0, -800.0, 1200.0)
POSE = np.array([140.0, -60.0, 0.4, 0.3, 0.7])


@models.model_function("measurement")
def bearing_range_speed(state, pose, params, out):
    out[0] = math.atan2(state[1] - pose[1], state[0] - pose[0]) + params[0]
    out[1] = math.hypot(state[0] - pose[0], state[1] - pose[1])
    out[2] = state[2]


@models.model_function("measurement_noise_cov")
def correlated(state, pose, params, out):
    for i in range(len(params)):
        for j in range(len(params)):
            out[i, j] = params[i] * params[j] * (1.0 if i == j else 0.4 + 1e-6 * math.sin(state[0]))


@models.model_function("prob_detection")
def falling(state, pose, params):
    return 1.0 / (1.0 + math.exp((math.hypot(state[0] - pose[0], state[1] - pose[1]) - params[0]) / 200.0))


@models.model_function("log_clutter_intensity")
def even(measurement, pose, params):
    return -5.0


def own_sampler(pose, measurement, *, state_dim, rng):
    """Angles of several turns, which a scan has as they are."""
    return 4.0 * rng.standard_normal((rng.poisson(3.0), measurement.meas_dim))


MEASUREMENTS = {
    "bearing_range": models.bearing_range(),
    "bearing_only": models.bearing_only(),
    "range_only": models.range_only(),
    "position": models.position(),
    "own": models.MeasurementModel(3, bearing_range_speed, np.array([2.5]), angular=np.array([True, False, False])),
}
NOISES = {
    "bearing_range": [
        models.range_dependent_noise(10.0, 5e-5, math.pi / 180, 5e-6),
        models.constant_noise([0.5, 40.0]),
    ],
    "bearing_only": [models.range_dependent_noise(sigma_bearing=0.1, eta_bearing=1e-4)],
    "range_only": [models.range_dependent_noise(sigma_range=10.0, eta_range=1e-4)],
    "position": [models.axis_noise([5.0, 6.0], [1e-5, 2e-5]), models.NoiseModel(correlated, np.array([40.0, 30.0]))],
    "own": [models.NoiseModel(correlated, np.array([0.5, 40.0, 2.0]))],
}
DETECTIONS = [
    models.constant_detection(0.8),
    models.gaussian_detection(800.0),
    models.limited_sector(0.9, 900.0, 1.0, 0.1),
    models.soft_sector(0.95, 800.0, 1.2, range_slope=0.01, angle_slope=4.0),
    models.camera(0.9, 900.0),
    models.DetectionModel(falling, np.array([700.0])),
]
BIASES = {
    "bearing_range": [Bias(), Bias(range=-300.0, bearing=3.0, clock=0.7), Bias(x=30.0, y=-20.0)],
    "bearing_only": [Bias(), Bias(bearing=-2.0, x=5.0)],
    "range_only": [Bias(), Bias(range=-900.0)],
    "position": [Bias(), Bias(x=30.0, clock=-0.4)],
    "own": [Bias(), Bias(clock=0.1, y=9.0)],
}


def clutters(kind):
    own = models.ClutterModel(3.0, even, sampler=own_sampler)
    if kind == "own":
        return [own]
    found = [models.region_clutter(rate, REGION, kind) for rate in (0.0, 12.0)]
    if kind in ("bearing_range", "position"):
        found.append(models.around_sensor(8.0, kind, half_side=600.0, half_width_rad=0.7))
    low, angular = np.full(MEASUREMENTS[kind].meas_dim, 0.0), MEASUREMENTS[kind].angular
    high = np.where(angular, 2.0 * math.pi, 1500.0)
    return [*found, own, models.measurement_space_clutter(7.0, low, high, angular=angular)]


def states_of(num, rng):
    return rng.standard_normal((num, 5)) * [600.0, 600.0, 20.0, 20.0, 0.1]


@pytest.mark.parametrize("kind", MEASUREMENTS)
def test_every_scan_is_the_plain_one_to_the_last_bit(kind):
    rng = np.random.default_rng(17)
    for noise, detection, clutter, bias in product(NOISES[kind], DETECTIONS, clutters(kind), BIASES[kind]):
        model = SensorModel(MEASUREMENTS[kind], noise, detection, clutter)
        placed = model.measurement.places is not None and rng.random() < 0.5
        true = TrueSensor(model, detection_of="measurement" if placed else "state", bias=bias)
        states, seed = states_of(int(rng.choice([0, 1, 7, 200], p=[0.2, 0.3, 0.4, 0.1])), rng), int(rng.integers(2**40))
        ids, one, other = 3 * np.arange(len(states)) + 5, np.random.default_rng(seed), np.random.default_rng(seed)
        found, wanted = (
            simulate_scan(states, POSE, true, ids=ids, rng=one),
            reference.scan(states, POSE, true, ids, other),
        )
        assert found.measurements.dtype == np.float64
        assert found.origins.dtype == np.int64
        assert found.measurements.flags.c_contiguous
        assert (found.measurements.tobytes(), found.origins.tobytes()) == tuple(part.tobytes() for part in wanted)
        assert one.random() == other.random()


@pytest.mark.parametrize("kind", ["bearing_range", "bearing_only", "range_only", "position"])
def test_clutter_of_a_region_is_the_plain_one_to_the_last_bit(kind):
    model, measurement = models.region_clutter(30.0, REGION, kind), MEASUREMENTS[kind]
    for seed in range(5):
        found = model.sample(POSE, measurement, state_dim=5, rng=np.random.default_rng(seed))
        wanted = reference.region_clutter(30.0, REGION, measurement, POSE, 5, np.random.default_rng(seed))
        assert found.tobytes() == wanted.tobytes()


def test_sensors_together_scan_as_alone():
    model = SensorModel(MEASUREMENTS["position"], NOISES["position"][0], DETECTIONS[0], clutters("position")[1])
    states, poses = states_of(5, np.random.default_rng(1)), np.stack([POSE, POSE + 1.0, POSE])
    together = simulate_scans(states, poses, [model, None, model], rngs=[np.random.default_rng(s) for s in range(3)])
    assert together[1] is None
    for s in (0, 2):
        alone, found = simulate_scan(states, poses[s], model, rng=np.random.default_rng(s)), together[s]
        assert found is not None
        assert (found.measurements.tobytes(), found.origins.tobytes()) == (
            alone.measurements.tobytes(),
            alone.origins.tobytes(),
        )
        assert (found.origins == CLUTTER).any()


@pytest.mark.parametrize("scale", [1e-8, 1.0, 4.0, 100.0, 1e8])
def test_angles_on_the_circle(scale):
    edges = [math.pi, -math.pi, math.nextafter(math.pi, 4.0), math.nextafter(-math.pi, -4.0), 3 * math.pi, 0.0, -0.0]
    angles = np.concatenate([edges, scale * np.random.default_rng(2).standard_normal(2000)])
    assert wrap_angles(angles).tobytes() == reference.on_circle(angles).tobytes()
    table = np.asfortranarray(angles[:2000].reshape(20, 100))
    np.testing.assert_array_equal(wrap_angles(table), reference.on_circle(table))
    assert float(wrap_angles(np.array(4.0))) == float(reference.on_circle(np.array(4.0)))


@models.model_function("measurement")
def lost_beyond(state, pose, params, out):
    out[0], out[1] = state[0], math.nan if state[0] > params[0] else state[1]


@models.model_function("prob_detection")
def too_sure_beyond(state, pose, params):
    return math.nan if state[0] > params[0] else 0.5


@models.model_function("measurement_noise_cov")
def none_beyond(state, pose, params, out):
    out[0, 0], out[0, 1], out[1, 0], out[1, 1] = 1.0, 0.0, 0.0, -1.0 if state[0] > params[0] else 1.0


@models.model_function("prob_detection")
def raising_beyond(state, pose, params):
    if state[0] > params[0]:
        raise ValueError("too far")
    return 0.5


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"measurement": models.MeasurementModel(2, lost_beyond, np.array([1.0]))}, r"sensor model .* finite .* nan\]"),
        ({"noise": models.NoiseModel(none_beyond, np.array([1.0]))}, "noise model .* positive definite covariance"),
        (
            {"detection": models.DetectionModel(too_sure_beyond, np.array([1.0]))},
            "detection model .* probability; got nan",
        ),
        ({"detection": models.DetectionModel(raising_beyond, np.array([1.0]))}, "'raising_beyond' .* too far"),
    ],
)
def test_model_errors_are_reported_with_state_and_pose(parts, message):
    own = {
        "measurement": models.position(),
        "noise": models.constant_noise([1.0, 1.0]),
        "detection": DETECTIONS[0],
        "clutter": models.ClutterModel(3.0, even, sampler=own_sampler),
    }
    model, states = SensorModel(**(own | parts)), np.array([[0.0, 0.0, 0.0, 0.0], [2.0, 7.0, 0.0, 0.0]])
    with pytest.raises(ModelError, match=message) as caught:
        simulate_scan(states, POSE[:3], model, rng=np.random.default_rng(0))
    assert "[2. 7. 0. 0.]" in str(caught.value)
    assert "140." in str(caught.value)
