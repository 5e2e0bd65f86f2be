"""Built-in measurements, noise and detection against plain formulas."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from reference.differences import central_differences
from vedette import models
from vedette.errors import InputError, ModelError

pytestmark = pytest.mark.lanes

POSE = np.array([-745.0, 830.0, 0.4])
RNG = np.random.default_rng(5)
STATES = np.hstack([RNG.uniform(-1000, 1000, (30, 2)), RNG.normal(0, 10, (30, 2))])
OFFSETS = STATES[:, :2] - POSE[:2]
RANGES = np.linalg.norm(OFFSETS, axis=1)
BEARINGS = np.arctan2(OFFSETS[:, 1], OFFSETS[:, 0])
RATES = (OFFSETS * STATES[:, 2:]).sum(axis=1) / RANGES

MEASUREMENTS = {
    "bearing_range": (models.bearing_range(), np.stack([BEARINGS, RANGES], axis=1)),
    "bearing_range_rate": (models.bearing_range_rate(), np.stack([BEARINGS, RANGES, RATES], axis=1)),
    "bearing_only": (models.bearing_only(), BEARINGS[:, None]),
    "range_only": (models.range_only(), RANGES[:, None]),
    "position": (models.position(), STATES[:, :2]),
}


def jacobian(measurement, state, pose):
    out = np.full((measurement.meas_dim, len(state)), np.nan)
    measurement.jacobian(state, pose, measurement.params, out)
    return out


@pytest.mark.parametrize("kind", MEASUREMENTS)
def test_measurement(kind):
    measurement, expected = MEASUREMENTS[kind]
    np.testing.assert_allclose(measurement.measure(STATES, POSE), expected, rtol=1e-14)
    measurement.check(STATES, POSE)


@pytest.mark.parametrize("kind", MEASUREMENTS)
@pytest.mark.parametrize("state_dim", [4, 5])
def test_jacobian_is_the_derivative(kind, state_dim):
    measurement, _ = MEASUREMENTS[kind]
    for state in np.hstack([STATES, np.ones((30, 1))])[:, :state_dim]:
        slopes = central_differences(lambda moved: measurement.measure(moved, POSE)[0], state, 1e-4)
        np.testing.assert_allclose(jacobian(measurement, state, POSE), slopes, atol=1e-7)


def test_bearings_cover_all_quadrants_and_never_minus_pi():
    states = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [-1, -1, 0, 0]], dtype=float)
    bearings = models.bearing_only().measure(states, np.zeros(3))[:, 0]
    np.testing.assert_allclose(bearings, [0, math.pi / 2, math.pi, -math.pi / 2, -3 * math.pi / 4])


@pytest.mark.parametrize("kind", ["bearing_range", "bearing_range_rate", "bearing_only", "range_only"])
def test_a_target_at_the_sensor_has_a_finite_jacobian(kind):
    measurement, _ = MEASUREMENTS[kind]
    np.testing.assert_array_equal(jacobian(measurement, np.zeros(4), np.zeros(3)), np.zeros((measurement.meas_dim, 4)))


def test_range_dependent_noise_is_the_papers():
    sigma_range, sigma_bearing = 10.0 + 5e-5 * RANGES**2, math.pi / 180 + 5e-6 * RANGES
    both = models.range_dependent_noise(10.0, 5e-5, math.pi / 180, 5e-6)
    expected = np.zeros((30, 2, 2))
    expected[:, 0, 0], expected[:, 1, 1] = sigma_bearing**2, sigma_range**2
    np.testing.assert_allclose(both.covs(STATES, POSE, 2), expected, rtol=1e-13)
    bearing = models.range_dependent_noise(sigma_bearing=math.pi / 180, eta_bearing=5e-6)
    np.testing.assert_allclose(bearing.covs(STATES, POSE, 1)[:, 0, 0], sigma_bearing**2, rtol=1e-13)
    ranging = models.range_dependent_noise(10.0, 5e-5)
    np.testing.assert_allclose(ranging.covs(STATES, POSE, 1)[:, 0, 0], sigma_range**2, rtol=1e-13)
    assert (both.meas_dim, bearing.meas_dim, ranging.meas_dim) == (2, 1, 1)
    both.check(STATES, POSE, 2)


def test_constant_noise():
    noise = models.constant_noise([2.0, 3.0])
    np.testing.assert_array_equal(noise.covs(STATES[:1], POSE, 2), [[[4.0, 0.0], [0.0, 9.0]]])


def test_noise_by_axis_grows_with_the_offset_along_it():
    noise = models.axis_noise([1.0, 2.0], [1e-5, 3e-5])
    expected = np.zeros((30, 2, 2))
    expected[:, 0, 0] = (1.0 + 1e-5 * OFFSETS[:, 0] ** 2) ** 2
    expected[:, 1, 1] = (2.0 + 3e-5 * OFFSETS[:, 1] ** 2) ** 2
    np.testing.assert_allclose(noise.covs(STATES, POSE, 2), expected, rtol=1e-13)
    assert noise.meas_dim == 2
    noise.check(STATES, POSE, 2)


def test_gaussian_detection_is_the_papers():
    detection = models.gaussian_detection(500.0)
    peak, at = (math.exp(-0.5 * (d / 500.0) ** 2) / (500.0 * math.sqrt(2 * math.pi)) for d in (0.0, RANGES[0]))
    assert detection.prob(STATES[0], POSE)[0] == pytest.approx(at / peak, rel=1e-12)


@pytest.mark.parametrize(
    "detection",
    [
        models.constant_detection(1.0),
        models.gaussian_detection(1e4),
        models.limited_range(1.0, 100.0),
        models.limited_sector(1.0, 100.0, 1.0),
    ],
)
def test_certain_detection_is_kept_below_one(detection):
    assert detection.prob([POSE[0], POSE[1], 0.0, 0.0], POSE)[0] == models.MAX_PROB_DETECTION < 1.0


def test_limited_range():
    np.testing.assert_array_equal(
        models.limited_range(0.9, 800.0).prob(STATES, POSE), np.where(RANGES <= 800.0, 0.9, 0)
    )


@pytest.mark.parametrize("heading", [0.0, 1.0, 3.0, math.pi, -3.0, 9.0])
def test_limited_sector(heading):
    pose = np.array([POSE[0], POSE[1], heading])
    off_axis = np.abs(np.angle(np.exp(1j * (BEARINGS - heading))))
    expected = np.where((RANGES <= 900.0) & (off_axis <= 0.7), 0.9, 0.0)
    np.testing.assert_array_equal(models.limited_sector(0.9, 900.0, 0.7).prob(STATES, pose), expected)


def test_a_full_sector_is_a_limited_range():
    sector = models.limited_sector(0.9, 900.0, math.pi).prob(STATES, POSE)
    np.testing.assert_array_equal(sector, models.limited_range(0.9, 900.0).prob(STATES, POSE))


def test_some_may_be_seen_beyond_the_edge():
    ranging, sector = models.limited_range(0.9, 800.0, 0.2), models.limited_sector(0.9, 800.0, 0.7, outside=0.2)
    np.testing.assert_array_equal(ranging.prob(STATES, POSE), np.where(RANGES <= 800.0, 0.9, 0.2))
    off_axis = np.abs(np.angle(np.exp(1j * (BEARINGS - POSE[2]))))
    expected = np.where((RANGES <= 800.0) & (off_axis <= 0.7), 0.9, 0.2)
    np.testing.assert_array_equal(sector.prob(STATES, POSE), expected)


def logistic(exponent):
    return 1.0 / (1.0 + np.exp(exponent))


@pytest.mark.parametrize("cut", [False, True])
@pytest.mark.parametrize("half_width", [0.8, math.pi])
def test_a_soft_sector_falls_off_at_its_edges(half_width, cut):
    off_axis = np.abs(np.angle(np.exp(1j * (BEARINGS - POSE[2]))))
    detection = models.soft_sector(0.9801, 900.0, half_width, range_slope=0.01, angle_slope=20.0, hard_limit=cut)
    expected = 0.9801 * logistic(0.01 * (RANGES - 900.0)) * logistic(20.0 * (off_axis - half_width))
    if cut:
        expected = np.where((off_axis <= half_width) & (RANGES <= 900.0), expected, 0.0)
    np.testing.assert_allclose(detection.prob(STATES, POSE), expected, rtol=1e-11)
    detection.check(STATES, POSE)


@pytest.mark.parametrize("half_width", [0.8, math.pi])
def test_a_soft_range_with_sharp_sides(half_width):
    off_axis = np.abs(np.angle(np.exp(1j * (BEARINGS - POSE[2]))))
    detection = models.soft_sector(0.9, 900.0, half_width, range_slope=0.01)
    expected = np.where(off_axis <= half_width, 0.9 * logistic(0.01 * (RANGES - 900.0)), 0.0)
    np.testing.assert_allclose(detection.prob(STATES, POSE), expected, rtol=1e-12)


def test_a_soft_sector_far_away_and_at_the_sensor():
    detection = models.soft_sector(1.0, 100.0, 0.5, range_slope=5.0, angle_slope=50.0)
    there = detection.prob([[POSE[0] + 1e7, POSE[1], 0.0, 0.0], [POSE[0], POSE[1], 0.0, 0.0]], POSE)
    np.testing.assert_allclose(there, [0.0, 1.0], atol=1e-8)


@pytest.mark.parametrize(
    ("detection", "reach"),
    [
        (models.limited_range(0.9, 600.0), 600.0),
        (models.limited_range(0.9, 600.0, 0.1), math.inf),
        (models.limited_sector(0.9, 600.0, 1.0), 600.0),
        (models.limited_sector(0.9, 600.0, 1.0, 0.1), math.inf),
        (models.camera(0.9, 600.0), 600.0),
        (models.camera(0.9, 600.0, 0.3), math.inf),
        (models.gaussian_detection(600.0), math.inf),
        (models.constant_detection(0.9), math.inf),
    ],
)
def test_nothing_is_detected_beyond_the_reach(detection, reach):
    assert detection.reach == reach
    detection.check(STATES, np.array([*POSE, 0.2, 0.5]))
    assert not detection.prob(STATES, np.array([*POSE, 0.2, 0.5]))[reach < RANGES].any()


def test_a_wrong_reach_is_detected():
    detection = replace(models.gaussian_detection(600.0), reach=900.0)
    detection.check(STATES[RANGES < 900.0], POSE)
    with pytest.raises(ModelError, match="expected 0, as its reach is 900 m; got 0"):
        detection.check(STATES, POSE)
    with pytest.raises(InputError, match=r"DetectionModel\.reach: expected a number above 0; got 0"):
        replace(detection, reach=0.0)


EXTENT = {
    "bearing_range": {"sigma_range": 8.0, "eta_range": 1e-5, "sigma_bearing": 0.01, "eta_bearing": 1e-5},
    "bearing_range_rate": {"sigma_range": 8.0, "sigma_bearing": 0.01, "sigma_range_rate": 0.5},
    "bearing_only": {"sigma_bearing": 0.01, "eta_bearing": 1e-5},
    "range_only": {"sigma_range": 8.0, "eta_range": 1e-5},
}


@pytest.mark.parametrize("kind", EXTENT)
def test_an_extent_is_an_error_of_the_position_in_the_plane(kind):
    measurement, own = MEASUREMENTS[kind][0], EXTENT[kind]
    plain, wide = models.range_dependent_noise(**own), models.range_dependent_noise(**own, extent=6.6)
    wide.check(STATES, POSE, measurement.meas_dim)
    for state in STATES:
        turned = jacobian(measurement, state, POSE)[:2, :2]
        added = np.zeros((measurement.meas_dim,) * 2)
        added[: len(turned), : len(turned)] = 6.6**2 * turned @ turned.T
        np.testing.assert_allclose(cov(wide, state), cov(plain, state) + added, rtol=1e-12, atol=1e-15)


def test_the_bearing_of_an_extent_is_within_a_radian_at_the_sensor():
    noise = models.range_dependent_noise(sigma_bearing=0.01, extent=6.6)
    at = np.array([*POSE[:2], 1.0, 0.0])
    for offset in (0.0, 1.0, 6.6):
        np.testing.assert_allclose(cov(noise, at + np.array([offset, 0.0, 0.0, 0.0])), [[1.0001]])
    with pytest.raises(InputError, match=r"extent: expected a number of at least 0; got -1"):
        models.range_dependent_noise(sigma_bearing=0.01, extent=-1.0)


def cov(noise, state):
    out = np.full((noise.meas_dim, noise.meas_dim), np.nan)
    noise.function(state, POSE, noise.params, out)
    return out
