"""What the mean probability of detection brings where targets cross the edge of a sensor's view.

    python benchmarks/detection_edge.py [--runs N]

A sensor sees 95 in 100 of what is within 500 m and nothing beyond. A target, there with probability 0.5, crosses the
edge outwards or inwards at 10 m/s, in 20 scans; its prior position and the measurements have one standard deviation
each of the size given. Everything is drawn from the model that an LMB filter has, so the exact posterior would have the
best scores: of existence the mean log score (higher is better) and the mean Brier score (lower is better), and OSPA of
the estimates (c = 100 m, p = 1). Differences mean minus centre are paired by run, with their standard errors.
"""

from __future__ import annotations

import argparse
import math
import time
from typing import Any

import numpy as np

from vedette import models
from vedette.densities import existence_probabilities, marginal_estimate
from vedette.evaluation import ospa
from vedette.filters import LmbFilter
from vedette.simulation import simulate_scan

REACH, SPEED, NUM_SCANS, CLUTTER, SIGMA_V = 500.0, 10.0, 20, 5.0, 1.0
DETECTIONS = {
    "range": models.limited_range(0.95, REACH),
    "soft": models.soft_sector(0.95, REACH, range_slope=0.5, hard_limit=True),
}
REGION, POSE = models.Region(-700.0, 700.0, -700.0, 700.0), np.zeros(3)


def filter_of(detection: models.DetectionModel, std: float, outwards: bool, detection_at: str) -> LmbFilter:
    clutter, noise = models.region_clutter(CLUTTER, REGION, "position"), models.constant_noise([std, std])
    sensor = models.SensorModel(models.position(), noise, detection, clutter, detection_at=detection_at)
    start = REACH + (-1.0 if outwards else 1.0) * 0.5 * SPEED * NUM_SCANS
    mean, cov = [start, 0.0, SPEED if outwards else -SPEED, 0.0], np.diag([std, std, 2.0, 2.0]) ** 2
    birth = models.BirthModel([0.5], [mean], [cov], frozenset([1]))
    return LmbFilter(
        models.TargetModel(models.constant_velocity(SIGMA_V), models.constant_survival(1.0), birth), sensor
    )


def drawn(local: LmbFilter, rng: np.random.Generator) -> list[tuple[np.ndarray, np.ndarray]]:
    """True states (none or one) and scan at each time."""
    birth, push = local.targets.birth, SIGMA_V * rng.normal(size=(NUM_SCANS, 2))
    state = rng.multivariate_normal(birth.means[0], birth.covs[0])
    alive, found = rng.uniform() < 0.5, []
    for k in range(NUM_SCANS):
        if k > 0:
            state = np.concatenate([state[:2] + state[2:] + 0.5 * push[k], state[2:] + push[k]])
        states = state[np.newaxis] if alive else np.empty((0, 4))
        found.append((states, simulate_scan(states, POSE, local.sensor, rng=rng).measurements))
    return found


def scores(local: LmbFilter, scans: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """Log score and Brier score of existence, OSPA; means over the scans."""
    belief, rows = local.initial(), []
    for step, (states, scan) in enumerate(scans, start=1):
        belief, _ = local.step(belief, scan, POSE, 1.0, step, rng=np.random.default_rng(0))
        existence = float(existence_probabilities(belief)[1].sum())
        existence = min(max(existence, 1e-6), 1.0 - 1e-6)
        happened = existence if len(states) else 1.0 - existence
        estimate = marginal_estimate(belief)
        distance = ospa(states[:, :2], estimate.means[:, :2], cutoff=100.0, order=1.0).total
        rows.append((math.log(happened), (1.0 - happened) ** 2, distance))
    return np.mean(rows, axis=0)


def compared(detection: models.DetectionModel, std: float, num_runs: int) -> tuple[np.ndarray, list[float]]:
    """(num_runs, 2, 3) scores at centre and mean, and CPU microseconds a scan of each."""
    table, spent = np.empty((num_runs, 2, 3)), [0.0, 0.0]
    for run in range(num_runs):
        ways = [filter_of(detection, std, run % 2 == 0, at) for at in ("centre", "mean")]
        scans = drawn(ways[0], np.random.default_rng(run))
        for way, local in enumerate(ways):
            start = time.process_time()
            table[run, way] = scores(local, scans)
            spent[way] += time.process_time() - start if run > 0 else 0.0  # the first run compiles
    return table, [1e6 * seconds / (num_runs - 1) / NUM_SCANS for seconds in spent]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=300, help="at least 2")
    num_runs = parser.parse_args().runs
    print("edge   std m  of each score: centre, mean (difference): log score; Brier score; OSPA m; CPU time")
    for name, detection in DETECTIONS.items():
        for std in (5.0, 20.0, 50.0):
            table, spent = compared(detection, std, num_runs)
            words: list[Any] = []
            for j, digits in enumerate((4, 4, 2)):
                change = table[:, 1, j] - table[:, 0, j]
                error = change.std(ddof=1) / math.sqrt(num_runs)
                both = ", ".join(f"{value:.{digits}f}" for value in table[:, :, j].mean(axis=0))
                words.append(f"{both} ({change.mean():+.{digits}f} +- {error:.{digits}f})")
            print(f"{name:5s} {std:6.0f}  {'   '.join(words)}   {spent[0]:.0f}, {spent[1]:.0f} us per scan", flush=True)


if __name__ == "__main__":
    main()
