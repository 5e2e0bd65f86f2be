"""Noise of one sensor whose errors last for several scans, and births as the initial guess counts them."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
import pytest

from vedette.calibration.initial_guess import Guess, initial_guess
from vedette.scenarios.calibration import build_problem
from vedette.scenarios.from_recording import scenario_from_recording

SENSORS = """recording: {bearings: east}
motion: {kind: constant_velocity, sigma_v: 0.1}
sensor_defaults:
  noise: {kind: constant, std: [0.012, 20.0]}
  detection: {kind: constant, probability: 0.95}
  clutter: {kind: region, rate: 1.0}
sensors:
"""
SHIPS = [(2000.0, 500.0, -5.0, 3.0), (-1500.0, 1000.0, 4.0, 4.0), (500.0, -2500.0, 3.0, -2.0)]


def guess_of(folder: Path, correlation: float, places: dict[str, float]) -> tuple[Guess, list[str]]:
    """The initial guess of a recording with errors of 20 m and 0.012 rad, and its noise parameters that are held."""
    rng, rows = np.random.default_rng(5), list[list[object]]()
    for name, place in places.items():
        errors = rng.normal(size=(len(SHIPS), 2))
        for time in np.arange(0.5 + place / 3000.0, 200.0, 4.0).tolist():
            errors = correlation * errors + math.sqrt(1.0 - correlation**2) * rng.normal(size=errors.shape)
            for (x, y, vx, vy), (wide, far) in zip(SHIPS, errors.tolist(), strict=True):
                dx, dy = x + vx * time - place, y + vy * time
                rows.append([time, name, math.hypot(dx, dy) + 20.0 * far, math.atan2(dy, dx) + 0.012 * wide])
            rows.append([time, name, rng.uniform(0.0, 3000.0), rng.uniform(-math.pi, math.pi)])
    rows.sort(key=lambda row: float(str(row[0])))
    with (folder / "scans.csv").open("w", newline="") as file:
        csv.writer(file).writerows([["time", "sensor", "range", "bearing_rad"], *rows])
    sites = "".join(f"  - {{name: {name}, position: [{place}, 0]}}\n" for name, place in places.items())
    (folder / "radars.yaml").write_text(SENSORS + sites, "utf-8")
    problem = build_problem(scenario_from_recording(folder / "radars.yaml", folder / "scans.csv").scenario)
    given = problem.free([each.start for each in problem.parameters])
    guess = initial_guess(problem, given, range(len(given)), lambda: None)
    return guess, [why for i, why in guess.held.items() if problem.parameters[i].kind == "noise"]


@pytest.mark.parametrize(
    ("correlation", "places", "held"),
    [(0.0, {"a": 0.0}, 0), (0.95, {"a": 0.0}, 2), (0.95, {"a": 0.0, "b": 3000.0}, 0)],
)
def test_noise_of_one_sensor_is_held_if_its_errors_last(
    tmp_path: Path, correlation: float, places: dict[str, float], held: int
) -> None:
    guess, reasons = guess_of(tmp_path, correlation, places)
    assert len(reasons) == held
    assert all("one sensor cannot separate errors that last" in why for why in reasons)
    # Three ships and half a birth in the scans and those of the prior; a track may break.
    assert 3.5 / (50 * len(places) + 5) <= guess.births <= 6.5 / (50 * len(places) + 5)
