"""Many kinds of scenes, most with targets that no sensor sees at first: joint decisions and simple rules.

    python benchmarks/far_targets.py                                      # all kinds, 10 runs
    python benchmarks/far_targets.py --kinds groups moving --runs 4 --planners jdm nearest --out after.jsonl
    python benchmarks/far_targets.py --against before.jsonl --out after.jsonl
    python benchmarks/far_targets.py --seed 1 --write docs/evidence/strategies.md

Each run has a layout of its own, drawn from its number and the seed. `KINDS` describes the kinds. Planners are the
strategies of scenarios and the rules of `benchmarks/hand_rules.py`. Runs, the table, `--out` and `--against` are those
of `benchmarks/ways_round.py`.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import late_births
import numpy as np
import turning
import ways_round
from hand_rules import RULES

from vedette.kernels.base.types import Floats
from vedette.scenarios import Scenario, parse_scenario, replace_fields

SPEED, SIDE = 30.0, 700.0  # m/s, m
SHORT = 40  # scans of the kinds that were added last
PLANNERS = ["jdm", "nearest", "assigned_target", *RULES]
# Sensors of 40 m/s that turn by up to 30 degrees a decision; and those that miss targets and measure what is none.
AIRCRAFT = {"kind": "heading", "speed": 40.0, "headings_deg": [-30, -15, 0, 15, 30], "relative": True}
MISSES = {"kind": "limited_range", "probability": 0.6, "max_range": 120.0}
FALSE = {"kind": "around_sensor", "rate": 8.0, "half_side": 120.0}

Layout = Callable[[dict[str, Any], np.random.Generator], int]  # adds to a scenario; returns the number of sensors


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


def expect(data: dict[str, Any], means: Floats, states: Floats, std: list[float], existence: float = 0.9) -> None:
    """Add targets at `states` (num, 4), which are expected at `means`."""
    sites = [{"existence": existence, "mean": mean, "std": std} for mean in means.tolist()]
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


def weak(data: dict[str, Any], rng: np.random.Generator) -> int:
    """Labels of existence .2, of which as many have a target, and two sure ones; returns the number of sensors."""
    places = rng.uniform(-400.0, 400.0, (10, 2))
    true = np.append(rng.random(8) < 0.2, [True, True])
    still(data, rng, places)
    for k in range(8):
        data["birth"]["sites"][k]["existence"] = 0.2
    data["targets"]["tracks"] = [own for own, there in zip(data["targets"]["tracks"], true, strict=True) if there]
    return 2


def forbid(data: dict[str, Any], boxes: Floats) -> None:
    """Add zones (num, 4), x_min, x_max, y_min, y_max, that sensors do not enter."""
    data["control"]["constraints"] = [ways_round.box(*own) for own in boxes.tolist()]


def straits(data: dict[str, Any], rng: np.random.Generator) -> int:
    """Land from south to north with two straits of 80 m, and targets on both sides; returns the number of sensors."""
    gaps = np.sort(rng.uniform([-350.0, 50.0], [-50.0, 350.0]))
    ends = np.array([-500.0, *np.repeat(gaps, 2) + np.tile([-40.0, 40.0], 2), 500.0]).reshape(3, 2)
    forbid(data, np.column_stack([np.full(3, -30.0), np.full(3, 30.0), ends]))
    sides = np.where(rng.random(5) < 0.5, -1.0, 1.0)
    still(data, rng, np.column_stack([sides * rng.uniform(80.0, 400.0, 5), rng.uniform(-400.0, 400.0, 5)]))
    return 2


def islands(data: dict[str, Any], rng: np.random.Generator) -> int:
    """Six islands, and targets between them; returns the number of sensors."""
    middles, halves = rng.uniform(-350.0, 350.0, (6, 2)), rng.uniform(30.0, 110.0, (6, 2))
    forbid(data, np.column_stack([middles - halves, middles + halves])[:, [0, 2, 1, 3]])
    places = rng.uniform(-450.0, 450.0, (200, 2))
    outside: Floats = np.abs(places[:, np.newaxis] - middles) - halves
    wet = outside.max(axis=2).min(axis=1) > 10.0
    still(data, rng, places[wet][:5])
    data["sensors"] = [{"position": own} for own in places[wet][5:7].tolist()]
    return 2


def speeds(data: dict[str, Any], rng: np.random.Generator) -> int:
    """One fast sensor that sees 60 m, and one slow one that sees 200 m; returns the number of sensors."""
    still(data, rng, rng.uniform(-400.0, 400.0, (6, 2)))
    usual = data["sensor_defaults"]
    data["sensors"] = [
        {
            "position": rng.uniform(-300.0, 300.0, 2).tolist(),
            "platform": {**usual["platform"], "speed": speed},
            "detection": {**usual["detection"], "max_range": reach},
        }
        for speed, reach in ((45.0, 60.0), (10.0, 200.0))
    ]
    return 2


def cued(data: dict[str, Any], rng: np.random.Generator) -> int:
    """A radar that sees all with 25 m of noise, and two narrow beams with 3 m; returns the number of sensors."""
    bearings, distances = rng.uniform(-np.pi, np.pi, 8), rng.uniform(150.0, 400.0, 8)
    places = distances[:, np.newaxis] * np.column_stack([np.cos(bearings), np.sin(bearings)])
    states = np.column_stack([places, rng.normal(0.0, 6.0, (8, 2))])
    expect(data, states, states, [20.0, 20.0, 3.0, 3.0])
    data["motion"]["sigma_v"] = 2.0
    region = {"kind": "region", "rate": 2.0}
    beam = {"kind": "camera", "half_width_deg": 5.0, "pointings_deg": np.arange(-180.0, 180.0, 10.0).tolist()}
    data["sensors"] = [
        {"platform": {"kind": "stationary"}, "noise": {"kind": "constant", "std": [25.0, 25.0]}},
        *({"platform": beam, "noise": {"kind": "constant", "std": [3.0, 3.0]}} for _ in range(2)),
    ]
    for own, kind in zip(data["sensors"], ("limited_range", "camera", "camera"), strict=True):
        detection = {"kind": kind, "probability": 0.9, "max_range": 700.0}
        own |= {"position": [0.0, 0.0], "clutter": region, "detection": detection}
    return 3


def scattered(num_targets: int, num_sensors: int, half_side: float = 400.0, **sensor: Any) -> Layout:
    """Targets anywhere, and sensors of this kind."""

    def layout(data: dict[str, Any], rng: np.random.Generator) -> int:
        data["sensor_defaults"] |= sensor
        still(data, rng, rng.uniform(-half_side, half_side, (num_targets, 2)))
        return num_sensors

    return layout


def turns(data: dict[str, Any], rng: np.random.Generator) -> int:
    """Targets that turn by up to 6 degrees a second at 5 m/s; returns the number of sensors."""
    data["motion"] = {"kind": "coordinated_turn", "sigma_v": 0.3, "sigma_turn_rate_deg": 0.5}
    angles, rates = rng.uniform(-np.pi, np.pi, 5), np.radians(rng.uniform(-6.0, 6.0, 5))
    velocities = 5.0 * np.column_stack([np.cos(angles), np.sin(angles)])
    states = np.column_stack([rng.uniform(-350.0, 350.0, (5, 2)), velocities, rates])
    expect(data, states, states, [15.0, 15.0, 0.7, 0.7, np.radians(1.0)])
    return 2


def circle(data: dict[str, Any], rng: np.random.Generator) -> int:
    """Five targets around one sensor that may stop; returns the number of sensors."""
    bearings, distances = rng.uniform(-np.pi, np.pi, 5), rng.uniform(200.0, 350.0, 5)
    still(data, rng, distances[:, np.newaxis] * np.column_stack([np.cos(bearings), np.sin(bearings)]))
    let_stop(data, SPEED)
    data["sensors"] = [{"position": [0.0, 0.0]}]
    return 1


def corridor(data: dict[str, Any], rng: np.random.Generator) -> int:
    """Six targets along 1,200 m, and two sensors at one end; returns the number of sensors."""
    still(data, rng, np.column_stack([rng.uniform(-500.0, 600.0, 6), rng.uniform(-60.0, 60.0, 6)]))
    data["sensors"] = [{"position": [-600.0, y]} for y in (-40.0, 40.0)]
    return 2


def fast(data: dict[str, Any], rng: np.random.Generator) -> int:
    """Five targets at 12 m/s; returns the number of sensors."""
    angles = rng.uniform(-np.pi, np.pi, 5)
    velocities = 12.0 * np.column_stack([np.cos(angles), np.sin(angles)])
    states = np.column_stack([rng.uniform(-350.0, 350.0, (5, 2)), velocities])
    expect(data, states, states, [15.0, 15.0, 0.7, 0.7])
    return 2


class Kind(NamedTuple):
    """Scenes of one kind: the layout, half the side of the region in m, and the number of scans."""

    layout: Layout
    half_side: float = 500.0
    num_steps: int = SHORT


KINDS = {
    "groups": Kind(groups, SIDE, 60),
    "stop": Kind(groups, SIDE, 60),
    "random": Kind(random, SIDE, 60),
    "moving": Kind(moving, 1000.0, 60),
    "drifting": Kind(drifting, 400.0, 100),
    "weak": Kind(weak),
    "straits": Kind(straits),
    "islands": Kind(islands),
    "speeds": Kind(speeds),
    "cued": Kind(cued, 700.0),
    "many-sensors": Kind(scattered(10, 8, 500.0)),
    "many-targets": Kind(scattered(15, 2)),
    "turns": Kind(turns),
    "circle": Kind(circle),
    "corridor": Kind(corridor, 700.0),
    "fast": Kind(fast, 1000.0),
    "clutter": Kind(scattered(5, 2, 350.0, detection=MISSES, clutter=FALSE)),
    "aircraft": Kind(scattered(5, 2, platform=AIRCRAFT)),
}
# Scenes of other benchmarks, by the number of the run.
ELSEWHERE: dict[str, Callable[[int], Scenario]] = {
    "cameras": lambda run: replace_fields(turning.scene(run), {"time.num_steps": SHORT}),
    "blind": lambda run: replace_fields(turning.scene(run, blind=True), {"time.num_steps": SHORT}),
    "cameras-sites": lambda run: turning.scene(2 * run),  # all targets expected at sites
    "blind-sites": lambda run: turning.scene(2 * run, blind=True),
    "late": lambda run: late_births.scene(run + run // 3 + 1, True),  # without those in which no target is late
}


def scenario_of(kind: str, run: int) -> Scenario:
    """The scene with the layout of one run."""
    if kind in ELSEWHERE:
        return ELSEWHERE[kind](run)
    rng, given = np.random.default_rng([11, run]), KINDS[kind]
    data = base(given.num_steps, given.half_side)
    num_sensors = given.layout(data, rng)
    if kind == "stop":
        let_stop(data, SPEED)
    if "sensors" not in data:
        data["sensors"] = [{"position": rng.uniform(-300.0, 300.0, 2).tolist()} for _ in range(num_sensors)]
    return Scenario(parse_scenario(json.dumps(data)), Path("far-targets.yaml"))


if __name__ == "__main__":
    ways_round.main(__doc__, "far_targets.py", [*KINDS, *ELSEWHERE], scenario_of, PLANNERS)
