"""Detections as Stone Soup has them: here a stand-in with the attributes that its documentation gives them."""

from __future__ import annotations

import datetime
import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from vedette.errors import InputError
from vedette.recorded import Conventions, RecordedScans, RecordedSensor, parse_scans, table_of_detections

START = datetime.datetime(2020, 1, 1, 12)
TARGETS = np.array([[500.0, 300.0], [-800.0, 20.0]])


class Bearing:
    """An angle as an element of a state vector, which only `float` makes a number."""

    def __init__(self, value: float) -> None:
        self.value = value

    def __float__(self) -> float:
        return self.value


@dataclass(frozen=True)
class Model:
    """`CartesianToBearingRange`: a bearing from where the sensor points, and a range."""

    translation_offset: Any
    rotation_offset: Any


@dataclass(eq=False)
class Detection:
    """As sets hold them, with no order."""

    state_vector: Any
    measurement_model: Model | None = None
    metadata: dict[str, Any] = field(default_factory=dict)


def polar(place: tuple[float, float], turn: float, **metadata: Any) -> set[Detection]:
    model = Model(np.array([[place[0]], [place[1]]]), np.array([[0.0], [0.0], [turn]]))
    found = set()
    for dx, dy in TARGETS - place:
        vector = np.array([[Bearing(math.atan2(dy, dx) - turn)], [math.hypot(dx, dy)]], dtype=object)
        found.add(Detection(vector, model, metadata))
    return found


def after(seconds: float) -> datetime.datetime:
    return START + datetime.timedelta(seconds=seconds)


def places(found: RecordedScans, k: int) -> Any:
    scan = found.scans[k][0]
    assert isinstance(scan, np.ndarray)
    ends = found.poses[k, 0, :2] + scan[:, 1:] * np.column_stack([np.cos(scan[:, 0]), np.sin(scan[:, 0])])
    return ends[np.lexsort(ends.T)]


def test_a_turned_sensor_that_moves_sees_targets_where_they_are() -> None:
    reader = ((after(k), polar((100.0 * k, -50.0), 0.7) if k not in (0, 2) else set()) for k in range(4))
    table = table_of_detections(reader, ("bearing", "range"), sensor="radar")
    found = parse_scans(table, [RecordedSensor("radar", "bearing_range", (0.0, 0.0, 0.0))], Conventions({}, {}))
    assert (found.is_utc, found.times.tolist(), found.start) == (True, [0.0, 1.0, 2.0, 3.0], 1577880000.0)
    np.testing.assert_array_equal(found.poses[:, 0, 0], [100.0, 100.0, 100.0, 300.0])  # where it says, or last did
    for k in (1, 3):
        np.testing.assert_allclose(places(found, k), TARGETS[np.lexsort(TARGETS.T)], atol=1e-9)
    assert [len(scans[0]) for scans in found.scans if scans[0] is not None] == [0, 2, 0, 2]


def test_sets_have_no_order_but_rows_do() -> None:
    rows = [table_of_detections([(START, polar((0.0, 0.0), 0.0))], ("bearing", "range"), sensor="a") for _ in range(9)]
    assert all(each.columns == rows[0].columns for each in rows)


def test_positions_of_several_sensors_name_them() -> None:
    found = [Detection(np.array([[3.0 * k], [4.0], [9.0]]), None, {"sensor": name}) for k, name in enumerate("ab")]
    table = table_of_detections([(after(0), found), (after(1), [])], ("x", "y", None))
    assert table.columns == {"time": [START, START], "sensor": ["a", "b"], "x_m": [0.0, 3.0], "y_m": [4.0, 4.0]}
    sites = [RecordedSensor(name, "position", (0.0, 0.0, 0.0)) for name in "ab"]
    scans = parse_scans(table, sites, Conventions({}, {})).scans
    np.testing.assert_array_equal(np.asarray(scans[0][1]), [[3.0, 4.0]])


@pytest.mark.parametrize(
    ("reader", "quantities", "message"),
    [
        (
            [(START, [Detection([[1.0]])])],
            ("bearing", "range"),
            r"scan 1, detection 1, state_vector: expected 2 finite",
        ),
        ([(START, [Detection([[1.0], [math.nan]])])], ("x", "y"), r"state_vector: expected 2 finite numbers \(x, y\)"),
        ([(START, [Detection([[1.0], ["far"]])])], ("x", "y"), r"state_vector: expected 2 finite numbers"),
        ([(START, [object()])], ("x", "y"), r"scan 1, detection 1, state_vector: expected 2 .*got 'None'"),
        ([(START, []), 7], ("x", "y"), r"scan 2: expected a time and detections; got '7'"),
        ([(START, 7)], ("x", "y"), r"scan 1: expected a time and detections"),
        (
            [],
            ("x", "speed"),
            r"quantities: expected None and names among bearing, range, .* elevation, altitude, lon, lat; got speed",
        ),
        (
            [(START, polar((0.0, 0.0), 0.0)), (after(1), [Detection([[1.0], [2.0]])])],
            ("bearing", "range"),
            r"scan 2: expected a measurement_model with a translation_offset, as others have",
        ),
    ],
)
def test_invalid_detections_are_reported(reader: Any, quantities: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        table_of_detections(reader, quantities, sensor="radar")


def test_a_sensor_must_be_named_somewhere() -> None:
    with pytest.raises(InputError, match="scan 1, detection 1, metadata: expected a sensor, as no other is named"):
        table_of_detections([(START, [Detection([[1.0], [2.0]])])], ("x", "y"))
    table = table_of_detections([("soon", [Detection([[1.0], [2.0]])])], ("x", "y"), sensor="a")
    with pytest.raises(InputError, match="detections, row 1, column 'time': expected an ISO 8601 time; got 'soon'"):
        parse_scans(table, [RecordedSensor("a", "position", (0.0, 0.0, 0.0))], Conventions({}, {}))
