"""Cameras that must turn, as their targets are farther apart than they see: planners and a sweep by hand.

    python benchmarks/turning.py                       # 12 scenes, 8 runs
    python benchmarks/turning.py --scenes 3 --runs 2 --planners jdm sweep
    python benchmarks/turning.py --write docs/evidence/turning-cameras.md
    python benchmarks/turning.py --blind               # no scan while the camera turns
    python benchmarks/turning.py --drawn --planners jdm sweep

Each scene is drawn: one camera that turns at 10 to 20 degrees a second and sees 24 to 40 degrees; two to five slow
targets 100 to 300 m away in any directions; decisions every 1, 2 or 4 s with a horizon of 4 s; targets expected at
sites (existence .9, at the first scan), or born anywhere. They move less than filters expect, or `--drawn` from the
model: from their sites, with process noise. `sweep` turns on and on, one way, as fast as the camera can;
a blind one by a field of view at a time, where it stays for a decision (`lawnmower` in `benchmarks/hand_rules.py`).
Prints mean OSPA in m (cutoff 100 m) with one standard error, and paired differences to the first planner.
"""

from __future__ import annotations

import argparse
import json
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from hand_rules import RULES
from pages import write_between

from vedette.evaluation.metrics.point_ospa import ospa_of_run
from vedette.kernels.base.types import Floats
from vedette.scenarios import Scenario, parse_scenario
from vedette.scenarios.build import build_experiment, build_planner
from vedette.simulation import simulate

PLANNERS = ("jdm", "sweep", "nearest", "random")
SEED, STEPS, CUTOFF, POINTINGS, HORIZON = 7, 100, 100.0, 36, 4


def scene(number: int, *, blind: bool = False, drawn: bool = False) -> Scenario:
    """One of the scenes; the same for a number."""
    rng = np.random.default_rng([SEED, number])
    num, every, anywhere = int(rng.integers(2, 6)), int(rng.choice([1, 2, 4])), bool(number % 2)
    bearings, distances = rng.uniform(-np.pi, np.pi, num), rng.uniform(100.0, 300.0, num)
    places = distances[:, np.newaxis] * np.column_stack([np.cos(bearings), np.sin(bearings)])
    velocities = [rng.normal(0.0, 1.0, 2).tolist() for _ in places]
    tracks: list[dict[str, Any]] = [
        {"state": [*place, *own], "start_step": 1} for place, own in zip(places.tolist(), velocities, strict=True)
    ]
    if drawn:
        spread = {"std": [20.0, 20.0, 2.0, 2.0], "process_noise": True}
        tracks = [{**own, "state": [*own["state"][:2], 0.0, 0.0], **spread} for own in tracks]
    sites = [{"existence": 0.9, "mean": [*place, 0.0, 0.0], "std": [20.0, 20.0, 2.0, 2.0]} for place in places.tolist()]
    measured = {"expected": 0.2, "max_existence": 0.1, "std": [10.0, 10.0, 2.0, 2.0]}
    data: dict[str, Any] = {
        "format": 1,
        "name": f"turning-{number}",
        "time": {"num_steps": STEPS, "step_period": 1.0, "start": 1.0},
        "region": {"x_min": -400.0, "x_max": 400.0, "y_min": -400.0, "y_max": 400.0},
        "motion": {"kind": "constant_velocity", "sigma_v": 0.5},
        "survival": {"kind": "constant", "probability": 0.99},
        "birth": {"sites": [], "from_measurements": measured} if anywhere else {"sites": sites, "steps": [1]},
        "targets": {"kind": "scripted", "tracks": tracks},
        "sensor_defaults": {
            "measurement": {"kind": "position"},
            "noise": {"kind": "constant", "std": [4.0, 4.0]},
            "detection": {"kind": "camera", "probability": 0.95, "max_range": 350.0},
            "clutter": {"kind": "region", "rate": 2.0},
        },
        "sensors": [
            {
                "name": "camera",
                "position": [0.0, 0.0],
                "platform": {
                    "kind": "camera",
                    "half_width_deg": float(rng.uniform(12.0, 20.0)),
                    "pointings_deg": np.arange(-180.0, 180.0, 360.0 / POINTINGS).tolist(),
                    "turn_rate_deg": float(rng.uniform(10.0, 20.0)),
                    "blind_while_turning": blind,
                },
            }
        ],
        "control": {"decision_every": every, "horizon_steps": HORIZON, "horizon_period": 1.0, "explain": False},
        "ospa": {"cutoff": CUTOFF, "order": 1.0},
    }
    return Scenario(parse_scenario(json.dumps(data)), Path("turning.yaml"))


def errors(scenario: Scenario, planner: str, runs: int) -> Floats:
    """(runs,) mean OSPA, m."""
    experiment, score = build_experiment(scenario), partial(ospa_of_run, cutoff=CUTOFF, order=1.0)

    def made() -> Any:
        """A sweep begins anew in each run."""
        return RULES["lawnmower"](scenario) if planner == "sweep" else build_planner(scenario, planner, 1)

    records = [simulate(experiment, made(), seed=SEED, run=run, score=score) for run in range(runs)]
    return np.array([record.ospa[:, 0].mean() for record in records])


def with_error(values: Floats, sign: str = "") -> str:
    """Mean and standard error."""
    return f"{values.mean():{sign}.1f} ± {values.std(ddof=1) / np.sqrt(len(values)):.1f}"


def in_words(scenario: Scenario) -> str:
    """What is drawn in a scene."""
    model = scenario.model
    num = build_experiment(scenario).targets.truth([1.0], rng=np.random.default_rng(0)).states.shape[0]
    born = "born anywhere" if model.birth.from_measurements else "at sites"
    every = model.decision_steps[1] - model.decision_steps[0]
    return f"{num} targets {born}, a decision every {every} s"


def main() -> None:
    """Run, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=12)
    parser.add_argument("--runs", type=int, default=8, help="of each scene, at least 2")
    parser.add_argument("--planners", nargs="+", choices=PLANNERS, default=PLANNERS)
    parser.add_argument("--blind", action="store_true", help="the camera makes no scan while it turns")
    parser.add_argument("--drawn", action="store_true", help="targets are drawn from the model")
    parser.add_argument("--write", type=Path, metavar="PAGE", help="Markdown page with a place for the table")
    given = parser.parse_args()
    first = given.planners[0]
    lines = [f"| Scene | {' | '.join(given.planners)} |", f"| --- |{' ---: |' * len(given.planners)}"]
    found: dict[str, list[Floats]] = {planner: [] for planner in given.planners}
    for number in range(given.scenes):
        scenario = scene(number, blind=given.blind, drawn=given.drawn)
        for planner in given.planners:
            found[planner].append(errors(scenario, planner, given.runs))
        cells = " | ".join(with_error(found[planner][-1]) for planner in given.planners)
        lines.append(f"| {number}: {in_words(scenario)} | {cells} |")
        print(lines[-1], flush=True)
    means = {planner: np.array([own.mean() for own in each]) for planner, each in found.items()}
    lines.append(f"| **all** | {' | '.join(f'{own.mean():.1f}' for own in means.values())} |")
    more = " | ".join(with_error(own - means[first], "+") if planner != first else "" for planner, own in means.items())
    lines.append(f"| more than {first} | {more} |")
    print("\n".join(lines))
    if given.write is not None:
        write_between(given.write, "turning.py", "\n".join(lines))


if __name__ == "__main__":
    main()
