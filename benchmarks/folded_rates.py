"""Range rates that are folded, on scenes drawn at random.

    python benchmarks/folded_rates.py                    # 20 scenes a row
    python benchmarks/folded_rates.py --first 1000       # others
    python benchmarks/folded_rates.py --write docs/evidence/range-rates.md

A scene has four targets of up to 15 m/s along each axis and two radars, one of which moves, for 50 s; 25 scans, P_D
.95, five false plots a scan. The range rates have a noise of 0.3 m/s and are folded at the given speed. Prints the mean
OSPA (c = 100 m) from the sixth scan on, and the root mean square errors of velocities in scans 3 to 6 and later.
"""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from pages import table_of_scenes

from vedette.evaluation.metrics.point_ospa import ospa_of_run
from vedette.kernels.base.types import Floats
from vedette.scenarios import Scenario, parse_scenario
from vedette.scenarios.build import build_experiment, build_planner
from vedette.simulation import simulate

BOAT = {"kind": "heading", "speed": 8.0, "headings_deg": [90.0]}
ROWS = {"none": 0.0, "not folded": np.inf, "folded at 12 m/s": 12.0, "folded at 6 m/s": 6.0, "folded at 3 m/s": 3.0}


def scenario(folded: float, seed: int) -> Scenario:
    """A scene. folded: largest unambiguous range rate, m/s; 0: none are measured."""
    rng, states = np.random.default_rng(seed), list[list[float]]()
    for _ in range(4):
        states.append([*rng.uniform(-600.0, 600.0, 2).tolist(), *rng.uniform(-15.0, 15.0, 2).tolist()])
    measurement: dict[str, Any] = {"kind": "bearing_range_rate" if folded else "bearing_range"}
    noise: dict[str, Any] = {"kind": "range_dependent", "sigma_range": 8.0, "sigma_bearing_deg": 0.5}
    clutter: dict[str, Any] = {"kind": "region", "rate": 5.0}
    if folded:
        noise["sigma_range_rate"] = 0.3
    if 0.0 < folded < np.inf:
        measurement["max_unambiguous_range_rate"] = folded
    elif folded:
        clutter["max_range_rate"] = 30.0
    data = {
        "format": 1,
        "name": "folded",
        "time": {"num_steps": 25, "step_period": 2.0, "start": 2.0},
        "region": {"x_min": -1000.0, "x_max": 1000.0, "y_min": -1000.0, "y_max": 1000.0},
        "motion": {"kind": "constant_velocity", "sigma_v": 0.2},
        "survival": {"kind": "constant", "probability": 0.99},
        "birth": {"from_measurements": {"expected": 0.2, "max_existence": 0.1, "std": [60.0, 60.0, 15.0, 15.0]}},
        "targets": {"kind": "scripted", "tracks": [{"state": state} for state in states]},
        "sensor_defaults": {
            "measurement": measurement,
            "noise": noise,
            "detection": {"kind": "constant", "probability": 0.95},
            "clutter": clutter,
        },
        "sensors": [
            {"name": "still", "position": [-900.0, 0.0]},
            {
                "name": "boat",
                "position": [0.0, -900.0],
                "heading_deg": 90.0,
                "stationary_until_first_decision": False,
                "platform": BOAT,
            },
        ],
        "fusion": {"kind": "central"},
    }
    return Scenario(parse_scenario(json.dumps(data)), Path("folded.yaml"))


def errors(folded: float, seed: int) -> tuple[float, Floats, Floats]:
    """OSPA, m, and the errors of velocities in scans 3 to 6 and later, m/s, of estimates within 60 m of a target."""
    made, found = scenario(folded, seed), (list[float](), list[float]())
    score = partial(ospa_of_run, cutoff=100.0, order=1.0)
    record = simulate(build_experiment(made), build_planner(made, "random", 1), seed=seed, run=0, score=score)
    for k, estimate in enumerate(record.estimates):
        _, states = record.truth.at(k)
        if k < 2 or not len(estimate.means):
            continue
        off = estimate.means[:, np.newaxis, :4] - states[:, :4]
        distances = np.hypot(off[..., 0], off[..., 1])
        own = off[np.arange(len(off)), distances.argmin(axis=1)][distances.min(axis=1) < 60.0]
        found[int(k >= 6)].extend(np.hypot(own[:, 2], own[:, 3]).tolist())
    return float(np.asarray(record.ospa)[5:, 0].mean()), np.array(found[0]), np.array(found[1])


def table(runs: int, first: int) -> str:
    """As Markdown."""
    lines = ["| range rates | OSPA, m | velocity, scans 3 to 6, m/s | later, m/s |", "| --- | ---: | ---: | ---: |"]
    for words, folded in ROWS.items():
        ospa, early, late = zip(*(errors(folded, seed) for seed in range(first, first + runs)), strict=True)
        rms = [float(np.sqrt(np.mean(np.concatenate(own) ** 2))) for own in (early, late)]
        lines.append(f"| {words} | {np.mean(ospa):.1f} | {rms[0]:.2f} | {rms[1]:.2f} |")
    return "\n".join(lines)


if __name__ == "__main__":
    table_of_scenes(__doc__, "folded_rates.py", table)
