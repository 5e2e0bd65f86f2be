"""CPU time of one scan of the filters of several sensors, beside as many scans of one sensor each.

    python benchmarks/central_scan.py

Two scenes of three sensors and ten targets: the recorded scans of `mslin3` (tests/filters/recordings), and bearing and
range from three corners of the built-in scenario polar-10. Median and mean over the scans, checks included. "One by
one": the three filters of one sensor that a distributed tracker would run on the same scans, their times summed.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from timing import Measure, Once

from vedette.filters import DeltaGlmbFilter, LmbFilter, MultiSensorGlmbFilter, MultiSensorLmbFilter
from vedette.scenarios import load_scenario
from vedette.scenarios.build import build_experiment
from vedette.simulation import simulate_scan

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from filters import recorded

PAIRS = {"LMB": (MultiSensorLmbFilter, LmbFilter), "delta-GLMB": (MultiSensorGlmbFilter, DeltaGlmbFilter)}


def recorded_scene() -> tuple[Any, Any, list[Any], list[Any]]:
    """Targets, sensors, poses and the scans of every step."""
    recording = recorded.load("mslin3", 2)
    tracker = recorded.make_central(MultiSensorLmbFilter, recording)
    scans = list(zip(*(recorded.scans_of(recording, s) for s in range(3)), strict=True))
    return tracker.targets, tracker.sensors, [recorded.POSE] * 3, scans


def polar_scene() -> tuple[Any, Any, list[Any], list[Any]]:
    """The same, of bearings and ranges."""
    experiment = build_experiment(load_scenario("polar-10"))
    one = experiment.tracker.filters[0]
    poses = [np.array([px, py, 0.0]) for px, py in ((-900.0, -900.0), (900.0, -900.0), (0.0, 900.0))]
    rng = np.random.default_rng(1)
    truth = experiment.targets.truth(experiment.times, rng=rng)
    states = [truth.at(k)[1] for k in range(len(experiment.times))]
    scans = [[simulate_scan(x, pose, one.sensor, rng=rng).measurements for pose in poses] for x in states]
    return one.targets, [one.sensor] * 3, poses, scans


def seconds_of(step: Any, belief: Any, scans: list[Any]) -> Any:
    """Of every scan; step(belief, scan, number) gives the next belief."""
    spent = []
    for number, scan in enumerate(scans, 1):
        start = time.process_time()
        belief = step(belief, scan, number)
        spent.append(time.process_time() - start)
    return np.array(spent)


Step = Callable[[Any, Any, int], Any]


def ways(kind: str, targets: Any, sensors: Any, poses: Any) -> tuple[tuple[Step, Any], tuple[Step, Any]]:
    """Of one central filter, and of a filter for each sensor: the step, and the belief before the first."""
    several, single = PAIRS[kind]
    rng, central = np.random.default_rng(0), several(targets, sensors)
    singles = [single(targets, sensor) for sensor in sensors]

    def together(belief: Any, scan: Any, number: int) -> Any:
        return central.step(belief, scan, poses, 1.0, number, rng=rng)[0]

    def alone(belief: Any, scan: Any, number: int) -> Any:
        parts = zip(singles, belief, scan, poses, strict=True)
        return [one.step(b, z, pose, 1.0, number, rng=rng)[0] for one, b, z, pose in parts]

    return (together, central.initial()), (alone, [one.initial() for one in singles])


def prepared(kind: str) -> Once:
    """What gives the median milliseconds of a central scan of `polar_scene`."""
    targets, sensors, poses, scans = polar_scene()
    (step, initial), _ = ways(kind, targets, sensors, poses)
    seconds_of(step, initial, scans)
    return lambda: 1e3 * float(np.median(seconds_of(step, initial, scans)))


def measures() -> Iterator[Measure]:
    """A scan of each filter of several sensors."""
    for kind in PAIRS:
        yield Measure("central scan", f"three sensors, ten targets, {kind}", partial(prepared, kind), rounds=3)


def main() -> None:
    print(f"{'scene':8s} {'filter':12s} central ms: median, mean   one by one ms: median, mean")
    for name, scene in (("mslin3", recorded_scene()), ("polar-10", polar_scene())):
        targets, sensors, poses, scans = scene
        for kind in PAIRS:
            (together, none), (alone, nobody) = ways(kind, targets, sensors, poses)
            for _ in range(2):  # the first time compiles, or reads the cache
                spent = 1e3 * seconds_of(together, none, scans)
                apart = 1e3 * seconds_of(alone, nobody, scans)
            figures = (np.median(spent), np.mean(spent), np.median(apart), np.mean(apart))
            print("{:8s} {:12s} {:19.2f} {:5.2f} {:23.2f} {:5.2f}".format(name, kind, *figures))


if __name__ == "__main__":
    main()
