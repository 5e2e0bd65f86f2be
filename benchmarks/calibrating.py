"""How well recordings alone say what their sensors are like.

    python benchmarks/calibrating.py [--scene ships|aircraft] [--redraws N] [--seconds S] [--assumed-motion]
    python benchmarks/calibrating.py --position
    python benchmarks/calibrating.py --write docs/evidence/calibration.md

Three radars of 5, 8 and 11 s, one of them on a boat, see six ships or aircraft for ten minutes; they have biases of up
to 300 m, 2 degrees and 0.5 s, none of which anybody knows, and noise and clutter are told wrongly. Each redraw is a
recording of its own: other targets, noise, clutter. It is calibrated, and tracked with the estimates, with
the truth, and with the given parameters. Prints for each parameter the truth, the mean and spread of the estimates, the
greatest error, and how many of the intervals of 95 % cover the truth; then OSPA. With --position two radars are not
where they are said to be, either, and the first, with which they are compared, is not turned. Equal arguments print
equal tables, but for the times.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import math
import tempfile
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from pages import write_between

from vedette.calibration import Calibration, calibrate
from vedette.evaluation.runs import run_scenario
from vedette.scenarios.calibration import build_problem, calibrated_text
from vedette.scenarios.from_recording import scenario_from_recording

RADARS = {"Calshot": ((-3000.0, -3000.0), 5.0), "Ryde": ((3500.0, -2500.0), 8.0), "boat": ((0.0, 3500.0), 11.0)}
BIASES = {
    "Calshot": {"range": 300.0, "bearing_deg": -1.0},
    "Ryde": {"range": -150.0, "bearing_deg": 2.0, "clock": 0.5},
    "boat": {"range": 100.0, "bearing_deg": -1.5, "clock": -0.5},
}
PLACED = {
    "Calshot": {"range": 300.0},
    "Ryde": {**BIASES["Ryde"], "x": 200.0, "y": -120.0},
    "boat": {**BIASES["boat"], "x": -80.0, "y": 150.0},
}
MODELS = {
    "noise.sigma_range": 20.0,
    "noise.sigma_bearing_deg": math.degrees(0.012),
    "detection.probability": 0.9,
    "clutter.rate": 4.0,
}
TOLD = """recording: {bearings: north}
%sospa: {cutoff: %s}
sensor_defaults:
  measurement: {kind: bearing_range}
  noise: {kind: range_dependent, sigma_range: %s, eta_range: 0.0, sigma_bearing_deg: %s, eta_bearing: 0.0}
  detection: {kind: constant, probability: %s}
  clutter: {kind: region, rate: %s}
sensors:
  - {name: Calshot, position: [-3000.0, -3000.0], bias: {%s}}
  - {name: Ryde, position: [3500.0, -2500.0], bias: {%s}}
  - {name: boat, position: [0.0, 3500.0], bias: {%s}}
"""
TARGETS = 6
ByRadar: TypeAlias = Mapping[str, Mapping[str, float]]
Ships: TypeAlias = list[tuple[Any, Any]]


class Scene(NamedTuple):
    """m/s of targets along each axis at most; m of where they are half way, and of clutter; m of OSPA's cutoff."""

    speed: float
    within: float
    half_side: float
    cutoff: float


SCENES = {"ships": Scene(8.0, 4000.0, 7000.0, 200.0), "aircraft": Scene(80.0, 8000.0, 32000.0, 1000.0)}
MOTION = "motion: {kind: constant_velocity, sigma_v: 0.05}\n"


def write_scans(
    folder: Path,
    scene: Scene,
    seconds: float,
    seed: int,
    motion: str = MOTION,
    biases: ByRadar = BIASES,
    drifts: ByRadar | None = None,
) -> Ships:
    """scans.csv, truth.csv, and what is told and what is true of the sensors: told.yaml, true.yaml.

    drifts: of a radar's biases, a second. Returns the ships' positions at 0 s and their velocities.
    """
    rng, within, speed = np.random.default_rng(seed), scene.within, scene.speed
    middles = [(rng.uniform(-within, within, 2), rng.uniform(-speed, speed, 2)) for _ in range(TARGETS)]
    ships = [(x - 0.5 * seconds * v, v) for x, v in middles]
    rows, half_side = list[list[Any]](), scene.half_side
    for name, (place, period) in RADARS.items():
        at_first, drift = biases[name], (drifts or {}).get(name, {})
        for at in np.arange(rng.uniform(0.0, period), seconds, period).tolist():
            bias = {key: value + at * drift.get(key, 0.0) for key, value in at_first.items()}
            own = np.array(place) + (np.array([4.0, -3.0]) * at if name == "boat" else 0.0)
            said = own + np.array([bias.get("x", 0.0), bias.get("y", 0.0)])
            offsets = [x + v * at - own for x, v in ships if rng.random() < MODELS["detection.probability"]]
            false = [rng.uniform(-half_side, half_side, 2) - own for _ in range(rng.poisson(MODELS["clutter.rate"]))]
            stds = [MODELS["noise.sigma_range"], math.radians(MODELS["noise.sigma_bearing_deg"])]
            for i, (dx, dy) in enumerate([*offsets, *false]):
                noise = rng.normal(0.0, stds) if i < len(offsets) else np.zeros(2)
                distance = max(math.hypot(dx, dy) + noise[0] + bias["range"], 0.0)
                angle = math.degrees(math.atan2(dx, dy) + noise[1]) + bias.get("bearing_deg", 0.0)
                rows.append([at + bias.get("clock", 0.0), name, distance, angle % 360.0, *said])
            if not offsets and not false:
                rows.append([at + bias.get("clock", 0.0), name, "", "", *said])
    rows.sort(key=lambda row: row[0])
    header = ["time", "sensor", "range_m", "bearing_deg", "own_x", "own_y"]
    _write(folder / "scans.csv", header, rows)
    told = [[t, f"ship {i}", *(x + v * t)] for i, (x, v) in enumerate(ships) for t in np.arange(0.0, seconds + 20, 10)]
    _write(folder / "truth.csv", ["time", "id", "x", "y"], told)
    (folder / "told.yaml").write_text(TOLD % (motion, scene.cutoff, 30.0, 1.0, 0.8, 6.0, "", "", ""))
    true = [", ".join(f"{name}: {value}" for name, value in one.items()) for one in biases.values()]
    (folder / "true.yaml").write_text(TOLD % (motion, scene.cutoff, *MODELS.values(), *true))
    return ships


def _write(path: Path, header: list[str], rows: list[list[Any]]) -> None:
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([header, *rows])


class Redraw(NamedTuple):
    """A calibration; mean OSPA, m, with it, the truth and the given parameters; CPU s and passes of the filter."""

    calibration: Calibration
    ospa: tuple[float, float, float]
    seconds: float
    passes: int


def redraw(
    folder: Path, scene: Scene, seconds: float, seed: int, motion: str = MOTION, position: bool = False
) -> Redraw:
    """One recording, calibrated and tracked."""
    write_scans(folder, scene, seconds, seed, motion, PLACED if position else BIASES)
    scans = folder / "scans.csv"
    begun, passes = time.process_time(), [0]
    scenario = scenario_from_recording(folder / "told.yaml", scans, speed=scene.speed).scenario

    def progress() -> None:
        passes[0] += 1

    calibration = calibrate(build_problem(scenario, position=position, prior_scale=10.0), progress)
    spent = time.process_time() - begun
    text = calibrated_text(scenario, folder / "told.yaml", calibration, folder)
    (folder / "found.yaml").write_text(text, "utf-8")
    scores = []
    for name in ("found", "true", "told"):
        at = folder / f"{name}.yaml"
        tracked = scenario_from_recording(at, scans, folder / "truth.csv", speed=scene.speed).scenario
        scores.append(float(np.nanmean(run_scenario(tracked, "stationary", seed=0).ospa[:, 0])))
    return Redraw(calibration, (scores[0], scores[1], scores[2]), spent, passes[0])


def table(redraws: list[Redraw], biases: ByRadar = BIASES) -> Iterator[str]:
    """The lines of the tables."""
    yield "| parameter | truth | mean estimate | root mean square error | interval std | largest error | covered |"
    yield "| --- | ---: | ---: | ---: | ---: | ---: | ---: |"
    total, by_redraw = [0, 0], np.zeros((2, len(redraws)))
    for i, first in enumerate(redraws[0].calibration.estimates):
        radar, name = list(RADARS)[first.parameter.sensor], first.parameter.name
        truth = biases[radar].get(name, 0.0) if first.parameter.kind == "bias" else MODELS[name]
        all_found = [each.calibration.estimates[i] for each in redraws]
        found = [each for each in all_found if not each.reason]
        values = np.array([each.value for each in found])
        said = np.mean([(each.ci_high - each.ci_low) / 3.92 for each in found])
        covered = sum(each.ci_low <= truth <= each.ci_high for each in found)
        by_redraw[0] += [each.ci_low <= truth <= each.ci_high for each in all_found]
        by_redraw[1] += [not each.reason for each in all_found]
        total = [total[0] + covered, total[1] + len(found)]
        rms, most = math.sqrt(np.mean((values - truth) ** 2)), np.abs(values - truth).max()
        cells = [f"{radar}, {name}", f"{truth:.3g}", f"{values.mean():.4g}", f"{rms:.2g}", f"{said:.2g}", f"{most:.2g}"]
        yield "| " + " | ".join([*cells, f"{covered} of {len(all_found)}"]) + " |"
    yield ""
    scores = np.array([each.ospa for each in redraws])
    found, true, told = scores.mean(axis=0)
    share = scores[:, 0] / scores[:, 1] - 1.0
    error = 1.96 * np.std(by_redraw[0] / by_redraw[1], ddof=1) / math.sqrt(len(redraws))
    covered = f"{total[0]} of {total[1]}, {total[0] / total[1]:.1%} ± {error:.1%}"
    yield f"Intervals that cover the truth: {covered} (1.96 standard errors between recordings)."
    yield f"OSPA, m: {found:.2f} with the estimates, {true:.2f} with the truth, {told:.2f} with the given parameters;"
    yield f"with the estimates {share.mean():+.1%} against the truth, {share.min():+.1%} to {share.max():+.1%}."
    seconds, passes = np.mean([(each.seconds, each.passes) for each in redraws], axis=0)
    yield f"CPU time: {seconds:.0f} s per recording, {passes:.0f} passes of the filter."


def main() -> None:
    """Read the arguments and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", choices=SCENES, default="ships")
    parser.add_argument("--redraws", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--assumed-motion", action="store_true", help="let the motion be taken from the speed")
    parser.add_argument("--position", action="store_true", help="radars are not where they are said to be")
    parser.add_argument("--seed", type=int, default=0, help="of the first redraw")
    parser.add_argument("--write", type=Path)
    given = parser.parse_args()
    redraws, motion = list[Redraw](), "" if given.assumed_motion else MOTION
    with tempfile.TemporaryDirectory() as folder, contextlib.suppress(KeyboardInterrupt):
        for number in range(given.seed, given.seed + given.redraws):
            one = redraw(Path(folder), SCENES[given.scene], given.seconds, number, motion, given.position)
            redraws.append(one)
    what = f"{len(redraws)} recordings of {given.seconds:g} s of {given.scene}."
    lines = [*table(redraws, PLACED if given.position else BIASES), "", what]
    print("\n".join(lines))
    if given.write is not None:
        script = f"calibrating.py --scene {given.scene}{' --position' if given.position else ''}"
        write_between(given.write, script, "\n".join(lines))


if __name__ == "__main__":
    main()
