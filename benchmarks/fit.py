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
import math
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from typing import Any

import numpy as np
from scenes import decades, own, track

from vedette.evaluation.fit import Fit, fit_of_run
from vedette.evaluation.runs import run_scenario
from vedette.internal.unit_warnings import suppress_unit_warnings

STREAM, NUM_SCANS = 5801, 120
# Fault: the test that must find it.
FAULTS = {
    "bearing bias of 2 deviations": "bias",
    "range bias of 3 deviations": "bias",
    "noise 2.5 times as large": "noise",
    "noise a third": "noise",
    "detection .3 lower": "detection",
    "clutter 4 times as much": "clutter",
}


def fields_of(number: int, fault: str) -> dict[str, Any]:
    """Return the fields of a scene, with a fault of its first sensor or none."""
    rng = np.random.default_rng([STREAM, number])
    side, clutter, rate = decades(rng, 100.0, 1e5), decades(rng, 0.1, 30.0), decades(rng, 0.2, 10.0)
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
    first = rng.integers(1, NUM_SCANS // 4, num_targets).tolist()
    sensors = [_sensor(s, place, polar, model) for s, place in enumerate(places.tolist())]
    if fault:
        sensors[0]["true_parameters"] = _true(fault, polar, model)
    spread = [3.0 * noise] * 2 + [speed] * 2
    return {
        "time": {"num_steps": NUM_SCANS, "step_period": 1.0 / rate},
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
    """Return the fit of a run of a scene."""
    with suppress_unit_warnings():
        scenario = own(f"scene {number}", fields_of(number, fault), fusion={"kind": "sequential"}).scenario(0)
        return fit_of_run(run_scenario(scenario, "stationary", seed=number), scenario)


def found(fit: Fit, fault: str) -> bool:
    """Return True if a finding names the fault of the first sensor."""
    return any(each.test == FAULTS[fault] and each.sensor == "sensor 1" for each in fit.findings)


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
