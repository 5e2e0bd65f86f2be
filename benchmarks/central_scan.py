"""CPU time of one scan of the filters of several sensors, beside as many scans of one sensor each.

    python benchmarks/central_scan.py

Two scenes of three sensors and ten targets: the recorded scans of `mslin3` (tests/filters/recordings), and bearing and
range from three corners of the built-in scenario polar-10. Median and mean over the scans, checks included. "One by
one": the three filters of one sensor that a distributed tracker would run on the same scans, their times summed.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

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


def main() -> None:
    rng = np.random.default_rng(0)
    print(f"{'scene':8s} {'filter':12s} central ms: median, mean   one by one ms: median, mean")
    for name, scene in (("mslin3", recorded_scene()), ("polar-10", polar_scene())):
        targets, sensors, poses, scans = scene
        for kind, (several, single) in PAIRS.items():
            central = several(targets, sensors)
            singles = [single(targets, sensor) for sensor in sensors]

            def together(belief: Any, scan: Any, number: int, central: Any = central, poses: Any = poses) -> Any:
                return central.step(belief, scan, poses, 1.0, number, rng=rng)[0]

            def alone(belief: Any, scan: Any, number: int, singles: Any = singles, poses: Any = poses) -> Any:
                parts = zip(singles, belief, scan, poses, strict=True)
                return [one.step(b, z, pose, 1.0, number, rng=rng)[0] for one, b, z, pose in parts]

            for _ in range(2):  # the first time compiles, or reads the cache
                spent = 1e3 * seconds_of(together, central.initial(), scans)
                apart = 1e3 * seconds_of(alone, [one.initial() for one in singles], scans)
            figures = (np.median(spent), np.mean(spent), np.median(apart), np.mean(apart))
            print("{:8s} {:12s} {:19.2f} {:5.2f} {:23.2f} {:5.2f}".format(name, kind, *figures))


if __name__ == "__main__":
    main()
