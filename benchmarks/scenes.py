"""Scenes by which filters and their defaults are compared: `benchmarks/defaults.py`, `benchmarks/beliefs.py`.

A scene is a scenario for each run, and who steers its sensors. Own ones are variations of `BASE`: position sensors that
see all of a square of a kilometre, one scan a second.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from vedette.scenarios import (
    GeneratedCrowd,
    GeneratedScene,
    Scenario,
    crowd_text,
    load_scenario,
    parse_scenario,
    replace_fields,
    scene_text,
)

BASE = """
format: 1
name: base
time: {num_steps: 40}
region: {x_min: -500.0, x_max: 500.0, y_min: -500.0, y_max: 500.0}
motion: {kind: constant_velocity, sigma_v: 1.0}
survival: {kind: constant, probability: 0.99}
birth:
  sites: [{existence: 0.06, mean: [0.0, 0.0, 0.0, 0.0], std: [20.0, 20.0, 5.0, 5.0]}]
targets:
  kind: scripted
  tracks: [{state: [0.0, 0.0, 0.0, 0.0]}]
sensor_defaults:
  measurement: {kind: position}
  noise: {kind: constant, std: [10.0, 10.0]}
  detection: {kind: constant, probability: 0.7}
  clutter: {kind: region, rate: 5.0}
sensors: [{position: [0.0, 0.0]}]
fusion: {kind: none}
"""
LAYOUT_SIDE, LAYOUT_SPEED, FIRST_LAYOUT = 1400.0, 10.0, 200  # m, m/s, seed


@dataclass(frozen=True)
class Scene:
    """What is run.

    Attributes:
        name: by which it is asked for.
        scenario: of a run.
        planner: the strategy by which sensors are steered.
        share: of the runs asked for that are enough here, for scenes that take long.
    """

    name: str
    scenario: Callable[[int], Scenario]
    planner: str = "stationary"
    share: float = 1.0


def decades(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a number that is uniform in its logarithm."""
    return float(np.exp(rng.uniform(math.log(low), math.log(high))))


def own(name: str, fields: dict[str, Any], num_sensors: int = 1, fusion: dict[str, Any] | None = None) -> Scene:
    """A variation of `BASE` for so many equal sensors, and a fusion where there are several."""

    @cache
    def scenario() -> Scenario:
        base = Scenario(parse_scenario(BASE))
        [sensor] = base.model.model_dump(mode="json")["sensors"]
        several = {"sensors": [{**sensor, "name": f"sensor {s}"} for s in range(num_sensors)]}
        return replace_fields(base, {**several, "fusion": fusion or {"kind": "none"}, **fields, "name": name})

    return Scene(name, lambda run: scenario())


def site(position: Sequence[float], std: float = 20.0, existence: float = 0.06, speed_std: float = 5.0) -> Any:
    """Where targets are born."""
    return {"existence": existence, "mean": [*position, 0.0, 0.0], "std": [std, std, speed_std, speed_std]}


def track(state: Sequence[float], start: int = 1) -> Any:
    """A target of constant velocity."""
    return {"state": list(state), "start_step": start}


def two_names() -> Iterator[Scene]:
    """One target that may have been missed at its first scan and be named by its second: scored from scan 10 on."""
    drawn = {"state": [0.0] * 4, "std": [20.0, 20.0, 5.0, 5.0], "process_noise": True}
    fields = {"time.num_steps": 20, "targets.tracks": [drawn], "ospa.first_scan": 10}
    own_tracks = {"kind": "cm_delta_glmb"}
    yield own("two names, GCI", fields, 2, own_tracks)
    yield own("two names, GCI, noise 4 m", {**fields, "sensors.*.noise.std": [4.0, 4.0]}, 2, own_tracks)
    yield own("two names, GCI, three sensors", fields, 3, own_tracks)
    yield own("two names, GCI, matched", fields, 2, {**own_tracks, "matching": "assignment"})
    yield own("two names, GCI with feedback", fields, 2, {**own_tracks, "feedback": True})
    yield own("two names, one sensor", fields)
    yield own("two names, sequential", fields, 2, {"kind": "sequential"})
    yield own("born once, GCI", {**fields, "birth.steps": [1]}, 2, own_tracks)


def close_targets() -> Iterator[Scene]:
    """In formation, born close together, and crossing."""
    starts = [(-200.0, -20.0), (-200.0, 0.0), (-200.0, 20.0)]
    abreast = {
        "sensors.*.noise.std": [8.0, 8.0],
        "sensors.*.detection.probability": 0.9,
        "sensors.*.clutter.rate": 10.0,
        "birth.sites": [site(start, 10.0, 0.2, 10.0) for start in starts],
        "birth.steps": [1],
        "targets.tracks": [track((*start, 10.0, 0.0)) for start in starts],
    }
    yield own("formation", abreast)
    yield own("formation, sequential", abreast, 2, {"kind": "sequential"})
    yield own("formation, GCI", abreast, 2, {"kind": "cm_delta_glmb"})
    sites = [site(place, 30.0, 0.03) for place in ((0.0, 0.0), (10.0, 10.0), (-10.0, 10.0))]
    born = [track((0.0, 0.0, 3.0, 1.0), 3), track((20.0, 15.0, -2.0, 3.0), 3), track((-15.0, 20.0, 0.0, -4.0), 8)]
    close = {
        "sensors.*.noise.std": [8.0, 8.0],
        "sensors.*.detection.probability": 0.9,
        "sensors.*.clutter.rate": 10.0,
        "birth.sites": sites,
        "targets.tracks": born,
    }
    yield own("close births", close)
    yield own("close births, GCI", close, 2, {"kind": "cm_delta_glmb"})
    yield own("close births, sequential", close, 2, {"kind": "sequential"})


def crossing_targets() -> Iterator[Scene]:
    """Two whose ways cross in the middle of the run, and four far apart; births at every scan or once."""
    starts = [(-200.0, -100.0), (-200.0, 100.0)]
    crossing = {
        "birth.sites": [site(start, 20.0, 0.03, 10.0) for start in starts],
        "targets.tracks": [track((x, y, 10.0, -y / 20.0)) for x, y in starts],
        "sensors.*.noise.std": [8.0, 8.0],
        "sensors.*.detection.probability": 0.9,
    }
    yield own("crossing", crossing)
    yield own("crossing, GCI, born once", {**crossing, "birth.steps": [1]}, 2, {"kind": "cm_delta_glmb"})
    yield own("crossing, clutter 250", {**crossing, "sensors.*.clutter.rate": 250.0})
    hard = {"sensors.*.detection.probability": 0.6, "sensors.*.clutter.rate": 100.0}
    yield own("crossing, P_D 0.6, clutter 100", crossing | hard)
    corners = [(-300.0, -300.0), (300.0, -300.0), (-300.0, 300.0), (300.0, 300.0)]
    far = {
        "birth.sites": [site(corner, 20.0, 0.03, 10.0) for corner in corners],
        "targets.tracks": [track((x, y, -x / 50.0, y / 100.0), 1 + 3 * i) for i, (x, y) in enumerate(corners)],
        "sensors.*.detection.probability": 0.9,
    }
    yield own("far", far)
    yield own("far, clutter 250", {**far, "sensors.*.clutter.rate": 250.0})
    births = {"expected": 0.1, "max_existence": 0.03, "std": [15.0, 15.0, 10.0, 10.0]}
    from_measurements = {**far, "birth.sites": [], "birth.from_measurements": births}
    yield own("far, from measurements", from_measurements)
    yield own("far, from measurements, sequential", from_measurements, 2, {"kind": "sequential"})
    matched = {"kind": "cm_delta_glmb", "matching": "assignment"}
    yield own("far, from measurements, GCI matched", from_measurements, 2, matched)


def builtin(name: str, planner: str, share: float = 1.0, **fields: Any) -> Scene:
    """A scenario that comes with the library, with some sections replaced, under a strategy."""
    scenario = cache(lambda: replace_fields(load_scenario(name), fields))
    return Scene(f"{name}, {planner}", lambda run: scenario(), planner, share)


def still_sensors() -> Scene:
    """Layouts of four targets drawn in a square and two of paper-a's sensors that lie anywhere in it; one a run."""
    given = load_scenario("paper-a")
    std = given.model.birth.sites[0].std

    def scenario(run: int) -> Scenario:
        rng = np.random.default_rng(FIRST_LAYOUT + run)
        places, courses = rng.uniform(0.0, LAYOUT_SIDE, (4, 2)), rng.uniform(0.0, 2.0 * np.pi, 4)
        states = np.column_stack([places, LAYOUT_SPEED * np.cos(courses), LAYOUT_SPEED * np.sin(courses)]).tolist()
        sensors = rng.uniform(0.0, LAYOUT_SIDE, (2, 2)).tolist()
        return replace_fields(
            given,
            {
                "birth.sites": [{"existence": 0.02, "mean": state, "std": std} for state in states],
                "targets.tracks": [{"state": state} for state in states],
                **{f"sensors.{s}.position": place for s, place in enumerate(sensors)},
            },
        )

    return Scene("still sensors", scenario)


def many() -> Iterator[Scene]:
    """A crowd, and a generated scene of four sensors."""
    crowd = cache(lambda: Scenario(parse_scenario(crowd_text(GeneratedCrowd(num_targets=100, num_steps=30)))))
    yield Scene("crowd of 100", lambda run: crowd(), share=0.25)
    spread = cache(lambda: Scenario(parse_scenario(scene_text(GeneratedScene(num_sensors=4, pattern="crowd")))))
    yield Scene("generated, four sensors", lambda run: spread(), "jdm", 0.25)


def all_scenes() -> tuple[Scene, ...]:
    """Every scene, in the order of the table."""
    return (
        *two_names(),
        *close_targets(),
        *crossing_targets(),
        builtin("linear-10", "stationary", 0.25),
        builtin("polar-10", "stationary", 0.25),
        builtin("paper-a", "jdm"),
        builtin("paper-e", "constant"),
        builtin("paper-e", "jdm"),
        still_sensors(),
        builtin("three-positions", "stationary", 0.25, fusion={"kind": "sequential"}),
        builtin("shore-radar", "stationary", 0.5),
        builtin("six-cameras", "jdm", 0.5),
        builtin("eight-mobile", "jdm", 0.25),
        *many(),
    )
