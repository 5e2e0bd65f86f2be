"""ROS 2 bags, made by rosbags itself, whole and damaged."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recordings import ORIGIN
from vedette.errors import InputError
from vedette.recorded import Conventions, RecordedSensor, RecordedTargets, parse_scans
from vedette.recorded.files import read_table

pytest.importorskip("rosbags")  # which is not there for the newest Python

from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_HUMBLE)
TYPES: Any = STORE.types
START = 1452603741
SITES = [RecordedSensor("/radar", "position", (0.0, 0.0, 0.0)), RecordedSensor("/camera", "position", (5.0, 0.0, 0.0))]


def header(time: float) -> Any:
    whole = math.floor(time)
    stamp = TYPES["builtin_interfaces/msg/Time"](whole, round((time - whole) * 1e9))
    return TYPES["std_msgs/msg/Header"](stamp, "map")


def point(x: float, y: float) -> Any:
    return TYPES["geometry_msgs/msg/Point"](x, y, 0.0)


def poses(time: float, *places: tuple[float, float]) -> Any:
    level = TYPES["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
    found = [TYPES["geometry_msgs/msg/Pose"](point(*place), level) for place in places]
    return TYPES["geometry_msgs/msg/PoseArray"](header(time), found)


def stamped(time: float, x: float, y: float) -> Any:
    return TYPES["geometry_msgs/msg/PointStamped"](header(time), point(x, y))


def fix(time: float, lon: float, lat: float, status: int = 0) -> Any:
    told = TYPES["sensor_msgs/msg/NavSatStatus"](status, 1)
    return TYPES["sensor_msgs/msg/NavSatFix"](header(time), told, lat, lon, 0.0, np.zeros(9), 0)


def bag(folder: Path, messages: Sequence[tuple[str, Any]], storage: str = "sqlite3") -> Path:
    """The one file with messages of a bag; each is received a second after its stamp."""
    plugin = StoragePlugin.SQLITE3 if storage == "sqlite3" else StoragePlugin.MCAP
    connections: dict[str, Any] = {}
    with Writer(folder / "bag", version=9, storage_plugin=plugin) as writer:
        for topic, message in messages:
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=STORE)
            stamp = message.header.stamp
            received = (stamp.sec + 1) * 10**9 + stamp.nanosec
            writer.write(connections[topic], received, STORE.serialize_cdr(message, kind))
    (found,) = (path for path in (folder / "bag").iterdir() if path.name != "metadata.yaml")
    return found


@pytest.mark.parametrize("storage", ["sqlite3", "mcap"])
def test_arrays_and_points_are_scans(tmp_path: Path, storage: str) -> None:
    fixed = fix(START, -1.1, 50.8)
    messages = [
        ("/radar", poses(START, (1.0, 2.0), (3.0, -4.5))),
        ("/camera", stamped(START + 0.25, 7.0, 8.0)),
        ("/radar", poses(START + 2.5)),
        ("/boat", fixed),
    ]
    found = parse_scans(read_table(bag(tmp_path, messages, storage)), SITES, Conventions({}, {}))
    assert (found.is_utc, found.start, found.times.tolist()) == (True, START, [0.0, 0.25, 2.5])
    first, second, third = found.scans
    np.testing.assert_array_equal(np.asarray(first[0]), [[1.0, 2.0], [3.0, -4.5]])
    np.testing.assert_array_equal(np.asarray(second[1]), [[7.0, 8.0]])
    assert third[0] is not None
    assert (len(third[0]), third[1]) == (0, None)


def test_seconds_of_a_simulation_are_no_dates(tmp_path: Path) -> None:
    found = parse_scans(read_table(bag(tmp_path, [("/radar", poses(12.5, (1.0, 2.0)))])), SITES, Conventions({}, {}))
    assert (found.is_utc, found.start) == (False, 12.5)


def test_receivers_report_where_they_are(tmp_path: Path) -> None:
    places = ORIGIN.to_degrees([[10.0 * k, -20.0] for k in range(4)]).tolist()
    messages = [("/boat/fix", fix(START + k, *place)) for k, place in enumerate(places)]
    messages += [("/boat/fix", fix(START + 4, 0.0, 0.0, status=-1)), ("/radar", poses(START, (1.0, 2.0)))]
    file = bag(tmp_path, messages)
    targets = RecordedTargets.from_file(file, origin_deg=(ORIGIN.longitude_deg, ORIGIN.latitude_deg))
    assert [track.name for track in targets.tracks] == ["/boat/fix"]
    assert targets.time_origin == START
    np.testing.assert_allclose(targets.tracks[0].positions, [[10.0 * k, -20.0] for k in range(4)], atol=1e-6)


def test_missing_or_non_numeric_values_are_reported(tmp_path: Path) -> None:
    messages = [("/radar", poses(START, (1.0, 2.0))), ("/radar", poses(START + 1, (math.nan, 2.0)))]
    file = bag(tmp_path, messages)
    with pytest.raises(InputError, match=r"bag.db3, row 2, column 'x': expected a finite number; got nan"):
        parse_scans(read_table(file), SITES, Conventions({}, {}))
    found = parse_scans(read_table(file), SITES, Conventions({}, {}, bad_rows="skip"))
    assert (found.num_measurements, len(found.skipped)) == (1, 1)
    with pytest.raises(InputError, match=r"column 'sensor': expected a sensor among 'north'"):
        parse_scans(read_table(file), [RecordedSensor("north", "position", (0.0, 0.0, 0.0))], Conventions({}, {}))
    with pytest.raises(InputError, match=r"bag.db3: expected messages sensor_msgs/msg/NavSatFix; got none"):
        read_table(file, reports=True)


@pytest.mark.parametrize("storage", ["sqlite3", "mcap"])
def test_a_damaged_bag_is_refused_by_name_or_read(tmp_path: Path, storage: str) -> None:
    whole = bag(tmp_path, [("/radar", poses(START + k, (1.0, 2.0), (3.0, 4.0))) for k in range(20)], storage)
    content, rng = whole.read_bytes(), np.random.default_rng(0)
    damaged = tmp_path / f"damaged{whole.suffix}"
    refused = list[str]()
    for case in range(60):
        bad = bytearray(content[: rng.integers(0, len(content))] if case % 3 == 0 else content)
        for at in rng.integers(0, max(len(bad), 1), 8 if case % 3 and bad else 0):
            bad[at] = rng.integers(256)
        damaged.write_bytes(bytes(bad))
        try:
            read_table(damaged)
        except InputError as error:
            refused.append(str(error))
    assert len(refused) > 10
    assert all(text.startswith(f"{damaged}: expected") for text in refused)
    (tmp_path / "empty.mcap").write_bytes(b"")
    with pytest.raises(InputError, match="it cannot be read"):
        read_table(tmp_path / "empty.mcap")
