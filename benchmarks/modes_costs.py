"""What modes of motion cost and where they err, on the scenes of `benchmarks/modes.py`.

    python benchmarks/modes_costs.py nees --scenes 20        # consistency in manoeuvres and elsewhere
    python benchmarks/modes_costs.py hidden --scenes 20      # false targets while some are behind a wall
    python benchmarks/modes_costs.py ends --scenes 20        # how long a target that ended keeps its label
    python benchmarks/modes_costs.py time                    # CPU time of a scan by targets and modes
    python benchmarks/modes_costs.py speeds --folder FOLDER  # a recording with scans.csv and truth.csv

`nees` prints the mean of e' P^-1 e / 2 of positions over targets with an estimate, 1 if covariances are right, with a
95 % interval over scenes. `speeds` reads columns time, range_m, bearing_deg (from north) and time, id, x, y.
"""

from __future__ import annotations

import argparse
import csv
import math
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from modes import CUTOFF, STEPS, Scene, modes_of, scene, targets_of, tracked
from scipy.optimize import linear_sum_assignment

from vedette import models
from vedette.densities.estimates import Estimate, best_estimate
from vedette.evaluation.metrics.point_ospa import ospa
from vedette.filters import FactoredGlmbFilter, Limits, LmbFilter
from vedette.kernels.base.types import Floats

NEAR = 5.0  # times the noise, within which an estimate is of a target
END = 60  # scan from which a target of `ends` is gone
NUM_SCANS, WARM_UP = 24, 6  # of `time`


def matched(estimate: Estimate, truth: Floats, reach: float) -> list[tuple[int, int]]:
    """Pairs of estimates and true positions (num, 2) that are nearest to each other within a distance."""
    distances = np.linalg.norm(estimate.means[:, np.newaxis, :2] - truth[np.newaxis], axis=2)
    pairs = zip(*linear_sum_assignment(np.minimum(distances, reach)), strict=True)
    return [(int(i), int(j)) for i, j in pairs if distances[i, j] < reach]


def motions_of(own: Scene, *, hides: bool = False) -> dict[str, models.MotionModel]:
    """Constant velocity for straight courses and for turns, and modes."""
    plain = {f"constant velocity {share:g}": models.constant_velocity(share * own.speed) for share in (0.02, 0.1)}
    return {**plain, "modes": modes_of(own.speed, hides=hides)}


def interval(values: list[float]) -> str:
    """Mean and 95 % interval over scenes."""
    known = np.array([value for value in values if math.isfinite(value)])
    half = 1.96 * known.std(ddof=1) / math.sqrt(len(known)) if len(known) > 1 else math.nan
    return f"{known.mean():.2f} [{known.mean() - half:.2f}, {known.mean() + half:.2f}]"


def nees(kinds: list[str], numbers: range) -> None:
    """Print the mean NEES of positions, in manoeuvres and elsewhere."""
    for kind in kinds:
        rows: dict[str, list[tuple[float, float]]] = {}
        for number in numbers:
            own = scene(kind, number)
            for name, motion in motions_of(own).items():
                found: dict[bool, list[float]] = {True: [], False: []}
                for step, estimate in enumerate(tracked(own, motion)[0]):
                    there = np.flatnonzero(np.isfinite(own.states[step, :, 0]))
                    for i, j in matched(estimate, own.states[step, there, :2], NEAR * own.noise):
                        error = estimate.means[i, :2] - own.states[step, there[j], :2]
                        value = float(error @ np.linalg.solve(estimate.covs[i, :2, :2], error)) / 2.0
                        found[bool(own.manoeuvring[step, there[j]])].append(value)
                means = [float(np.mean(each)) if each else math.nan for each in found.values()]
                rows.setdefault(name, []).append((means[0], means[1]))
        for name, values in rows.items():
            busy, quiet = ([value[side] for value in values] for side in (0, 1))
            shown = interval(busy) if np.isfinite(busy).any() else "none"
            print(f"{kind:10} {name:24} in manoeuvres {shown}, else {interval(quiet)}")


def hidden(numbers: range) -> None:
    """Print false targets per scan while a target is behind a wall, and at other scans."""
    rows: dict[str, list[tuple[float, float]]] = {}
    for number in numbers:
        own = scene("hidden", number)
        for name, motion in motions_of(own, hides=True).items():
            false: dict[bool, list[int]] = {True: [], False: []}
            for step, estimate in enumerate(tracked(own, motion)[0]):
                there = np.isfinite(own.states[step, :, 0])
                pairs = matched(estimate, own.states[step, there, :2], CUTOFF * own.noise)
                false[bool(own.hidden[step, there].any())].append(len(estimate.means) - len(pairs))
            means = [float(np.mean(each)) if each else math.nan for each in false.values()]
            rows.setdefault(name, []).append((means[0], means[1]))
    for name, values in rows.items():
        behind, other = ([value[side] for value in values] for side in (0, 1))
        print(f"{name:24} false targets a scan: behind a wall {interval(behind)}, else {interval(other)}")


def ends(numbers: range) -> None:
    """Print for how many scans a target that ended in view keeps an estimate with its label."""
    rows: dict[str, list[float]] = {}
    for number in numbers:
        own = scene("straight", number)
        gone = int(np.flatnonzero(np.isfinite(own.states[END, :, 0]))[0])
        rng = np.random.default_rng([number, END])
        for step in range(END, STEPS):  # its detections are those near it
            scan = own.scans[step]
            near = np.linalg.norm(scan - own.states[step, gone, :2], axis=1) < 4.0 * own.noise
            own.scans[step] = rng.permutation(scan[~near])
        for name, motion in motions_of(own, hides=True).items():
            found, _ = tracked(own, motion)
            before = found[END - 1]
            pairs = matched(before, own.states[END - 1, gone : gone + 1, :2], NEAR * own.noise)
            if not pairs:
                continue
            label = tuple(before.labels[pairs[0][0]].tolist())
            late = [step for step in range(END, STEPS) if label in set(map(tuple, found[step].labels.tolist()))]
            rows.setdefault(name, []).append(float(len(late)))
    for name, values in rows.items():
        print(f"{name:24} keeps its label for {interval(values)} scans, at most {max(values):.0f}")


def crossing(
    num: int, motion: models.MotionModel, at_sites: bool
) -> tuple[models.TargetModel, models.SensorModel, list[Floats]]:
    """Return targets, a sensor and scans of this number of targets, on straight courses at one density.

    at_sites: True for births where the targets are, False for births anywhere.
    """
    half, rng = 200.0 * math.sqrt(num), np.random.default_rng(1)
    begin = np.column_stack([rng.uniform(-0.9 * half, 0.9 * half, (num, 2)), rng.normal(0.0, 8.0, (num, 2))])
    ways = np.pad(begin[:, 2:], ((0, 0), (0, 2)))
    states = begin + np.arange(NUM_SCANS)[:, np.newaxis, np.newaxis] * ways
    scans = [own[rng.random(num) < 0.9, :2] for own in states]
    scans = [scan + 3.0 * rng.standard_normal(scan.shape) for scan in scans]
    region = models.Region(-half, half, -half, half)
    sensor = models.SensorModel(
        models.position(),
        models.constant_noise([3.0, 3.0]),
        models.constant_detection(0.9),
        models.region_clutter(1.0, region, "position"),
    )
    empty = np.zeros((NUM_SCANS, num), bool)
    targets = targets_of(Scene(states, empty, empty, scans, region, 3.0, 10.0, 0.9, 1.0), motion)
    if at_sites:
        covs = np.tile(np.diag([36.0, 36.0, 100.0, 100.0]), (num, 1, 1))
        birth = models.BirthModel(np.full(num, 0.99), states[0], covs, steps=frozenset({1}))
        targets = replace(targets, birth=birth)
    return targets, sensor, scans


def time_of_scan(kind: Any, num: int, motion: models.MotionModel) -> float:
    """Return the CPU time of a scan once all targets are tracked, ms: the least of several medians."""
    targets, sensor, scans = crossing(num, motion, kind is LmbFilter)
    tracker, medians = kind(targets, sensor, Limits()), list[float]()
    for _ in range(max(2, 60 // num)):
        belief, spent, rng = tracker.initial(), list[float](), np.random.default_rng(1)
        for step, scan in enumerate(scans, 1):
            start = time.process_time()
            belief, _ = tracker.step(belief, scan, np.zeros(3), 1.0, step, rng=rng)
            spent.append(1e3 * (time.process_time() - start))
        medians.append(float(np.median(spent[WARM_UP:])))
    return min(medians)


def costs(numbers: tuple[int, ...]) -> None:
    """Print the CPU time of a scan by filter and the numbers of targets and of modes."""
    every, stays = modes_of(10.0), [40.0, 8.0, 8.0, 8.0, 40.0]
    several = [models.Modes(every.motions[:count], stays[:count]) for count in (2, 3, 5)]
    print("| filter | targets | one motion, ms | two modes, ms, ratio | three | five |")
    print("| --- | ---: | ---: | ---: | ---: | ---: |")
    for kind in (LmbFilter, FactoredGlmbFilter):
        for num in numbers:
            base = time_of_scan(kind, num, every.motions[0])
            times = [time_of_scan(kind, num, motion) for motion in several]
            shown = " | ".join(f"{value:.2f}, {value / base:.2f}" for value in times)
            print(f"| {kind.__name__} | {num} | {base:.2f} | {shown} |", flush=True)


def speeds(folder: Path) -> None:
    """Print OSPA and broken tracks on a recording of targets of very different speeds."""
    rows = [[float(row[n]) for n in ("time", "range_m", "bearing_deg")] for row in _read(folder / "scans.csv")]
    true = [[float(row[n]) for n in ("time", "id", "x", "y")] for row in _read(folder / "truth.csv")]
    table, truth = np.array(rows), np.array(true)
    times = np.unique(table[:, 0])
    region = models.Region(-30e3, 30e3, -30e3, 30e3)
    sensor = models.SensorModel(
        models.bearing_range(),
        models.constant_noise([0.0035, 20.0]),
        models.constant_detection(0.95),
        models.region_clutter(10.0, region, "bearing_range"),
    )
    slow, fast = models.constant_velocity(0.1), models.constant_velocity(10.0)
    motions: dict[str, models.MotionModel] = {
        f"constant velocity {noise:g} m/s2": models.constant_velocity(noise) for noise in (0.1, 1.0, 5.0, 10.0)
    }
    motions["modes of 0.1 and 10 m/s2"] = models.Modes((slow, fast), (60.0, 20.0))
    measured = models.MeasurementBirth(0.02, 0.05, np.array([100.0, 100.0, 150.0, 150.0]), region)
    birth = models.BirthModel(np.empty(0), np.empty((0, 4)), np.empty((0, 4, 4)), from_measurements=measured)
    for name, motion in motions.items():
        targets = models.TargetModel(motion, models.constant_survival(0.999), birth)
        tracker: Any = FactoredGlmbFilter(targets, sensor, Limits())
        belief, rng, last = tracker.initial(), np.random.default_rng(0), times[0] - 1.0
        errors, labels = [], dict[int, list[tuple[int, ...]]]()
        for step, now in enumerate(times, 1):
            own = table[table[:, 0] == now]
            scan = np.column_stack([np.radians(90.0 - own[:, 2]), own[:, 1]])
            scan[:, 0] = (scan[:, 0] + math.pi) % (2.0 * math.pi) - math.pi
            belief, _ = tracker.step(belief, scan, np.zeros(3), float(now - last), step, rng=rng)
            estimate, there, last = best_estimate(belief, step), truth[truth[:, 0] == now], now
            errors.append(ospa(estimate.means[:, :2], there[:, 2:], cutoff=500.0, order=1.0).total)
            for i, j in matched(estimate, there[:, 2:], 500.0):
                labels.setdefault(int(there[j, 1]), []).append(tuple(estimate.labels[i].tolist()))
        broken = {target: len(set(found)) - 1 for target, found in sorted(labels.items())}
        shares = ", ".join(f"{len(labels.get(t, [])) / len(times):.2f}" for t in np.unique(truth[:, 1]).astype(int))
        print(f"{name:28} OSPA {np.mean(errors):6.1f} m, tracked {shares}, broken {sum(broken.values())}")


def _read(file: Path) -> list[dict[str, str]]:
    with file.open() as lines:
        return list(csv.DictReader(lines))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("nees", "hidden", "ends", "time", "speeds"))
    parser.add_argument("--scenes", type=int, default=20)
    parser.add_argument("--first", type=int, default=200)
    parser.add_argument("--kinds", nargs="+", default=["boats", "aircraft", "ferries", "straight"])
    parser.add_argument("--targets", nargs="+", type=int, default=(10, 100, 1000))
    parser.add_argument("--folder", type=Path)
    options = parser.parse_args()
    numbers = range(options.first, options.first + options.scenes)
    if options.what == "nees":
        nees(options.kinds, numbers)
    elif options.what == "hidden":
        hidden(numbers)
    elif options.what == "ends":
        ends(numbers)
    elif options.what == "time":
        costs(tuple(options.targets))
    elif options.folder is None:
        parser.error("speeds: --folder is needed")
    else:
        speeds(options.folder)


if __name__ == "__main__":
    main()
