"""Warnings of moving sensors that start at a place that the constraints forbid."""

from collections.abc import Iterator, Sequence

import numpy as np

from vedette.scenarios.diagnostics import Path
from vedette.scenarios.loading import Scenario
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
