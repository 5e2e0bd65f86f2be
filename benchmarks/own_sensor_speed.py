"""How fast a user-made bearing-range sensor is beside the built-in one, through the filters' own steps.

    python benchmarks/own_sensor_speed.py [--pairs N]

Both sensors see the same scans of one scene. A pair is one pass over the scans with each, in alternating order, in CPU
time of this process; what is printed is the median over pairs, and the median, lowest and highest of the paired ratio
built-in time / user-made time. 1 means equally fast; the aim is at least 0.8.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from vedette import models
from vedette.filters import DeltaGlmbFilter, Filter, LmbFilter
from vedette.simulation import ScriptedTargets, simulate_scan

sys.path.insert(0, str(Path(__file__).parents[1] / "examples"))
from own_sensor import (
    POSE,
    built_in_sensor,
    my_sensor,
)

NUM_SCANS = 30
NUM_TARGETS = 10
AIM = 0.8


def without_jacobian(sensor: models.SensorModel) -> models.SensorModel:
    """The same sensor with its Jacobian left out, so that sigma points are used."""
    parts = sensor.measurement
    bare = models.MeasurementModel(parts.meas_dim, parts.function, parts.params, angular=parts.angular)
    return models.SensorModel(bare, sensor.noise, sensor.detection, sensor.clutter)


def scene() -> tuple[models.BirthModel, list[np.ndarray]]:
    """Births and the scans of ten targets crossing the region."""
    rng = np.random.default_rng(0)
    states = np.hstack([rng.uniform(-800, 800, (NUM_TARGETS, 2)), rng.normal(0, 10, (NUM_TARGETS, 2))])
    times = np.arange(1.0, NUM_SCANS + 1.0)
    truth = ScriptedTargets(models.constant_velocity(5.0), states).truth(times, rng=rng)
    scans = [simulate_scan(truth.at(k)[1], POSE, built_in_sensor(), rng=rng).measurements for k in range(NUM_SCANS)]
    covs = np.tile(np.diag([50.0, 50.0, 25.0, 25.0]) ** 2, (NUM_TARGETS, 1, 1))
    means = np.hstack([states[:, :2], np.zeros((NUM_TARGETS, 2))])
    return models.BirthModel(np.full(NUM_TARGETS, 0.02), means, covs, frozenset({1})), scans


def seconds_of_a_pass(tracker: Filter, scans: Sequence[np.ndarray]) -> float:
    belief, rng = tracker.initial(), np.random.default_rng(0)
    start = time.process_time()
    for k, scan in enumerate(scans):
        belief, _ = tracker.step(belief, scan, POSE, 1.0, k + 1, rng=rng)
    return time.process_time() - start


def compare(name: str, built_in: Filter, user_made: Filter, scans: list[np.ndarray], pairs: int) -> float:
    """Print one line; return the median ratio."""
    for tracker in (built_in, user_made):
        seconds_of_a_pass(tracker, scans)
    seconds = np.empty((pairs, 2))
    for pair in range(pairs):
        for which in (0, 1) if pair % 2 == 0 else (1, 0):
            seconds[pair, which] = seconds_of_a_pass((built_in, user_made)[which], scans)
    ratios = seconds[:, 0] / seconds[:, 1]
    first, second = 1e3 * np.median(seconds, axis=0) / len(scans)
    print(
        f"{name:<22} built-in {first:7.3f} ms per scan, user-made {second:7.3f} ms; "
        f"ratio {np.median(ratios):.3f} ({ratios.min():.3f} to {ratios.max():.3f})"
    )
    return float(np.median(ratios))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=15, help="number of paired passes")
    pairs = parser.parse_args().pairs
    birth, scans = scene()
    targets = models.TargetModel(models.constant_velocity(5.0), models.constant_survival(0.98), birth)
    ratios = []
    for kind, make in (("delta-GLMB", DeltaGlmbFilter), ("LMB", LmbFilter)):
        for method, change in (("EKF", lambda sensor: sensor), ("UKF", without_jacobian)):
            built_in, user_made = (make(targets, change(sensor)) for sensor in (built_in_sensor(), my_sensor()))
            ratios.append(compare(f"{kind}, {method}", built_in, user_made, scans, pairs))
    print(f"lowest median ratio {min(ratios):.3f}, aim at least {AIM}")
    return 0 if min(ratios) >= AIM else 1


if __name__ == "__main__":
    sys.exit(main())
