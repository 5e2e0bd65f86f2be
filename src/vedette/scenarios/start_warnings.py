"""Warnings of sensors at their start: at a forbidden place, or without a place that another one sees."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from vedette.scenarios.diagnostics import Path
from vedette.scenarios.loading import Scenario
from vedette.scenarios.sections import ScenarioModel
from vedette.scenarios.sections.field_of_view import FieldOfView, field_of_view
from vedette.scenarios.sections.sensors import Sensor
from vedette.scenarios.zones import COAST, HOLE, INSIDE, NO_GO, zones


def start_warnings(scenario: Scenario) -> Iterator[tuple[Path, str]]:
    """A warning for each sensor that can move and starts inside `keep_out`, outside `stay_inside`, or on drawn land."""
    areas = [(zone.kind, zone.corners) for zone in zones(scenario)]
    for i, sensor in enumerate(scenario.model.sensors):
        if _moves(sensor) and (where := _describe_fault(sensor.position, areas)):
            x, y = sensor.position
            place = f"sensors[{i}].position: expected a place where the sensor may be; ({x:g}, {y:g}) is {where}"
            yield ("sensors", i, "position"), place


def _describe_fault(place: tuple[float, float], areas: Sequence[tuple[str, Sequence[tuple[float, float]]]]) -> str:
    """Describe where a place lies if a moving sensor should not start there, and the consequence; "" if it may.

    The edges of `keep_out` and of its holes are forbidden, that of `stay_inside` is not.
    """
    containing = {kind for kind, corners in areas if _is_inside(*place, corners)}
    edges = {kind for kind, corners in areas if kind != COAST and _is_on_edge(*place, corners)}
    outside = any(k == INSIDE and not (_is_inside(*place, c) or _is_on_edge(*place, c)) for k, c in areas)
    follows = "and its first decisions lead it back as far as they can"
    if edges & {NO_GO, HOLE}:
        return f"on the edge of an area that control.constraints keep it out of, {follows}"
    if NO_GO in containing and HOLE not in containing:
        return f"inside an area that control.constraints keep it out of, {follows}"
    if outside:
        return f"outside the area that control.constraints keep it inside, {follows}"
    rings = [corners for kind, corners in areas if kind == COAST and corners[0] == corners[-1]]
    if NO_GO not in {kind for kind, _ in areas} and sum(_is_inside(*place, ring) for ring in rings) % 2:
        return (
            "inside a closed line of the coastline, which is only drawn: keep_out in control.constraints keeps it off"
        )
    return ""


def _moves(sensor: Sensor) -> bool:
    """Return True if the platform, or the carrier of a camera, can move."""
    platform = sensor.platform
    if platform.kind == "camera":
        platform = getattr(platform, "platform", None) or platform
    return platform.kind not in ("stationary", "camera")


def _is_inside(x: float, y: float, corners: Sequence[tuple[float, float]]) -> bool:
    """Return True if a ray to the east crosses the edges of a polygon an odd number of times."""
    (x1, y1), (x2, y2) = np.array(corners).T, np.roll(np.array(corners), -1, axis=0).T
    spans = (y1 > y) != (y2 > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = x1 + (y - y1) / (y2 - y1) * (x2 - x1)
    return bool((spans & (x < crossing)).sum() % 2)


def _is_on_edge(x: float, y: float, corners: Sequence[tuple[float, float]]) -> bool:
    """Return True if a place is on an edge of a polygon, to within rounding."""
    starts = np.array(corners)
    along, off = np.roll(starts, -1, axis=0) - starts, np.array([x, y]) - starts
    lengths = np.maximum((along**2).sum(axis=1), np.finfo(np.float64).tiny)
    nearest = np.clip((off * along).sum(axis=1) / lengths, 0.0, 1.0)[:, np.newaxis] * along
    size = float(np.abs(starts).max(initial=1.0))
    return bool((np.hypot(*(off - nearest).T) <= 1e-12 * size).any())


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
