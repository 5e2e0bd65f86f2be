"""Targets that manoeuvre, stop and hide: one setting of modes for all scenes, against constant velocity.

    python benchmarks/modes.py                        # 20 scenes of each kind
    python benchmarks/modes.py --scenes 4 --kinds boats hidden
    python benchmarks/modes.py --tune                 # also 7 noises of constant velocity, and the best of them
    python benchmarks/modes.py --paper 60             # joint decisions on paper-a, whose targets turn

Every scene is drawn: three to six targets, their places, courses and manoeuvres, the probability of detection (.7 to
.98), clutter (2 to 20) and noise. `boats` turn 60 to 180 degrees at 5 to 15 degrees a second, `aircraft` at 2 to 4 g,
`ferries` stop and sail on, `straight` targets do neither, `hidden` ones pass behind walls for 10 to 40 scans. Births
may be anywhere in the region, so that filters know no target in advance. Prints mean OSPA (cutoff 10 times the noise)
in units of the noise, during manoeuvres and elsewhere, its ratio to that of the best constant velocity, and the time.
"""

from __future__ import annotations

import argparse
import json
import math
import re
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from vedette import models
from vedette.densities.estimates import Estimate, best_estimate
from vedette.evaluation.metrics.point_ospa import ospa, ospa_of_run
from vedette.filters import FactoredGlmbFilter, Limits
from vedette.kernels.base.types import Floats
from vedette.scenarios import Scenario, list_builtin, parse_scenario
from vedette.scenarios.build import build_experiment, build_planner
from vedette.simulation import simulate

STEPS, SEED = 100, 61


def modes_of(speed: float, *, hides: bool = False) -> models.Modes:
    """One setting for all kinds, in units of the scene: cruise, turns to both sides, changes of speed, and standing."""
    step = 0.01 * speed
    motions: list[models.MotionModel] = [
        models.constant_velocity(step),
        models.constant_turn(math.radians(9.0), 10.0 * step),
        models.constant_turn(math.radians(-9.0), 10.0 * step),
        models.constant_velocity(20.0 * step),
        models.ornstein_uhlenbeck(0.02 * speed, 3.0),
    ]
    names, stay, factors = ["cruise", "left", "right", "changes", "stands"], [40.0, 8.0, 8.0, 8.0, 40.0], [1.0] * 5
    if hides:
        motions, names, factors = [motions[0], motions[0]], ["seen", "hidden"], [1.0, 0.0]
        stay = [1000.0, 30.0]
    return models.Modes(motions, stay, names=names, detection_factors=factors)


@dataclass
class Scene:
    """Truth (num_scans, num_targets, 4), NaN before and after; what is seen; and what the filter knows."""

    states: Floats
    manoeuvring: Any  # (num_scans, num_targets)
    hidden: Any
    scans: list[Floats]
    region: models.Region
    noise: float
    speed: float
    prob_detection: float
    clutter: float


def _course(kind: str, rng: np.random.Generator, state: Floats, speed: float) -> tuple[Floats, Any]:
    """States of one target at all scans, and whether it manoeuvres."""
    states, busy = [state], [False]
    turn, rate, brake, left = 0.0, 0.0, 0.0, int(rng.integers(10, 40))
    fast = float(np.hypot(*state[2:]))
    for _ in range(STEPS - 1):
        px, py, vx, vy = states[-1]
        left -= 1
        if left <= 0 and kind in ("boats", "aircraft"):
            if turn == 0.0:
                rate = float(rng.uniform(5.0, 15.0)) * math.pi / 180.0
                if kind == "aircraft":
                    rate = float(rng.uniform(2.0, 4.0)) * 9.81 / fast
                angle = float(rng.uniform(60.0, 180.0)) * math.pi / 180.0
                turn, left = rate * float(rng.choice([-1.0, 1.0])), max(2, round(angle / rate))
            else:
                turn, left = 0.0, int(rng.integers(10, 40))
        now = float(np.hypot(vx, vy))
        if left <= 0 and kind == "ferries":
            brake, left = (-fast / 8.0, 8) if now > 0.5 * fast else (fast / 8.0, 8)
            if states[-1][2] == 0.0 and brake < 0.0:
                brake = fast / 8.0
        elif kind == "ferries" and brake and left == 1:
            brake, left = 0.0, int(rng.integers(15, 40))
        heading = math.atan2(vy, vx) if now > 1e-6 else math.atan2(*state[2:][::-1])
        heading += turn
        now = min(max(now + brake, 1e-7), fast)
        vx, vy = now * math.cos(heading), now * math.sin(heading)
        states.append(np.array([px + vx, py + vy, vx, vy]))
        busy.append(turn != 0.0 or brake != 0.0)
    return np.array(states), np.array(busy)


def scene(kind: str, number: int) -> Scene:
    """A scene of a kind, the same for a number."""
    rng = np.random.default_rng([SEED, sum(map(ord, kind)), number])
    speed = 220.0 if kind == "aircraft" else float(rng.uniform(6.0, 14.0))
    noise = speed * float(rng.uniform(0.2, 0.8))
    half, num = 60.0 * speed, int(rng.integers(3, 7))
    states, busy = [], []
    for _ in range(num):
        place, heading = rng.uniform(-0.6 * half, 0.6 * half, 2), rng.uniform(-math.pi, math.pi)
        own = speed * float(rng.uniform(0.7, 1.2))
        begin = np.array([*place, own * math.cos(heading), own * math.sin(heading)])
        course, flags = _course(kind, rng, begin, speed)
        states.append(course)
        busy.append(flags)
    truth, flags = np.array(states).transpose(1, 0, 2), np.array(busy).T
    inside = (np.abs(truth[:, :, :2]) < half).all(axis=2)
    truth[np.cumsum(~inside, axis=0) > 0] = np.nan  # who leaves does not come back
    hidden = np.zeros(flags.shape, bool)
    if kind == "hidden":
        for target in range(0, num, 2):
            begin = int(rng.integers(25, 50))
            hidden[begin : begin + int(rng.integers(10, 41)), target] = True
    chance, clutter = float(rng.uniform(0.7, 0.98)), float(rng.uniform(2.0, 20.0))
    scans = []
    for step in range(STEPS):
        there = np.isfinite(truth[step, :, 0]) & ~hidden[step] & (rng.random(num) < chance)
        seen = truth[step, there, :2] + noise * rng.standard_normal((there.sum(), 2))
        false = rng.uniform(-half, half, (rng.poisson(clutter), 2))
        scans.append(rng.permutation(np.concatenate([seen, false])))
    region = models.Region(-half, half, -half, half)
    return Scene(truth, flags, hidden, scans, region, noise, speed, chance, clutter)


def targets_of(scene: Scene, motion: models.MotionModel) -> models.TargetModel:
    """Targets that may appear anywhere."""
    std = np.array([2.0 * scene.noise] * 2 + [scene.speed] * 2)
    measured = models.MeasurementBirth(0.02, 0.05, std, scene.region)
    birth = models.BirthModel(np.empty(0), np.empty((0, 4)), np.empty((0, 4, 4)), from_measurements=measured)
    return models.TargetModel(motion, models.constant_survival(0.995), birth)


def tracked(scene: Scene, motion: models.MotionModel) -> tuple[list[Estimate], float]:
    """The estimates of the default filter, and its CPU seconds."""
    sensor = models.SensorModel(
        models.position(),
        models.constant_noise([scene.noise] * 2),
        models.constant_detection(scene.prob_detection),
        models.region_clutter(scene.clutter, scene.region, "position"),
    )
    tracker = FactoredGlmbFilter(targets_of(scene, motion), sensor, Limits())
    belief, rng, found = tracker.initial(), np.random.default_rng(0), []
    begin = time.process_time()
    for step, scan in enumerate(scene.scans, 1):
        belief, _ = tracker.step(belief, scan, np.zeros(3), 1.0, step, rng=rng)
        found.append(best_estimate(belief, step))
    return found, time.process_time() - begin


CUTOFF = 10.0  # times the noise
KINDS = ("boats", "aircraft", "ferries", "straight", "hidden")
NOISES = (0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 0.8)  # standard deviations of an acceleration, per second of the speed


def errors(scene: Scene, found: list[Estimate]) -> tuple[float, float, float]:
    """Mean OSPA over all scans, during manoeuvres and outside of them, in units of the noise."""
    of_scan, busy = [], []
    for step, estimate in enumerate(found):
        there = np.isfinite(scene.states[step, :, 0])
        result = ospa(estimate.means[:, :2], scene.states[step, there, :2], cutoff=CUTOFF * scene.noise, order=1.0)
        of_scan.append(result.total / scene.noise)
        busy.append(bool(scene.manoeuvring[step, there].any()))
    values, flags = np.array(of_scan), np.array(busy)
    return tuple(float(values[mask].mean()) if mask.any() else math.nan for mask in (flags | True, flags, ~flags))


def labels_back(scene: Scene, found: list[Estimate]) -> tuple[int, int]:
    """Return how many targets that come from behind a wall have their label again within 5 scans, and how many came."""
    back = came = 0
    for target in range(scene.states.shape[1]):
        behind = np.flatnonzero(scene.hidden[:, target])
        if not len(behind) or behind[-1] + 5 >= STEPS or not np.isfinite(scene.states[behind[-1] + 5, target, 0]):
            continue
        before = _labels_at(scene, found[behind[0] - 1], behind[0] - 1, target)
        if before:
            came += 1
            back += bool(before & _labels_at(scene, found[behind[-1] + 5], behind[-1] + 5, target))
    return back, came


def _labels_at(scene: Scene, estimate: Estimate, step: int, target: int) -> set[tuple[int, ...]]:
    near = np.linalg.norm(estimate.means[:, :2] - scene.states[step, target, :2], axis=1) < 5.0 * scene.noise
    return {tuple(label) for label in estimate.labels[near].tolist()}


def settings_of(scene: Scene, kind: str, tune: bool) -> dict[str, models.MotionModel]:
    """The motions that are compared: constant velocity at the noise that suits turns and straight lines, and modes."""
    noises = NOISES if tune else (0.02, 0.1)
    velocity = {f"constant velocity {own:g}": models.constant_velocity(own * scene.speed) for own in noises}
    return {**velocity, "modes": modes_of(scene.speed, hides=kind == "hidden")}


PAPER = """motion:
  kind: modes
  modes:
    cruise: {motion: {kind: constant_velocity, sigma_v: 0.5}, stay_s: 20.0}
    left: {motion: {kind: constant_turn, turn_rate_deg: 15.0, sigma_v: 1.0}, stay_s: 8.0, to: {cruise: 1.0}}
    right: {motion: {kind: constant_turn, turn_rate_deg: -15.0, sigma_v: 1.0}, stay_s: 8.0, to: {cruise: 1.0}}
"""


def paper(num_runs: int) -> None:
    """Compare joint decisions on paper-a, whose targets turn: filters with modes and with constant velocities."""
    text, motions = list_builtin()["paper-a"].read_text("utf-8"), {"modes": PAPER}
    text = re.sub(r"(- \{state: \[[^\]]*\])\}", r"\1, process_noise: true}", text)
    for noise in (1.0, 2.0, 5.0):
        motions[f"constant velocity {noise:g}"] = f"motion: {{kind: constant_velocity, sigma_v: {noise}}}\n"
    scenarios = {
        name: Scenario(parse_scenario(re.sub(r"motion:\n(?:  .*\n)+", lambda _, own=own: own, text, count=1)))
        for name, own in motions.items()
    }
    experiments, errors = {name: build_experiment(own) for name, own in scenarios.items()}, dict[str, list[float]]()
    for run in range(num_runs):
        for name, own in experiments.items():
            planner, alike = (
                build_planner(scenarios[name], "jdm", 1),
                replace(own, targets=experiments["modes"].targets),
            )
            record = simulate(alike, planner, seed=SEED, run=run, score=None)
            series = ospa_of_run(record.truth, record.estimates, cutoff=100.0, order=1.0)
            errors.setdefault(name, []).append(float(np.mean(series[10:])))
    print(f"\npaper-a with targets that turn, joint decisions, {num_runs} paired runs: mean OSPA from scan 11 on, m")
    for name, values in errors.items():
        apart = np.array(values) - errors["modes"]
        error = apart.std(ddof=1) / math.sqrt(num_runs)
        print(f"  {name:24} {np.mean(values):6.2f}  difference to modes {apart.mean():+.2f} +- {error:.2f}")


def _mean(values: Floats) -> float:
    return float(np.nanmean(values)) if np.isfinite(values).any() else math.nan


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=20)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS)
    parser.add_argument("--tune", action="store_true")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--paper", type=int, metavar="RUNS")
    options = parser.parse_args()
    if options.paper:
        paper(options.paper)
        return
    for kind in options.kinds:
        rows: dict[str, list[Any]] = {}
        for number in range(options.first, options.first + options.scenes):
            own = scene(kind, number)
            for setting, motion in settings_of(own, kind, options.tune).items():
                found, seconds = tracked(own, motion)
                rows.setdefault(setting, []).append([*errors(own, found), seconds, *labels_back(own, found)])
        show(kind, {setting: np.array(values) for setting, values in rows.items()})
        if options.out:
            with options.out.open("a") as file:
                file.write(json.dumps({"kind": kind, "rows": rows}) + "\n")


def show(kind: str, rows: dict[str, Any]) -> None:
    """Print a table of one kind of scene."""
    print(f"\n{kind}, {len(next(iter(rows.values())))} scenes")
    best = min((setting for setting in rows if setting != "modes"), key=lambda setting: rows[setting][:, 0].mean())
    for setting, values in rows.items():
        ratio = values[:, 0] / rows[best][:, 0]
        spread = ratio.std(ddof=1) / math.sqrt(len(ratio)) if len(ratio) > 1 else math.nan
        whole, busy, quiet, seconds = (_mean(values[:, column]) for column in range(4))
        back = f", labels back {values[:, 4].sum():.0f} of {values[:, 5].sum():.0f}" if kind == "hidden" else ""
        times = seconds / rows[best][:, 3].mean()
        print(
            f"  {setting:24} {whole:5.2f}  in manoeuvres {busy:5.2f}, else {quiet:5.2f}  "
            f"ratio {ratio.mean():.3f} +- {spread:.3f}  CPU x {times:.2f}{back}"
        )


if __name__ == "__main__":
    main()
