"""Warnings of moving sensors that start where the constraints do not let them be."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from vedette.scenarios.faults import Path
from vedette.scenarios.loading import Scenario
from vedette.scenarios.sections.sensors import Sensor
from vedette.scenarios.views import HOLE, INSIDE, NO_GO, zones


def start_cautions(scenario: Scenario) -> Iterator[tuple[Path, str]]:
    """A warning for each sensor that can move and starts inside `keep_out` or outside `stay_inside`."""
    areas = [(zone.kind, zone.corners) for zone in zones(scenario)]
    for i, sensor in enumerate(scenario.model.sensors):
        if not _moves(sensor):
            continue
        x, y = sensor.position
        found = {kind for kind, corners in areas if _is_inside(x, y, corners)}
        outside = any(kind == INSIDE and not _is_inside(x, y, corners) for kind, corners in areas)
        if NO_GO in found and HOLE not in found:
            where = "inside an area that control.constraints keep it out of"
        elif outside:
            where = "outside the area that control.constraints keep it inside"
        else:
            continue
        place = f"sensors[{i}].position: expected a place where the sensor may be; ({x:g}, {y:g}) is {where}"
        yield ("sensors", i, "position"), f"{place}, and its first decisions lead it back as far as they can"


def _moves(sensor: Sensor) -> bool:
    """Whether the platform, or the carrier of a camera, can move."""
    platform = sensor.platform
    if platform.kind == "camera":
        platform = getattr(platform, "carrier", None) or platform
    return platform.kind not in ("still", "camera")


def _is_inside(x: float, y: float, corners: Sequence[tuple[float, float]]) -> bool:
    """Whether a ray to the east crosses the edges of a polygon an odd number of times."""
    (x1, y1), (x2, y2) = np.array(corners).T, np.roll(np.array(corners), -1, axis=0).T
    spans = (y1 > y) != (y2 > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = x1 + (y - y1) / (y2 - y1) * (x2 - x1)
    return bool((spans & (x < crossing)).sum() % 2)
