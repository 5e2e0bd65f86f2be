"""Scenes drawn at random, by number, on which beliefs are checked; and the scene of four sites."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from scenes import Scene, own, site

HALF_SIDE = 500.0  # m, of the region of `scenes.BASE`
LEAST, MOST = 0.003, 0.2  # existence of a site
SECONDS, FEWEST_SCANS, MOST_SCANS = 12.0, 25, 60  # length of a run
_STREAM = 7401  # of the random numbers that scenes are drawn from

Fields = dict[str, Any]
Rng = np.random.Generator


def random_scene(number: int) -> Scene:
    """Return the scene of a number from 1; equal numbers give equal scenes.

    Births are of the kinds of `BIRTHS` in turn. All else is drawn: scan rate, survival, motion, one to three sensors
    with their measurements, views, noise, detection and clutter.
    """
    rng = np.random.default_rng([_STREAM, number])
    rate = float(rng.choice([1.0, 1.0, 2.0, 5.0, 10.0, 20.0]))  # scans a second
    num_steps = int(np.clip(round(SECONDS * rate), FEWEST_SCANS, MOST_SCANS))
    per_second = rate > 1.0 or bool(rng.integers(2))
    survival = float(rng.choice([0.9, 0.95, 0.98, 0.99, 0.995, 1.0]))
    num_sensors = int(rng.choice([1, 2, 3], p=[0.5, 0.3, 0.2]))
    kinds = list(BIRTHS)
    kind = kinds[(number - 1) % len(kinds)]
    period = {"period": 1.0} if per_second else {}
    fields: Fields = {
        "time.num_steps": num_steps,
        "time.step_period": 1.0 / rate,
        "motion": {
            "kind": "constant_velocity",
            "sigma_v": float(rng.uniform(0.5, 4.0)),
            "noise_model": "continuous_white",
        },
        "survival": {"kind": "constant", "probability": survival, **period},
        "sensors": [_sensor(s, num_sensors, rng) for s in range(num_sensors)],
        **BIRTHS[kind](rng, num_steps / rate if per_second else float(num_steps)),
        **{f"birth.{name}": value for name, value in period.items()},
    }
    sensors = "1 sensor" if num_sensors == 1 else f"{num_sensors} sensors"
    name = f"{number}: {kind}, {rate:g}/s, {sensors}"
    return own(name, fields, fusion={"kind": "sequential"} if num_sensors > 1 else None)


def apart(rng: Rng, periods: float) -> Fields:
    """Three to six sites anywhere, some of them maybe out of view."""
    places = rng.uniform(-400.0, 400.0, (int(rng.integers(3, 7)), 2))
    return _sites(rng, places, _expected(rng), periods)


def overlapping(rng: Rng, periods: float) -> Fields:
    """One to three groups of two to four sites, each one to two standard deviations from the middle of its group."""
    std, places = float(rng.uniform(10.0, 40.0)), []
    for centre in rng.uniform(-350.0, 350.0, (int(rng.integers(1, 4)), 2)):
        num = int(rng.integers(2, 5))
        angles, far = rng.uniform(0.0, 2.0 * math.pi, num), rng.uniform(1.0, 2.0, num) * std
        places.append(centre + np.column_stack([far * np.cos(angles), far * np.sin(angles)]))
    return _sites(rng, np.concatenate(places), _expected(rng), periods, std)


def weak(rng: Rng, periods: float) -> Fields:
    """Twenty to forty sites of small existence."""
    places = rng.uniform(-450.0, 450.0, (int(rng.integers(20, 41)), 2))
    return _sites(rng, places, _expected(rng), periods, most=0.05)


def anywhere(rng: Rng, periods: float) -> Fields:
    """Births anywhere in the region: a grid of weak sites that covers it.

    A section for births from an intensity over the region would take the place of these sites; `PriorTargets` would
    then have to draw such births, too.
    """
    a_side = int(rng.integers(5, 9))
    cell = 2.0 * HALF_SIDE / a_side
    middles = (np.arange(a_side) + 0.5) * cell - HALF_SIDE
    places = np.stack(np.meshgrid(middles, middles), axis=-1).reshape(-1, 2)
    return _sites(rng, places, _expected(rng), periods, 0.5 * cell, most=0.05, spread=1.0)


# Each is called with random numbers and the number of periods of birth (s, or else scans) in a run.
BIRTHS: dict[str, Callable[[Rng, float], Fields]] = {
    "apart": apart,
    "overlapping": overlapping,
    "weak": weak,
    "anywhere": anywhere,
}


def _expected(rng: Rng) -> float:
    """Draw the mean number of births in a run."""
    return float(np.exp(rng.uniform(math.log(4.0), math.log(20.0))))


def _sites(
    rng: Rng,
    places: np.ndarray,
    expected: float,
    periods: float,
    std: float | None = None,
    *,
    most: float = MOST,
    spread: float = 6.0,
) -> Fields:
    """Return sites at (num, 2) places with this mean number of births in a run, as far as existences allow.

    spread: largest ratio of their existences before they are held in [LEAST, most].
    """
    shares = np.exp(rng.uniform(0.0, math.log(spread), len(places))) if spread > 1.0 else np.ones(len(places))
    existence = np.clip(shares / shares.sum() * expected / periods, LEAST, most)
    speed = float(rng.uniform(2.0, 15.0))
    stds = rng.uniform(10.0, 40.0, len(places)) if std is None else np.full(len(places), std)
    given = zip(places.tolist(), stds.tolist(), existence.tolist(), strict=True)
    return {"birth.sites": [site(place, own_std, r, speed) for place, own_std, r in given]}


def _sensor(index: int, num_sensors: int, rng: Rng) -> Fields:
    """Draw one sensor."""
    position, towards = rng.uniform(-600.0, 600.0, 2), rng.uniform(-200.0, 200.0, 2)
    heading = math.degrees(math.atan2(*(towards - position)[::-1]))
    polar = bool(rng.integers(2))
    std = float(rng.uniform(5.0, 25.0))
    bearing_noise = {
        "kind": "range_dependent",
        "sigma_range": std,
        "sigma_bearing_deg": float(rng.uniform(0.5, 2.0)),
    }
    scans = {"scans": {"every": 2}} if num_sensors > 1 and index > 0 and rng.random() < 0.25 else {}
    return {
        "name": f"sensor {index + 1}",
        "position": position.tolist(),
        "heading_deg": heading,
        "measurement": {"kind": "bearing_range" if polar else "position"},
        "noise": bearing_noise if polar else {"kind": "constant", "std": [std, std]},
        "detection": _view(rng, float(rng.uniform(0.4, 0.98))),
        "clutter": {"kind": "region", "rate": float(np.exp(rng.uniform(0.0, math.log(60.0))))},
        **scans,
    }


def _view(rng: Rng, probability: float) -> Fields:
    """Draw what a sensor sees: everything, what is within a range, or a sector about its heading."""
    kind = str(rng.choice(["constant", "limited_range", "limited_sector"], p=[0.6, 0.2, 0.2]))
    view: Fields = {"kind": kind, "probability": probability}
    if kind == "limited_range":
        view["max_range"] = float(rng.uniform(400.0, 800.0))
    elif kind == "limited_sector":
        view |= {"max_range": float(rng.uniform(600.0, 1200.0)), "half_width_deg": float(rng.uniform(30.0, 90.0))}
    return view


def four_sites(detection: float, num_sensors: int = 1) -> Scene:
    """Return the scene of four sites far apart and position sensors that see everything."""
    places = [(200.0, 200.0), (-200.0, 200.0), (200.0, -200.0), (-200.0, -200.0)]
    fields = {
        "time.num_steps": 25,
        "motion.sigma_v": 2.0,
        "survival.probability": 0.95,
        "birth.sites": [site(place) for place in places],
        "sensors.*.detection.probability": detection,
        "sensors.*.clutter.rate": 10.0,
    }
    name = f"four sites, P_D {detection:g}" + (", 2 sensors" if num_sensors > 1 else "")
    return own(name, fields, num_sensors, {"kind": "sequential"} if num_sensors > 1 else None)
