"""A sensor of your own: plain Python functions with a decorator, compiled, and run through the library's own filter.

    python examples/own_sensor.py [--picture FILE]

First a copy of the built-in bearing-range sensor, which gives the built-in's results. Then a sensor that the library
does not have, a microphone that hears direction and loudness, without a Jacobian: sigma points are used. Nothing in the
library is changed for either. Functions must write every entry of `out`; `SensorModel.check` tries them.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from vedette import models
from vedette.densities import map_estimate
from vedette.filters import DeltaGlmbFilter
from vedette.simulation import ScriptedTargets, Truth, simulate_scan

POSE = np.array([-745.0, 830.0, 0.0])
TIMES = np.arange(1.0, 31.0)
REGION = models.Region(-1000.0, 1000.0, -1000.0, 1000.0)
TARGETS = np.array([[-55.0, 875.0, 15.0, -6.0], [-180.0, -205.0, -5.5, -19.0], [-320.0, 485.0, 5.5, -5.5]])


@models.model_function("measurement")
def my_bearing_range(state, pose, params, out):
    dx, dy = state[0] - pose[0], state[1] - pose[1]
    out[0] = math.atan2(dy, dx)
    out[1] = math.sqrt(dx * dx + dy * dy)


@models.model_function("measurement_jacobian")
def my_bearing_range_jacobian(state, pose, params, out):
    dx, dy = state[0] - pose[0], state[1] - pose[1]
    square = dx * dx + dy * dy
    distance = math.sqrt(square)
    for row in range(2):
        for column in range(out.shape[1]):
            out[row, column] = 0.0
    out[0, 0] = -dy / square
    out[0, 1] = dx / square
    out[1, 0] = dx / distance
    out[1, 1] = dy / distance


@models.model_function("measurement_noise_cov")
def my_noise(state, pose, params, out):
    """params: sigma_range, eta_range, sigma_bearing, eta_bearing (the paper's noise)."""
    square = (state[0] - pose[0]) ** 2 + (state[1] - pose[1]) ** 2
    sigma_bearing = params[2] + params[3] * math.sqrt(square)
    sigma_range = params[0] + params[1] * square
    out[0, 0] = sigma_bearing**2
    out[0, 1] = 0.0
    out[1, 0] = 0.0
    out[1, 1] = sigma_range**2


@models.model_function("prob_detection")
def my_detection(state, pose, params):
    square = (state[0] - pose[0]) ** 2 + (state[1] - pose[1]) ** 2
    return min(math.exp(-0.5 * square / params[0] ** 2), 1.0 - 1e-9)


@models.model_function("measurement")
def bearing_and_loudness(state, pose, params, out):
    """params: source level in dB at 1 m. Spherical spreading: 20 dB for ten times the distance."""
    dx, dy = state[0] - pose[0], state[1] - pose[1]
    out[0] = math.atan2(dy, dx)
    out[1] = params[0] - 10.0 * math.log10(1.0 + dx * dx + dy * dy)


def built_in_sensor() -> models.SensorModel:
    return models.SensorModel(
        models.bearing_range(),
        models.range_dependent_noise(10.0, 5e-5, math.pi / 180, 5e-6),
        models.gaussian_detection(10_000.0),
        models.region_clutter(25.0, REGION, "bearing_range"),
    )


def my_sensor() -> models.SensorModel:
    angular = np.array([True, False])
    return models.SensorModel(
        models.MeasurementModel(2, my_bearing_range, jacobian=my_bearing_range_jacobian, angular=angular),
        models.NoiseModel(my_noise, np.array([10.0, 5e-5, math.pi / 180, 5e-6])),
        models.DetectionModel(my_detection, np.array([10_000.0])),
        models.region_clutter(25.0, REGION, "bearing_range"),
    )


def microphone() -> models.SensorModel:
    angular = np.array([True, False])
    return models.SensorModel(
        models.MeasurementModel(2, bearing_and_loudness, np.array([140.0]), angular=angular),
        models.constant_noise([math.radians(1.0), 0.3]),
        models.constant_detection(0.95),
        models.measurement_space_clutter(10.0, [-math.pi, 70.0], [math.pi, 100.0], angular=angular),
    )


def make_filter(sensor: models.SensorModel) -> DeltaGlmbFilter:
    """The paper's motion, and births at the targets' first places, at step 1 only."""
    means = np.hstack([TARGETS[:, :2], np.zeros((3, 2))])
    covs = np.tile(np.diag([50.0, 50.0, 25.0, 25.0]) ** 2, (3, 1, 1))
    birth = models.BirthModel(np.full(3, 0.02), means, covs, frozenset({1}))
    targets = models.TargetModel(models.constant_velocity(5.0), models.constant_survival(0.98), birth)
    return DeltaGlmbFilter(targets, sensor)


def track(sensor: models.SensorModel, truth: Truth, report: Callable[[str], None] = print) -> np.ndarray:
    """(num_scans,) mean error in metres of the estimates; a line is reported every ten scans."""
    sensor.check(TARGETS, POSE)
    tracker = make_filter(sensor)
    belief = tracker.initial()
    scan_rng, filter_rng = np.random.default_rng(1), np.random.default_rng(2)
    errors = np.empty(len(TIMES))
    for k in range(len(TIMES)):
        _, states = truth.at(k)
        scan = simulate_scan(states, POSE, sensor, rng=scan_rng)
        belief, _ = tracker.step(belief, scan.measurements, POSE, 1.0, k + 1, rng=filter_rng)
        estimate = map_estimate(belief)
        distances = np.linalg.norm(states[:, None, :2] - estimate.means[None, :, :2], axis=2)
        errors[k] = distances.min(axis=1).mean() if estimate.num_targets else math.nan
        if k % 10 == 9:
            report(f"  t = {TIMES[k]:2.0f} s: {estimate.num_targets} targets estimated, mean error {errors[k]:5.1f} m")
    return errors


def main() -> dict[str, np.ndarray]:
    truth = ScriptedTargets(models.constant_velocity(5.0), TARGETS).truth(TIMES, rng=np.random.default_rng(0))
    print("built-in bearing-range sensor")
    built_in = track(built_in_sensor(), truth)
    print("a copy of it written here")
    mine = track(my_sensor(), truth)
    print(f"  greatest difference between the two: {np.nanmax(np.abs(mine - built_in)):.1e} m")
    print("a microphone written here, without a Jacobian")
    return {"built in": built_in, "its copy": mine, "microphone": track(microphone(), truth)}


def draw(errors: dict[str, np.ndarray]):
    figure, axes = panels(1, width=5.0)
    draw_errors(axes, TIMES, errors)
    return figure


if __name__ == "__main__":
    from pictures import draw_errors, panels, show

    show(main, draw)
