"""The filters of several sensors against full enumeration, in any order of the sensors; and what they refuse."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

import reference
from filters.examples import (
    SCENES,
    assert_same_glmb,
    assert_same_lmb,
    cv_matrices,
    plain_glmb,
    plain_lmb,
    together,
)
from reference import glmb as oracle
from reference import multi_sensor
from vedette import models
from vedette.densities import LMB, TrackTable, marginalise
from vedette.filters import DeltaGlmbFilter, Limits, LmbFilter, MultiSensorGlmbFilter, MultiSensorLmbFilter
from vedette.kernels.base.compile import JIT_ENABLED

pytestmark = pytest.mark.lanes

DT = 1.5
POSES = [np.zeros(3)] * 3
ORDERS = [(0, 1, 2), (2, 1, 0), (1, 2, 0)]
KINDS = [MultiSensorGlmbFilter, MultiSensorLmbFilter]
SCANS: Any = [
    [np.array([[112.0, 52.0], [131.0, 48.0]]), np.array([[118.0, 55.0]]), np.array([[125.0]])],
    [np.array([[120.0, 49.0]]), np.empty((0, 2)), np.array([[122.0]])],
]
BIRTH = models.BirthModel(
    np.array([0.3, 0.2]),
    np.array([[100.0, 50.0, 5.0, -3.0], [130.0, 60.0, -4.0, 2.0]]),
    np.stack([np.diag([20.0, 15.0, 5.0, 5.0]) ** 2, np.diag([10.0, 25.0, 6.0, 4.0]) ** 2]),
    steps=frozenset({1}),
)
TARGETS = models.TargetModel(models.constant_velocity(3.0), models.constant_survival(0.9), BIRTH)


@models.model_function("measurement")
def easting(state, pose, params, out):
    out[0] = state[0]


@models.model_function("measurement_jacobian")
def easting_jacobian(state, pose, params, out):
    out[0, 0] = 1.0
    out[0, 1] = out[0, 2] = out[0, 3] = 0.0


def sensor(measurement: models.MeasurementModel, stds: list[float], prob: float, rate: float) -> models.SensorModel:
    bound = np.full(measurement.meas_dim, 1000.0)
    return models.SensorModel(
        measurement,
        models.constant_noise(stds),
        models.constant_detection(prob),
        models.measurement_space_clutter(rate, -bound, bound),
    )


SENSORS = (
    sensor(models.position(), [12.0, 9.0], 0.85, 200.0),
    sensor(models.position(), [6.0, 14.0], 0.7, 90.0),
    sensor(models.MeasurementModel(1, easting, jacobian=easting_jacobian), [8.0], 0.6, 12.0),
)
LINEAR = multi_sensor.LinearModel(
    *cv_matrices(3.0),
    0.9,
    (
        multi_sensor.LinearSensor(np.eye(2, 4), np.diag([144.0, 81.0]), 0.85, 200.0 / 4e6),
        multi_sensor.LinearSensor(np.eye(2, 4), np.diag([36.0, 196.0]), 0.7, 90.0 / 4e6),
        multi_sensor.LinearSensor(np.eye(1, 4), np.diag([64.0]), 0.6, 12.0 / 2e3),
    ),
)


def plain_births(step: int) -> reference.Lmb:
    if not BIRTH.is_active(step):
        return {}
    sites = zip(BIRTH.existence, BIRTH.means, BIRTH.covs, strict=True)
    return {(step, i): (float(r), [(1.0, mean, cov)]) for i, (r, mean, cov) in enumerate(sites)}


def make(kind: Any, order: Any = (0, 1, 2), limits: Limits | None = None) -> Any:
    return kind(TARGETS, tuple(SENSORS[s] for s in order), Limits.none() if limits is None else limits)


def log_density(total: float, scans: Any) -> float:
    """From the sum of weights relative to clutter to the log density of the scans."""
    clutter = sum(len(scan) * math.log(s.clutter_intensity) for s, scan in zip(LINEAR.sensors, scans, strict=True))
    return math.log(total) + clutter - 302.0


@pytest.mark.parametrize("order", ORDERS)
def test_glmb_equals_enumeration_in_any_order(order):
    tracker, rng = make(MultiSensorGlmbFilter, order), np.random.default_rng(0)
    belief, expected = tracker.initial(), oracle.no_target()
    for step, scans in enumerate(SCANS, 1):
        expected, total = multi_sensor.step(expected, plain_births(step), scans, LINEAR)
        belief, info = tracker.step(belief, [scans[s] for s in order], POSES, DT, step, rng=rng)
        belief.validate()
        assert_same_glmb(plain_glmb(belief), oracle.as_glmb(expected))
        assert info.log_likelihood == pytest.approx(log_density(total, scans), abs=1e-10)
        assert info.num_hypotheses == len(expected)


@pytest.mark.parametrize("order", ORDERS)
def test_lmb_equals_enumeration_in_any_order(order):
    tracker, rng = make(MultiSensorLmbFilter, order), np.random.default_rng(0)
    belief, expected = tracker.initial(), reference.Lmb()
    for step, scans in enumerate(SCANS, 1):
        expected, total = multi_sensor.lmb_step(expected, plain_births(step), scans, LINEAR)
        expected = {label: (existence, together(mixture)) for label, (existence, mixture) in expected.items()}
        belief, info = tracker.step(belief, [scans[s] for s in order], POSES, DT, step, rng=rng)
        belief.validate()
        assert_same_lmb(belief, expected)
        assert info.log_likelihood == pytest.approx(log_density(total, scans), abs=1e-10)
        assert (info.num_inexact_clusters, info.truncation_error_bound, info.search_truncated) == (0, 0.0, False)


def test_certain_and_impossible_tracks():
    tracks = TrackTable.from_gaussians([[-2, 0], [-1, 0]], BIRTH.means, BIRTH.covs)
    belief = LMB(tracks, np.array([math.inf, -math.inf]))
    tracker, rng = make(MultiSensorLmbFilter), np.random.default_rng(0)
    posterior, _ = tracker.step(belief, SCANS[0], POSES, DT, 5, rng=rng)
    posterior.validate()
    certain = {(-2, 0): (1.0, plain_lmb(belief)[-2, 0][1])}
    assert_same_lmb(posterior, multi_sensor.lmb_step(certain, {}, SCANS[0], LINEAR)[0])


@pytest.mark.parametrize("name", SCENES)
def test_one_sensor_is_the_filter_of_one_sensor(name):
    if not JIT_ENABLED and name != "ukf":
        pytest.skip("long in plain Python")
    scene, rng = SCENES[name](), np.random.default_rng(0)
    for several, one in ((MultiSensorGlmbFilter, DeltaGlmbFilter), (MultiSensorLmbFilter, LmbFilter)):
        central = several(scene.targets, (scene.sensor,), Limits.none())
        single = one(scene.targets, scene.sensor, Limits.none())
        belief: Any = central.initial()
        expected: Any = single.initial()
        for step, scan in enumerate(scene.scans[:2], 1):
            belief, info = central.step(belief, [scan], [scene.pose], DT, step, rng=rng)
            expected, expected_info = single.step(expected, scan, scene.pose, DT, step, rng=rng)
            assert info.log_likelihood == pytest.approx(expected_info.log_likelihood, abs=1e-10)
            if isinstance(expected, LMB):
                assert_same_lmb(belief, plain_lmb(expected))
            else:
                assert_same_glmb(plain_glmb(belief), plain_glmb(expected))


def test_the_marginal_glmb_has_one_hypothesis_a_label_set():
    whole, marginal = make(MultiSensorGlmbFilter), make(MultiSensorGlmbFilter)
    marginal = dataclasses.replace(marginal, marginalised=True)
    rng = np.random.default_rng(0)
    expected, _ = whole.step(whole.initial(), SCANS[0], POSES, DT, 1, rng=rng)
    collapsed = marginalise(expected, max_components=1000, log_min_weight=-math.inf, merge_distance=0.0)
    belief, info = marginal.step(marginal.initial(), SCANS[0], POSES, DT, 1, rng=rng)
    assert_same_glmb(plain_glmb(belief), plain_glmb(collapsed))
    assert info.num_hypotheses == belief.num_hyps < expected.num_hyps


@pytest.mark.parametrize("limits", [Limits(max_hypotheses=3), Limits(min_existence=0.02, min_relative_weight=0.03)])
def test_what_is_cut_is_bounded(limits):
    rng = np.random.default_rng(0)
    exact, _ = make(MultiSensorLmbFilter).step(make(MultiSensorLmbFilter).initial(), SCANS[0], POSES, DT, 1, rng=rng)
    cut = dataclasses.replace(limits, min_existence=min(limits.min_existence, 0.02), gate_probability=1.0)
    tracker = make(MultiSensorLmbFilter, limits=cut)
    belief, info = tracker.step(tracker.initial(), SCANS[0], POSES, DT, 1, rng=rng)
    assert info.search_truncated == (limits.max_hypotheses == 3)
    assert 0.0 < np.abs(belief.existence - exact.existence).max() <= info.truncation_error_bound <= 1.0
    few = make(MultiSensorGlmbFilter, limits=Limits(max_hypotheses=3))
    glmb, glmb_info = few.step(few.initial(), SCANS[0], POSES, DT, 1, rng=rng)
    assert glmb.num_hyps == 3
    assert glmb_info.limit_reached
    assert 0.0 < glmb_info.truncation_error_bound < 1.0
