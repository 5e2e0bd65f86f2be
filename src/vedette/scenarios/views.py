"""What a sensor sees where its view ends: for checks, which compile nothing, and for drawings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from vedette.scenarios.coastline import coastline
from vedette.scenarios.loading import Scenario
from vedette.scenarios.sections.deciding import KeepOut, StayInside
from vedette.scenarios.sections.sensors import Sensor
from vedette.scenarios.sections.world import RegionSection

REGION, NO_GO, INSIDE, HOLE = "region", "no-go zone", "sensors stay inside", "hole of a no-go zone"
COAST = "coastline"


class FieldOfView(NamedTuple):
    """A sector of a disc around a sensor: middle and half width in rad, reach in m, probability within it."""

    middle: float
    half_width: float
    reach: float
    probability: float


class Zone(NamedTuple):
    """A part of the plane, such as where no sensor may go: what it is, and its corners in order, m.

    Of a coastline they are a line, which ends where it ends.
    """

    kind: str
    corners: tuple[tuple[float, float], ...]


def zones(scenario: Scenario) -> tuple[Zone, ...]:
    """The coastline, the region, and what constraints say of where sensors may be."""
    model = scenario.model
    found = [Zone(COAST, line) for line in coastline(model, scenario.folder)]
    found.append(Zone(REGION, _corners(model.region)))
    for section in model.control.constraints:
        if isinstance(section, StayInside):
            found.append(Zone(INSIDE, _corners(section.region)))
        elif isinstance(section, KeepOut):
            found += [Zone(NO_GO, section.polygon or _corners(section.region))]
            found += [Zone(HOLE, hole) for hole in section.holes]
    return tuple(found)


def _corners(region: RegionSection | None) -> tuple[tuple[float, float], ...]:
    if region is None:
        return ()
    west, east, south, north = region.x_min, region.x_max, region.y_min, region.y_max
    return ((west, south), (east, south), (east, north), (west, north))


def field_of_view(sensor: Sensor, pose: Sequence[float] | None = None) -> FieldOfView | None:
    """Of a sensor at a pose, or where it starts; None where its view has no edge, or is of the user's own.

    The edge of a soft sector is where half of its probability is left.
    """
    section, at = sensor.detection, sensor.pose if pose is None else pose
    if section.kind == "limited_range":
        return FieldOfView(at[2], math.pi, section.max_range, section.probability)
    if section.kind in ("limited_sector", "soft_sector"):
        return FieldOfView(at[2], math.radians(section.half_width_deg), section.max_range, section.probability)
    if section.kind == "camera" and len(at) >= 5:
        reference, width = section.reference_half_width_deg, at[4]
        reach = section.max_range * (math.radians(reference) / width if reference is not None and width > 0.0 else 1.0)
        return FieldOfView(at[3], width, reach, section.probability)
    return None
