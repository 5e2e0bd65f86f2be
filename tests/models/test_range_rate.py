"""Range rates: of a sensor that moves, their Jacobian, noise and clutter, and what one of them says of a velocity."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from reference.differences import central_differences
from vedette import models
from vedette.errors import InputError
from vedette.kernels.base.types import OWN_VELOCITY, RowNoise
from vedette.kernels.gaussian.innovation import expect_measurement, make_innovation
from vedette.kernels.gaussian.scratch import make_scratch
from vedette.models.clutter import at_raw_measurements

pytestmark = pytest.mark.lanes

RNG = np.random.default_rng(8)
STATES = np.hstack([RNG.uniform(-1000, 1000, (20, 2)), RNG.normal(0, 20, (20, 2))])
POSE = np.array([-745.0, 830.0, 0.4, 0.0, 0.0, 0.0, 7.0, -3.0])
REGION = models.Region(-1000.0, 600.0, -300.0, 900.0)


def test_it_is_the_derivative_of_the_range_where_both_move():
    model, dt = models.bearing_range_rate(), 1e-3
    ranges = []
    for side in (-0.5, 0.5):
        states, pose = STATES.copy(), POSE.copy()
        states[:, :2] += side * dt * states[:, 2:]
        pose[:2] += side * dt * pose[OWN_VELOCITY:]
        ranges.append(model.measure(states, pose)[:, 1])
    np.testing.assert_allclose(model.measure(STATES, POSE)[:, 2], (ranges[1] - ranges[0]) / dt, rtol=1e-6)


@pytest.mark.parametrize("length", [3, 7])
def test_a_sensor_of_a_shorter_pose_is_at_rest(length):
    model, still = models.bearing_range_rate(), POSE.copy()
    still[OWN_VELOCITY:] = 0.0
    np.testing.assert_array_equal(model.measure(STATES, POSE[:length]), model.measure(STATES, still))


@pytest.mark.parametrize("state_dim", [4, 5])
def test_the_jacobian_is_the_derivative_where_both_move(state_dim):
    model = models.bearing_range_rate()
    model.check(STATES, POSE)
    for state in np.hstack([STATES, np.ones((20, 1))])[:, :state_dim]:
        out = np.full((3, state_dim), np.nan)
        assert model.jacobian is not None
        model.jacobian(state, POSE, model.params, out)
        slopes = central_differences(lambda moved: model.measure(moved, POSE)[0], state, 1e-4)
        np.testing.assert_allclose(out, slopes, atol=1e-7)


def sensor(method, noise=None):
    noise = noise or models.constant_noise([0.01, 10.0, 0.5])
    clutter = models.region_clutter(5.0, REGION, "bearing_range_rate")
    return models.SensorModel(
        models.bearing_range_rate(), noise, models.constant_detection(0.9), clutter, method=method
    )


NO_NOISE = RowNoise(np.empty((0, 3, 3)), np.empty((0, 3, 3)))


def test_sigma_points_agree_with_the_jacobian_on_a_narrow_gaussian():
    cov, found = np.diag([4.0, 4.0, 0.25, 0.25]), []
    for method in ("ekf", "ukf", "ckf"):
        out = make_innovation(1, 4, 3)
        expect_measurement(sensor(method).to_kernel(), POSE, STATES[0], cov, NO_NOISE, 0, out, make_scratch(4, 3))
        found.append((out.predicted[0], out.covs[0]))
    for predicted, posterior in found[1:]:
        np.testing.assert_allclose(predicted, found[0][0], rtol=1e-4)
        np.testing.assert_allclose(posterior, found[0][1], rtol=1e-3, atol=1e-4)


def test_the_velocity_after_one_measurement_is_known_along_the_line_of_sight_alone():
    mean, cov = np.array([3000.0, 0.0, 0.0, 0.0]), np.diag([1e-6, 1e-6, 400.0, 400.0])
    out = make_innovation(1, 4, 3)
    expect_measurement(sensor("ekf").to_kernel(), np.zeros(3), mean, cov, NO_NOISE, 0, out, make_scratch(4, 3))
    along = 1.0 / (1.0 / 400.0 + 1.0 / 0.25)
    np.testing.assert_allclose(np.diag(out.covs[0])[2:], [along, 400.0], rtol=1e-6)


def test_the_noise_has_a_third_component():
    both = models.range_dependent_noise(10.0, 5e-5, 0.02, 5e-6)
    three = models.range_dependent_noise(10.0, 5e-5, 0.02, 5e-6, 0.5)
    three.check(STATES, POSE, 3)
    covs = three.covs(STATES, POSE, 3)
    np.testing.assert_array_equal(covs[:, :2, :2], both.covs(STATES, POSE, 2))
    np.testing.assert_array_equal(covs[:, 2], np.tile([0.0, 0.0, 0.25], (20, 1)))
    np.testing.assert_array_equal(three.least_stds, [0.02, 10.0, 0.5])
    with pytest.raises(InputError, match=r"sigma_range_rate: expected None where no sigma_range and sigma_bearing"):
        models.range_dependent_noise(10.0, sigma_range_rate=0.5)


def clutters(kind):
    yield models.region_clutter(50.0, REGION, kind, max_range_rate=40.0)
    yield models.around_sensor(50.0, kind, radius=700.0, max_range_rate=40.0)


def test_clutter_is_uniform_in_range_rate():
    pose = POSE.copy()
    pose[:2] = -200.0, 100.0
    for plain, clutter in zip(clutters("bearing_range"), clutters("bearing_range_rate"), strict=True):
        drawn = np.concatenate(
            [
                clutter.sample(pose, models.bearing_range_rate(), state_dim=4, rng=np.random.default_rng(k))
                for k in range(9)
            ]
        )
        density = plain.log_intensity_at(drawn[:, :2].copy(), pose) - math.log(80.0)
        np.testing.assert_allclose(clutter.log_intensity_at(drawn, pose), density, rtol=1e-12)
        assert stats.kstest((drawn[:, 2] + 40.0) / 80.0, "uniform").pvalue > 1e-3
        assert clutter.log_intensity_at([[*drawn[0, :2], 40.1]], pose)[0] == -math.inf


def test_clutter_at_raw_measurements_has_its_bias():
    pose, bias, moved = np.zeros(3), np.array([0.1, -20.0, 5.0]), np.array([10.0, 30.0])
    for clutter in clutters("bearing_range_rate"):
        raw, told = at_raw_measurements(clutter, bias, moved), np.array([[0.3, 400.0, 38.0]])
        place = pose.copy()
        place[:2] += moved
        assert raw.log_intensity_at(told - bias, pose) == pytest.approx(clutter.log_intensity_at(told, place))
