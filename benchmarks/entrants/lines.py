"""What these entrants share: lines of JSON in and out, and what a scene says of its sensors. Without Vedette."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable
from typing import Any

Told = dict[str, Any]


def serve(begin: Callable[[Told], Callable[[Told], Told]]) -> None:
    """Answer every line: the first says what the scene is, the others ask."""
    # What a library prints is no answer.
    out, sys.stdout = sys.stdout, sys.stderr
    answer: Callable[[Told], Told] | None = None
    for line in sys.stdin:
        told = json.loads(line)
        if answer is None:
            answer, said = begin(told), {"ready": True}
        else:
            said = answer(told)
        print(json.dumps(said), file=out, flush=True)


def noise_std(sensor: Told, pose: list[float], place: list[float]) -> list[float]:
    """Standard deviations of a measurement of a target at that place; of a bearing in radians."""
    noise = sensor["noise"]
    if noise["kind"] == "constant":
        degrees = sensor["measurement"]["kind"] != "position"
        return [math.radians(own) if degrees and i == 0 else own for i, own in enumerate(noise["std"])]
    gap = math.hypot(place[0] - pose[0], place[1] - pose[1])
    bearing = math.radians(noise["sigma_bearing_deg"]) + noise["eta_bearing"] * gap
    return [bearing, noise["sigma_range"] + noise["eta_range"] * gap**2]


def place_of(sensor: Told, pose: list[float], measured: list[float]) -> list[float]:
    """Where a measurement says that the target is."""
    if sensor["measurement"]["kind"] == "position":
        return measured
    bearing, gap = measured
    return [pose[0] + gap * math.cos(bearing), pose[1] + gap * math.sin(bearing)]


def sees(sensor: Told, pose: list[float], place: list[float]) -> bool:
    """Whether a place is within the range and the sector of a sensor; True where it has neither."""
    view = sensor["detection"]
    dx, dy = place[0] - pose[0], place[1] - pose[1]
    if math.hypot(dx, dy) > view.get("max_range", math.inf):
        return False
    pointing = pose[3] if view["kind"] == "camera" else pose[2]
    half = pose[4] if view["kind"] == "camera" else math.radians(view.get("half_width_deg", 180.0))
    off = math.remainder(math.atan2(dy, dx) - pointing, 2.0 * math.pi)
    return abs(off) <= half + 1e-9


def clutter_density(sensor: Told, region: Told) -> float:
    """False measurements a unit of the measurement space."""
    clutter, kind = sensor["clutter"], sensor["measurement"]["kind"]
    width, height = region["x_max"] - region["x_min"], region["y_max"] - region["y_min"]
    if clutter["kind"] == "around_sensor":
        if clutter["half_side"]:
            return float(clutter["rate"]) / (2.0 * clutter["half_side"]) ** 2
        return float(clutter["rate"]) / (math.radians(clutter["half_width_deg"]) * clutter["radius"] ** 2)
    if kind == "position":
        return float(clutter["rate"]) / (width * height)
    return float(clutter["rate"]) / (2.0 * math.pi * math.hypot(width, height))
