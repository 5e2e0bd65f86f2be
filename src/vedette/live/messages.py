"""Strict reader of scans as lines of JSON: an invalid line is an error, and no part of it is used."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from vedette.errors import InputError
from vedette.internal.quantities import COMPONENTS, HEIGHT_DEPENDENT, is_doppler
from vedette.internal.reading import error_summary, parse_json
from vedette.internal.text import pluralise, shown
from vedette.kernels.base.types import BEAM, HEADING, OWN_VELOCITY, Floats
from vedette.models.arguments import reject
from vedette.models.pose_noise import pose_stds_of
from vedette.models.scan_rows import ScanLike
from vedette.models.turns import Turn, with_beam
from vedette.recorded import Conventions, Origin, RecordedSensor, parse_scans
from vedette.recorded.conventions import GAPS
from vedette.recorded.tables import Table, is_number, seconds
from vedette.recorded.turns import bearings_of
from vedette.tracking import SensorScan

MAX_LINE_BYTES = 1_000_000  # per line
MAX_MEASUREMENTS = 2000  # per scan
_REQUIRED = ("sensor", "time", "measurements")
_KEYS = (*_REQUIRED, "pose", "velocity", "times", "stds", "snr_db", "class", "size_m", "pose_stds")


def is_message(line: bytes) -> bool:
    """Return True if a line has the form of a message. Its values are not checked."""
    try:
        _object(line, "line")
    except InputError:
        return False
    return True


class Message(NamedTuple):
    """A scan with its time as given in the line, and whether that is in seconds since 1970 UTC."""

    scan: SensorScan
    is_utc: bool


def read_message(
    line: bytes, place: str, sites: Sequence[RecordedSensor], conventions: Conventions, origin: Origin | None = None
) -> Message:
    """Return the scan of a line.

    `{"sensor": name or number from 1, "time": s or ISO 8601, "measurements": [[...], ...], "pose": ...}`. Measurements
    have the components of `vedette.internal.quantities.COMPONENTS`, in rad (degrees for a sensor with a compass) and m
    unless `conventions.units` has others. The direction of angles is that of `conventions.bearings`, else the sensor's.
    The optional pose is `[x, y, heading_rad, ...]`, or `{"lon": , "lat": , "course_deg": }`, where the course,
    clockwise from true north as in plans, is optional, or with `heading_deg`, which has the direction of bearings and
    needs `bearings` or a compass. For a sensor that measures range rates or turns, `"velocity": [vx, vy]` is its own
    velocity in m/s. For a sensor that turns, `"times"` has the time of each measurement, and `time` is the middle of
    the turn. Without `"times"`, all measurements are of one time. `"stds"` has a row of standard deviations for each
    measurement, in its units, null where the sensor's noise model holds. `"snr_db"` the signal-to-noise ratio of each
    measurement of a sensor with `signal`, or null. `"class"` and `"size_m"` the reported class and the size of each,
    for a sensor with `classification`, or null. `"pose_stds"` has standard deviations of the pose, `{"x": , "y": ,
    "heading_deg": , "height": , "vx": , "vy": }`, each optional.

    Args:
        line: line of UTF-8 text.
        place: name of the line in messages.
        sites: the sensors, in the order of the tracker's.
        conventions: units and bearings. Its other fields are not used.
        origin: origin of longitudes and latitudes.

    Raises:
        InputError: an invalid field. The message has its name, the expected and the given value.
    """
    data = _object(line, place)
    number = _sensor(data["sensor"], place, sites)
    site, time = sites[number], data["time"]
    if not isinstance(time, str) and (isinstance(time, bool) or not isinstance(time, int | float)):
        raise reject(f"{place}, time", "seconds, or a text in ISO 8601", time)
    rows = _rows(data["measurements"], f"{place}, measurements", site)
    pose, more_components = _pose(data.get("pose"), f"{place}, pose", site)
    if "pose.heading_deg" not in pose and conventions.bearings is None and not site.compass:
        conventions = replace(conventions, bearings="east")
    course = pose.pop("pose.course_deg", None)
    pose |= _velocity(data.get("velocity"), f"{place}, velocity", site)
    num, names = max(len(rows), 1), COMPONENTS[site.kind]
    columns: dict[str, list[Any]] = {"time": [time] * num, "sensor": [site.name] * num}
    columns |= {name: [row[j] for row in rows] if rows else [None] for j, name in enumerate(names)}
    columns |= {name: [value] * num for name, value in pose.items()}
    columns |= _accuracy(data, len(rows), site, place)
    columns |= {name: [std] * num for name, std in _pose_stds(data.get("pose_stds"), f"{place}, pose_stds", site)}
    unit = "deg" if site.compass else "rad"
    units = {
        "bearing": unit,
        "elevation": unit,
        **{name: unit for name, unit in conventions.units.items() if name in names},
    }
    units |= {f"{name}_std": units[name] for name in names if name in units} | {"own_heading_std": "deg"}
    column_names = {_POSE_COLUMNS[name]: name for name in pose}
    # The loop removes measurements beyond the reach, and counts them.
    unlimited_site = replace(site, reach=math.inf, turn="none")
    scans_read = parse_scans(
        Table(columns, range(1, num + 1), place),
        [unlimited_site],
        replace(conventions, columns=column_names, units=units),
        origin,
    )
    pose_vector = scans_read.poses[0, 0].copy()
    pose_vector[HEADING + 1 : HEADING + 1 + len(more_components)] = more_components
    if "velocity.x" in pose and len(pose_vector) >= BEAM:  # rows have a velocity for range rates only
        pose_vector[OWN_VELOCITY:BEAM] = pose["velocity.x"], pose["velocity.y"]
    if course is not None and origin is not None:  # a position in degrees needed an origin
        pose_vector[HEADING] = origin.angle(math.radians(course), pose_vector)
    scan = scans_read.scans[0][0]
    if "times" in data and scan is not None:
        lags = _lags(data["times"], f"{place}, times", len(rows), scans_read.start, scans_read.is_utc)
        pose_vector = _with_beam(pose_vector, scan, lags, site, f"{place}, times")
    return Message(SensorScan(number, scans_read.start, scan, pose_vector), scans_read.is_utc)


def _lags(given: Any, place: str, num: int, time: float, is_utc: bool) -> Floats:
    """Time of each measurement after the time of the scan, (num,), s."""
    wanted = f"a list of {pluralise(num, 'time')}, one for each measurement, of the form of `time`"
    if not isinstance(given, list) or len(given) != num or any(isinstance(each, str) != is_utc for each in given):
        raise reject(place, wanted, given)
    try:
        return np.array([seconds(each) for each in given]) - time
    except (TypeError, ValueError, OverflowError):
        raise reject(place, wanted, given) from None


def _with_beam(pose: Floats, scan: ScanLike, lags: Floats, site: RecordedSensor, place: str) -> Floats:
    """Return the pose with the bearing of the beam at the middle of the turn, from the measurements and their times."""
    if not isinstance(site.turn, Turn):
        raise reject(place, f"none, as the sensors file gives no `turn` of {site.name}", "some")
    if len(lags) and np.abs(lags).max() > site.turn.period:
        raise reject(place, f"times within a turn ({site.turn.period:g} s) of `time`", f"{lags.tolist()} s")
    bearings = bearings_of(scan, pose, site.kind)
    middle = float(np.angle(np.exp(1j * (bearings - site.turn.rate * lags)).sum())) if len(lags) else 0.0
    velocity = pose[OWN_VELOCITY:BEAM] if len(pose) >= BEAM else np.zeros(2)
    return with_beam(pose, velocity, middle, site.turn.rate)


_POSE_COLUMNS = {
    "pose.x": "own_x",
    "pose.y": "own_y",
    "pose.heading_rad": "own_heading",
    "pose.lon": "own_lon",
    "pose.lat": "own_lat",
    "pose.heading_deg": "own_heading",
    "velocity.x": "own_vx",
    "velocity.y": "own_vy",
}


def _object(line: bytes, place: str) -> Mapping[str, Any]:
    if len(line) > MAX_LINE_BYTES:
        raise reject(place, f"at most {MAX_LINE_BYTES} bytes", "more")
    try:
        data = parse_json(line)
    except ValueError as fault:
        raise InputError(f"{place}: expected a JSON object; it is damaged: {error_summary(fault)}") from None
    if not isinstance(data, dict):
        raise reject(place, "a JSON object", data)
    for key in data:
        if key not in _KEYS:
            raise InputError(f"{place}: expected keys among {', '.join(_KEYS)}; got {shown(key)}")
    for key in _REQUIRED:
        if key not in data:
            raise reject(f"{place}, {key}", "it in every line", "none")
    return data


def _sensor(given: Any, place: str, sites: Sequence[RecordedSensor]) -> int:
    """Return the number of a sensor, from 0."""
    for number, site in enumerate(sites):
        if given == site.name or (type(given) is int and given == number + 1):
            return number
    names = ", ".join(shown(site.name) for site in sites)
    raise InputError(f"{place}, sensor: expected one of {names}, or its number from 1; got {shown(given)}")


def _rows(given: Any, field: str, site: RecordedSensor) -> list[list[float]]:
    names = COMPONENTS[site.kind]
    if not isinstance(given, list):
        raise reject(field, f"a list of [{', '.join(names)}]", given)
    if len(given) > MAX_MEASUREMENTS:
        raise reject(field, f"at most {MAX_MEASUREMENTS} of a scan", len(given))
    for i, row in enumerate(given):
        third = row[2:] if isinstance(row, list) else []
        measured = [each for each, name in zip(third, names[2:], strict=False) if not (each is None and name in GAPS)]
        if not isinstance(row, list) or len(row) != len(names) or not all(map(_is_number, [*row[:2], *measured])):
            raise reject(f"{field}[{i}]", f"numbers [{', '.join(names)}]", row)
    return given


def _accuracy(data: Mapping[str, Any], num: int, site: RecordedSensor, place: str) -> dict[str, list[Any]]:
    """Return standard deviations, signal-to-noise ratios, classes and sizes as columns of a table."""
    names, found = COMPONENTS[site.kind], dict[str, list[Any]]()
    if (stds := data.get("stds")) is not None:
        wanted = f"for each of {pluralise(num, 'measurement')} [{', '.join(names)}], numbers above 0 or null"
        shaped = isinstance(stds, list) and len(stds) == num and all(isinstance(row, list) for row in stds)
        if not shaped or not all(
            len(row) == len(names) and all(each is None or (_is_number(each) and each > 0.0) for each in row)
            for row in stds
        ):
            raise reject(f"{place}, stds", wanted, stds)
        found |= {f"{name}_std": [row[j] for row in stds] or [None] for j, name in enumerate(names)}
    features = site.features
    for key, name, section, is_read, thing in (
        ("snr_db", "snr", "signal", site.signal is not None, "number"),
        ("size_m", "size", "classification", features is not None and bool(features.sizes), "number"),
        ("class", "class", "classification", features is not None and bool(features.reports), "text"),
    ):
        if (cells := data.get(key)) is None:
            continue
        if not is_read:
            raise reject(f"{place}, {key}", f"none, as the sensors file gives no `{section}` of {site.name}", "some")
        is_valid = _is_number if thing == "number" else lambda each: isinstance(each, str)
        are_valid = isinstance(cells, list) and all(each is None or is_valid(each) for each in cells)
        if not are_valid or len(cells) != num:
            raise reject(f"{place}, {key}", f"{pluralise(num, thing)} or null, one for each measurement", cells)
        found[name] = cells or [None]
    return found


def _pose(given: Any, field: str, site: RecordedSensor) -> tuple[dict[str, float], list[float]]:
    """Return the pose as columns of a table, and its components after the heading."""
    if given is None:
        return {}, []
    if isinstance(given, dict):
        is_valid = {"lon", "lat"} <= set(given) <= {"lon", "lat", "course_deg", "heading_deg"}
        if not is_valid or {"course_deg", "heading_deg"} <= set(given):
            wanted = "lon, lat and, if it is known, course_deg or heading_deg"
            raise reject(field, wanted, ", ".join(map(str, given)) or "nothing")
        for name, value in given.items():
            if not _is_number(value):
                raise reject(f"{field}.{name}", "a number", value)
            if name == "course_deg" and not 0.0 <= value <= 360.0:
                raise reject(f"{field}.{name}", "degrees from 0 to 360, clockwise from true north", value)
        return {f"pose.{name}": value for name, value in given.items()}, []
    if not isinstance(given, list) or not 3 <= len(given) <= len(site.pose) or not all(map(_is_number, given)):
        wanted = "[x, y, heading_rad" + (", ...]" if len(site.pose) > 3 else "]")
        raise reject(field, f"numbers {wanted}, or lon and lat", given)
    return dict(zip(("pose.x", "pose.y", "pose.heading_rad"), given, strict=False)), given[3:]


def _pose_stds(given: Any, field: str, site: RecordedSensor) -> Iterator[tuple[str, float]]:
    """Yield standard deviations of the pose as columns of a table: their names and values."""
    if given is None:
        return
    fields = pose_stds_of(COMPONENTS[site.kind], site.kind in HEIGHT_DEPENDENT)
    names = {{"heading": "heading_deg"}.get(each, each): each for each in fields}
    if not names:
        raise reject(field, f"none, as measurements of {shown(site.name)} do not depend on its pose", given)
    if not isinstance(given, dict) or not given or not set(given) <= set(names):
        raise reject(field, f"keys among {', '.join(names)}", given)
    for name, std in given.items():
        if not (_is_number(std) and std > 0.0):
            raise reject(f"{field}.{name}", "a number above 0", std)
        yield f"own_{names[name]}_std", std


def _velocity(given: Any, field: str, site: RecordedSensor) -> dict[str, float]:
    """Return the velocity as columns of a table."""
    if given is None:
        return {}
    if not (is_doppler(site.kind) or isinstance(site.turn, Turn)):
        raise reject(field, f"none, as sensor {shown(site.name)} measures no range rates and has no `turn`", given)
    if not isinstance(given, list) or len(given) != 2 or not all(map(_is_number, given)):
        raise reject(field, "numbers [vx, vy]", given)
    return dict(zip(("velocity.x", "velocity.y"), given, strict=True))


def _is_number(value: Any) -> bool:
    return not isinstance(value, str) and is_number(value)
