"""A user-made sensor through the filters: the built-in's results, with and without a Jacobian; the example runs."""

from __future__ import annotations

import math
import runpy
from pathlib import Path

import numpy as np
import pytest

from reference.user_models import user_made_bearing_range
from vedette import models
from vedette.filters import DeltaGlmbFilter, LmbFilter
from vedette.simulation import ScriptedTargets, simulate_scan

POSE = np.array([-745.0, 830.0, 0.0])
REGION = models.Region(-1000.0, 1000.0, -1000.0, 1000.0)
STARTS = np.array([[-55.0, 875.0, 15.0, -6.0], [340.0, -5.0, 10.0, 6.0]])
EXAMPLE = Path(__file__).parents[2] / "examples" / "own_sensor.py"


@models.model_function("measurement_noise_cov")
def my_noise(state, pose, params, out):
    distance = math.sqrt((state[0] - pose[0]) ** 2 + (state[1] - pose[1]) ** 2)
    out[0, 0] = (math.pi / 180 + 5e-6 * distance) ** 2
    out[0, 1] = out[1, 0] = 0.0
    out[1, 1] = (10.0 + 5e-5 * distance**2) ** 2


@models.model_function("prob_detection")
def my_detection(state, pose, params):
    square = (state[0] - pose[0]) ** 2 + (state[1] - pose[1]) ** 2
    return min(math.exp(-0.5 * square / 1e8), models.MAX_PROB_DETECTION)


@models.model_function("transition")
def my_transition(state, dt, params, out):
    out[0] = state[0] + dt * state[2]
    out[1] = state[1] + dt * state[3]
    out[2] = state[2]
    out[3] = state[3]


@models.model_function("process_noise_cov")
def my_process_noise(state, dt, params, out):
    factor = (0.5 * dt * dt, dt)
    for i in range(4):
        for j in range(4):
            out[i, j] = 25.0 * factor[i // 2] * factor[j // 2] if i % 2 == j % 2 else 0.0


def built_in(method):
    sensor = models.SensorModel(
        models.bearing_range(),
        models.range_dependent_noise(10.0, 5e-5, math.pi / 180, 5e-6),
        models.gaussian_detection(1e4),
        models.region_clutter(10.0, REGION, "bearing_range"),
        method,
    )
    return models.constant_velocity(5.0, method=method), sensor


def user_made(method):
    clutter = models.region_clutter(10.0, REGION, "bearing_range")
    measurement = user_made_bearing_range(jacobian=method == "ekf")
    detection, noise = models.DetectionModel(my_detection), models.NoiseModel(my_noise)
    sensor = models.SensorModel(measurement, noise, detection, clutter, method)
    jacobian = models.constant_velocity(5.0).transition_jacobian if method == "ekf" else None
    motion = models.MotionModel(
        4, my_transition, my_process_noise, transition_jacobian=jacobian, method="auto" if method == "ukf" else method
    )
    return motion, sensor


def beliefs(make_filter, motion, sensor):
    sensor.check(STARTS, POSE)
    motion.check(STARTS)
    covs = np.tile(np.diag([50.0, 50.0, 25.0, 25.0]) ** 2, (2, 1, 1))
    birth = models.BirthModel(np.full(2, 0.02), STARTS * [1, 1, 0, 0], covs, frozenset({1}))
    tracker = make_filter(models.TargetModel(motion, models.constant_survival(0.98), birth), sensor)
    times, rng = np.arange(1.0, 7.0), np.random.default_rng(3)
    truth = ScriptedTargets(models.constant_velocity(5.0), STARTS).truth(times, rng=rng)
    belief = tracker.initial()
    for k in range(len(times)):
        scan = simulate_scan(truth.at(k)[1], POSE, built_in("auto")[1], rng=rng)
        belief, _ = tracker.step(belief, scan.measurements, POSE, 1.0, k + 1, rng=rng)
        yield belief


@pytest.mark.parametrize("make_filter", [DeltaGlmbFilter, LmbFilter])
@pytest.mark.parametrize("method", ["ekf", "ukf", "ckf"])
def test_a_user_made_sensor_and_motion_give_the_built_ins_beliefs(make_filter, method):
    pairs = zip(
        beliefs(make_filter, *built_in(method)), beliefs(make_filter, *user_made(method)), strict=True
    )  # fmt: skip
    for theirs, mine in pairs:
        np.testing.assert_array_equal(mine.tracks.labels, theirs.tracks.labels)
        np.testing.assert_allclose(mine.tracks.means, theirs.tracks.means, rtol=1e-9, atol=1e-7)
        np.testing.assert_allclose(mine.tracks.covs, theirs.tracks.covs, rtol=1e-7, atol=1e-7)


def test_the_example_runs(capsys):
    runpy.run_path(str(EXAMPLE))["main"]()
    lines = capsys.readouterr().out.splitlines()
    assert sum("3 targets estimated" in line for line in lines) >= 8
    difference = next(line for line in lines if "greatest difference" in line)
    assert float(difference.split()[-2]) < 1e-6
