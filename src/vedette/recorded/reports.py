"""Recorded positions of real targets: columns of a table as checked arrays."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vedette.errors import InputError
from vedette.internal.quantities import HEIGHTS
from vedette.internal.text import join_alternatives
from vedette.kernels.base.types import Floats, Ints
from vedette.recorded.conventions import ONE_PLACE, ONE_PLACE_SHARE, OTHER_NAMES
from vedette.recorded.geography import Origin
from vedette.recorded.opensky import is_opensky, of_opensky
from vedette.recorded.tables import FARTHEST, Table, is_empty

_USED = ("time", "id", "x", "y", "longitude", "latitude", "vx", "vy", "altitude")
_SAME_TIME = 1e-6  # s; two reports of one target nearer in time than this count as one


@dataclass(frozen=True, slots=True, eq=False)
class Reports:
    """Positions of targets, sorted by target and time.

    Attributes:
        times: (n,) s. For ISO 8601 times, seconds since 1970 UTC.
        tracks: (n,) index into `names`.
        positions: (n, 2) m.
        velocities: (n, 2) m/s along x and y of the plane, or None if the record has none.
        altitudes: (n,) m, or None if the record has none.
        names: of each target in the record.
        origin_deg: longitude and latitude of (0, 0) if the record was geographic, else None.
        bounds_deg: its smallest and largest longitude and latitude if it was geographic, else None.
        repeats: rows of the table (retained, left out) of second reports of a target at one time.
        unused: columns of the table that were not read.
        notes: warnings of the table.
        sha256: of the table.
    """

    times: Floats
    tracks: Ints
    positions: Floats
    velocities: Floats | None
    altitudes: Floats | None
    names: tuple[str, ...]
    origin_deg: tuple[float, float] | None
    bounds_deg: tuple[tuple[float, float], tuple[float, float]] | None = None
    repeats: tuple[tuple[int, int], ...] = ()
    unused: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    sha256: str = ""


def parse_reports(
    table: Table,
    *,
    columns: Mapping[str, str] | None = None,
    origin_deg: tuple[float, float] | None = None,
    usual_origin_deg: tuple[float, float] | None = None,
) -> Reports:
    """Return reports from a table with columns time, id and x, y or longitude, latitude, and vx, vy, altitude if given.

    In a geographic record `vx` and `vy` are to true east and north at the place of each report.

    Args:
        table: see `read_table`. State vectors of OpenSky are recognised by their columns if `columns` names none.
        columns: names in the table if they differ: {"time": "Time", "id": "MMSI", ...}. Naming a longitude and latitude
            makes the record geographic. Otherwise x, y are used if they are there.
        origin_deg: longitude and latitude of (0, 0) for a geographic record, an error for any other.
        usual_origin_deg: used if `origin_deg` is None, and ignored for other records. None: the median of the reports.

    Raises:
        InputError: names the file, row, column, and the expected and given values.
    """
    given = dict(columns or {})
    if is_known := not given and is_opensky(table.columns):
        table, given = of_opensky(table)
    if unknown := set(given) - {*_USED}:
        raise InputError(f"columns: expected {join_alternatives(_USED)}; got {', '.join(unknown)}")
    given = {**usual_names(table.columns), **given}
    times, labels = table.times(given.get("time", "time")), table.labels(given.get("id", "id"))
    positions, origin, bounds = _positions(table, given, origin_deg, usual_origin_deg)
    if len(times) == 0:
        raise InputError(f"{table.source}: expected at least one report; got none")
    speed_columns = [given.get(name, name) for name in ("vx", "vy")]
    has_velocity = any(name in given for name in ("vx", "vy")) or all(name in table.columns for name in speed_columns)
    velocities = _velocities(table, given, speed_columns, origin) if has_velocity else None
    altitudes = _altitudes(table, given)
    names, tracks = np.unique(labels, return_inverse=True)
    order = np.lexsort((times, tracks))  # equal ones stay in the order of the file
    again = (np.diff(times[order], prepend=-np.inf) < _SAME_TIME) & (np.diff(tracks[order], prepend=-1) == 0)
    repeats = tuple((table.rows[order[i - 1]], table.rows[order[i]]) for i in np.flatnonzero(again))
    order = order[~again]
    velocities = None if velocities is None else velocities[order]
    altitudes = None if altitudes is None else altitudes[order]
    tracks = tracks[order].astype(np.int64)
    used = {given.get(name, name) for name in _USED} - ({"x", "y"} if origin is not None else set())
    used.add(_altitude_column(table, given)[0])
    unused = () if is_known else tuple(name for name in table.columns if name not in used)
    facts = tuple(map(str, names)), origin, bounds, repeats, unused, table.notes, table.sha256
    return Reports(times[order], tracks, positions[order], velocities, altitudes, *facts)


def _altitude_column(table: Table, given: Mapping[str, str]) -> tuple[str, float]:
    """Return the column of altitudes and the size of its unit in m, or "" if there is none."""
    if name := given.get("altitude"):
        return name, next((size for unit, size in HEIGHTS.items() if name.endswith(f"_{unit}")), 1.0)
    named = ((f"altitude_{unit}", size) for unit, size in HEIGHTS.items())
    return next((each for each in named if each[0] in table.columns), ("", 1.0))


def _altitudes(table: Table, given: Mapping[str, str]) -> Floats | None:
    """Return the altitudes of all reports, m, or None without a column, or if a report that needs none has none."""
    name, unit = _altitude_column(table, given)
    if not name or (not given.get("altitude") and any(map(is_empty, table.column(name)))):
        return None
    return unit * table.numbers(name, FARTHEST)


def usual_names(columns: Iterable[str]) -> dict[str, str]:
    """Return columns under other usual names, places in degrees only if there are none in metres."""
    have = set(columns)
    quantities = ("time", "id") if {"x", "y"} <= have else ("time", "id", "longitude", "latitude")
    columns_of = {}
    for quantity in quantities:
        others = [name for name in OTHER_NAMES[quantity] if name in have]
        if quantity not in have and others:
            columns_of[quantity] = others[0]
    return columns_of


def _pair(table: Table, names: Sequence[str]) -> Floats:
    """Return two columns, in m or m/s, (n, 2)."""
    return np.stack([table.numbers(name, FARTHEST) for name in names], axis=1)


def _velocities(
    table: Table, given: Mapping[str, str], names: Sequence[str], origin: tuple[float, float] | None
) -> Floats:
    """Return velocities along x and y of the plane, (n, 2) m/s."""
    velocities = _pair(table, names)
    if origin is None:
        return velocities
    degrees = (table.numbers(given.get(name, name), np.inf) for name in ("longitude", "latitude"))
    return np.asarray(np.einsum("nij,nj->ni", Origin(*origin).axes(*degrees), velocities))


def _degrees(table: Table, given: Mapping[str, str]) -> list[Floats]:
    """Return longitudes and latitudes."""
    degrees = []
    for name, limit in (("longitude", 360.0), ("latitude", 90.0)):
        column = given.get(name, name)
        values = table.numbers(column, np.inf)
        if (wrong := np.abs(values) > limit).any():
            raise table.fault(int(np.argmax(wrong)), column, f"a {name} in degrees, at most {limit:g}")
        degrees.append(values)
    return degrees


def _to_plane(table: Table, given: Mapping[str, str], origin: Origin, degrees: list[Floats]) -> Floats:
    """Return places in the plane, (num_rows, 2) m."""
    if (beyond := origin.beyond(*degrees)).any():
        at = f"({origin.longitude_deg:g}, {origin.latitude_deg:g}) degrees"
        expected = f"a place on the same side of the globe as the origin, {at}"
        raise table.fault(int(np.argmax(beyond)), given.get("latitude", "latitude"), expected)
    return origin.to_plane(*degrees)


def _median_longitude(longitudes: Floats) -> float:
    """Return the median of longitudes, also on both sides of 180 degrees, from -180 to 180."""
    around = longitudes[0] + np.remainder(longitudes - longitudes[0] + 180.0, 360.0) - 180.0
    middle = float(np.median(around))
    return middle if abs(middle) <= 180.0 else middle - math.copysign(360.0, middle)


def _check_agreed(table: Table, positions: Floats, origin: Origin) -> None:
    """Check that places in metres agree with the longitudes and latitudes of the same rows."""
    from_degrees = _to_plane(table, {}, origin, _degrees(table, {})) if len(positions) else positions
    apart = np.hypot(*(positions - from_degrees).T)
    if (wrong := apart > ONE_PLACE + ONE_PLACE_SHARE * np.hypot(*from_degrees.T)).any():
        i = int(np.argmax(wrong))
        where = f"the place of its longitude and latitude ({from_degrees[i, 0]:.0f}, {from_degrees[i, 1]:.0f} m)"
        expected = f"x, y at {where}, not {apart[i]:.0f} m away; `columns: {{x: x, y: y}}` takes them alone"
        raise table.fault(i, "x", expected)


def _positions(
    table: Table,
    given: Mapping[str, str],
    origin_deg: tuple[float, float] | None,
    usual_origin_deg: tuple[float, float] | None,
) -> tuple[Floats, tuple[float, float] | None, tuple[tuple[float, float], tuple[float, float]] | None]:
    """Return places in m, the origin, and the bounds in degrees."""
    named_geographic = "longitude" in given or "latitude" in given
    if named_geographic and ("x" in given or "y" in given):
        raise InputError("columns: expected either x and y, or longitude and latitude; got both")
    has_plane = all(given.get(name, name) in table.columns for name in ("x", "y"))
    has_globe = all(given.get(name, name) in table.columns for name in ("longitude", "latitude"))
    if not named_geographic and (has_plane or not has_globe):
        if origin_deg is not None:
            raise InputError("origin_deg: expected only for longitudes and latitudes; the record has x and y")
        positions = _pair(table, [given.get(name, name) for name in ("x", "y")])
        if has_globe and usual_origin_deg is not None and "x" not in given:
            _check_agreed(table, positions, Origin(*usual_origin_deg))
        return positions, None, None
    degrees = _degrees(table, given)
    origin_deg = origin_deg or usual_origin_deg
    if origin_deg is None:
        origin_deg = (_median_longitude(degrees[0]), float(np.median(degrees[1]))) if len(degrees[0]) else (0.0, 0.0)
    if not len(degrees[0]):
        return np.empty((0, 2)), origin_deg, None
    low, high = ((float(end(degrees[0])), float(end(degrees[1]))) for end in (np.min, np.max))
    return _to_plane(table, given, Origin(*origin_deg), degrees), origin_deg, (low, high)
