"""Advice on the motion: how often the fit advises modes where targets manoeuvre, and where they do not.

    python benchmarks/stiff_motion.py --first 1000 --scenes 20      # modes are advised in this number of scenes
    python benchmarks/stiff_motion.py --kinds boats --first 0 --scenes 5 --show
    python benchmarks/stiff_motion.py --ferry DATASET  # findings of the recordings of calibrating_recordings.py

A scene is three to six targets for 150 s. Drawn over decades are: noise (.05 to .5 of the way in a second), the assumed
process noise of constant velocity (.005 to .05 of the speed per square root of a second), and clutter (.3 to 20). Also
drawn are the scan period (.5 to 2 s), the probability of detection (.7 to .98), and one or two sensors, of bearings and
ranges or of positions. `boats` turn by 60 to 150 degrees at 8 to 15 degrees a second, `aircraft` at 2.5 to 3.5 g,
`ferries` stop within 8 s. `straight` targets have the process noise that is assumed. The other kinds are straight
targets with one fault: another process noise (four times or a quarter), another noise of all sensors (twice or half), a
bias of the first sensor of three standard deviations. `--modes` gives the filter the modes of docs/manoeuvres.md.
"""

from __future__ import annotations

import argparse
import csv
import math
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml
from calibrating_recordings import radar_scans, write_files
from scenes import decades

from vedette.evaluation.fit import Fit, fit_of_run
from vedette.evaluation.runs import track_recording
from vedette.internal.unit_warnings import suppress_unit_warnings
from vedette.kernels.base.types import Floats
from vedette.scenarios.from_recording import RecordingScenario, scenario_from_recording

STREAM, DURATION, STEP = 6101, 150.0, 0.1  # s; s between points of a course
MANOEUVRING = ("boats", "aircraft", "ferries")
FAULTS = ("process noise x 4", "process noise / 4", "noise x 2", "noise / 2", "bias")
KINDS = (*MANOEUVRING, "straight", *FAULTS)


class Scene(NamedTuple):
    """Courses (num_targets, num_points, 2), the rows of the scans, the sensors file, and the speed of targets, m/s."""

    courses: Floats
    rows: list[dict[str, Any]]
    sensors: dict[str, Any]
    speed: float
    noise: float


def course(kind: str, rng: np.random.Generator, begin: Floats, sigma_v: float) -> Floats:
    """Return the places of a target at all points of time. sigma_v: process noise of the straight ones, m/s^1.5."""
    num = round(DURATION / STEP)
    if kind not in MANOEUVRING:
        moves = rng.normal(0.0, sigma_v * math.sqrt(STEP), (num, 2)).cumsum(axis=0) + begin[2:]
        return np.asarray(begin[:2] + np.cumsum(moves * STEP, axis=0))
    fast, heading = float(np.hypot(*begin[2:])), math.atan2(begin[3], begin[2])
    rates, speeds, at = np.zeros(num), np.full(num, fast), round(rng.uniform(15.0, 40.0) / STEP)
    while at < num:
        if kind == "ferries":
            brake, stand = round(8.0 / STEP), round(rng.uniform(15.0, 40.0) / STEP)
            ramp = np.linspace(1.0, 0.0, brake)
            profile = np.concatenate([ramp, np.zeros(stand), ramp[::-1]])
            speeds[at : at + len(profile)] = fast * profile[: num - at]
            at += len(profile)
        else:
            rate = math.radians(rng.uniform(8.0, 15.0)) if kind == "boats" else rng.uniform(2.5, 3.5) * 9.81 / fast
            points = round(math.radians(rng.uniform(60.0, 150.0)) / rate / STEP)
            rates[at : at + points] = rate * rng.choice([-1.0, 1.0])
            at += points
        at += round(rng.uniform(15.0, 40.0) / STEP)
    headings = heading + np.cumsum(rates) * STEP
    moves = speeds[:, None] * np.column_stack([np.cos(headings), np.sin(headings)])
    return np.asarray(begin[:2] + np.cumsum(moves * STEP, axis=0))


def scene(kind: str, number: int, *, modes: bool = False) -> Scene:
    """Return a scene of a kind, the same for a number."""
    rng = np.random.default_rng([STREAM, number])
    speed = 220.0 if kind == "aircraft" else decades(rng, 1.0, 30.0)
    noise, sigma_v = speed * decades(rng, 0.05, 0.5), speed * decades(rng, 0.005, 0.05)
    period, clutter, detection = decades(rng, 0.5, 2.0), decades(rng, 0.3, 20.0), float(rng.uniform(0.7, 0.98))
    num_sensors = 2 if kind == "bias" else int(rng.integers(1, 3))
    polar, half = bool(rng.integers(2)) or kind == "bias", 90.0 * speed
    true_sigma = sigma_v * {"process noise x 4": 4.0, "process noise / 4": 0.25}.get(kind, 1.0)
    factor = {"noise x 2": 2.0, "noise / 2": 0.5}.get(kind, 1.0)
    courses = []
    for _ in range(int(rng.integers(3, 7))):
        place, heading = rng.uniform(-0.7 * half, 0.7 * half, 2), rng.uniform(-math.pi, math.pi)
        own = speed * rng.uniform(0.7, 1.2)
        begin = np.array([*place, own * math.cos(heading), own * math.sin(heading)])
        courses.append(course(kind, rng, begin, true_sigma))
    truth, bearing, rows = np.array(courses), noise / half, list[dict[str, Any]]()
    bounds = {"x_min": -half, "x_max": half, "y_min": -half, "y_max": half}
    places = rng.uniform(-half, half, (num_sensors, 2))
    sections = [_section(s, place, polar, noise, bearing, detection, clutter) for s, place in enumerate(places)]
    for s, place in enumerate(places):
        offset = 3.0 * bearing if kind == "bias" and s == 0 else 0.0
        for time in np.arange(rng.uniform(0.0, period), DURATION, period):
            now = truth[:, min(int(time / STEP), truth.shape[1] - 1)]
            now = now[(np.abs(now) < half).all(axis=1) & (rng.random(len(now)) < detection)]
            false = rng.uniform(-half, half, (rng.poisson(clutter), 2))
            stds = factor * np.array([noise, bearing])
            rows += _rows(rng, s, float(time), place, polar, now, false, stds, offset)
    rows.sort(key=lambda row: row["time"])
    motion: dict[str, Any] = {"kind": "constant_velocity", "sigma_v": sigma_v, "noise_model": "continuous_white"}
    if modes:
        motion = modes_section(speed)
    return Scene(truth, rows, {"region": bounds, "motion": motion, "sensors": sections}, speed, noise)


def modes_section(speed: float) -> dict[str, Any]:
    """Return the modes of docs/manoeuvres.md as a section, for a speed."""
    motions = {
        "cruise": ({"kind": "constant_velocity", "sigma_v": 0.01 * speed}, 40.0),
        "left": ({"kind": "constant_turn", "turn_rate_deg": 9.0, "sigma_v": 0.1 * speed}, 8.0),
        "right": ({"kind": "constant_turn", "turn_rate_deg": -9.0, "sigma_v": 0.1 * speed}, 8.0),
        "changes": ({"kind": "constant_velocity", "sigma_v": 0.2 * speed}, 8.0),
        "stands": ({"kind": "ornstein_uhlenbeck", "speed": 0.02 * speed, "time_constant": 3.0}, 40.0),
    }
    return {"kind": "modes", "modes": {name: {"motion": own, "stay_s": stay} for name, (own, stay) in motions.items()}}


def _section(
    s: int, place: Floats, polar: bool, noise: float, bearing: float, detection: float, clutter: float
) -> dict[str, Any]:
    own: dict[str, Any] = {"kind": "constant", "std": [noise] * 2}
    if polar:
        stds = {"sigma_range": noise, "sigma_bearing_deg": math.degrees(bearing)}
        own = {"kind": "range_dependent", **stds, "eta_range": 0.0, "eta_bearing": 0.0}
    return {
        "name": f"sensor {s + 1}",
        "position": place.tolist(),
        "measurement": {"kind": "bearing_range" if polar else "position"},
        "noise": own,
        "detection": {"kind": "constant", "probability": detection},
        "clutter": {"kind": "region", "rate": clutter},
        "extent": 0.0,  # none is learnt, which takes most of the time
    }


def _rows(
    rng: np.random.Generator,
    s: int,
    time: float,
    place: Floats,
    polar: bool,
    seen: Floats,
    false: Floats,
    stds: Floats,
    offset: float,
) -> Iterator[dict[str, Any]]:
    """Yield the rows of a scan. stds: of ranges, m, and bearings, rad. offset: bias of bearings, rad."""
    base = {"time": f"{time:.6f}", "sensor": f"sensor {s + 1}"}
    if not len(seen) + len(false):
        yield base
    for i, at in enumerate(np.concatenate([seen, false])):
        errors = rng.normal(size=2) if i < len(seen) else np.zeros(2)
        if polar:
            away = at - place
            bearing = math.atan2(away[1], away[0]) + offset + stds[1] * errors[1]
            yield {**base, "range_m": abs(math.hypot(*away) + stds[0] * errors[0]), "bearing_rad": bearing}
        else:
            x, y = at + stds[0] * errors
            yield {**base, "x_m": x, "y_m": y}


def written(own: Scene, folder: Path) -> RecordingScenario:
    """Write the files of a scene, and return its scenario."""
    scans, sensors = folder / "scans.csv", folder / "sensors.yaml"
    with scans.open("w", newline="") as file:
        columns = list(dict.fromkeys(name for row in own.rows for name in row))
        writer = csv.DictWriter(file, columns)
        writer.writeheader()
        writer.writerows(own.rows)
    sensors.write_text(yaml.safe_dump({"recording": {"bearings": "east"}, **own.sensors}))
    return scenario_from_recording(sensors, scans, speed=own.speed)


def fit_of(own: Scene) -> Fit:
    """Return the fit of a scene."""
    with suppress_unit_warnings(), tempfile.TemporaryDirectory() as folder:
        recorded = written(own, Path(folder))
        return fit_of_run(track_recording(recorded.scenario, recorded.recording), recorded.scenario)


def show_ferry(dataset: Path) -> None:
    """Print the findings of the recordings of a ferry's radar."""
    for number in (2, 4, 5, 13, 17):
        with tempfile.TemporaryDirectory() as folder:
            scans, sensors = Path(folder, "scans.csv"), Path(folder, "radar.yaml")
            write_files(radar_scans(dataset, number)[0], scans, sensors)
            recorded = scenario_from_recording(sensors, scans)
            fit = fit_of_run(track_recording(recorded.scenario, recorded.recording), recorded.scenario)
        print(f"{number}:", *(each.text for each in fit.findings), sep="\n  ", flush=True)


def main() -> None:
    """Read the arguments and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--scenes", type=int, default=20)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS)
    parser.add_argument("--modes", action="store_true", help="The filter has modes already.")
    parser.add_argument("--show", action="store_true", help="Print all findings.")
    parser.add_argument("--ferry", type=Path, metavar="DATASET")
    given = parser.parse_args()
    if given.ferry:
        show_ferry(given.ferry)
        return
    for kind in given.kinds:
        advised, others = list[int](), list[str]()
        for number in range(given.first, given.first + given.scenes):
            findings = fit_of(scene(kind, number, modes=given.modes)).findings
            advised += [number] * any(each.test == "manoeuvres" for each in findings)
            others += sorted({each.test for each in findings})
            if given.show:
                print(*(f"  {number}: {each.text}" for each in findings), sep="\n")
        counts = ", ".join(f"{name} {others.count(name)}" for name in sorted(set(others)))
        print(f"| {kind} | {len(advised)} of {given.scenes} | {counts} |", flush=True)


if __name__ == "__main__":
    main()
