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
from vedette.scenarios.diagnostics import Finding, Path, describe
from vedette.scenarios.geojson import as_list, degrees_of, geometries
from vedette.scenarios.sections import ScenarioModel

if TYPE_CHECKING:  # importing it imports the filters, which a check does not need
    from vedette.recorded import Origin

Line: TypeAlias = tuple[tuple[float, float], ...]
_MIN_SPACING = 1e-4  # of the extent: points nearer than that are one
_MAX_POINTS = 10_000  # of all lines; a finer coastline is drawn more coarsely
_MAX_ANGLE_DEG = 60.0  # from the origin: places beyond this do not lie in its plane


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
    raw_lines = [line for geometry in geometries(name, folder) for line in _lines(geometry)]
    if not raw_lines:
        raise InputError(f"{describe(name)}: no line and no polygon in it")
    lines = [part for line in raw_lines for part in _in_plane(degrees_of(line, name, "a line"), origin)]
    lines = [part for line in lines for part in _retained_parts(line, _meets_box(line, low, high))]
    spacing = _MIN_SPACING * float((high - low).max())
    while (
        sum(map(len, lines := [_thin(line, spacing) for line in lines if np.ptp(line, axis=0).max() >= spacing]))
        > _MAX_POINTS
    ):
        spacing *= 2.0
    return tuple(tuple(map(tuple, line.tolist())) for line in lines)


def _lines(geometry: Any) -> list[Any]:
    """Return the lines of a geometry, or the rings of its polygons; none for points."""
    coordinates: list[Any] = geometry["coordinates"]
    several = {"LineString": [coordinates], "MultiLineString": coordinates, "Polygon": coordinates}
    if geometry["type"] == "MultiPolygon":
        return [ring for polygon in coordinates for ring in as_list(polygon)]
    return several.get(geometry["type"], [])


def _in_plane(degrees: Floats, origin: Origin) -> Iterator[Floats]:
    """Yield the parts of a line that lie in the plane of the origin, m."""
    lon, lat = np.radians(degrees.T)
    lon0, lat0 = np.radians([origin.longitude_deg, origin.latitude_deg])
    cosines = np.sin(lat) * np.sin(lat0) + np.cos(lat) * np.cos(lat0) * np.cos(lon - lon0)
    near = cosines > np.cos(np.radians(_MAX_ANGLE_DEG))
    for part in _retained_parts(degrees, near[:-1] & near[1:]):
        yield origin.to_plane(*part.T)


def _meets_box(line: Floats, low: Floats, high: Floats) -> Bools:
    """Return True for each segment whose bounding box meets the given box, shape (n - 1,)."""
    lower, upper = np.minimum(line[:-1], line[1:]), np.maximum(line[:-1], line[1:])
    return np.asarray((upper >= low).all(axis=1) & (lower <= high).all(axis=1))


def _retained_parts(points: Floats, retained: Bools) -> Iterator[Floats]:
    """Yield the lines that the retained segments form."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], retained, [False]]).astype(np.int8)))
    for first, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        yield points[first : end + 1]


def _thin(line: Floats, spacing: float) -> Floats:
    """Return a line without points nearer than `spacing` to the last retained one; its ends stay."""
    retained = [0]
    for i in range(1, len(line) - 1):
        if np.abs(line[i] - line[retained[-1]]).max() >= spacing:
            retained.append(i)
    return line[[*retained, len(line) - 1]]


def coastline_findings(model: ScenarioModel, folder: FilePath) -> Iterator[Finding]:
    """Yield a fault if the coastline file cannot be read."""
    try:
        coastline(model, folder)
    except InputError as error:
        yield ("coastline",), "a GeoJSON file of lines or polygons", str(error)


def coastline_warnings(model: ScenarioModel, folder: FilePath) -> Iterator[tuple[Path, str]]:
    """Yield a warning if no line of the coastline is near the region, which is probably a mistake."""
    if model.coastline is not None and not coastline(model, folder):
        hint = "are longitudes and latitudes exchanged?"
        yield ("coastline",), f"coastline: nothing of it is near region and sensors, and none is drawn ({hint})"
