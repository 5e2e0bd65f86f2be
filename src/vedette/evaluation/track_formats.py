"""Whole tracks in formats of maps, globes and log viewers: GeoJSON, CZML, MCAP."""

import io
import json
from collections import defaultdict
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime, timedelta
from typing import Any, TypeAlias

from vedette.errors import InputError

Table: TypeAlias = Mapping[str, Sequence[Any]]
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_DIGITS = 7  # decimals of a degree: a centimetre
# In the form that Foxglove's map reads; covariances are of east, north and up, row by row.
_FIX = {
    "type": "object",
    "properties": {
        "timestamp": {
            "type": "object",
            "title": "time",
            "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}},
        },
        "frame_id": {"type": "string"},
        "latitude": {"type": "number"},
        "longitude": {"type": "number"},
        "altitude": {"type": "number"},
        "position_covariance": {"type": "array", "items": {"type": "number"}, "minItems": 9, "maxItems": 9},
        "position_covariance_type": {"type": "integer"},
        "existence": {"type": "number"},
    },
}
_DIAGONAL_KNOWN = 2  # type of covariance: only the diagonal is known


def geojson(table: Table) -> bytes:
    """Return one GeoJSON feature per track: a line through its places (or a point), with times and existence by place.

    `label` is the first label of a track, and `labels` has all.
    """
    features = []
    for track, rows in _tracks("GeoJSON", table).items():
        points = [[table["lon_deg"][row], table["lat_deg"][row]] for row in rows]
        points = [[round(degrees, _DIGITS) for degrees in point] for point in points]
        if "z_m" in table:
            points = [[*point, round(table["z_m"][row], 1)] for point, row in zip(points, rows, strict=True)]
        line = {"type": "LineString", "coordinates": points}
        geometry = line if len(points) > 1 else {"type": "Point", "coordinates": points[0]}
        properties: dict[str, Any] = {"label": track, "target": _most_common([table["target"][row] for row in rows])}
        properties["labels"] = list(dict.fromkeys(table["label"][row] for row in rows))
        for name in ("time_s", "utc", "existence"):
            if name in table:
                properties[name] = [table[name][row] for row in rows]
        features.append({"type": "Feature", "geometry": geometry, "properties": properties})
    return json.dumps({"type": "FeatureCollection", "features": features}).encode()


def czml(table: Table) -> bytes:
    """Return one CZML packet per track, for a globe: a point with its path, at its height or 0.

    It has the name of its target or its first label. Times that are not dates count as seconds since 1970.
    """
    packets: list[dict[str, Any]] = []
    for label, rows in _tracks("CZML", table).items():
        times = [table["time_s"][row] for row in rows]
        coordinates: list[float] = []
        for row, time in zip(rows, times, strict=True):
            degrees = [round(table[name][row], _DIGITS) for name in ("lon_deg", "lat_deg")]
            coordinates += [round(time - times[0], 6), *degrees, round(table["z_m"][row], 1) if "z_m" in table else 0.0]
        name = _most_common([table["target"][row] for row in rows]) or label
        packets.append(
            {
                "id": label,
                "name": name,
                "availability": f"{utc_text(times[0])}/{utc_text(times[-1])}",
                "position": {"epoch": utc_text(times[0]), "cartographicDegrees": coordinates},
                "point": {"pixelSize": 8},
                "path": {"width": 2},
                "label": {"text": name, "font": "12px sans-serif", "pixelOffset": {"cartesian2": [0, -16]}},
            }
        )
    first, last = utc_text(min(table["time_s"], default=0.0)), utc_text(max(table["time_s"], default=0.0))
    clock = {"currentTime": first, "interval": f"{first}/{last}"}
    return json.dumps([{"id": "document", "name": "vedette", "version": "1.0", "clock": clock}, *packets]).encode()


def mcap(table: Table) -> bytes:
    """Return an MCAP log with one channel `/tracks/LABEL` per track: JSON of `foxglove.LocationFix` and existence."""
    tracks = _tracks("MCAP", table)
    from mcap.writer import Writer

    content = io.BytesIO()
    writer = Writer(content)
    writer.start(library="vedette")
    schema = writer.register_schema("foxglove.LocationFix", "jsonschema", json.dumps(_FIX).encode())
    channels = {
        row: (writer.register_channel(f"/tracks/{label}", "json", schema), label)
        for label, rows in tracks.items()
        for row in rows
    }
    for row, time in enumerate(table["time_s"]):  # of all tracks, in order of time
        channel, label = channels[row]
        nanoseconds = max(0, round(time * 1e9))  # a log begins in 1970
        east, north = table["std_x_m"][row], table["std_y_m"][row]
        up = table["std_z_m"][row] if "z_m" in table else 0.0
        message = {
            "timestamp": {"sec": nanoseconds // 10**9, "nsec": nanoseconds % 10**9},
            "frame_id": label,
            "latitude": table["lat_deg"][row],
            "longitude": table["lon_deg"][row],
            "altitude": table["z_m"][row] if "z_m" in table else 0.0,
            "position_covariance": [east * east, 0.0, 0.0, 0.0, north * north, 0.0, 0.0, 0.0, up * up],
            "position_covariance_type": _DIAGONAL_KNOWN,
            "existence": table["existence"][row],
        }
        writer.add_message(channel, nanoseconds, json.dumps(message).encode(), nanoseconds)
    writer.finish()  # type: ignore[no-untyped-call]
    return content.getvalue()


def _tracks(kind: str, table: Table) -> dict[str, list[int]]:
    """Return the rows of every track, for a format of places on the Earth."""
    if "lon_deg" not in table:
        raise InputError(f"{kind}: expected tracks in longitude and latitude, by an origin of the scenario; got metres")
    tracks = defaultdict(list)
    for row, track in enumerate(table["track"]):
        tracks[track].append(row)
    return tracks


def utc_text(time: float) -> str:
    """Return seconds since 1970 as ISO 8601, to the millisecond. Raises `InputError` beyond years of four digits."""
    try:
        moment = _EPOCH + timedelta(seconds=time)
    except OverflowError:
        raise InputError(f"time: expected seconds since 1970 of a date before the year 10000; got {time:g}") from None
    return moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")


def _most_common(names: Sequence[str | None]) -> str | None:
    known = [name for name in names if name is not None]
    return max(sorted(set(known)), key=known.count) if known else None
