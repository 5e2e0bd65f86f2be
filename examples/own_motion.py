"""A motion of your own: ships that a current carries along, faster in the middle of the stream.

    python examples/own_motion.py [--picture FILE]

The state's velocity is through the water; the current adds to it, by where the ship is. One plain function says so;
there is no Jacobian, and sigma points are used. The same scans are tracked with it and with the built-in constant
velocity.
"""

from __future__ import annotations

import math

import numpy as np

from vedette import models
from vedette.densities import map_estimate
from vedette.filters import LmbFilter
from vedette.simulation import ScriptedTargets, simulate_scan

PERIOD = 10.0  # s between scans
TIMES = np.arange(0.0, 400.0, PERIOD)
SHIPS = np.array([[0.0, -600.0, 0.0, 3.0], [400.0, 600.0, 1.0, -3.0], [900.0, -500.0, -2.0, 2.5]])
POSE = np.array([600.0, 0.0, 0.0])


@models.model_function("transition")
def in_current(state, dt, params, out):
    """params: speed of the current at y = 0 in m/s, and by where it has gone down to 0.6 of it, in m."""
    current = params[0] * math.exp(-0.5 * (state[1] / params[1]) ** 2)
    out[0] = state[0] + (state[2] + current) * dt
    out[1] = state[1] + state[3] * dt
    out[2] = state[2]
    out[3] = state[3]


def carried(speed: float = 3.0, width: float = 200.0) -> models.MotionModel:
    still = models.constant_velocity(0.02)
    return models.MotionModel(4, in_current, still.process_noise_cov, np.array([speed, width]), still.noise_params)


def track(motion: models.MotionModel, scans: list[np.ndarray], states: list[np.ndarray]) -> np.ndarray:
    """(num_scans,) mean distance from each ship to the nearest estimate."""
    sensor = radar()
    birth = models.BirthModel(np.full(3, 0.5), SHIPS, np.tile(np.diag([50.0, 50.0, 1.0, 1.0]) ** 2, (3, 1, 1)), {1})
    tracker = LmbFilter(models.TargetModel(motion, models.constant_survival(0.99), birth), sensor)
    belief, rng, errors = tracker.initial(), np.random.default_rng(0), []
    for step, (scan, truth) in enumerate(zip(scans, states, strict=True), start=1):
        belief, _ = tracker.step(belief, scan, POSE, PERIOD, step, rng=rng)
        means = map_estimate(belief).means
        errors.append(np.linalg.norm(truth[:, None, :2] - means[None, :, :2], axis=2).min(axis=1, initial=500.0).mean())
    return np.array(errors)


def radar() -> models.SensorModel:
    region = models.Region(-500.0, 2500.0, -1000.0, 1000.0)
    clutter = models.region_clutter(5.0, region, "position")
    return models.SensorModel(
        models.position(), models.constant_noise([30.0, 30.0]), models.constant_detection(0.7), clutter
    )


def main() -> tuple[np.ndarray, dict[str, np.ndarray]]:
    carried().check(SHIPS, PERIOD)
    truth = ScriptedTargets(carried(), SHIPS).truth(TIMES, rng=np.random.default_rng(0))
    states = [truth.at(k)[1] for k in range(len(TIMES))]
    rng = np.random.default_rng(1)
    scans = [simulate_scan(now, POSE, radar(), rng=rng).measurements for now in states]
    motions = {
        "with the current": carried(),
        "constant velocity, 0.02 m/s²": models.constant_velocity(0.02),
        "constant velocity, 0.2 m/s²": models.constant_velocity(0.2),
    }
    errors = {name: track(motion, scans, states) for name, motion in motions.items()}
    for name, values in errors.items():
        print(f"{name:29} mean error {values[5:].mean():5.1f} m")
    return np.array(states).swapaxes(0, 1)[:, :, :2], errors


def draw(found: tuple[np.ndarray, dict[str, np.ndarray]]):
    paths, errors = found
    figure, (left, right) = panels(2)
    draw_paths(left, paths)
    left.plot(paths[:, 0, 0], paths[:, 0, 1], "ko", markersize=4, label="start")
    legend_above(left)
    draw_errors(right, TIMES, errors)
    return figure


if __name__ == "__main__":
    from pictures import draw_errors, draw_paths, legend_above, panels, show

    show(main, draw)
