"""A step of eight sensors that all see the same objects: fused by GCI, and one sensor after another.

    python benchmarks/eight_sensors.py [--objects N ...] [--repeats 5]

Objects bounce off the walls of a square of 200 m; each sensor measures positions to 1 m with detection 0.98 and one
false measurement a scan. A new object may be at any of a grid of 16 places, with existence 0.01 and a deviation of
50 m. The scene is that of the benchmarks of `multisensor-lmb-filters-rs`; `benchmarks/peers.py` runs it beside ours.
CPU time of a step, checks included.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from timing import Figures, Measure, Once

from vedette import models
from vedette.densities import LMB, Estimate, map_estimate
from vedette.filters import Limits, LmbFilter
from vedette.fusion import Clmb
from vedette.tracking import Distributed

SIDE, NUM_SENSORS, DETECTION, SURVIVAL, ACCELERATION = 100.0, 8, 0.98, 0.99, 3.0
POSE = np.zeros(3)
# The first scans find the objects, and cost more than those that follow.
SETTLED = 5


def box_scene(num_objects: int, num_steps: int, seed: int = 42) -> tuple[list[np.ndarray], list[list[np.ndarray]]]:
    """The true positions at each step, and the scans of each sensor at each step."""
    rng = np.random.default_rng(seed)
    states = np.column_stack([rng.uniform(-SIDE, SIDE, (num_objects, 2)), rng.normal(0.0, 3.0, (num_objects, 2))])
    truth, scans = [], []
    for _ in range(num_steps):
        states[:, :2] += states[:, 2:]
        outside = np.abs(states[:, :2]) > SIDE
        states[:, 2:][outside] *= -1.0
        states[:, :2] = np.clip(states[:, :2], -SIDE, SIDE)
        truth.append(states[:, :2].copy())
        scans.append([_scan(states[:, :2], rng) for _ in range(NUM_SENSORS)])
    return truth, scans


def _scan(positions: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    seen = positions[rng.random(len(positions)) < DETECTION]
    clutter = rng.uniform(-SIDE, SIDE, (rng.poisson(1.0), 2))
    return rng.permutation(np.concatenate([seen + rng.normal(size=seen.shape), clutter]))


def box_filter() -> LmbFilter:
    """As every sensor has it."""
    grid = np.array([(x, y, 0.0, 0.0) for x in (-75.0, -25.0, 25.0, 75.0) for y in (-75.0, -25.0, 25.0, 75.0)])
    covs = np.tile(np.diag([2500.0, 2500.0, 100.0, 100.0]), (len(grid), 1, 1))
    births = models.BirthModel(np.full(len(grid), 0.01), grid, covs)
    targets = models.TargetModel(models.constant_velocity(ACCELERATION), models.constant_survival(SURVIVAL), births)
    clutter = models.measurement_space_clutter(1.0, [-SIDE, -SIDE], [SIDE, SIDE])
    sensor = models.SensorModel(
        models.position(), models.constant_noise([1.0, 1.0]), models.constant_detection(DETECTION), clutter
    )
    return LmbFilter(targets, sensor, Limits(min_existence=1e-3, max_hypotheses=100))


Stepper = Callable[[Any, list[np.ndarray], int], tuple[Any, LMB]]


def by_gci() -> tuple[Any, Stepper]:
    """A filter at each sensor, all going on from the fusion of what they believe."""
    tracker = Distributed((box_filter(),) * NUM_SENSORS, Clmb((1.0 / NUM_SENSORS,) * NUM_SENSORS), feedback=True)
    rngs, poses = [np.random.default_rng(0)] * NUM_SENSORS, np.zeros((NUM_SENSORS, 3))

    def step(state: Any, scans: list[np.ndarray], number: int) -> tuple[Any, LMB]:
        state, _ = tracker.step(state, scans, poses, float(number), rngs=rngs)
        return state, state.fused

    return tracker.initial(), step


def one_after_another() -> tuple[Any, Stepper]:
    """One belief, updated with the scan of each sensor in turn."""
    one, rng = box_filter(), np.random.default_rng(0)

    def step(belief: Any, scans: list[np.ndarray], number: int) -> tuple[Any, LMB]:
        belief, _ = one.predict(belief, 1.0, number)
        for scan in scans:
            belief, _ = one.update(belief, scan, POSE, rng=rng)
        return belief, belief

    return one.initial(), step


RULES: dict[str, Callable[[], tuple[Any, Stepper]]] = {"GCI": by_gci, "sequential": one_after_another}


def box_run(rule: str, scans: Sequence[list[np.ndarray]]) -> tuple[list[float], list[Estimate]]:
    """CPU seconds and estimate of each step."""
    belief, step = RULES[rule]()
    seconds, estimates = [], []
    for number, of_all in enumerate(scans, 1):
        start = time.process_time()
        belief, told = step(belief, of_all, number)
        seconds.append(time.process_time() - start)
        estimates.append(map_estimate(told))
    return seconds, estimates


def prepared(num_objects: int, rule: str) -> Once:
    """What gives the median milliseconds of a step over a run."""
    _, scans = box_scene(num_objects, 20)
    box_run(rule, scans[:3])
    return lambda: 1e3 * float(np.median(box_run(rule, scans)[0][SETTLED:]))


def measures() -> Iterator[Measure]:
    """A step of fifty objects."""
    for rule in RULES:
        yield Measure("8 sensors", f"50 objects, {rule}", partial(prepared, 50, rule), rounds=5)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--objects", type=int, nargs="+", default=(10, 20, 50))
    parser.add_argument("--repeats", type=int, default=5)
    given = parser.parse_args()
    for number in given.objects:
        for rule in RULES:
            once = prepared(number, rule)
            least, median = Figures.of([once() for _ in range(given.repeats)])
            print(f"{number:3d} objects, {rule:10s}: median {median:7.2f} ms of CPU, least {least:7.2f} ms")


if __name__ == "__main__":
    main()
