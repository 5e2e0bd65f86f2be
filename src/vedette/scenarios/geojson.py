"""Zones from GeoJSON files: each polygon becomes a separate zone, with corners in metres."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import numpy as np

from vedette.errors import InputError
from vedette.internal.reading import parse_json, read_text
from vedette.kernels.base.types import Floats
from vedette.scenarios.diagnostics import Diagnostic, Path, describe
from vedette.scenarios.sections.places import read_origin

if TYPE_CHECKING:  # importing it imports the filters, which a check does not need
    from vedette.recorded import Origin

_MAX_BYTES = 20_000_000
_MAX_CORNERS = 50_000  # of all zones of a file: each corner is checked for every course of every sensor

_SIMPLE = ("Point", "MultiPoint", "LineString", "MultiLineString", "Polygon", "MultiPolygon")

Ring = list[list[float]]


def with_zones(data: Mapping[str, Any], folder: FilePath) -> tuple[Mapping[str, Any], list[Diagnostic]]:
    """Return a scenario's data with the polygons of its zones' GeoJSON files, and the faults of these files.

    The first polygon of a file replaces the zone that named it; the others come after all constraints, so that every
    other constraint keeps its index.
    """
    control = data.get("control")
    constraints = control.get("constraints") if isinstance(control, Mapping) else None
    if not isinstance(constraints, list | tuple) or not any(map(_names_file, constraints)):
        return data, []
    faults, in_place, appended = list[Diagnostic](), list[Any](), list[Any]()
    for i, constraint in enumerate(constraints):
        if not _names_file(constraint):
            in_place.append(constraint)
            continue
        path: Path = ("control", "constraints", i, "geojson")
        try:
            polygons = _read(constraint, read_origin(data), folder)
        except InputError as error:
            faults.append(Diagnostic(path, "a GeoJSON file of polygons", str(error)))
            polygons = [[[[0.0, 0.0], [1e3, 0.0], [0.0, 1e3]]]]
        zones = [{"kind": "keep_out", "polygon": rings[0], "holes": rings[1:]} for rings in polygons]
        in_place.append(zones[0])
        appended += zones[1:]
    return {**data, "control": {**control, "constraints": [*in_place, *appended]}}, faults  # type: ignore[dict-item]


def _names_file(constraint: Any) -> bool:
    if not isinstance(constraint, Mapping) or constraint.get("kind") != "keep_out":
        return False
    given = {key for key, value in constraint.items() if value is not None}
    return "geojson" in given and not {"region", "polygon"} & given


def _read(constraint: Mapping[str, Any], origin: Origin | None, folder: FilePath) -> list[list[Ring]]:
    """Return the outer ring of each polygon and then its holes, m."""
    if origin is None:
        raise InputError("longitudes and latitudes, of which the scenario has no valid `origin`")
    name = constraint["geojson"]
    polygons = (
        polygon
        for geometry in geometries(name, folder)
        for polygon in (geometry["coordinates"] if geometry["type"] == "MultiPolygon" else [geometry["coordinates"]])
        if geometry["type"].endswith("Polygon")
    )
    rings_of_polygons = [
        [_in_metres(ring, origin, name) for ring in as_list(polygon)] for polygon in polygons if polygon
    ]
    if not rings_of_polygons:
        raise InputError(f"{describe(name)}: no polygon in it")
    if (number := sum(len(ring) for rings in rings_of_polygons for ring in rings)) > _MAX_CORNERS:
        raise InputError(f"{describe(name)}: {number} corners in it, above {_MAX_CORNERS} (simplify it)")
    return rings_of_polygons


def geometries(name: Any, folder: FilePath) -> Iterator[Mapping[str, Any]]:
    """Yield the points, lines and polygons of a GeoJSON file, at any depth, with lists of coordinates.

    Raises `InputError` for a name that is not text, a file that does not exist, or one that is not GeoJSON.
    """
    if not isinstance(name, str) or not os.path.isfile(folder / name):
        raise InputError(f"{describe(name)}: no such file")
    try:
        content = parse_json(read_text(folder / name, "GeoJSON file", _MAX_BYTES))
    except ValueError as error:
        raise InputError(f"{describe(name)}: {error}") from None
    return _geometries_in(content, name)


def as_list(value: Any) -> list[Any]:
    """Return the value if it is a list, else an empty list."""
    return value if isinstance(value, list) else []


def _geometries_in(content: Any, name: str) -> Iterator[Mapping[str, Any]]:
    kind = content.get("type") if isinstance(content, Mapping) else None
    if kind == "FeatureCollection":
        for feature in as_list(content.get("features")):
            yield from _geometries_in(feature, name)
    elif kind == "Feature":
        if content.get("geometry") is not None:
            yield from _geometries_in(content["geometry"], name)
    elif kind == "GeometryCollection":
        for geometry in as_list(content.get("geometries")):
            yield from _geometries_in(geometry, name)
    elif kind in _SIMPLE:
        yield {"type": kind, "coordinates": as_list(content.get("coordinates"))}
    else:
        raise InputError(f"{describe(name)}: no GeoJSON: type {describe(kind)}")


def _in_metres(ring: Any, origin: Origin, name: str) -> Ring:
    """Return a ring in metres, without its last corner, which repeats the first."""
    degrees = degrees_of(ring, name, "a ring")
    if len(degrees) < 4 or (degrees[0] != degrees[-1]).any():
        raise InputError(f"{describe(name)}: a ring of {len(degrees)} corners, or not closed")
    corners: Ring = origin.to_plane(*degrees[:-1].T).tolist()
    return corners


def degrees_of(places: Any, name: str, kind: str) -> Floats:
    """Return longitudes and latitudes, shape (n, 2), of a line or ring, called `kind` in messages."""
    try:
        degrees = np.array([[float(place[0]), float(place[1])] for place in places], np.float64).reshape(-1, 2)
    except (TypeError, ValueError, IndexError, KeyError):
        degrees = np.empty((0, 2))
    if len(degrees) < 2:
        raise InputError(f"{describe(name)}: {kind} whose places are not several [longitude, latitude]")
    if not (np.abs(degrees) <= [360.0, 90.0]).all():  # also False for NaN
        raise InputError(f"{describe(name)}: places that are no degrees of longitude and latitude")
    return degrees
