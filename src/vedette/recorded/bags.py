"""Recordings of ROS 2 (rosbag2) as tables: detections with positions, and position reports of receivers."""

from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from vedette.errors import InputError
from vedette.internal.extras import require_packages
from vedette.internal.reading import error_summary
from vedette.internal.text import printable

BAG_ENDINGS = (".db3", ".mcap")
_POSES, _POINT, _FIX = "geometry_msgs/msg/PoseArray", "geometry_msgs/msg/PointStamped", "sensor_msgs/msg/NavSatFix"
_FIRST_DATE = 1e8  # s since 1970; smaller stamps are seconds of a simulation


def read_bag(file: Path, *, reports: bool) -> tuple[dict[str, list[Any]], list[int]]:
    """Return the messages of a bag, each at the time of its header.

    Positions of `PoseArray` and `PointStamped`, in metres in the plane of the scenario: `time`, `sensor` (the topic),
    `x`, `y`. An array without poses is a scan without measurements. With `reports`, positions of the senders of
    `NavSatFix`: `time`, `id` (the topic), `longitude`, `latitude`. Messages without a fix are skipped, and so are all
    other messages. Returns the columns and the number of each row's message among the messages read.

    Raises:
        MissingPackageError: rosbags is not installed.
        InputError: no bag, a damaged one, or no such messages in it.
    """
    require_packages(f"{file}, which is a ROS 2 bag,", "rosbags")
    kinds = (_FIX,) if reports else (_POSES, _POINT)
    rows = list[tuple[int, float, str, Any]]()
    try:
        for number, (topic, message) in enumerate(_messages(file, kinds), start=1):
            stamp = message.header.stamp
            for place in _places(message):
                rows.append((number, stamp.sec + 1e-9 * stamp.nanosec, topic, place))
    except Exception as error:  # a damaged bag may raise any error in the packages that read it
        reason = printable(error_summary(error))
        raise InputError(
            f"{file}: expected a ROS 2 bag; it cannot be read: {type(error).__name__}: {reason}"
        ) from error
    if not rows:
        raise InputError(f"{file}: expected messages {' or '.join(kinds)}; got none")
    dates, epoch = min(row[1] for row in rows) > _FIRST_DATE, datetime.fromtimestamp(0, UTC)
    columns: dict[str, list[Any]] = {
        "time": [epoch + timedelta(seconds=row[1]) if dates else row[1] for row in rows],
        "id" if reports else "sensor": [row[2] for row in rows],
        "longitude" if reports else "x": [row[3][0] for row in rows],
        "latitude" if reports else "y": [row[3][1] for row in rows],
    }
    return columns, [row[0] for row in rows]


def _messages(file: Path, kinds: tuple[str, ...]) -> Any:
    """Yield topic and content of every message of these kinds, in order of time."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    # All distributions define these messages equally; definitions in the bag take precedence.
    with AnyReader([file], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        connections = [connection for connection in reader.connections if connection.msgtype in kinds]
        if connections:
            for connection, _, raw in reader.messages(connections=connections):
                yield connection.topic, reader.deserialize(raw, connection.msgtype)


def _places(message: Any) -> list[tuple[float | None, float | None]]:
    if message.__msgtype__ == _FIX:
        return [(message.longitude, message.latitude)] if message.status.status >= 0 else []
    if message.__msgtype__ == _POINT:
        return [(message.point.x, message.point.y)]
    return [(pose.position.x, pose.position.y) for pose in message.poses] or [(None, None)]
