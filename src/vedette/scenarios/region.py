"""The region of recorded or future scans, from the measurements or from the sensors' ranges."""

from collections.abc import Iterator, Mapping
from pathlib import Path as FilePath

import numpy as np

from vedette.errors import InputError
from vedette.internal.text import pluralise
from vedette.kernels.base.types import Floats
from vedette.recorded import RecordedScans
from vedette.recorded.extents import box_of, places_of
from vedette.recorded.geography import PLANE_REACH
from vedette.scenarios.diagnostics import Path
from vedette.scenarios.sections import ScenarioModel
from vedette.scenarios.sections.field_of_view import field_of_view
from vedette.scenarios.sections.sensors import Sensor

_MAX_LISTED = 3  # measurements beyond the region that a warning lists


def measured_region(model: ScenarioModel, recording: RecordedScans) -> dict[str, float]:
    """Return the rectangle around the sensors and all their measurements.

    Raises `InputError` if the measurements give no places, or lie beyond the plane of the scenario's origin.
    """
    measured = list(_measured_places(model, recording))
    for k, s, places_of_scan in measured if model.origin is not None else ():
        if (is_beyond := np.abs(places_of_scan).max(axis=1, initial=0.0) > PLANE_REACH).any():
            distance = float(np.hypot(*(places_of_scan[np.argmax(is_beyond)] - recording.poses[k, s, :2])))
            name, path = model.sensor_names[s], "" if model.recording is None else f"{model.recording.path}: "
            expected = f"{path}expected measurements within {PLANE_REACH / 1000.0:g} km of the origin"
            got = f"one of {name} at t = {recording.times[k]:g} s, {distance / 1000.0:.0f} km away from it"
            raise InputError(f"{expected}; got {got} (is its unit right?)")
    places = [places_of_scan for _, _, places_of_scan in measured]
    corners = np.concatenate([*places, recording.poses[:, :, :2].reshape(-1, 2)])
    if np.ptp(corners, axis=0).max() <= 0.0:
        raise InputError("region: expected in the sensors file, as its sensors measure no positions; got none")
    return _edges(box_of(corners))


def reached_region(model: ScenarioModel, sensors: FilePath) -> dict[str, float]:
    """Return the rectangle that the sensors reach from their start; raises `InputError` if a sensor gives no range."""
    corners = list[Floats]()
    for name, sensor in zip(model.sensor_names, model.sensors, strict=True):
        reach = _reach(sensor)
        if reach is None:
            wanted = (
                f"a region, or of {name} `detection: {{max_range: ...}}` or `clutter: {{kind: around_sensor, ...}}`"
            )
            raise InputError(f"{sensors}: expected {wanted}, as nothing says how far it sees; got none of them")
        corners += [np.array(sensor.position) - reach, np.array(sensor.position) + reach]
    return _edges(box_of(np.array(corners), share=0.0))


def beyond_region_warnings(model: ScenarioModel, recording: RecordedScans) -> Iterator[tuple[Path, str]]:
    """Yield a warning if measurements lie beyond the region, with their number and the first of them."""
    region, listed, num = model.region.build(), list[str](), 0
    for k, s, places in _measured_places(model, recording):
        for place in places[~region.contains(places)]:
            num += 1
            if num <= _MAX_LISTED:
                distance = float(np.hypot(*(place - recording.poses[k, s, :2])))
                position = f"x {place[0]:.0f}, y {place[1]:.0f} m"
                when = f"{recording.times[k]:g} s after the first scan"
                listed.append(f"{model.sensor_names[s]} {when}, {distance:.0f} m away ({position})")
    if num:
        more = f" and {num - _MAX_LISTED} more" if num > _MAX_LISTED else ""
        count = f"{num} of {pluralise(recording.num_measurements, 'measurement')}"
        finding = (
            f"{count} {'lies' if num == 1 else 'lie'} beyond the region, where no clutter and no births are expected"
        )
        yield ("region",), f"{finding}: {', '.join(listed)}{more}"


def describe_region(region: Mapping[str, float]) -> str:
    """Return the edges of the region, with units."""
    return "x {x_min:g} to {x_max:g} m, y {y_min:g} to {y_max:g} m".format(**region)


def _measured_places(model: ScenarioModel, recording: RecordedScans) -> Iterator[tuple[int, int, Floats]]:
    """Yield instant and sensor of each scan, and the (num, 2) places that it measured."""
    for k, (scans, poses) in enumerate(zip(recording.scans, recording.poses, strict=True)):
        for s, (scan, pose, sensor) in enumerate(zip(scans, poses, model.sensors, strict=True)):
            if scan is not None:
                yield k, s, places_of(scan, pose, sensor.measurement.kind)


def _reach(sensor: Sensor) -> float | None:
    """Return the range of a sensor, m, from its detection or its clutter; None if neither has an edge."""
    view, clutter = field_of_view(sensor), sensor.clutter
    if view is not None:
        return view.reach
    return (clutter.radius or clutter.half_side) if clutter.kind == "around_sensor" else None


def _edges(box: Floats) -> dict[str, float]:
    """Return the region of a box, in whole metres."""
    (x_min, y_min), (x_max, y_max) = np.floor(box[0]).tolist(), np.ceil(box[1]).tolist()
    return {"x_min": x_min, "x_max": x_max, "y_min": y_min, "y_max": y_max}
