"""How well a calibration finds the biases of radars that measure slant ranges, elevations or altitudes.

    python benchmarks/calibrating_heights.py [--runs N] [--first SEED]
    python benchmarks/calibrating_heights.py --write docs/evidence/calibration.md

Two radars 20 km apart, or one, scan five aircraft of 120 to 240 m/s at 3 to 9 km every 4 s for 90 s. The
aircraft move with the process noise that the calibration assumes. The radars have biases in each measured quantity;
noise, detection and clutter are given wrongly. Each run is another recording. Prints for each parameter how many are
reported, their root mean square error, the mean standard deviation of the intervals, and how many intervals cover the
truth (noise in rad and m). Equal arguments print equal tables.
"""

from __future__ import annotations

import math
import tempfile
from pathlib import Path

import numpy as np
from heights import COLUMNS, KINDS, RADARS, STDS, measured
from pages import table_of_scenes

from vedette.calibration import Calibration, calibrate
from vedette.kernels.base.types import Floats
from vedette.scenarios.calibration import build_problem
from vedette.scenarios.from_recording import scenario_from_recording

SECONDS, PERIOD, STEP = 90.0, 4.0, 0.5  # s
SIGMA_V, SIGMA_CLIMB = 1.0, 0.3  # m/s^1.5
DETECTED, FALSE, HALF_SIDE, HIGHEST = 0.9, 2.0, 40e3, 12e3  # -, per scan, m, m
BIASES = {
    "R": {"bearing": 0.006, "range": 120.0, "elevation": 0.008, "altitude": 90.0},
    "S": {"bearing": -0.01, "range": -80.0, "elevation": -0.005, "altitude": -60.0},
}
SCENES = (*((kind, 2) for kind in KINDS if kind != "bearing_range"), ("bearing_range_elevation", 1))
_GIVEN = {"bearing": 1.3, "range": 1.3, "elevation": 0.75, "altitude": 0.75}  # noise over the true one


def aircraft(rng: np.random.Generator, num: int = 5) -> Floats:
    """(num_steps, num, 3) positions once in `STEP`, m."""
    way, speed = rng.uniform(-math.pi, math.pi, num), rng.uniform(120.0, 240.0, num)
    starts = np.column_stack([rng.uniform(-20e3, 20e3, (num, 2)), rng.uniform(3e3, 9e3, num)])
    velocities = np.column_stack([speed * np.cos(way), speed * np.sin(way), rng.uniform(-8.0, 8.0, num)])
    kicks = rng.normal(size=(round(SECONDS / STEP) + 1, num, 3)) * [SIGMA_V, SIGMA_V, SIGMA_CLIMB] * math.sqrt(STEP)
    return np.asarray(starts + STEP * np.cumsum(velocities + np.cumsum(kicks, axis=0), axis=0))


def write(folder: Path, rng: np.random.Generator, kind: str, num_radars: int) -> None:
    """A recording and its sensors file."""
    names, radars, places = KINDS[kind], dict(list(RADARS.items())[:num_radars]), aircraft(rng)
    lines = [f"time,sensor,{','.join(COLUMNS[name] for name in names)}"]
    for k, (name, radar) in enumerate(radars.items()):
        bias, stds = [BIASES[name][each] for each in names], [STDS[each] for each in names]
        for time in np.arange(STEP * (1 + k), SECONDS, PERIOD).tolist():
            now = places[round(time / STEP)]
            true = measured(now[rng.uniform(size=len(now)) < DETECTED] - radar, radar[2], kind)
            spots = rng.uniform([-HALF_SIDE, -HALF_SIDE, 0.0], [HALF_SIDE, HALF_SIDE, HIGHEST], (rng.poisson(FALSE), 3))
            rows = np.concatenate(
                [true + rng.normal(0.0, stds, true.shape) + bias, measured(spots - radar, radar[2], kind)]
            )
            lines += [f"{time},{name},{','.join(map(str, row))}" for row in rows.tolist() or [[""] * len(names)]]
    (folder / "scans.csv").write_text("\n".join(lines), "utf-8")
    sensors = "".join(
        f"  - {{name: {name}, position: [{x}, {y}], height: {z}}}\n" for name, (x, y, z) in radars.items()
    )
    (folder / "radars.yaml").write_text(
        f"recording: {{bearings: east, turns: none}}\n"
        f"region: {{x_min: {-HALF_SIDE}, x_max: {HALF_SIDE}, y_min: {-HALF_SIDE}, y_max: {HALF_SIDE}}}\n"
        f"motion: {{kind: constant_velocity_height, sigma_v: {SIGMA_V}, sigma_climb: {SIGMA_CLIMB}}}\n"
        f"sensor_defaults:\n  measurement: {{kind: {kind}}}\n"
        f"  noise: {{kind: constant, std: {[_GIVEN[name] * STDS[name] for name in names]}}}\n"
        f"  detection: {{kind: constant, probability: 0.8}}\n  clutter: {{kind: region, rate: 3.0}}\n"
        f"sensors:\n{sensors}",
        "utf-8",
    )


def calibrated(seed: int, kind: str, num_radars: int) -> Calibration:
    """One recording, calibrated."""
    with tempfile.TemporaryDirectory() as place:
        write(Path(place), np.random.default_rng([seed, SCENES.index((kind, num_radars))]), kind, num_radars)
        scenario = scenario_from_recording(Path(place) / "radars.yaml", Path(place) / "scans.csv", speed=250.0)
        return calibrate(build_problem(scenario.scenario, prior_scale=10.0))


def truth_of(kind: str, name: str, sensor: int) -> float:
    """Of a parameter, in its unit."""
    if name.startswith("noise.std."):
        return STDS[KINDS[kind][int(name.rpartition(".")[2])]]
    named = {"detection.probability": DETECTED, "clutter.rate": FALSE, "clock": 0.0}
    if name in named:
        return named[name]
    quantity = name.removesuffix("_deg")
    value = BIASES[list(RADARS)[sensor]][quantity]
    return math.degrees(value) if name.endswith("_deg") else value


def rows(kind: str, num_radars: int, all_found: list[Calibration]) -> list[str]:
    """Rows of the table: each parameter, of all radars together, and all."""
    total, lines = np.zeros(2, np.int64), list[str]()
    label = f"`{kind}`, {'two radars' if num_radars == 2 else 'one radar'}"
    estimates = [each for found in all_found for each in found.estimates]
    for name in dict.fromkeys(each.parameter.name for each in estimates):
        asked = [each for each in estimates if each.parameter.name == name]
        found = [each for each in asked if not math.isnan(each.ci_low)]
        errors = [each.value - truth_of(kind, name, each.parameter.sensor) for each in found]
        covers = sum(
            each.ci_low <= each.value - error <= each.ci_high for each, error in zip(found, errors, strict=True)
        )
        total += covers, len(found)
        cells = [label, name, f"{len(found)} of {len(asked)}", "-", "-", "-"]
        if found:
            std = np.mean([(each.ci_high - each.ci_low) / 3.92 for each in found])
            cells[3:] = f"{np.sqrt(np.mean(np.square(errors))):.2g}", f"{std:.2g}", f"{covers} of {len(found)}"
        lines.append(f"| {' | '.join(cells)} |")
    converged = sum(found.converged for found in all_found)
    return [*lines, f"| {label} | all, {converged} of {len(all_found)} converged | | | | {total[0]} of {total[1]} |"]


def table(runs: int, first: int) -> str:
    """The table, of that many recordings a scene from that seed on."""
    text = ["| scene | parameter | reported | root mean square error | interval std | covered |"]
    text += ["| --- | --- | ---: | ---: | ---: | ---: |"]
    for scene in SCENES:
        text += rows(*scene, [calibrated(seed, *scene) for seed in range(first, first + runs)])
    return "\n".join([*text, f"\n{runs} recordings of {SECONDS:.0f} s of each."])


if __name__ == "__main__":
    table_of_scenes(__doc__, "calibrating_heights.py", table)
