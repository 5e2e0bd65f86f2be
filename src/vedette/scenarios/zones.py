"""The zones of a scenario, for drawings."""

from typing import NamedTuple

from vedette.scenarios.coastline import coastline
from vedette.scenarios.loading import Scenario
from vedette.scenarios.sections.deciding import KeepOut, StayInside
from vedette.scenarios.sections.world import RegionSection

REGION, NO_GO, INSIDE, HOLE = "region", "no-go zone", "sensors stay inside", "hole of a no-go zone"
COAST = "coastline"


class Zone(NamedTuple):
    """A part of the plane, such as a no-go zone: its kind, and its corners in order, m.

    The corners of a coastline are a line, which may be open.
    """

    kind: str
    corners: tuple[tuple[float, float], ...]


def zones(scenario: Scenario) -> tuple[Zone, ...]:
    """Return the coastline, the region, and the areas of the constraints on sensor positions."""
    model = scenario.model
    result = [Zone(COAST, line) for line in coastline(model, scenario.folder)]
    result.append(Zone(REGION, _region_corners(model.region)))
    for section in model.control.constraints:
        if isinstance(section, StayInside):
            result.append(Zone(INSIDE, _region_corners(section.region)))
        elif isinstance(section, KeepOut):
            result += [Zone(NO_GO, section.polygon or _region_corners(section.region))]
            result += [Zone(HOLE, hole) for hole in section.holes]
    return tuple(result)


def _region_corners(region: RegionSection | None) -> tuple[tuple[float, float], ...]:
    if region is None:
        return ()
    west, east, south, north = region.x_min, region.x_max, region.y_min, region.y_max
    return ((west, south), (east, south), (east, north), (west, north))
