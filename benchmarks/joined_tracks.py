"""Whether a target keeps its identity over a gap in its detections: joined tracks, nearest new track, and no join.

    python benchmarks/joined_tracks.py                          # 100 runs of each kind, a table
    python benchmarks/joined_tracks.py --first 1000 --runs 200  # other scenes
    python benchmarks/joined_tracks.py --write docs/evidence/joined-tracks.md

Each run draws a scene: a radar or a sensor of positions (noise 5 to 20 m, P_D .7 to .98, clutter .1 to 20 a scan, a
scan every 1, 2 or 4 s), and targets at 2 to 12 m/s. Half of them go straight on with small accelerations, the others
turn by up to 1.5 degrees a second. The filter assumes what `vedette track` does: speeds up to 10 m/s, survival .999 a
second, .5 births a scan.

One target, or ten: nothing detects it for 3, 6 or 12 scans (`missed`, of ten the first), or nothing in a strip that
takes it as long to cross (`shadow`). Of ten, each other target ends or begins at a random scan with probability 1/2, so
that there is something to join wrongly.

Kept: runs in which the first target has the same track before and after its gap. Wrong: joins of labels of two targets,
or of a target and clutter, of all joins but those of two labels of clutter, which are not counted; a label is of the
target that is matched with at least half of its estimates. With 95 % intervals (Wilson). `nearest`: each label that
ended goes on as the nearest one that begins later, within 10 m/s times the time between.
"""

from __future__ import annotations

import argparse
import math
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from pages import write_between

from vedette import models
from vedette.densities import Estimate, best_estimate, track_histories
from vedette.evaluation import match_run
from vedette.evaluation.joining import PROB_HIDDEN, THRESHOLD, Join, find_joins, track_names
from vedette.evaluation.observation_history import ObservationHistory
from vedette.filters import FactoredGlmbFilter
from vedette.kernels.base.types import Bools, Floats
from vedette.simulation.truth import Truth

NUM_SCANS, GAP_AT, SEED, HALF, SPEED = 50, 20, 7000, 2000.0, 10.0
GAPS, KINDS = (3, 6, 12), ("one, missed", "one, shadow", "ten, missed", "ten, shadow")
CUTOFF = 150.0  # m within which an estimate is of a target
BEFORE, AFTER = 6, 12  # scans before a gap and after it in which a track is looked for


class Scene(NamedTuple):
    """A scene: models and times of the filter, the targets, and whether each is hidden at each scan."""

    targets: models.TargetModel
    sensor: models.SensorModel
    times: Floats
    states: Floats  # (num_targets, num_scans, 4)
    there: Bools  # (num_targets, num_scans)
    hidden: Bools  # (num_targets, num_scans)
    stds: Floats  # (2,) of the noise
    prob_detection: float
    clutter: float


def paths(rng: np.random.Generator, num: int, period: float) -> Floats:
    """(num, num_scans, 4) states of targets that are near the middle at the gap; the first passes through it."""
    states = np.empty((num, NUM_SCANS, 4))
    for k in range(num):
        speed, course, rate = rng.uniform(2.0, 12.0), rng.uniform(-np.pi, np.pi), 0.0
        if rng.random() < 0.5:
            rate = math.radians(rng.uniform(-1.5, 1.5))
        turned = course + rate * period * (np.arange(NUM_SCANS) - GAP_AT) + np.cumsum(rng.normal(0.0, 0.01, NUM_SCANS))
        velocity = speed * np.column_stack([np.cos(turned), np.sin(turned)])
        place = np.cumsum(velocity * period, axis=0)
        states[k, :, :2] = place - place[GAP_AT] + (rng.uniform(-0.4 * HALF, 0.4 * HALF, 2) if k else 0.0)
        states[k, :, 2:] = velocity
    return states


def scene(number: int, kind: str, gap: int) -> tuple[Scene, np.random.Generator]:
    """The scene of this number."""
    rng = np.random.default_rng([SEED + number, KINDS.index(kind), gap])
    num, period = 10 if kind.startswith("ten") else 1, float(rng.choice([1.0, 2.0, 4.0]))
    noise, prob_detection = float(rng.uniform(5.0, 20.0)), float(rng.choice([0.7, 0.8, 0.9, 0.95, 0.98]))
    clutter, region = float(rng.choice([0.1, 2.0, 10.0, 20.0])), models.Region(-HALF, HALF, -HALF, HALF)
    states = paths(rng, num, period)
    there, hidden = np.ones((num, NUM_SCANS), np.bool_), np.zeros((num, NUM_SCANS), np.bool_)
    for k in range(1, num):
        change = int(rng.integers(10, NUM_SCANS - 10))
        if rng.random() < 0.5:
            there[k, slice(change) if rng.random() < 0.5 else slice(change, None)] = False
    if kind.endswith("missed"):
        hidden[0, GAP_AT : GAP_AT + gap] = True
    else:
        along = states[0, GAP_AT, 2:] / np.hypot(*states[0, GAP_AT, 2:])
        reach = (states[:, :, :2] - states[0, GAP_AT, :2]) @ along
        hidden = (reach >= 0.0) & (reach < reach[0, GAP_AT + gap])
    if rng.random() < 0.5:
        kind_of, stds, across, measurement = "position", [noise, noise], noise, models.position()
    else:
        kind_of, stds, across, measurement = (
            "bearing_range",
            [noise / 2000.0, noise],
            1.5 * noise,
            models.bearing_range(),
        )
    sensor = models.SensorModel(
        measurement,
        models.constant_noise(stds),
        models.constant_detection(prob_detection),
        models.region_clutter(clutter, region, kind_of),
    )
    born = models.MeasurementBirth(0.5, 0.03, np.array([2.0 * across, 2.0 * across, SPEED, SPEED]), region)
    birth = models.BirthModel(np.empty(0), np.empty((0, 4)), np.empty((0, 4, 4)), from_measurements=born)
    motion = models.constant_velocity(SPEED / 20.0, noise_model="continuous_white")
    targets = models.TargetModel(motion, models.constant_survival(0.999, period=1.0), birth)
    times = period * np.arange(NUM_SCANS)
    return Scene(targets, sensor, times, states, there, hidden, np.array(stds), prob_detection, clutter), rng


POSE = np.array([0.0, -1.2 * HALF, 0.0])


def tracked(given: Scene, rng: np.random.Generator) -> list[Estimate]:
    """The filter's estimates of all scans."""
    follow, estimates = FactoredGlmbFilter(given.targets, given.sensor), list[Estimate]()
    belief = follow.initial()
    for scan in range(NUM_SCANS):
        seen = given.there[:, scan] & ~given.hidden[:, scan] & (rng.random(len(given.states)) < given.prob_detection)
        exact = given.sensor.measurement.measure(given.states[seen, scan], POSE)
        clutter = np.zeros((rng.poisson(given.clutter), 4))
        clutter[:, :2] = rng.uniform(-HALF, HALF, (len(clutter), 2))
        false = given.sensor.measurement.measure(clutter, POSE)
        rows = np.concatenate([exact + rng.normal(0.0, given.stds, exact.shape), false])
        dt = given.times[scan] - given.times[scan - 1] if scan else 1.0
        belief, _ = follow.step(belief, rows, POSE, dt, scan + 1, rng=rng)
        estimates.append(best_estimate(belief, scan + 1))
    return estimates


def nearest(estimates: Sequence[Estimate], times: Floats) -> tuple[Join, ...]:
    """What one would do by hand: the nearest new label within the largest speed times the gap, nearest pairs first."""
    histories, pairs = track_histories(estimates, times), []
    for ended in histories:
        for began in histories:
            gap = began.times[0] - ended.times[-1]
            apart = float(np.hypot(*(began.means[0, :2] - ended.means[-1, :2])))
            if gap > 0.0 and apart <= SPEED * gap:
                pairs.append((apart, ended.label, began.label))
    joins, gone = list[Join](), set[Any]()
    for _, first, second in sorted(pairs):
        if (first, "ends") not in gone and (second, "begins") not in gone:
            gone |= {(first, "ends"), (second, "begins")}
            joins.append(Join(first, second, 1.0))
    return tuple(joins)


def truth_of(given: Scene) -> Truth:
    """The targets that are there, as measures take them."""
    there = given.there.T
    offsets = np.concatenate([[0], np.cumsum(there.sum(axis=1))])
    ids = np.concatenate([np.flatnonzero(row) for row in there])
    return Truth(given.times, offsets, ids, np.concatenate([given.states[row, k] for k, row in enumerate(there)]))


def outcome(given: Scene, estimates: Sequence[Estimate], joins: Sequence[Join], gap: int) -> tuple[bool, int, int]:
    """Whether the first target keeps its track over its gap; the number of wrong joins, and of all that count."""
    truth = truth_of(given)
    matching = match_run(truth, estimates, cutoff=CUTOFF, order=1.0)
    ids, labels = truth.ids[matching.truth_rows], list(map(tuple, matching.labels.tolist()))
    names, owners = track_names(joins), {}
    for history in track_histories(estimates, given.times):
        own = ids[[label == history.label for label in labels]].tolist()
        target, number = Counter(own).most_common(1)[0] if own else (None, 0)
        owners[history.label] = target if 2 * number >= len(history.steps) else None
    found = []
    for first, last in ((GAP_AT - BEFORE, GAP_AT), (GAP_AT + gap, GAP_AT + gap + AFTER)):
        own = (ids == 0) & (matching.scans >= first) & (matching.scans < last)
        tracks = [names.get(label, label) for label, mine in zip(labels, own, strict=True) if mine]
        found.append(tracks[-1] if tracks else None)
    pairs = [(owners[join.ended], owners[join.began]) for join in joins]
    counted = [first != second for first, second in pairs if first is not None or second is not None]
    return found[0] is not None and found[0] == found[1], sum(counted), len(counted)


def interval(count: int, num: int) -> str:
    """A share in percent with its 95 % interval (Wilson)."""
    if num == 0:
        return "none"
    z, p = 1.96, count / num
    middle, half = p + z * z / (2 * num), z * math.sqrt(p * (1 - p) / num + z * z / (4 * num * num))
    low, high = ((middle + sign * half) / (1 + z * z / num) for sign in (-1, 1))
    return f"{100 * p:.0f} ({100 * max(low, 0.0):.0f} to {100 * high:.0f})"


def compared(kind: str, gap: int, numbers: Sequence[int], hidden: float, threshold: float) -> str:
    """The row of a kind of gaps."""
    kept, wrong, joined = Counter[str](), Counter[str](), Counter[str]()
    for number in numbers:
        given, rng = scene(number, kind, gap)
        estimates = tracked(given, rng)
        poses, scanned = np.tile(POSE, (NUM_SCANS, 1, 1)), np.ones((NUM_SCANS, 1), np.bool_)
        observations = ObservationHistory(given.targets, (given.sensor,), given.times, poses, scanned, hidden)
        ways: dict[str, tuple[Join, ...]] = {
            "no": (),
            "nearest": nearest(estimates, given.times),
            "joined": find_joins(estimates, observations, threshold=threshold),
        }
        for name, joins in ways.items():
            keeps, errors, number_of_joins = outcome(given, estimates, joins, gap)
            kept[name] += keeps
            wrong[name] += errors
            joined[name] += number_of_joins
    num = len(numbers)
    cells = [interval(kept[name], num) for name in ("no", "nearest", "joined")]
    cells += [
        f"{wrong[name]} of {joined[name]}: {interval(wrong[name], joined[name])}" for name in ("nearest", "joined")
    ]
    return f"| {kind} | {gap} | {' | '.join(cells)} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--first", type=int, default=0, help="number of the first scene")
    parser.add_argument("--hidden", type=float, default=PROB_HIDDEN)
    parser.add_argument("--threshold", type=float, default=THRESHOLD)
    parser.add_argument("--kinds", nargs="*", default=KINDS)
    parser.add_argument("--write", type=Path, help="page with the two marks between which the table goes")
    given = parser.parse_args()
    lines = [
        "| targets, gap | scans | kept, no join, % | nearest | joined | wrong joins, nearest, % | joined |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    print("\n".join(lines))
    for kind in given.kinds:
        for gap in GAPS:
            numbers = range(given.first, given.first + given.runs)
            lines.append(compared(kind, gap, numbers, given.hidden, given.threshold))
            print(lines[-1], flush=True)
    if given.write is not None:
        write_between(given.write, "joined_tracks.py", "\n".join(lines))


if __name__ == "__main__":
    main()
