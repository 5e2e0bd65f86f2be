"""Places on the Earth in a scenario with an origin: places in degrees may be given in place of metres."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import Field

from vedette.errors import InputError
from vedette.scenarios.diagnostics import Finding, Path, describe
from vedette.scenarios.sections.base import Section, sections_in
from vedette.scenarios.sections.birth import BirthSite
from vedette.scenarios.sections.deciding import KeepOut
from vedette.scenarios.sections.platforms import Waypoints
from vedette.scenarios.sections.sensors import Sensor
from vedette.scenarios.sections.targets import PoissonTargets, ScriptedTarget
from vedette.scenarios.sections.world import RegionSection

if TYPE_CHECKING:  # importing it imports further packages, which a check does not need
    from vedette.recorded import Origin

_PLACE = {"lon", "lat"}
_BOX = ("lon_min", "lon_max", "lat_min", "lat_max")
_NODES = 33  # points on each edge of a box of degrees, which is not a rectangle in the plane
# Numbers this near to the origin's degrees count as degrees, unless the origin is near (0, 0).
_NEAR_DEG = 2.0


class OriginSection(Section):
    """Where x = y = 0 lies on the Earth (WGS 84), x to the east and y to the north in the plane that touches it there.

    Wherever a place in metres is read, `{lon: , lat: }` in degrees may then stand, also as the first entry of a state;
    and a region may be `{lon_min: , lon_max: , lat_min: , lat_max: }`.
    """

    lon: float = Field(ge=-360.0, le=360.0, description="Longitude to the east [deg].")
    lat: float = Field(ge=-90.0, le=90.0, description="Latitude to the north [deg].")

    def build(self) -> Origin:
        """Return the origin."""
        from vedette.recorded import Origin

        return Origin(self.lon, self.lat)


def in_metres(data: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return a scenario's data with its places in metres; unchanged without a readable origin.

    An invalid place stays, and is reported by the section that reads it.
    """
    origin = read_origin(data)
    if origin is None:
        return data
    return {key: value if key == "origin" else _converted(value, origin) for key, value in data.items()}


def read_origin(data: Mapping[str, Any]) -> Origin | None:
    """Return the origin of a scenario's data; None if it has none, or one that cannot be read."""
    try:
        return OriginSection.model_validate(data.get("origin")).build()
    except ValueError:
        return None


def is_place(value: Any) -> bool:
    """Return True if the value is written as a place in degrees."""
    return isinstance(value, Mapping) and bool(_PLACE & set(value) or set(_BOX) & set(value))


def _converted(value: Any, origin: Origin) -> Any:
    if isinstance(value, Mapping):
        if set(value) == _PLACE:
            try:
                return origin.to_plane([value["lon"]], [value["lat"]])[0].tolist() if _is_on_earth(value) else value
            except InputError:
                return value
        if set(value) == set(_BOX):
            return _region(value, origin)
        return {key: _converted(item, origin) for key, item in value.items()}
    if isinstance(value, list | tuple):
        items = [_converted(item, origin) for item in value]
        if items and is_place(value[0]) and not any(map(is_place, value[1:])) and len(value) > 1:
            return [*items[0], *items[1:]] if isinstance(items[0], list) else items  # a state
        return items
    return value


def _is_on_earth(place: Mapping[str, Any]) -> bool:
    numbers = [place[key] for key in place]
    if not all(isinstance(number, int | float) and not isinstance(number, bool) for number in numbers):
        return False
    return all(abs(number) <= (360.0 if key.startswith("lon") else 90.0) for key, number in place.items())


def _region(box: Mapping[str, Any], origin: Origin) -> Any:
    """Return the rectangle around a box of degrees."""
    if _is_on_earth(box) and box["lon_max"] < box["lon_min"] and box["lon_max"] + 180.0 < box["lon_min"]:
        box = {**box, "lon_max": box["lon_max"] + 360.0}  # across 180 degrees
    if box["lon_max"] <= box["lon_min"] or box["lat_max"] <= box["lat_min"]:
        return box
    shares = np.linspace(0.0, 1.0, _NODES)
    lon, lat = (box[f"{name}_min"] + shares * (box[f"{name}_max"] - box[f"{name}_min"]) for name in ("lon", "lat"))
    try:
        edges = origin.to_plane(
            np.concatenate([lon, lon, np.full(_NODES, lon[0]), np.full(_NODES, lon[-1])]),
            np.concatenate([np.full(_NODES, lat[0]), np.full(_NODES, lat[-1]), lat, lat]),
        )
    except InputError:
        return box
    (x_min, y_min), (x_max, y_max) = edges.min(axis=0).tolist(), edges.max(axis=0).tolist()
    return {"x_min": x_min, "x_max": x_max, "y_min": y_min, "y_max": y_max}


def misplaced_findings(scenario: Section, origin: OriginSection | None) -> Iterator[Finding]:
    """Yield faults of places in metres that must be degrees, near the origin's degrees, and of places too far away."""
    if origin is None:
        return
    from vedette.recorded.geography import PLANE_REACH

    is_origin_far = max(abs(origin.lon), abs(origin.lat)) > 2.0 * _NEAR_DEG
    wanted = "metres from the origin, or a place {lon: , lat: } in degrees"
    near = f"places within {PLANE_REACH / 1000.0:g} km of the origin"
    for path, section in sections_in(scenario):
        for inside, points in _points_of(section):
            far = [(x, y) for x, y in points if max(abs(x), abs(y)) > PLANE_REACH]
            if far:
                x, y = far[0]
                got = f"x {x / 1000.0:.0f} km, y {y / 1000.0:.0f} km (are lon and lat exchanged, here or in `origin`?)"
                yield (*path, *inside), near, got
            elif (
                is_origin_far
                and points
                and all(abs(x - origin.lon) < _NEAR_DEG and abs(y - origin.lat) < _NEAR_DEG for x, y in points)
            ):
                yield (*path, *inside), wanted, f"{describe(points[0][0])}, {describe(points[0][1])}"


def _points_of(section: Section) -> Iterator[tuple[Path, Sequence[tuple[float, float]]]]:
    """Yield the places that a section itself names, each with its path in it."""
    if isinstance(section, Sensor):
        yield ("position",), [section.position]
    elif isinstance(section, RegionSection):
        yield (), [(section.x_min, section.y_min), (section.x_max, section.y_max)]
    elif isinstance(section, KeepOut):
        yield ("polygon",), section.polygon or ()
    elif isinstance(section, Waypoints):
        yield ("points",), section.points
    elif isinstance(section, BirthSite | PoissonTargets):
        yield ("mean",), [section.mean[:2]]  # type: ignore[list-item]
    elif isinstance(section, ScriptedTarget):
        yield ("state",), [section.state[:2]]  # type: ignore[list-item]
