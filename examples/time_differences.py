"""Time differences of arrival: four receivers hear the same signals, and no one of them measures a position.

    python examples/time_differences.py [--picture FILE]

Receivers 1 to 3 compare what they hear with what receiver 0 hears. Each difference, times the speed of the signal, is a
difference of two distances: the target is on a hyperbola between the two receivers. The second receiver of a pair is in
the parameters of the measurement. A difference has no position, so targets are born on a grid of sites, not at
measurements; the filter of all three pairs finds where the hyperbolas meet.
"""

from __future__ import annotations

import math

import numpy as np

from vedette import models
from vedette.densities import best_estimate
from vedette.filters import SequentialFactoredFilter
from vedette.simulation import ScriptedTargets, simulate_scans

PERIOD = 2.0  # s between scans
TIMES = np.arange(0.0, 120.0, PERIOD)
RECEIVERS = np.array([[0.0, 0.0], [4000.0, 0.0], [2000.0, 3500.0], [1800.0, -2500.0]])  # m; the first is the reference
TARGETS = np.array([[600.0, 1500.0, 20.0, -8.0], [3200.0, 900.0, -22.0, 4.0], [1500.0, -1200.0, 6.0, 18.0]])
POSES = np.column_stack([RECEIVERS[1:], np.zeros(3)])


@models.model_function("measurement")
def range_difference(state, pose, params, out):
    """params: position of the reference receiver, m."""
    own = math.hypot(state[0] - pose[0], state[1] - pose[1])
    out[0] = own - math.hypot(state[0] - params[0], state[1] - params[1])


def pair(receiver: int) -> models.SensorModel:
    """Return the pair of a receiver with the reference: noise of 10 m, three false differences per scan."""
    baseline = float(np.hypot(*(RECEIVERS[receiver] - RECEIVERS[0])))
    return models.SensorModel(
        models.MeasurementModel(1, range_difference, RECEIVERS[0]),
        models.constant_noise([10.0]),
        models.constant_detection(0.9),
        models.measurement_space_clutter(3.0, [-baseline], [baseline]),
    )


def births() -> models.BirthModel:
    """Return a grid of sites every 500 m."""
    x, y = np.meshgrid(np.arange(0.0, 4001.0, 500.0), np.arange(-2000.0, 3001.0, 500.0))
    means = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size), np.zeros(x.size)])
    cov = np.diag([250.0, 250.0, 20.0, 20.0]) ** 2
    return models.BirthModel(np.full(x.size, 0.1 / x.size), means, np.tile(cov, (x.size, 1, 1)))


def main() -> tuple[np.ndarray, np.ndarray]:
    motion = models.constant_velocity(0.5)
    truth = ScriptedTargets(motion, TARGETS).truth(TIMES, rng=np.random.default_rng(0))
    states = [truth.at(k)[1] for k in range(len(TIMES))]
    sensors = tuple(pair(receiver) for receiver in (1, 2, 3))
    for sensor, pose in zip(sensors, POSES, strict=True):
        sensor.check(TARGETS, pose)
    tracker = SequentialFactoredFilter(models.TargetModel(motion, models.constant_survival(0.99), births()), sensors)
    belief, rng, rngs = tracker.initial(), np.random.default_rng(1), [np.random.default_rng(s) for s in range(3)]
    errors, numbers = [], list[int]()
    for step, now in enumerate(states, start=1):
        scans = [scan.measurements for scan in simulate_scans(now, POSES, sensors, rngs=rngs)]
        belief, _ = tracker.step(belief, scans, POSES, PERIOD, step, rng=rng)
        means = best_estimate(belief, step).means
        errors.append(np.linalg.norm(now[:, None, :2] - means[None, :, :2], axis=2).min(axis=1, initial=500.0))
        numbers.append(len(means))
    found = np.array(errors)
    print(f"from 40 s on: mean error {found[20:].mean():.1f} m, {np.mean(numbers[20:]):.2f} targets estimated of 3")
    return np.array(states).swapaxes(0, 1)[:, :, :2], found


def draw(found: tuple[np.ndarray, np.ndarray]):
    paths, errors = found
    figure, (left, right) = panels(2)
    draw_paths(left, paths)
    left.plot(*RECEIVERS.T, "k^", markersize=6, label="receivers")
    x, y = np.meshgrid(np.linspace(-300.0, 4300.0, 200), np.linspace(-2800.0, 3800.0, 200))
    for number, receiver in enumerate(RECEIVERS[1:], start=1):
        own, last = np.hypot(x - receiver[0], y - receiver[1]), paths[0, -1]
        difference = own - np.hypot(x - RECEIVERS[0, 0], y - RECEIVERS[0, 1])
        level = np.hypot(*(last - receiver)) - np.hypot(*(last - RECEIVERS[0]))
        left.contour(x, y, difference, [level], colors=f"C{number}", linestyles="solid", linewidths=0.8)
    legend_above(left)
    draw_errors(right, TIMES, {f"target {number}": values for number, values in enumerate(errors.T, start=1)})
    right.set(yscale="log", ylim=(1.0, 1000.0))
    return figure


if __name__ == "__main__":
    from pictures import draw_errors, draw_paths, legend_above, panels, show

    show(main, draw)
