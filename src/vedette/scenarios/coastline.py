"""The coastline in figures: lines from a GeoJSON file, cut to about the area that a figure shows."""

from __future__ import annotations

import os
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from vedette.errors import InputError
from vedette.kernels.base.types import Bools, Floats
from vedette.scenarios.faults import Finding, Path, describe
from vedette.scenarios.geojson import geometries, listed
from vedette.scenarios.sections import ScenarioModel

if TYPE_CHECKING:  # importing it imports the filters, which a check does not need
    from vedette.recorded import Origin

Line: TypeAlias = tuple[tuple[float, float], ...]
_FINEST = 1e-4  # of the extent: points nearer than that are one
_MOST_POINTS = 10_000  # of all lines; a finer coastline is drawn more coarsely
_FARTHEST_DEG = 60.0  # from the origin: places beyond this do not lie in its plane


def coastline(model: ScenarioModel, folder: FilePath) -> tuple[Line, ...]:
    """Return the lines of the coastline in the plane, m, as far as they are near the region and the sensors.

    Near means at most the larger side of the region away from them. folder: to which the file is relative. Raises
    `InputError` for a file that cannot be read.
    """
    if model.coastline is None:
        return ()
    if model.origin is None:
        raise InputError("longitudes and latitudes, of which the scenario has no `origin`")
    region = model.region
    places = np.array(
        [[region.x_min, region.y_min], [region.x_max, region.y_max], *(s.position for s in model.sensors)]
    )
    side = max(region.x_max - region.x_min, region.y_max - region.y_min)
    low, high = places.min(axis=0) - side, places.max(axis=0) + side
    try:
        state = os.stat(folder / model.coastline)
    except (OSError, ValueError):
        raise InputError(f"{describe(model.coastline)}: no such file") from None
    box = (*low.tolist(), *high.tolist())
    return _read(model.coastline, folder, (state.st_mtime_ns, state.st_size), model.origin.build(), box)


@lru_cache(maxsize=4)
def _read(
    name: str, folder: FilePath, changed: tuple[int, int], origin: Origin, box: tuple[float, ...]
) -> tuple[Line, ...]:
    low, high = np.array(box[:2]), np.array(box[2:])
    given = [line for geometry in geometries(name, folder) for line in _lines(geometry)]
    if not given:
        raise InputError(f"{describe(name)}: no line and no polygon in it")
    lines = [part for line in given for part in _in_plane(_degrees(line, name), origin)]
    lines = [part for line in lines for part in _runs(line, _near(line, low, high))]
    least = _FINEST * float((high - low).max())
    while sum(map(len, lines := [_thinned(line, least) for line in lines if _size(line) >= least])) > _MOST_POINTS:
        least *= 2.0
    return tuple(tuple(map(tuple, line.tolist())) for line in lines)


def _lines(geometry: Any) -> list[Any]:
    """Return the lines of a geometry, or the rings of its polygons; none for points."""
    coordinates: list[Any] = geometry["coordinates"]
    several = {"LineString": [coordinates], "MultiLineString": coordinates, "Polygon": coordinates}
    if geometry["type"] == "MultiPolygon":
        return [ring for polygon in coordinates for ring in listed(polygon)]
    return several.get(geometry["type"], [])


def _degrees(line: Any, name: str) -> Floats:
    """Longitudes and latitudes, shape (n, 2)."""
    try:
        found = np.array([[float(place[0]), float(place[1])] for place in line], np.float64).reshape(-1, 2)
    except (TypeError, ValueError, IndexError, KeyError):
        found = np.empty((0, 2))
    if len(found) < 2:
        raise InputError(f"{describe(name)}: a line whose places are not several [longitude, latitude]")
    if not (np.abs(found) <= [360.0, 90.0]).all():  # also False for NaN
        raise InputError(f"{describe(name)}: places that are no degrees of longitude and latitude")
    return found


def _in_plane(degrees: Floats, origin: Origin) -> Iterator[Floats]:
    """Yield the parts of a line that lie in the plane of the origin, m."""
    lon, lat = np.radians(degrees.T)
    lon0, lat0 = np.radians([origin.longitude_deg, origin.latitude_deg])
    cosines = np.sin(lat) * np.sin(lat0) + np.cos(lat) * np.cos(lat0) * np.cos(lon - lon0)
    near = cosines > np.cos(np.radians(_FARTHEST_DEG))
    for part in _runs(degrees, near[:-1] & near[1:]):
        yield origin.to_plane(*part.T)


def _near(line: Floats, low: Floats, high: Floats) -> Bools:
    """Return True for each segment whose bounding box meets the given box, shape (n - 1,)."""
    least, most = np.minimum(line[:-1], line[1:]), np.maximum(line[:-1], line[1:])
    return np.asarray((most >= low).all(axis=1) & (least <= high).all(axis=1))


def _runs(points: Floats, kept: Bools) -> Iterator[Floats]:
    """Yield the lines that the retained segments form."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], kept, [False]]).astype(np.int8)))
    for first, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        yield points[first : end + 1]


def _size(line: Floats) -> float:
    return float((line.max(axis=0) - line.min(axis=0)).max())


def _thinned(line: Floats, least: float) -> Floats:
    """Return a line without points nearer than `least` to the last retained one; its ends stay."""
    kept = [0]
    for i in range(1, len(line) - 1):
        if np.abs(line[i] - line[kept[-1]]).max() >= least:
            kept.append(i)
    return line[[*kept, len(line) - 1]]


def coastline_findings(model: ScenarioModel, folder: FilePath) -> Iterator[Finding]:
    """Yield a fault if the coastline file cannot be read."""
    try:
        coastline(model, folder)
    except InputError as error:
        yield ("coastline",), "a GeoJSON file of lines or polygons", str(error)


def coastline_cautions(model: ScenarioModel, folder: FilePath) -> Iterator[tuple[Path, str]]:
    """Yield a warning if no line of the coastline is near the region, which is probably a mistake."""
    if model.coastline is not None and not coastline(model, folder):
        meant = "are longitudes and latitudes exchanged?"
        yield ("coastline",), f"coastline: nothing of it is near region and sensors, and none is drawn ({meant})"
