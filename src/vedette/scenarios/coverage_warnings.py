"""Warnings of sensors of a recording whose given coverages have no place in common."""

import math
from collections.abc import Iterator

import numpy as np

from vedette.scenarios.diagnostics import Path
from vedette.scenarios.sections import ScenarioModel
from vedette.scenarios.sections.field_of_view import FieldOfView, field_of_view
from vedette.scenarios.sections.sensors import Sensor

_POINTS_PER_SIDE = 21


def coverage_warnings(model: ScenarioModel) -> Iterator[tuple[Path, str]]:
    """Yield a warning of each sensor of a recording whose given coverage meets that of no other sensor."""
    views = [field_of_view(sensor) for sensor in model.sensors]
    if model.recording is None or len(views) < 2:
        return
    for s, (sensor, own) in enumerate(zip(model.sensors, views, strict=True)):
        others = [(model.sensors[t], views[t]) for t in range(len(views)) if t != s]
        if (
            own is None
            or sensor.platform.top_speed > 0.0
            or any(_views_overlap(sensor, own, *other) for other in others)
        ):
            continue
        names = model.sensor_names
        subject = f"{names[s]} and the other sensors" if len(names) > 2 else f"{names[0]} and {names[1]}"
        yield (
            ("sensors", s, "detection"),
            f"{subject} see no place in common, as far as positions, headings and ranges of detection say: check "
            "units, north and places",
        )
        if len(names) == 2:  # the warning holds for the other sensor, too
            return


def _views_overlap(first: Sensor, first_view: FieldOfView, second: Sensor, second_view: FieldOfView | None) -> bool:
    """Return True if two sensors see a common place from their start, or if the other one moves or has no edge."""
    if second_view is None or second.platform.top_speed > 0.0:
        return True
    shares = np.linspace(0.0, 1.0, _POINTS_PER_SIDE)
    radii, angles = np.meshgrid(
        first_view.reach * shares, first_view.middle + first_view.half_width * (2.0 * shares - 1.0)
    )
    points = np.array(first.position) + np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=-1).reshape(
        -1, 2
    )
    offsets = points - np.array(second.position)
    deviations = np.abs(
        np.remainder(np.arctan2(offsets[:, 1], offsets[:, 0]) - second_view.middle + math.pi, 2.0 * math.pi) - math.pi
    )
    return bool(((np.hypot(*offsets.T) <= second_view.reach) & (deviations <= second_view.half_width)).any())
