"""Tests of fit: how often they find a fault where there is none, and how often they find one that is there.

    python benchmarks/fit.py [--scenes FIRST LAST] [--power FIRST LAST] [--workers N]

The scenes are numbered, and a number always gives the same scene. Drawn over decades are: the side of the region
(100 m to 100 km), noise and speed relative to it, false measurements a scan (.1 to 30) and the scan rate (.2 to 10 a
second); further the probability of detection (.6 to .98), two or three sensors of bearings and ranges or of positions,
and two to six targets. The level has the share of scenes with a finding of each test where the model is right. The
power has for each fault of the first sensor the share of scenes in which a finding names the fault and the sensor.
"""

from __future__ import annotations

import argparse
import csv
import math
import tempfile
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import yaml
from scenes import decades, own, track

from vedette.evaluation.fit import Fit, fit_of_run
from vedette.evaluation.runs import run_scenario, track_recording
from vedette.evaluation.scans import scan_table
from vedette.internal.unit_warnings import suppress_unit_warnings
from vedette.kernels.base.types import Floats
from vedette.scenarios.from_recording import scenario_from_recording

Row: TypeAlias = dict[str, Any]

STREAM, NUM_SCANS = 5801, 120
# Fault: the test that must find it. Those after the first six are faults of rows, or of targets.
FAULTS = {
    "bearing bias of 2 deviations": "bias",
    "range bias of 3 deviations": "bias",
    "noise 2.5 times as large": "noise",
    "noise a third": "noise",
    "detection .3 lower": "detection",
    "clutter 4 times as much": "clutter",
    "bearings of two sensors biased by 8 deviations": "agreement",
    "a target 8 times as fast or more": "fast targets",
    "four returns a target": "several returns",
    "six stationary echoes, seen in half of the scans": "stationary echoes",
    "detections lost beyond the median range": "detection by place",
    "detections lost in the first third of bearings": "detection by place",
    "clutter in a sector of 40 deg": "clutter by place",
    "no scan for a quarter of the time": "period",
    "first scan after a third of the time": "period",
    "each second scan only, from the middle on": "period",
}


def fields_of(number: int, fault: str, rate: float | None = None, num_scans: int = NUM_SCANS) -> dict[str, Any]:
    """Return the fields of a scene, with a fault of its first sensor or none. rate: scans a second; None: random."""
    rng = np.random.default_rng([STREAM, number])
    side, clutter, drawn = decades(rng, 100.0, 1e5), decades(rng, 0.1, 30.0), decades(rng, 0.2, 10.0)
    rate = drawn if rate is None else rate
    noise = side * decades(rng, 3e-4, 3e-3)
    speed = noise * decades(rng, 0.1, 1.5) * rate
    detection, polar = float(rng.uniform(0.6, 0.98)), bool(rng.integers(2)) or "bearing" in fault or "range" in fault
    num_sensors, num_targets = int(rng.integers(2, 4)), int(rng.integers(2, 7))
    model = {"noise": noise, "bearing": math.degrees(noise / (0.5 * side)), "detection": detection, "clutter": clutter}
    places = rng.uniform(-0.6 * side, 0.6 * side, (num_sensors, 2))
    starts, velocities = (
        rng.uniform(-0.35 * side, 0.35 * side, (num_targets, 2)),
        rng.normal(0, speed, (num_targets, 2)),
    )
    first = rng.integers(1, num_scans // 4, num_targets).tolist()
    sensors = [_sensor(s, place, polar, model) for s, place in enumerate(places.tolist())]
    if fault in list(FAULTS)[:6]:
        sensors[0]["true_parameters"] = _true(fault, polar, model)
    if "two sensors" in fault:
        for sensor, sign in zip(sensors, (8.0, -8.0), strict=False):
            sensor["true_parameters"] = {"bias": {"bearing_deg": sign * model["bearing"]}}
    if "as fast" in fault:
        angle = rng.uniform(-math.pi, math.pi)
        direction = np.array([math.cos(angle), math.sin(angle)])
        starts = np.vstack([starts, -0.45 * side * direction])
        velocities = np.vstack([velocities, max(8.0 * speed, 20.0 * noise * rate) * direction])
        first.append(NUM_SCANS // 3)
    spread = [3.0 * noise] * 2 + [speed] * 2
    return {
        "time": {"num_steps": num_scans, "step_period": 1.0 / rate},
        "region": {"x_min": -side / 2, "x_max": side / 2, "y_min": -side / 2, "y_max": side / 2},
        "motion": {"kind": "constant_velocity", "sigma_v": 0.1 * speed * rate**0.5, "noise_model": "continuous_white"},
        "survival.probability": 0.999,
        "ospa.cutoff": 20.0 * noise,
        "birth": {"sites": [], "from_measurements": {"expected": 0.05, "std": spread}},
        "sensors": sensors,
        "targets.tracks": [
            track([*start, *velocity], at)
            for start, velocity, at in zip(starts.tolist(), velocities.tolist(), first, strict=True)
        ],
    }


def _sensor(index: int, place: list[float], polar: bool, model: dict[str, float]) -> dict[str, Any]:
    return {
        "name": f"sensor {index + 1}",
        "position": place,
        "measurement": {"kind": "bearing_range" if polar else "position"},
        "noise": _noise(polar, model),
        "detection": {"kind": "constant", "probability": model["detection"]},
        "clutter": {"kind": "region", "rate": model["clutter"]},
    }


def _noise(polar: bool, model: dict[str, float], factor: float = 1.0) -> dict[str, Any]:
    if not polar:
        return {"kind": "constant", "std": [factor * model["noise"]] * 2}
    stds = {"sigma_range": factor * model["noise"], "sigma_bearing_deg": factor * model["bearing"]}
    return {"kind": "range_dependent", **stds, "eta_range": 0.0, "eta_bearing": 0.0}


def _true(fault: str, polar: bool, model: dict[str, float]) -> dict[str, Any]:
    """Return the true parameters of a sensor with a fault."""
    if "bias" in fault:
        return {
            "bias": {"bearing_deg": 2.0 * model["bearing"]} if "bearing" in fault else {"range": 3.0 * model["noise"]}
        }
    if "noise" in fault:
        return {"noise": _noise(polar, model, 2.5 if "2.5" in fault else 1.0 / 3.0)}
    if "detection" in fault:
        return {"detection": {"kind": "constant", "probability": model["detection"] - 0.3}}
    return {"clutter": {"kind": "region", "rate": 4.0 * model["clutter"]}}


def fit_of(number: int, fault: str = "") -> Fit:
    """Return the fit of a scene whose scans were written to a file and tracked."""
    with suppress_unit_warnings(), tempfile.TemporaryDirectory() as folder:
        fields = fields_of(number, fault)
        scene = own(f"scene {number}", fields, fusion={"kind": "sequential"}).scenario(0)
        record = run_scenario(scene, "stationary", seed=number)
        columns = scan_table(record, scene)
        rows = [dict(zip(columns, cells, strict=True)) for cells in zip(*columns.values(), strict=True)]
        for row in rows:
            if row.get("range_m") is not None:
                row["range_m"] = abs(row["range_m"])  # noise makes some ranges negative, which files may not have
        noise = fields["ospa.cutoff"] / 20.0
        rows = list(changed(rows, fault, noise, true_places(fields), np.random.default_rng([STREAM, number, 1])))
        scans, sensors = Path(folder, "scans.csv"), Path(folder, "sensors.yaml")
        with scans.open("w", newline="") as file:
            writer = csv.DictWriter(file, list(columns))
            writer.writeheader()
            writer.writerows(rows)
        model = scene.model.model_dump(mode="json", exclude_unset=True)
        for each in model["sensors"]:
            each.pop("true_parameters", None)
            each["extent"] = 0.0  # none is learnt, which takes most of the time, and mends several returns
        kept = ("format", "name", "region", "motion", "survival", "birth", "sensors", "sensor_defaults", "fusion")
        document = {key: model[key] for key in kept if key in model}
        sensors.write_text(yaml.safe_dump({**document, "recording": {"bearings": "east"}}))
        scenario = scenario_from_recording(sensors, scans).scenario
        return fit_of_run(track_recording(scenario), scenario)


def true_places(fields: dict[str, Any]) -> Floats:
    """Return the places of all targets at all steps, (num, 2)."""
    period = fields["time"]["step_period"]
    return np.array(
        [
            np.array(each["state"][:2]) + (step - each["start_step"]) * period * np.array(each["state"][2:])
            for each in fields["targets.tracks"]
            for step in range(each["start_step"], NUM_SCANS + 1)
        ]
    )


def changed(rows: list[Row], fault: str, noise: float, targets: Floats, rng: np.random.Generator) -> Iterator[Row]:
    """Yield the rows of the scans, with a fault of the first sensor; targets: their places at all times."""
    times = sorted({row["time"] for row in rows})
    first = [row for row in rows if row["sensor"] == "sensor 1"]
    places = np.array([place_of(row) for row in first if is_measured(row)])
    echoes = rng.uniform(places.min(axis=0), places.max(axis=0), (6, 2))
    offsets = targets - own_place(first[0])
    middle, far = float(np.median(np.hypot(*offsets.T))), float(np.hypot(*(places - own_place(first[0])).T).max())
    centre = np.arctan2(*offsets.mean(axis=0)[::-1])
    turns = np.remainder(np.arctan2(offsets[:, 1], offsets[:, 0]) - centre + math.pi, 2.0 * math.pi) - math.pi
    # The first third of the targets' bearings; and the middle of a sector with clutter.
    limit, angle = float(np.quantile(turns, 1.0 / 3.0)), math.atan2(*offsets[rng.integers(len(offsets))][::-1])
    for k, time in enumerate(times):
        for row in (row for row in rows if row["time"] == time):
            if row["sensor"] != "sensor 1" or not is_measured(row):
                if row["sensor"] != "sensor 1" or not is_out(fault, k):
                    yield row
                continue
            if is_out(fault, k):
                continue
            away = place_of(row) - own_place(row)
            turn = math.remainder(math.atan2(away[1], away[0]) - centre, 2.0 * math.pi)
            is_there = np.hypot(*away) > middle if "beyond" in fault else "lost in" in fault and turn < limit
            if is_there and rng.random() < 0.6:
                yield empty(row)
                continue
            yield row
            if "returns" in fault and np.hypot(*(targets - place_of(row)).T).min() < 4.0 * noise:
                for _ in range(3):
                    yield at_place(row, place_of(row) + rng.normal(0.0, 2.0 * noise, 2))
        if is_out(fault, k):
            continue
        pattern = next((row for row in first if row["time"] == time), None)
        if pattern is None:
            continue
        if "echoes" in fault:
            for echo in echoes[rng.random(len(echoes)) < 0.5]:
                yield at_place(pattern, echo + rng.normal(0.0, 0.5 * noise, 2))
        if "clutter in" in fault:
            for _ in range(rng.poisson(max(2.0, 1.5 * len(places) / len(times)))):
                direction, reach = angle + rng.uniform(-0.35, 0.35), far * math.sqrt(rng.random())
                yield at_place(pattern, own_place(pattern) + reach * np.array([np.cos(direction), np.sin(direction)]))


def is_out(fault: str, k: int) -> bool:
    """Return True if the first sensor has no scan at a step."""
    third, quarter, half = NUM_SCANS // 3, NUM_SCANS // 4, NUM_SCANS // 2
    if "no scan" in fault:
        return third < k < third + quarter
    return k < third if "first scan" in fault else "second scan" in fault and k >= half and k % 2 == 1


def is_measured(row: Row) -> bool:
    """Return True for a row with a measurement, False for that of an empty scan."""
    return any(row.get(name) is not None for name in ("range_m", "x_m"))


def empty(row: Row) -> Row:
    """Return the row of an empty scan."""
    return {**row, **{name: None for name in ("bearing_rad", "range_m", "x_m", "y_m") if name in row}}


def own_place(row: Row) -> Floats:
    return np.array([row["own_x_m"], row["own_y_m"]])


def place_of(row: Row) -> Floats:
    """Return the place of the measurement of a row."""
    if row.get("x_m") is not None:
        return np.array([row["x_m"], row["y_m"]])
    return own_place(row) + row["range_m"] * np.array([math.cos(row["bearing_rad"]), math.sin(row["bearing_rad"])])


def at_place(row: Row, place: Floats) -> Row:
    """Return the row of a measurement at another place."""
    away = place - own_place(row)
    if "x_m" in row:
        return {**row, "x_m": place[0], "y_m": place[1]}
    return {**row, "bearing_rad": math.atan2(away[1], away[0]), "range_m": math.hypot(*away)}


def found(fit: Fit, fault: str) -> bool:
    """Return True if a finding names the fault of the first sensor."""
    return any(each.test == FAULTS[fault] and "sensor 1" in each.text for each in fit.findings)


def table(first: int, last: int, power: tuple[int, int], workers: int) -> Iterator[str]:
    """Yield the lines of the tables."""
    scenes = range(first, last + 1)
    with ProcessPoolExecutor(workers) as pool:
        fits = list(pool.map(fit_of, scenes))
        wrong = [number for number, fit in zip(scenes, fits, strict=True) if fit.findings]
        tests = Counter(test for fit in fits for test in {each.test for each in fit.findings})
        yield f"| model right | {len(wrong)} of {len(scenes)} scenes with a finding |"
        yield from (f"| {test} | {number} of {len(scenes)} |" for test, number in sorted(tests.items()))
        yield from (f"{number}: {each.text}" for number, fit in zip(scenes, fits, strict=True) for each in fit.findings)
        numbers = range(power[0], power[1] + 1)
        for fault in FAULTS:
            hits = [found(fit, fault) for fit in pool.map(partial(fit_of, fault=fault), numbers)]
            missed = ", ".join(str(number) for number, hit in zip(numbers, hits, strict=True) if not hit)
            yield f"| {fault} | found in {sum(hits)} of {len(hits)} | {missed and f'not in {missed}'} |"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, nargs=2, default=(1, 100), metavar=("FIRST", "LAST"))
    parser.add_argument("--power", type=int, nargs=2, default=(1, 20), metavar=("FIRST", "LAST"))
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    for line in table(*options.scenes, tuple(options.power), options.workers):
        print(line, flush=True)
