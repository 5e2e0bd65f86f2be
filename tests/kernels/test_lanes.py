"""Kalman steps of many Gaussians side by side, against the kernels that take one at a time."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from vedette import models
from vedette.control.known_models import forms_of
from vedette.kernels.base.types import RowNoise
from vedette.kernels.gaussian.innovation import expect, make_innovation
from vedette.kernels.gaussian.prediction import predict
from vedette.kernels.gaussian.relinearisation import Pair, make_pair_work, relinearise
from vedette.kernels.gaussian.scratch import make_scratch
from vedette.kernels.planning.batched_innovation import expect_batch, relinearise_batch
from vedette.kernels.planning.batched_models import ANY
from vedette.kernels.planning.batched_prediction import make_batch, make_batch_work, predict_batch

NUM, ROOM, DT = 11, 16, 1.5
POSE = np.array([-300.0, 120.0, 0.4])
REGION = models.Region(-1000.0, 1000.0, -1000.0, 1000.0)


@models.model_function("prob_detection")
def _own_detection(state: Any, pose: Any, params: Any) -> float:
    return float(params[0] / (1.0 + abs(state[0] - pose[0]) / 500.0))


@models.model_function("measurement_noise_cov")
def _own_noise(state: Any, pose: Any, params: Any, out: Any) -> None:
    out[0, 0], out[0, 1], out[1, 0], out[1, 1] = 0.01, 0.02, 0.03, 9.0 + abs(state[1]) / 100.0


POLAR = (models.bearing_range(), "bearing_range")
PLACE = (models.position(), "position")
BEARING = (models.bearing_only(), "bearing_only")
GROWING = models.range_dependent_noise(5.0, 5e-5, 0.02, 2e-5)
EXTENDED = models.range_dependent_noise(5.0, 5e-5, 0.02, 2e-5, extent=30.0)
SENSORS: dict[str, Any] = {
    "polar": (POLAR, GROWING, models.gaussian_detection(500.0), "auto", "centre"),
    "position": (PLACE, models.constant_noise([4.0, 7.0]), models.constant_detection(0.7), "auto", "centre"),
    "extended": (POLAR, EXTENDED, models.gaussian_detection(500.0), "auto", "centre"),
    "wide": (POLAR, GROWING, models.gaussian_detection(500.0), "auto", "centre"),
    "wide position": (PLACE, models.constant_noise([4.0, 7.0]), models.constant_detection(0.7), "auto", "centre"),
    "one component": (BEARING, models.constant_noise([0.02]), models.gaussian_detection(500.0), "auto", "mean"),
    "own parts": (POLAR, models.NoiseModel(_own_noise, np.empty(0), 2), None, "auto", "centre"),
    "by nodes": (POLAR, GROWING, None, "auto", "mean"),
    "soft edge": (POLAR, GROWING, models.soft_sector(0.9, 400.0, range_slope=0.02), "auto", "centre"),
    "soft edge, cut": (
        POLAR,
        GROWING,
        models.soft_sector(0.9, 300.0, range_slope=0.5, hard_limit=True),
        "auto",
        "centre",
    ),
    "soft sector": (POLAR, GROWING, models.soft_sector(0.9, 400.0, 1.0, range_slope=0.02), "auto", "centre"),
    "sigma points": (POLAR, GROWING, models.gaussian_detection(500.0), "ukf", "centre"),
    "nothing left": (PLACE, models.constant_noise([1e-7, 1e-7]), models.constant_detection(0.7), "auto", "centre"),
}


def sensor_of(name: str) -> models.SensorModel:
    (measurement, kind), noise, detection, method, at = SENSORS[name]
    own = models.DetectionModel(_own_detection, np.array([0.9])) if detection is None else detection
    return models.SensorModel(measurement, noise, own, models.region_clutter(5.0, REGION, kind), method, at)


def gaussians(dim: int, wide: float = 1.0) -> tuple[Any, Any]:
    rng, std = np.random.default_rng(0), np.array([20.0 * wide, 30.0 * wide, 4.0, 5.0, 0.05])[:dim]
    means = rng.normal(size=(NUM, dim)) * np.array([300.0, 300.0, 10.0, 10.0, 0.1])[:dim]
    factors = np.diag(std) @ (np.eye(dim) + 0.3 * rng.normal(size=(NUM, dim, dim)))
    return means, factors @ factors.transpose(0, 2, 1)


def side_by_side(values: Any) -> Any:
    """(k, ROOM) of (NUM, ...) vectors or symmetric matrices, with nonsense in the places that are not asked for."""
    flat = values if values.ndim == 2 else values[:, *np.tril_indices(values.shape[1])]
    out = np.full((flat.shape[1], ROOM), np.nan)
    out[:, :NUM] = flat.T
    return out


def test_a_turning_radar_has_no_known_form() -> None:
    moves = models.kernel_motion(models.constant_velocity(2.0), models.constant_survival(1.0))
    forms = forms_of(moves, sensor_of(next(iter(SENSORS))).to_kernel(), DT, 4, turns=True)
    assert (forms.measurement, forms.noise, forms.detection) == (ANY, ANY, ANY)


@pytest.mark.parametrize("name", SENSORS)
@pytest.mark.parametrize("motion", [models.constant_velocity(2.0), models.coordinated_turn(2.0, 0.02)])
def test_steps_are_those_of_one_gaussian_at_a_time(name: str, motion: models.MotionModel) -> None:
    dim, sensor = motion.state_dim, sensor_of(name)
    moves, sees = models.kernel_motion(motion, models.constant_survival(1.0)), sensor.to_kernel()
    forms = forms_of(moves, sees, DT, dim)
    assert forms.is_linear == (dim == 4)
    check_against_one_at_a_time(sensor, moves, forms, *gaussians(dim, 4.0 if "wide" in name else 1.0))


@pytest.mark.parametrize(("height", "std"), [(3000.0, 40.0), (3000.0, 2000.0), (200.0, 500.0)])
def test_a_slant_range_bends_over_a_height_in_a_batch_too(height: float, std: float) -> None:
    parts = models.bearing_slant_range(), models.constant_noise([0.02, 40.0]), models.constant_detection(0.9)
    sensor = models.SensorModel(*parts, models.region_clutter(5.0, REGION, "bearing_slant_range"))
    motion, rng = models.constant_velocity_height(2.0, 0.5), np.random.default_rng(2)
    means = rng.normal(size=(NUM, 6)) * np.array([6000.0, 6000.0, 10.0, 10.0, 0.1 * height, 1.0])
    means[:, 4] += height
    covs = np.tile(np.diag(np.array([20.0, 30.0, 4.0, 5.0, std, 2.0]) ** 2), (NUM, 1, 1))
    moves = models.kernel_motion(motion, models.constant_survival(1.0))
    work = check_against_one_at_a_time(sensor, moves, forms_of(moves, sensor.to_kernel(), DT, 6), means, covs)
    assert work.bends[:NUM].any() == (std > 40.0)


def check_against_one_at_a_time(sensor: models.SensorModel, moves: Any, forms: Any, means: Any, covs: Any) -> Any:
    """Predict and expect side by side and one by one; returns the working arrays."""
    dim, sees = means.shape[1], sensor.to_kernel()
    batch, work = make_batch(dim, sensor.meas_dim, ROOM), make_batch_work(dim, sensor.meas_dim, ROOM)
    predict_batch(moves, forms, DT, side_by_side(means), side_by_side(covs), NUM, batch, work)
    expect_batch(sees, forms, POSE, NUM, batch, work)
    expected, scratch = make_innovation(1, dim, sensor.meas_dim), make_scratch(dim, sensor.meas_dim)
    mean, cov, lower, few = np.empty(dim), np.empty((dim, dim)), np.tril_indices(dim), np.tril_indices(sensor.meas_dim)
    for s in range(NUM):
        predict(moves, 0, DT, means[s], covs[s], mean, cov, scratch)
        expect(sees, POSE, mean, cov, 0, expected, scratch)
        close: dict[str, Any] = {"rtol": 1e-12, "atol": 1e-12}
        np.testing.assert_allclose(batch.means[:, s], mean, **close)
        np.testing.assert_allclose(batch.covs[:, s], cov[lower], **close)
        np.testing.assert_allclose(batch.predicted[:, s], expected.predicted[0], **close)
        np.testing.assert_allclose(batch.factor[:, s], expected.factor[0][few], **close)
        np.testing.assert_allclose(batch.whitened_cross[:, s], expected.whitened_cross[0].ravel(), **close)
        np.testing.assert_allclose(batch.posterior[:, s], expected.covs[0][lower], rtol=1e-10, atol=1e-12)
        np.testing.assert_allclose(batch.log_norm[s], expected.log_norm[0], **close)
        np.testing.assert_allclose(batch.prob_detection[s], expected.prob_detection[0], **close)
        assert work.bends[s] == expected.bends[0]
    return work


@pytest.mark.parametrize("name", ["wide", "one component", "own parts"])
def test_gaussians_that_bend_are_updated_as_one_at_a_time(name: str) -> None:
    sensor, rng = sensor_of(name), np.random.default_rng(3)
    sees, (means, covs) = sensor.to_kernel(), gaussians(4, 4.0)
    forms = forms_of(models.kernel_motion(models.constant_velocity(2.0), models.constant_survival(1.0)), sees, DT, 4)
    batch, work = make_batch(4, sensor.meas_dim, ROOM), make_batch_work(4, sensor.meas_dim, ROOM)
    batch.means[:], batch.covs[:] = side_by_side(means), side_by_side(covs)
    expect_batch(sees, forms, POSE, NUM, batch, work)
    is_seen, scans = np.arange(ROOM) % 3 > 0, sensor.measurement.measure(means + rng.normal(size=(NUM, 4)), POSE)
    assert (work.bends[:NUM] & is_seen[:NUM]).any()
    measurements, pair = side_by_side(scans), make_pair_work(4, sensor.meas_dim)
    none = RowNoise(pair.innovation.factor[:0], pair.innovation.factor[:0])
    relinearise_batch(sees, POSE, measurements, is_seen, NUM, batch, work)
    for s in np.flatnonzero(work.bends[:NUM] & is_seen[:NUM]):
        expect(sees, POSE, means[s], covs[s], 0, pair.innovation, pair.scratch)
        relinearise(sees, Pair(POSE, means[s], covs[s], scans[s], none), pair)
        np.testing.assert_allclose(measurements[:, s], pair.scratch.residual, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(batch.whitened_cross[:, s], pair.innovation.whitened_cross[0].ravel(), rtol=1e-9)
        np.testing.assert_allclose(batch.log_norm[s], pair.innovation.log_norm[0])
        np.testing.assert_allclose(batch.posterior[:, s], pair.innovation.covs[0][np.tril_indices(4)], rtol=1e-8)
        assert (batch.predicted[:, s] == 0.0).all()


def test_models_of_a_users_own_have_no_form() -> None:
    forms = forms_of(
        models.kernel_motion(models.coordinated_turn(2.0, 0.02), models.constant_survival(1.0)),
        sensor_of("own parts").to_kernel(),
        DT,
        5,
    )
    assert (forms.is_linear, forms.noise, forms.detection) == (0, ANY, ANY)


def test_what_no_gaussian_has_is_told_as_of_one_alone() -> None:
    motion, sensor = models.constant_velocity(2.0), sensor_of("polar")
    moves, sees = models.kernel_motion(motion, models.constant_survival(1.0)), sensor.to_kernel()
    forms, (means, covs) = forms_of(moves, sees, DT, 4), gaussians(4)
    means[3, 0] = np.inf
    batch, work = make_batch(4, 2, ROOM), make_batch_work(4, 2, ROOM)
    with pytest.raises(Exception, match="predicted mean or covariance is not"):
        predict_batch(moves, forms, DT, side_by_side(means), side_by_side(covs), NUM, batch, work)
