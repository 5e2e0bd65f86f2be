"""Plots, service messages and tracks of radars (ASTERIX) as tables."""

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vedette.errors import InputError
from vedette.internal.extras import require_packages
from vedette.internal.text import pluralise, shown
from vedette.models.turns import Turn
from vedette.recorded.turns import RadarService

ASTERIX_ENDINGS = (".ast", ".asterix", ".raw")
CAPTURE_ENDINGS = (".pcap", ".pcapng")
_HALF_DAY = 43_200.0  # s
_MILE, _FLIGHT_LEVEL, _EARTH = 1852.0, 30.48, 6_371_000.0  # m
# Categories of plots of a rotating radar, of its service messages, and of tracks of a tracker.
_PLOTS, _SERVICE, _TRACKS = 48, 34, 62
_NORTH, _SECTOR = 1, 2  # types of service messages: the beam passes the north, or enters a sector
_DEGREE = "\N{DEGREE SIGN}"


class AsterixTable(NamedTuple):
    """Columns of a file, number of each record, warnings, and turns of radars by their service messages."""

    columns: dict[str, list[Any]]
    numbers: list[int]
    notes: tuple[str, ...]
    service: dict[str, RadarService]


def read_asterix(file: Path, *, reports: bool = False) -> AsterixTable:
    """Read plots of rotating radars, category 048, or tracks of a system, category 062. A sensor is "SAC/SIC".

    Columns of plots are `time`, `sensor`, `bearing_deg` from the north, `range_nmi` and `slant_range_nmi`; if any plot
    has a valid flight level (I048/090), which is taken as the height above the radar, `altitude_m`; if any has a valid
    Doppler speed (I048/120, CAL), `range_rate_mps`, taken as positive for growing ranges, as the standard gives no
    sign. `range_nmi` is along the ground if a plot has a flight level, else it is the slant range. Columns of tracks,
    which are read if there are no plots or if `reports` is True, are `time`, `sensor`, `longitude`, `latitude`, `id`
    (the number of the track), `vx`, `vy` if every track has them, and `altitude_m` if any has a measured flight level
    (I062/136). Times are seconds from midnight UTC of the day of the first one. Service messages of category 034 tell
    when a radar turned, and how fast. Other categories are skipped, and records without a time and place are left out.
    There are warnings of plots without a flight level and of records left out.

    Raises:
        MissingPackageError: libasterix is not installed.
        InputError: bytes that are not ASTERIX, or contain no plots and tracks.
    """
    require_packages(f"{file}, which is an ASTERIX file,", "asterix")
    records: dict[int, tuple[list[dict[str, Any]], list[int]]] = {name: ([], []) for name in _READ}
    days, left_out_categories = dict.fromkeys(records, 0.0), list[int]()
    for number, (category, record) in enumerate(_records(file), start=1):
        row = _READ[category](record)
        if row is None:
            left_out_categories.append(category)
            continue
        rows, numbers = records[category]
        if rows and row["time"] + days[category] < rows[-1]["time"] - _HALF_DAY:  # midnight
            days[category] += 2.0 * _HALF_DAY
        rows.append({**row, "time": row["time"] + days[category]})
        numbers.append(number)
    read = _TRACKS if reports or not records[_PLOTS][0] else _PLOTS
    rows, numbers = records[read]
    if not numbers:
        raise InputError(
            f"{file}: expected {'' if reports else 'plots of category 048 or '}tracks of category 062; got none"
        )
    columns: dict[str, list[Any]] = {name: [row[name] for row in rows] for name in rows[0]}
    slant = sum(columns.pop("is_slant", []))
    notes = () if not slant else (_of_slant_ranges(slant, len(numbers)),)
    if num_left_out := left_out_categories.count(read):
        notes = (*notes, f"left out: {pluralise(num_left_out, 'record')} of category {read:03} without a time or place")
    for name in ("range_rate_mps", "altitude_m"):
        if set(columns.get(name, ())) == {None}:
            del columns[name]
    complete_columns = {name: cells for name, cells in columns.items() if name not in ("vx", "vy") or None not in cells}
    return AsterixTable(complete_columns, numbers, notes, _service_of(records[_SERVICE][0]))


def _service_of(messages: list[dict[str, Any]]) -> dict[str, RadarService]:
    """Return for each radar its turn, from messages of one radar in order of time."""
    services: dict[str, RadarService] = {}
    for radar in dict.fromkeys(message["sensor"] for message in messages):
        own = [message for message in messages if message["sensor"] == radar]
        norths = np.array([message["time"] for message in own if message["kind"] == _NORTH])
        periods = [message["period"] for message in own if message["period"]] or np.diff(norths).tolist()
        if periods and (period := float(np.median(periods))) > 0.0:
            services[radar] = RadarService(Turn(period), own[0]["time"], own[-1]["time"])
    return services


def _of_slant_ranges(number: int, total: int) -> str:
    return (
        f"{number} of {total} plots have no flight level: their slant ranges are taken for ranges along the ground, of "
        "an aircraft 10 km high too long by 1.7 km at 30 km and by .5 km at 100 km (bearing_slant_range takes them as "
        "they are)"
    )


def _records(file: Path) -> Iterator[tuple[int, Any]]:
    """Yield category and content of every plot, service message and track."""
    from asterix.base import Bits, RawDatablock
    from asterix.generated import manifest

    editions: Any = manifest["CATS"]
    blocks = RawDatablock.parse(Bits.from_bytes(file.read_bytes()))
    if isinstance(blocks, ValueError):
        raise InputError(f"{file}: expected ASTERIX data blocks; got other bytes")
    for place, block in enumerate(blocks, start=1):
        if (category := block.get_category()) not in _READ:
            continue
        records = editions[category][-1].cv_uap.parse(block.get_raw_records())  # by the newest edition
        if isinstance(records, ValueError):
            expected = f"records of category {category:03} in data block {place}"
            raise InputError(f"{file}: expected {expected}; got {shown(str(records))}")
        yield from ((category, record) for record in records)


def _plot(record: Any) -> dict[str, Any] | None:
    source, time, polar = (record.get_item(name) for name in ("010", "140", "040"))
    if source is None or time is None or polar is None:
        return None
    slant, azimuth = _quantity(polar, "RHO", "NM"), _quantity(polar, "THETA", _DEGREE)
    height = _height(record.get_item("090"))
    ground = _ground_range(_MILE * slant, height)
    reach = slant if ground is None else ground / _MILE
    return {
        **_source(source, time),
        "range_nmi": reach,
        "slant_range_nmi": slant,
        "bearing_deg": azimuth,
        "altitude_m": height,
        "range_rate_mps": _range_rate(record.get_item("120")),
        "is_slant": ground is None,
    }


def _range_rate(doppler: Any) -> float | None:
    """Return a calculated Doppler speed in m/s, or None if it is missing or doubtful."""
    calculated = None if doppler is None else doppler.variation.get_item("CAL")
    if calculated is None or calculated.variation.get_item("D").as_uint():
        return None
    return _quantity(calculated, "CAL", "m/s")


def _height(level: Any) -> float | None:
    """Return the height of a flight level in m, or None if it is missing, not validated or garbled."""
    if level is None or any(level.variation.get_item(name).as_uint() for name in ("V", "G")):
        return None
    return _FLIGHT_LEVEL * _quantity(level, "FL", "FL")


def _ground_range(slant: float, height: float | None) -> float | None:
    """Return the range along the radar's horizontal plane, m, for a round Earth, or None if the height is unknown."""
    if height is None:
        return None
    up = ((_EARTH + height) ** 2 - _EARTH**2 - slant**2) / (2.0 * _EARTH)
    return math.sqrt(slant**2 - up**2) if abs(up) <= slant else None


def _track(record: Any) -> dict[str, Any] | None:
    source, time, place, number, velocity = (record.get_item(name) for name in ("010", "070", "105", "040", "185"))
    if source is None or time is None or place is None or number is None:
        return None
    lon, lat = _quantity(place, "LON", _DEGREE), _quantity(place, "LAT", _DEGREE)
    speeds = {name.lower(): None if velocity is None else _quantity(velocity, name, "m/s") for name in ("VX", "VY")}
    level = record.get_item("136")
    height = None if level is None else _FLIGHT_LEVEL * float(level.variation.content.as_quantity("FL"))
    own = {"longitude": lon, "latitude": lat, "id": str(number.variation.as_uint()), "altitude_m": height}
    return {**_source(source, time), **own, **speeds}


def _service(record: Any) -> dict[str, Any] | None:
    source, time, kind, period = (record.get_item(name) for name in ("010", "030", "000", "041"))
    if source is None or time is None or kind is None or kind.variation.as_uint() not in (_NORTH, _SECTOR):
        return None
    seconds = None if period is None else float(period.variation.content.as_quantity("s"))
    return {**_source(source, time), "kind": kind.variation.as_uint(), "period": seconds}


_READ: dict[int, Callable[[Any], dict[str, Any] | None]] = {_PLOTS: _plot, _SERVICE: _service, _TRACKS: _track}


def _source(source: Any, time: Any) -> dict[str, Any]:
    radar = "/".join(str(source.variation.get_item(name).as_uint()) for name in ("SAC", "SIC"))
    return {"time": time.variation.content.as_quantity("s"), "sensor": radar}


def _quantity(item: Any, name: str, unit: str) -> float:
    return float(item.variation.get_item(name).variation.content.as_quantity(unit))
