"""Recordings in the formats of others, as tables: AIS messages of ships (NMEA 0183), and radar plots (ASTERIX)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from vedette.errors import InputError
from vedette.extras import need
from vedette.text import shown

AIS_ENDINGS = (".nmea", ".ais")
ASTERIX_ENDINGS = (".ast", ".asterix")
_KNOT = 1852.0 / 3600.0  # m/s
_HALF_DAY = 43_200.0  # s
_NO_SPEED, _NO_COURSE = 102.3, 360.0  # what AIS says where a ship does not know
_MONOPULSE_PLOTS = 48  # category of what a rotating radar sees; others are passed over

Columns = dict[str, list[Any]]


def read_ais(file: Path) -> tuple[Columns, list[int]]:
    """Positions of ships: `time`, `id` (MMSI), `longitude`, `latitude`; `vx`, `vy` where every ship says them.

    Times are those of the receiver in tag blocks (`\\c:1452603741*..\\`); lines without one, and messages that are no
    positions, are passed over. Returns the columns and the line of each row.

    Raises:
        MissingPackageError: pyais is not installed.
        InputError: no position with a time in it.
    """
    need(f"{file}, which is a file of AIS messages,", "pyais")
    from pyais.stream import IterMessages

    rows, lines = list[tuple[Any, ...]](), list[int]()
    with file.open("rb") as source:
        for number, line in enumerate(source, start=1):
            for message in IterMessages([line.rstrip()]):
                found = _position(message)
                if found is not None:
                    rows.append(found)
                    lines.append(number)
    if not rows:
        raise InputError(f"{file}: expected AIS positions with times in tag blocks; got none")
    names = ("time", "id", "longitude", "latitude")
    columns: Columns = {name: [row[place] for row in rows] for place, name in enumerate(names)}
    if all(row[4] is not None for row in rows):
        columns |= {"vx": [row[4][0] for row in rows], "vy": [row[4][1] for row in rows]}
    return columns, lines


def _position(message: Any) -> tuple[Any, ...] | None:
    """Time, MMSI, longitude, latitude and velocity of a message; None of any other."""
    from pyais.exceptions import AISBaseException

    if message.tag_block is None:
        return None
    try:
        message.tag_block.init()
        said = message.decode().asdict()
        time = float(message.tag_block.receiver_timestamp)
    except (AISBaseException, TypeError, ValueError):
        return None
    place = said.get("lon"), said.get("lat")
    if not all(isinstance(number, float) for number in place) or abs(place[0]) > 180.0 or abs(place[1]) > 90.0:
        return None
    return time / 1000.0 if time > 1e11 else time, str(said["mmsi"]), *place, _velocity(said)


def _velocity(said: dict[str, Any]) -> tuple[float, float] | None:
    """m/s to the east and north."""
    speed, course = said.get("speed"), said.get("course")
    if speed is None or course is None or speed >= _NO_SPEED or course >= _NO_COURSE:
        return None
    angle = math.radians(course)
    return _KNOT * speed * math.sin(angle), _KNOT * speed * math.cos(angle)


def read_asterix(file: Path) -> tuple[Columns, list[int]]:
    """Plots of rotating radars, category 048: `time`, `sensor` ("SAC/SIC"), `range_nmi`, `bearing_deg` from north.

    Times are seconds from midnight UTC of the first plot's day; ranges are slant ranges. Other categories, and records
    without a plot, are passed over. Returns the columns and the number of each record.

    Raises:
        MissingPackageError: libasterix is not installed.
        InputError: bytes that are no ASTERIX, or no plots in them.
    """
    need(f"{file}, which is an ASTERIX file,", "asterix")
    columns: Columns = {"time": [], "sensor": [], "range_nmi": [], "bearing_deg": []}
    numbers, days = list[int](), 0.0
    for number, plot in enumerate(_plots(file), start=1):
        if plot is None:
            continue
        time, radar, reach, azimuth = plot
        if columns["time"] and time + days < columns["time"][-1] - _HALF_DAY:  # midnight
            days += 2.0 * _HALF_DAY
        for name, value in zip(columns, (time + days, radar, reach, azimuth), strict=True):
            columns[name].append(value)
        numbers.append(number)
    if not numbers:
        raise InputError(f"{file}: expected plots of category 048; got none")
    return columns, numbers


def _plots(file: Path) -> Iterator[tuple[float, str, float, float] | None]:
    """Of every record of category 048 its plot: time of day, radar, range and azimuth; None of one without."""
    from asterix.base import Bits, RawDatablock
    from asterix.generated import manifest

    editions: Any = manifest["CATS"]
    category = editions[_MONOPULSE_PLOTS][-1]  # the newest
    blocks = RawDatablock.parse(Bits.from_bytes(file.read_bytes()))
    if isinstance(blocks, ValueError):
        raise InputError(f"{file}: expected ASTERIX data blocks; got other bytes")
    for place, block in enumerate(blocks, start=1):
        if block.get_category() != _MONOPULSE_PLOTS:
            continue
        records = category.cv_uap.parse(block.get_raw_records())
        if isinstance(records, ValueError):
            wanted = f"records of category 048 in data block {place}"
            raise InputError(f"{file}: expected {wanted}; got {shown(str(records))}")
        yield from map(_plot, records)


def _plot(record: Any) -> tuple[float, str, float, float] | None:
    source, time, polar = (record.get_item(name) for name in ("010", "140", "040"))
    if source is None or time is None or polar is None:
        return None
    radar = "/".join(str(source.variation.get_item(name).as_uint()) for name in ("SAC", "SIC"))
    reach = polar.variation.get_item("RHO").variation.content.as_quantity("NM")
    azimuth = polar.variation.get_item("THETA").variation.content.as_quantity("\N{DEGREE SIGN}")
    return time.variation.content.as_quantity("s"), radar, reach, azimuth
