"""Scans of sensors, built from rows of measurements."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from vedette.errors import InputError
from vedette.internal.quantities import COMPONENTS, PLACED, is_position
from vedette.internal.text import pluralise, shown
from vedette.kernels.base.types import Floats
from vedette.models.bias import NO_BIAS
from vedette.models.scan_rows import ScanLike, ScanRows, values_of
from vedette.recorded.conventions import Conventions
from vedette.recorded.empty_scans import empty_scans
from vedette.recorded.extents import places_of, wild
from vedette.recorded.geography import Origin
from vedette.recorded.rows import Row, Rows
from vedette.recorded.scan_times import (
    RecordedScan,
    RecordedScans,
    RecordedSensor,
    group_by_time,
    poses_at_sites,
    remove_biases,
)
from vedette.recorded.tables import Table
from vedette.recorded.turns import bearings_of, scans_of_turns
from vedette.simulation.records import ScansFile

_LASTING, _ONE_PLACE = 5, 0.1  # fewest times at which wild rows are at one place, and its size, a share of the distance


def parse_scans(
    table: Table, sites: Sequence[RecordedSensor], conventions: Conventions, origin: Origin | None = None
) -> RecordedScans:
    """Return scans from rows of one measurement each: time, sensor, and the measured quantities.

    A row whose measured cells are all empty is a scan without measurements. So is one that lies beyond the sensor's
    reach or far beyond all others (see `vedette.recorded.extents.wild`). It is listed in `skipped`.

    Args:
        table: see `vedette.recorded.files.read_table`.
        sites: the sensors, in the order of the tracker's.
        conventions: of the rows.
        origin: of longitudes and latitudes.

    Raises:
        InputError: names the file, row, column, and the expected and given values.
    """
    rows = Rows(table, sites, conventions, origin)
    readable, skipped = rows.read()
    if not readable:
        raise InputError(f"{table.source}: expected at least one row that can be read; got none of {len(table.rows)}")
    marked = {row.sensor for row in readable if row.measured is None}
    readable, beyond, lasting = _without_wild(readable, table, sites)
    recording = _at_instants(readable, rows, skipped + beyond, marked)
    notes = (*table.notes, *rows.notes, *lasting, *rows.without_velocity(recording.poses))
    file, columns = ScansFile(Path(table.source).name, table.sha256), tuple(names or () for names in rows.accuracy)
    if any(site.bias != NO_BIAS for site in sites):
        recording = remove_biases(recording, sites)
    return replace(recording, unused=rows.unused, notes=notes, file=file, accuracy_columns=columns)


def _without_wild(
    rows: list[Row], table: Table, sites: Sequence[RecordedSensor]
) -> tuple[list[Row], tuple[str, ...], tuple[str, ...]]:
    """Return the rows, wild ones first and without measurements, the faults of the wild ones, and warnings of them."""
    placed = [i for i, row in enumerate(rows) if row.measured is not None and sites[row.sensor].kind in PLACED]
    if not placed:
        return rows, (), ()
    placed_rows = [rows[i] for i in placed]
    sensor_places = np.array([row.pose[:2] for row in placed_rows])
    reaches = np.array([sites[row.sensor].reach for row in placed_rows])
    times, sensors = np.array([row.time for row in placed_rows]), np.array([row.sensor for row in placed_rows])
    places = np.where([[is_position(sites[s].kind)] for s in sensors.tolist()], 0.0, sensor_places)
    for s in set(sensors.tolist()):
        scan = _scan([row for row in placed_rows if row.sensor == s], sites[s])
        places[sensors == s] += places_of(scan, np.zeros(2), sites[s].kind)
    is_wild = wild(times, places, sensor_places, reaches)
    texts, emptied = list[str](), dict[int, Row]()
    for j in np.flatnonzero(is_wild).tolist():
        row, away = placed_rows[j], float(np.hypot(*(places[j] - sensor_places[j])))
        reach = sites[row.sensor].reach
        why = f"within its reach of {reach:g} m" if away > reach else "no farther than the others"
        expected = f"a measurement of {shown(sites[row.sensor].name)} {why}"
        texts.append(f"{table.source}, row {table.rows[row.index]}: expected {expected}; got one {away:.0f} m away")
        emptied[placed[j]] = replace(row, measured=None)
    lasting, off = list[str](), places - sensor_places
    for s in set(sensors[is_wild].tolist()):
        own = is_wild & (sensors == s)
        lasting += _lasting(sites[s].name, times[own], off[own])
    return [*emptied.values(), *(row for i, row in enumerate(rows) if i not in emptied)], tuple(texts), tuple(lasting)


def _lasting(name: str, times: Floats, off: Floats) -> Iterator[str]:
    """Yield a warning of wild rows that stay at one place, perhaps a target. off: (num, 2) m from the sensor."""
    middle = np.median(off, axis=0)
    stay = times[np.hypot(*(off - middle).T) <= _ONE_PLACE * np.hypot(*middle)]
    if len(np.unique(stay)) >= _LASTING:
        where = f"about {np.hypot(*middle):.0f} m away between t = {stay.min():g} and {stay.max():g} s"
        cure = "if they are of a target, give the sensor a `detection` with a max_range beyond it"
        yield f"{name}: {pluralise(len(stay), 'row')} left out, far beyond all others but {where}: {cure}"


def _at_instants(rows: list[Row], how: Rows, skipped: tuple[str, ...], marked: set[int]) -> RecordedScans:
    """Return rows with one sensor and time as scans, scans with one time as instants.

    marked: sensors with rows of empty cells. They have no other empty scans.
    """
    looks, sites, window, texts = list[RecordedScan](), how.sites, how.conventions.scan_window, dict[str, str]()
    spans = [0.0] * len(sites)
    for s, site in enumerate(sites):
        own = sorted((row for row in rows if row.sensor == s), key=lambda row: row.time)
        turning = _looks_of_turns(own, s, how)
        if turning is not None:
            looks += turning
            continue
        groups = _groups(own, window)
        if several := [group[-1].time - group[0].time for group in groups if len(group) > 1]:
            spans[s] = float(np.median(several))
        with_rows = list[RecordedScan]()
        for group in groups:
            time = math.fsum(row.time for row in group) / len(group) if window > 0.0 else group[0].time
            pose = np.array(group[-1].pose)
            with_rows.append(RecordedScan(time, s, _scan(group, site), pose, _accuracy(group, how.accuracy[s])))
        looks += with_rows
        if with_rows and how.conventions.empty_scans == "found" and s not in marked:
            empty, texts[site.name] = _without_rows(with_rows, site)
            looks += empty
    recording = group_by_time(looks, poses_at_sites(sites, looks), 0.0, how.is_utc, skipped, how.bearings)
    empty_texts = tuple(f"{name} {text}" for name, text in texts.items() if text)
    return replace(recording, gathered=tuple(spans), empty=empty_texts)


def _without_rows(scans: list[RecordedScan], site: RecordedSensor) -> tuple[list[RecordedScan], str]:
    """Return the scans between those with rows that have none, and a description, or nothing without a period."""
    is_placed = site.kind in PLACED
    places = [places_of(look.scan, look.pose, site.kind) if is_placed else values_of(look.scan) for look in scans]
    of_rows = np.repeat(np.arange(len(scans)), [len(each) for each in places])
    found = empty_scans(np.array([look.time for look in scans]), np.concatenate(places), of_rows)
    if found is None:
        return [], ""
    looks = list[RecordedScan]()
    times, before_scans, text = found
    for time, k in zip(times.tolist(), before_scans.tolist(), strict=True):
        before, after = scans[k], scans[k + 1]
        pose = before.pose.copy()
        pose[:2] += (after.pose[:2] - pose[:2]) * (time - before.time) / (after.time - before.time)
        accuracy = None if before.accuracy is None else before.accuracy[:0]
        looks.append(before._replace(time=time, scan=before.scan[:0], pose=pose, accuracy=accuracy))
    return looks, text


def _looks_of_turns(rows: list[Row], sensor: int, how: Rows) -> list[RecordedScan] | None:
    """Return the scans of a turning radar, or None without a turn."""
    own, site = [row for row in rows if row.measured is not None], how.sites[sensor]
    if not own:
        return None
    times, poses, scan = np.array([row.time for row in own]), np.array([row.pose for row in own]), _scan(own, site)
    scans = scans_of_turns(times, bearings_of(scan, poses, site.kind), poses, site.turn, how.service_of(sensor))
    if scans is None:
        return None
    accuracy = _accuracy(own, how.accuracy[sensor])
    return [
        RecordedScan(each.time, sensor, scan[each.rows], each.pose, None if accuracy is None else accuracy[each.rows])
        for each in scans
    ]


def _groups(rows: list[Row], window: float) -> list[list[Row]]:
    groups: list[list[Row]] = []
    for row in rows:
        if not groups or row.time - groups[-1][0].time > window:
            groups.append([])
        groups[-1].append(row)
    return groups


def _scan(rows: list[Row], site: RecordedSensor) -> ScanLike:
    own, dim = [row for row in rows if row.measured is not None], len(COMPONENTS[site.kind])
    values = np.array([row.measured for row in own], np.float64).reshape(len(own), dim)
    brought = [row.brought for row in own if row.brought is not None]
    if not brought:
        return values
    return ScanRows(values, *(column if np.any(column) else None for column in zip(*brought, strict=True)))


def _accuracy(rows: list[Row], columns: Sequence[str] | None) -> Floats | None:
    """Return the columns of accuracy of the rows with a measurement, see `RecordedScans`."""
    if not columns:
        return None
    return np.array([row.accuracy for row in rows if row.measured is not None]).reshape(-1, len(columns))
