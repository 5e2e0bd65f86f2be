"""Directions by compass in a scenario: a course may be given in place of a heading in degrees from east.

With an origin, a sensor with a compass or scans that count from north, `course_deg`, `courses_deg`, `azimuth_deg` and
`azimuths_deg` count clockwise from true north, as plans do. A file counts all directions of its sensors in one way.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from typing import TYPE_CHECKING, Any, TypeGuard

from vedette.scenarios.diagnostics import Path
from vedette.scenarios.sections.base import Section
from vedette.scenarios.sections.places import read_origin

if TYPE_CHECKING:
    from vedette.platforms.compass import Compass
    from vedette.scenarios.sections.sensors import Sensor

COURSE_KEYS = ("course_deg", "courses_deg", "azimuth_deg", "azimuths_deg")
_HEADING_KEYS = {"heading_deg", "headings_deg", "directions_deg", "pointing_deg", "pointings_deg"}
# New name of the key `courses_deg` of a platform, by its kind.
_LISTS = {"heading": "headings_deg", "grid_moves": "directions_deg"}


def courses_to_headings(data: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return a scenario's data with its courses as headings, counter-clockwise from east.

    Data is unchanged if nothing counts from north, or if directions are counted in both ways; the keys are then unknown
    ones.
    """
    sensors, defaults = data.get("sensors"), data.get("sensor_defaults")
    keys = {key for part in _parts(data).values() for key in _keys(part)}
    if not keys & set(COURSE_KEYS) or keys & _HEADING_KEYS or not _counts_from_north(data):
        return data
    from vedette.platforms.compass import PlaneCompass

    compass, shared_settings = read_origin(data) or PlaneCompass(), defaults if _is_mapping(defaults) else {}
    inherited = {key: shared_settings[key] for key in ("course_deg", "platform") if key in shared_settings}
    converted = {**data}
    if isinstance(sensors, list | tuple):
        converted["sensors"] = [
            _sensor({**inherited, **sensor}, compass) if _is_mapping(sensor) else sensor for sensor in sensors
        ]
    return {**converted, "sensor_defaults": _sensor(shared_settings, compass)} if shared_settings else converted


def headings_beside_north(data: Mapping[str, Any]) -> list[Path]:
    """Return the paths of `heading_deg` of sensors, which counts from east, in data whose directions are courses."""
    paths: list[Path] = [(*path, "heading_deg") for path, part in _parts(data).items() if "heading_deg" in part]
    return paths if _counts_from_north(data) else []


def _parts(data: Mapping[str, Any]) -> dict[Path, Mapping[str, Any]]:
    """Return the shared settings and the sensors by their paths, as far as they are mappings."""
    sensors, defaults = data.get("sensors"), data.get("sensor_defaults")
    parts: dict[Path, Any] = {("sensor_defaults",): defaults}
    parts |= {("sensors", i): each for i, each in enumerate(sensors if isinstance(sensors, list | tuple) else ())}
    return {path: part for path, part in parts.items() if _is_mapping(part)}


def _counts_from_north(data: Mapping[str, Any]) -> bool:
    """Return True for data with an origin, recorded bearings from north or a compass."""
    recording = data.get("recording")
    if read_origin(data) is not None or (_is_mapping(recording) and recording.get("bearings") == "north"):
        return True
    return any(part.get("compass") is True for part in _parts(data).values())


def directions_as_courses(platform: Section, compass: Compass, place: Any) -> dict[str, tuple[str, Any]]:
    """Return the directions of a platform by compass, as in a file: name and value by the name of its field."""
    courses: dict[str, tuple[str, Any]] = {}
    lists = {"headings_deg": "courses_deg", "directions_deg": "courses_deg", "pointings_deg": "azimuths_deg"}
    for name, key in lists.items():
        if name in type(platform).model_fields:
            is_relative = getattr(platform, "relative", False)
            courses[name] = (
                key,
                tuple(-each if is_relative else (90.0 - each) % 360.0 for each in getattr(platform, name)),
            )
    if "pointing_deg" in type(platform).model_fields:
        courses["pointing_deg"] = "azimuth_deg", start_course(platform.pointing_deg, compass, place)  # type: ignore[attr-defined]
    return courses


def sensor_as_courses(data: Mapping[str, Any], sensor: Sensor, compass: Compass) -> dict[str, Any]:
    """Return the plain data of a sensor with its directions by compass, as plans have them."""
    converted = {key: value for key, value in data.items() if key != "heading_deg"}
    converted["course_deg"] = start_course(sensor.heading_deg, compass, sensor.position)
    converted["platform"] = _platform_as_courses(data["platform"], sensor.platform, compass, sensor.position)
    return converted


def _platform_as_courses(data: Mapping[str, Any], platform: Section, compass: Compass, place: Any) -> dict[str, Any]:
    courses = directions_as_courses(platform, compass, place)
    converted = dict(courses.get(key, (key, value)) for key, value in data.items())
    if isinstance(mounting := getattr(platform, "platform", None), Section):
        converted["platform"] = _platform_as_courses(data["platform"], mounting, compass, place)
    return converted


def start_course(heading_deg: float, compass: Compass, place: Any) -> float:
    """Return the course of a heading in the plane at a place, deg in [0, 360)."""
    return round(math.degrees(float(compass.azimuth(math.radians(heading_deg), place))), 9) % 360.0


def path_in_file(path: Path, data: Any) -> Path:
    """Return the path in the file for a path after `courses_to_headings`."""
    written: list[str | int] = []
    for key in path:
        if _is_mapping(data) and key not in data:
            key = next((name for name in COURSE_KEYS if name in data and key in _heading_keys(name)), key)
        written.append(key)
        try:
            data = data[key]
        except (KeyError, IndexError, TypeError):
            data = None
    return tuple(written)


def _heading_keys(key: str) -> Collection[str]:
    """Return the possible new names of a key of courses."""
    single = {"course_deg": "heading_deg", "azimuth_deg": "pointing_deg", "azimuths_deg": "pointings_deg"}
    return (single[key],) if key in single else _LISTS.values()


def _keys(part: Mapping[str, Any]) -> Iterator[str]:
    """Yield the keys of a sensor, its platform and the platform that carries that one."""
    platform = part.get("platform")
    for section in (part, platform, platform.get("platform") if _is_mapping(platform) else None):
        if _is_mapping(section):
            yield from map(str, section)


def _sensor(data: Mapping[str, Any], compass: Compass) -> dict[str, Any]:
    position = data.get("position")
    is_place = isinstance(position, list | tuple) and len(position) == 2 and all(map(_is_number, position))
    place = position if is_place else (0.0, 0.0)
    converted = _convert_key(data, "course_deg", "heading_deg", lambda course: _angle(course, compass, place))
    if _is_mapping(converted.get("platform")):
        converted["platform"] = _platform(converted["platform"], compass, place)
    return converted


def _platform(data: Mapping[str, Any], compass: Compass, place: Any) -> dict[str, Any]:
    is_relative = data.get("relative") is True
    converted = _convert_key(data, "azimuth_deg", "pointing_deg", lambda azimuth: _angle(azimuth, compass, place))
    for key, name in (("courses_deg", _LISTS.get(str(data.get("kind")))), ("azimuths_deg", "pointings_deg")):
        if name is not None:
            converted = _convert_key(
                converted,
                key,
                name,
                lambda given: [-each if is_relative else (270.0 - each) % 360.0 - 180.0 for each in given],
            )
    if _is_mapping(converted.get("platform")):
        converted["platform"] = _platform(converted["platform"], compass, place)
    return converted


def _convert_key(data: Mapping[str, Any], key: str, name: str, change: Any) -> dict[str, Any]:
    """Return a copy with one key renamed and its numbers changed; other values stay."""
    converted = dict(data)
    if key in converted:
        value = converted.pop(key)
        is_list = isinstance(value, list | tuple) and all(map(_is_number, value))
        converted[name] = change(value) if is_list or _is_number(value) else value
    return converted


def _angle(azimuth: float, compass: Compass, place: Any) -> float:
    """Return the heading of a course at a place of the plane, deg."""
    return math.degrees(float(compass.angle(math.radians(azimuth), place)))


def _is_mapping(value: Any) -> TypeGuard[Mapping[str, Any]]:
    return isinstance(value, Mapping)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
