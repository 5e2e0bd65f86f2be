"""Detections of Stone Soup as a table of scans, without importing Stone Soup."""

import math
from collections.abc import Iterable, Sequence
from typing import Any, TypeAlias

import numpy as np

from vedette.errors import InputError
from vedette.internal.quantities import QUANTITIES, si_column
from vedette.internal.text import shown
from vedette.models.arguments import reject
from vedette.recorded.tables import Table

_COLUMNS = {**{name: si_column(name) for name in QUANTITIES}, "lon": "lon_deg", "lat": "lat_deg"}
Place: TypeAlias = tuple[float, float]


def table_of_detections(
    reader: Iterable[tuple[Any, Iterable[Any]]], quantities: Sequence[str | None], *, sensor: str | None = None
) -> Table:
    """Return the rows from a `DetectionReader`, a simulator or an equivalent list, for `parse_scans`.

    Bearings are Stone Soup's: from the east, in rad. If the detection's `measurement_model` has a `translation_offset`
    and a `rotation_offset`, they are the sensor's position and rotation.

    Args:
        reader: pairs of a time (a `datetime`, taken as UTC without a zone) and a set of detections, each with a
            `state_vector`. If `sensor` is given, an empty set is a scan without measurements, at the sensor's last
            position.
        quantities: of the elements of the state vector, such as ("bearing", "range"): bearing, range, range_rate, x,
            y, lon or lat. None: an element that is ignored.
        sensor: of all detections. None: each gives its own in `metadata["sensor"]`.

    Raises:
        InputError: names the scan, the detection and its attribute, and the expected and given values.
    """
    for quantity in quantities:
        if quantity is not None and quantity not in _COLUMNS:
            raise reject("quantities", f"None and names among {', '.join(_COLUMNS)}", quantity)
    columns: dict[str, list[Any]] = {"time": [], "sensor": []}
    columns |= {_COLUMNS[name]: [] for name in quantities if name is not None}
    places, numbers = list[Place | None](), list[int]()
    for number, pair in enumerate(reader, start=1):
        time, detections = _pair(pair, number)
        rows = [_row(each, quantities, sensor, f"scan {number}, detection {k}") for k, each in detections]
        if not rows and sensor is not None:
            rows = [(sensor, (), None)]
        for name, values, own in sorted(rows, key=lambda row: row[:2]):  # a set has no order
            for column, cell in zip(columns, (time, name, *(values or [None] * len(columns))), strict=False):
                columns[column].append(cell)
            places.append(own if values or not places else places[-1])
            numbers.append(number)
    with_place = [k for k, place in enumerate(places) if place is not None]
    if with_place:
        cells = list(columns.values())[2]  # cells of empty scans before all others
        places[: with_place[0]] = [places[with_place[0]] if cell is None else None for cell in cells[: with_place[0]]]
        if None in places:
            expected = "a measurement_model with a translation_offset, as others have"
            raise InputError(f"detections, scan {numbers[places.index(None)]}: expected {expected}; got none")
        columns |= {f"own_{axis}": [place[k] for place in places if place] for k, axis in enumerate("xy")}
    return Table(columns, numbers, "detections", "east")


def _pair(pair: Any, number: int) -> tuple[Any, list[tuple[int, Any]]]:
    try:
        time, detections = pair
        return time, list(enumerate(detections, start=1))
    except (TypeError, ValueError):
        raise InputError(f"detections, scan {number}: expected a time and detections; got {shown(str(pair))}") from None


def _row(
    detection: Any, quantities: Sequence[str | None], sensor: str | None, place: str
) -> tuple[str, tuple[float, ...], Place | None]:
    """Return the sensor, the elements of the state vector that are used, and the position of the sensor."""
    name = sensor
    if name is None:
        metadata = getattr(detection, "metadata", None) or {}
        if "sensor" not in metadata:
            raise InputError(f"detections, {place}, metadata: expected a sensor, as no other is named; got none")
        name = str(metadata["sensor"])
    model = getattr(detection, "measurement_model", None)
    values = elements_of(detection, quantities, model, f"detections, {place}")
    offset = getattr(model, "translation_offset", None)
    if offset is None or not {"bearing", "range"} & set(quantities):
        return name, values, None
    east, north = (float(element) for element in np.ravel(np.asarray(offset, dtype=object))[:2])
    return name, values, (east, north)


def elements_of(detection: Any, quantities: Sequence[str | None], model: Any, place: str) -> tuple[float, ...]:
    """Return the used elements of a detection's state vector, bearings turned by its model's `rotation_offset`.

    place: text of an error before the attribute. Raises `InputError` if there is no such vector.
    """
    vector = getattr(detection, "state_vector", None)
    try:
        elements = [float(element) for element in np.ravel(np.asarray(vector, dtype=object))]
    except (TypeError, ValueError):
        elements = []
    if len(elements) != len(quantities) or not np.isfinite(elements).all():
        expected = f"{len(quantities)} finite numbers ({', '.join(map(str, quantities))})"
        raise InputError(f"{place}, state_vector: expected {expected}; got {shown(str(vector))}")
    rotation = getattr(model, "rotation_offset", None)
    if "bearing" in quantities and rotation is not None:
        place_of = quantities.index("bearing")
        elements[place_of] = math.remainder(elements[place_of] + float(np.ravel(rotation)[-1]), 2.0 * math.pi)
    return tuple(element for quantity, element in zip(quantities, elements, strict=True) if quantity is not None)
