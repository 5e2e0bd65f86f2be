"""Updates by one bearing and range over Gaussians of many widths, distances and noises, by every Gaussian method.

usage: bent_measurements.py [--draws N]

Each cell of the grid draws targets from the prior and measurements of them, and updates the prior by each method. The
normalised error squared (NEES) of the position is 2 on average where mean and covariance are those of the posterior.
"Exact" is the Gaussian with the moments of the posterior, by numerical integration.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

sys.path.append(str(Path(__file__).resolve().parents[1] / "tests"))

from reference.polar import posterior
from vedette import models
from vedette.kernels.base.types import RowNoise
from vedette.kernels.gaussian.innovation import expect, update_mean, whiten
from vedette.kernels.gaussian.relinearisation import Pair, make_pair_work, relinearise

DISTANCES = (100.0, 365.0, 1500.0, 5000.0, 20000.0)  # m
BEARING_NOISES = (0.05, 0.17, 0.5, 1.0, 3.0)  # degrees
RANGE_NOISES = (1.0, 10.0, 50.0)  # m
PRIORS = (5.0, 20.0, 50.0, 150.0, 500.0)  # m, along each axis
METHODS = ("ekf", "ukf", "ckf", "auto")
QUOTED = ((365.0, 0.17, 10.0, 50.0), (1500.0, 0.1, 10.0, 150.0), (20000.0, 1.0, 1.0, 500.0), (100.0, 0.05, 1.0, 500.0))


NO_NOISE = RowNoise(np.empty((0, 2, 2)), np.empty((0, 2, 2)))  # of a measurement that brings none


class Updater:
    """Updates of one sensor at the origin."""

    def __init__(self, method: str, noise: Any) -> None:
        clutter = models.region_clutter(1.0, models.Region(-1e5, 1e5, -1e5, 1e5), "bearing_range")
        parts = models.bearing_range(), models.constant_noise(noise), models.constant_detection(0.9), clutter
        self.kernel, self.periods = models.SensorModel(*parts, method).to_kernel(), parts[0].periods
        self.work, self.pose = make_pair_work(4, 2), np.zeros(3)

    def __call__(self, mean: Any, cov: Any, measurement: Any) -> tuple[Any, Any, bool]:
        """Mean and covariance after a measurement, and whether it bends."""
        innovation, scratch, out = self.work.innovation, self.work.scratch, np.empty(4)
        expect(self.kernel, self.pose, mean, cov, 0, innovation, scratch)
        if innovation.bends[0]:
            relinearise(self.kernel, Pair(self.pose, mean, cov, measurement, NO_NOISE), self.work)
        else:
            whiten(innovation, 0, measurement, self.periods, np.inf, scratch.residual)
        update_mean(innovation, 0, scratch.residual, mean, out)
        return out, innovation.covs[0].copy(), bool(innovation.bends[0])


def nees(mean: Any, cov: Any, target: Any) -> float:
    off = (mean - target)[:2]
    return float(off @ np.linalg.solve(cov[:2, :2], off))


def cell(case: tuple[float, ...], draws: int, *, exact: bool = False) -> dict[str, tuple[float, float, float]]:
    """Of each method: mean NEES, microseconds an update (called from Python), and the share of updates that bend."""
    distance, bearing, reach, std = case
    noise, rng = np.array([np.deg2rad(bearing), reach]), np.random.default_rng(1)
    mean, cov, sensor = np.array([distance, 0.0, 0.0, 0.0]), np.diag([std**2, std**2, 1.0, 1.0]), models.bearing_range()
    targets = mean + rng.normal(size=(draws, 4)) * np.sqrt(np.diag(cov))
    scans = sensor.measure(targets, np.zeros(3)) + rng.normal(size=(draws, 2)) * noise
    scans[:, 0], scans[:, 1] = np.remainder(scans[:, 0] + np.pi, 2.0 * np.pi) - np.pi, np.abs(scans[:, 1])
    found = {}
    for method in METHODS:
        update, start = Updater(method, noise), time.perf_counter()
        after = [update(mean, cov, z) for z in scans]
        spent = 1e6 * (time.perf_counter() - start) / draws
        errors = [nees(m, c, x) for (m, c, _), x in zip(after, targets, strict=True)]
        found[method] = (float(np.mean(errors)), spent, float(np.mean([bends for _, _, bends in after])))
    if exact:
        moments = [posterior(mean[:2], cov[:2, :2], np.zeros(2), z, noise) for z in scans]
        errors = [nees(m, c, x[:2]) for (m, c, _), x in zip(moments, targets, strict=True)]
        found["exact"] = (float(np.mean(errors)), float("nan"), float("nan"))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=300, help="targets and measurements a cell (default 300)")
    draws = parser.parse_args().draws
    Updater("auto", np.ones(2))  # the first call compiles
    cell(QUOTED[0], 2)
    print("distance m, bearing degrees, range m, prior m |", *(f"{name:>9}" for name in (*METHODS, "exact")))
    for case in QUOTED:
        found = cell(case, draws, exact=True)
        values = " ".join(f"{found[name][0]:9.4g}" for name in (*METHODS, "exact"))
        print(f"{case[0]:10.0f} {case[1]:16.2f} {case[2]:8.0f} {case[3]:8.0f} | {values}")
    grid = list(itertools.product(DISTANCES, BEARING_NOISES, RANGE_NOISES, PRIORS))
    cells = [cell(case, draws) for case in grid]
    bent = np.array([each["auto"][2] > 0.0 for each in cells])
    print(f"\n{len(grid)} cells, auto relinearises in {bent.sum()}; NEES, and microseconds an update from Python")
    print(f"{'':8}{'median':>10}{'largest':>12}{'above 4':>10}{'straight, us':>14}{'bent, us':>10}")
    for name in METHODS:
        errors, spent = (np.array([each[name][k] for each in cells]) for k in (0, 1))
        print(
            f"{name:8}{np.median(errors):10.2f}{errors.max():12.4g}{np.sum(~(errors < 4.0)):10d}"
            f"{np.median(spent[~bent]):14.1f}{np.median(spent[bent]):10.1f}"
        )
    worst = max(range(len(grid)), key=lambda k: cells[k]["auto"][0])
    print(f"largest of auto: {grid[worst]}, {cells[worst]['auto'][0]:.2f}")


if __name__ == "__main__":
    main()
