"""Targets farther away than sensors see and than their horizon reaches: does the cost-to-go lead to them?

    python benchmarks/far_targets.py                                 # all scenes, 10 runs, jdm and nearest
    python benchmarks/far_targets.py groups moving --runs 4 --planners jdm --out after.jsonl
    python benchmarks/far_targets.py --against before.jsonl --out after.jsonl

Each run has a layout of its own, drawn from its number. "groups": three groups of two or three targets 700 m apart, two
sensors that see 120 m and go 30 m/s; "stop": the same, and sensors may stop; "random": one to three sensors that see 60
to 200 m, two to seven targets; "moving": targets with about 5 m/s; "drifting": targets cross a region and new ones
enter at its western edge. Runs, the table, `--out` and `--against` are those of `benchmarks/ways_round.py`.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import ways_round

from vedette.kernels.base.types import Floats
from vedette.scenarios import Scenario, parse_scenario

SPEED, SIDE = 30.0, 700.0  # m/s, m


def base(num_steps: int, half_side: float) -> dict[str, Any]:
    """What all scenes have in common."""
    return {
        "format": 1,
        "name": "far-targets",
        "time": {"num_steps": num_steps, "step_period": 1.0, "start": 1.0},
        "region": {"x_min": -half_side, "x_max": half_side, "y_min": -half_side, "y_max": half_side},
        "motion": {"kind": "constant_velocity", "sigma_v": 0.3},
        "survival": {"kind": "constant", "probability": 0.99},
        "sensor_defaults": {
            "platform": {"kind": "heading", "speed": SPEED, "headings_deg": list(range(-135, 181, 45))},
            "measurement": {"kind": "position"},
            "noise": {"kind": "constant", "std": [4.0, 4.0]},
            "detection": {"kind": "limited_range", "probability": 0.95, "max_range": 120.0},
            "clutter": {"kind": "around_sensor", "rate": 1.0, "half_side": 120.0},
        },
        "control": {"decision_every": 1, "horizon_steps": 1, "horizon_period": 1.0, "explain": False},
        "ospa": {"cutoff": 50.0, "order": 1.0},
    }


def expect(data: dict[str, Any], means: Floats, states: Floats, std: list[float]) -> None:
    """Add targets at `states` (num, 4), which are expected at `means`."""
    sites = [{"existence": 0.9, "mean": mean, "std": std} for mean in means.tolist()]
    data["birth"] = {"sites": sites, "steps": [1]}
    data["targets"] = {
        "kind": "scripted",
        "tracks": [{"state": state, "process_noise": True} for state in states.tolist()],
    }


def let_stop(data: dict[str, Any], speed: float) -> None:
    """Let sensors go at a speed, or stop."""
    platform = data["sensor_defaults"]["platform"]
    del platform["speed"]
    platform["speeds"] = [speed, 0.0]


def still(data: dict[str, Any], rng: np.random.Generator, places: Floats) -> None:
    """Add slow targets at places (num, 2)."""
    nothing = np.zeros_like(places)
    states = np.concatenate([places, [rng.normal(0.0, 0.7, 2) for _ in places]], axis=1)
    expect(data, np.concatenate([places, nothing], axis=1), states, [20.0, 20.0, 1.0, 1.0])


def groups(data: dict[str, Any], rng: np.random.Generator) -> int:
    """Three groups on a circle; returns the number of sensors."""
    angles = rng.uniform(-np.pi, np.pi) + np.arange(3) * 2.0 * np.pi / 3.0
    centres = SIDE / np.sqrt(3.0) * np.column_stack([np.cos(angles), np.sin(angles)])
    places = [centre + rng.uniform(-140.0, 140.0, 2) for centre in centres for _ in range(int(rng.integers(2, 4)))]
    still(data, rng, np.array(places))
    return 2


def random(data: dict[str, Any], rng: np.random.Generator) -> int:
    """Any layout; returns the number of sensors."""
    data["sensor_defaults"]["detection"]["max_range"] = float(rng.uniform(60.0, 200.0))
    data["sensor_defaults"]["platform"]["speed"] = speed = float(rng.choice([15.0, 30.0]))
    still(data, rng, rng.uniform(-500.0, 500.0, (int(rng.integers(2, 8)), 2)))
    if rng.random() < 0.5:
        let_stop(data, speed)
    return int(rng.integers(1, 4))


def moving(data: dict[str, Any], rng: np.random.Generator) -> int:
    """Targets with known velocities; returns the number of sensors."""
    num = int(rng.integers(3, 7))
    states = np.column_stack([rng.uniform(-400.0, 400.0, (num, 2)), rng.normal(0.0, 5.0, (num, 2))])
    expect(data, states, states, [15.0, 15.0, 0.7, 0.7])
    return int(rng.integers(1, 4))


def drifting(data: dict[str, Any], rng: np.random.Generator) -> int:
    """Four targets at first and eight later ones go to the east; returns the number of sensors."""
    tracks = []
    for first in [1] * 4 + rng.integers(10, 70, 8).tolist():
        x, speed = (float(rng.uniform(-300.0, 100.0)) if first == 1 else -395.0), float(rng.uniform(4.0, 8.0))
        state = [x, float(rng.uniform(-250.0, 250.0)), speed, float(rng.normal(0.0, 0.5))]
        last = min(100, int(first + (400.0 - x) / speed))
        tracks.append({"state": state, "start_step": first, "end_step": last})
    data["targets"] = {"kind": "scripted", "tracks": tracks}
    data["birth"] = {
        "sites": [],
        "from_measurements": {"expected": 0.1, "max_existence": 0.1, "std": [10.0, 10.0, 5.0, 5.0]},
    }
    return 3


SCENES = {"groups": groups, "stop": groups, "random": random, "moving": moving, "drifting": drifting}


def scenario_of(scene: str, run: int) -> Scenario:
    """The scene with the layout of one run."""
    rng = np.random.default_rng([11, run])
    data = base(100 if scene == "drifting" else 60, {"moving": 1000.0, "drifting": 400.0}.get(scene, 700.0))
    num_sensors = SCENES[scene](data, rng)
    if scene == "stop":
        let_stop(data, SPEED)
    data["sensors"] = [{"position": rng.uniform(-300.0, 300.0, 2).tolist()} for _ in range(num_sensors)]
    return Scenario(parse_scenario(json.dumps(data)), Path("far-targets.yaml"))


if __name__ == "__main__":
    ways_round.main(__doc__, list(SCENES), scenario_of, ["jdm", "nearest"])
