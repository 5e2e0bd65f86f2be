"""Recorded scans of sensors: rows of measurements, in the units and conventions of whoever wrote them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vedette.errors import InputError
from vedette.kernels.base.types import Floats
from vedette.models.arguments import reject
from vedette.models.bias import NO_BIAS
from vedette.platforms.compass import PlaneCompass
from vedette.recorded.conventions import ANGLES, MOST, OTHER_NAMES, QUANTITIES, Conventions
from vedette.recorded.geography import PLANE_REACH, Origin
from vedette.recorded.instants import (
    COMPONENTS,
    Look,
    RecordedScans,
    Site,
    in_order,
    turned,
    without_biases,
)
from vedette.recorded.tables import FARTHEST, LATEST, Table, column_names, is_empty, is_number, number, seconds
from vedette.text import shown


def parse_scans(
    table: Table, sites: Sequence[Site], conventions: Conventions, origin: Origin | None = None
) -> RecordedScans:
    """Scans out of rows of one measurement each: time, sensor, and what was measured.

    A row whose measured cells are all empty says that the sensor scanned and found nothing.

    Args:
        table: see `vedette.recorded.tables.read_table`.
        sites: the sensors, in the order of the tracker's.
        conventions: how rows are read.
        origin: of longitudes and latitudes.

    Raises:
        InputError: names the file, row, column, what was expected and what came.
    """
    rows = _Rows(table, sites, conventions, origin)
    found, skipped = rows.read()
    if not found:
        raise InputError(f"{table.source}: expected at least one row that can be read; got none of {len(table.rows)}")
    recording = _at_instants(found, rows, skipped)
    return without_biases(recording, sites) if any(site.bias != NO_BIAS for site in sites) else recording


@dataclass(frozen=True, slots=True)
class _Row:
    time: float
    sensor: int
    measured: tuple[float, ...] | None
    pose: tuple[float, ...]


class _Rows:
    """The columns of a table as quantities."""

    def __init__(self, table: Table, sites: Sequence[Site], conventions: Conventions, origin: Origin | None) -> None:
        self.table, self.sites, self.conventions, self.origin = table, sites, conventions, origin
        self.compass = origin or PlaneCompass()
        self.bearings = tuple(conventions.bearings or ("north" if site.compass else table.bearings) for site in sites)
        self._columns: dict[str, tuple[str, float]] = {}
        for quantity, units in QUANTITIES.items():
            if (found := self._found(quantity, units)) is not None:
                self._columns[quantity] = found
        self._time, self._sensor = self._plain("time"), self._plain("sensor")
        self._numbers = {site.name: s for s, site in enumerate(sites)} | {
            str(s): s - 1 for s in range(1, len(sites) + 1) if str(s) not in {site.name for site in sites}
        }
        cells = table.columns[self._time]
        self.is_utc = len(cells) > 0 and not is_number(cells[0])
        self._check()

    def _plain(self, quantity: str) -> str:
        """The column of time or sensor."""
        names = (self.conventions.columns.get(quantity, quantity), *OTHER_NAMES.get(quantity, ()))
        for name in names:
            if name in self.table.columns:
                return name
        self.table.column(names[0])
        raise AssertionError  # it is not there, which was told

    def _found(self, quantity: str, units: Mapping[str, float]) -> tuple[str, float] | None:
        """The column of a quantity and what one of its units is in SI; None where there is none."""
        if (named := self.conventions.columns.get(quantity)) is not None:
            self.table.column(named)
            return named, self._unit(quantity, named, units)
        for stem in (quantity, *OTHER_NAMES.get(quantity, ())):
            for name in (stem, *(f"{stem}_{unit}" for unit in units)):
                if name in self.table.columns:
                    return name, self._unit(quantity, name, units)
        return None

    def _unit(self, quantity: str, name: str, units: Mapping[str, float]) -> float:
        given = self.conventions.units.get(quantity)
        ends = [unit for unit in units if name.endswith(f"_{unit}")]
        if given is None and not ends and units is ANGLES:
            if self._told_by_compass(quantity):
                return ANGLES["deg"]
            wanted = f"a unit of {quantity}: a column {quantity}_deg or {quantity}_rad, or units: {{{quantity}: deg}}"
            raise InputError(f"{self.table.source}, column {shown(name)}: expected {wanted}; got none")
        return units[given or (ends[0] if ends else next(iter(units)))]

    def _told_by_compass(self, quantity: str) -> bool:
        """Whether all sensors that have an angle tell it in degrees, as a compass does."""
        sites = [site for site in self.sites if quantity != "bearing" or "bearing" in COMPONENTS.get(site.kind, ())]
        return bool(sites) and all(site.compass for site in sites)

    def _check(self) -> None:
        """That the table has what the sensors measure, and says how."""
        have = column_names(self.table.columns) or "none"
        geographic = {"lon", "lat"} <= set(self._columns)
        for site in self.sites:
            if site.kind not in COMPONENTS:
                raise reject(f"sensor {site.name}", f"measurements of kind {', '.join(COMPONENTS)}", site.kind)
            for quantity in COMPONENTS[site.kind]:
                if quantity not in self._columns and not (site.kind == "position" and geographic):
                    wanted = f"a column of {quantity}, as sensor {shown(site.name)} measures {site.kind}"
                    raise InputError(f"{self.table.source}: expected {wanted}; got columns {have}")
        angles = {"bearing", "own_heading"} & set(self._columns)
        if angles and any(
            bearings is None and ("own_heading" in angles or "bearing" in COMPONENTS[site.kind])
            for site, bearings in zip(self.sites, self.bearings, strict=True)
        ):
            wanted = "bearings: north (clockwise, a compass) or east (counter-clockwise)"
            name = shown(self._columns[min(angles)][0])
            raise InputError(f"{self.table.source}, column {name}: expected {wanted}; got none")
        if {"lon", "lat", "own_lon", "own_lat"} & set(self._columns) and self.origin is None:
            wanted = "an origin {lon: , lat: } for longitudes and latitudes"
            raise InputError(f"{self.table.source}: expected {wanted}; got none")

    def read(self) -> tuple[list[_Row], tuple[str, ...]]:
        """The rows that can be read, and what is wrong with the others."""
        found, skipped = list[_Row](), list[str]()
        for i in range(len(self.table.rows)):
            try:
                found.append(self._row(i))
            except InputError as error:
                if self.conventions.bad_rows == "refuse":
                    raise
                skipped.append(str(error))
        return found, tuple(skipped)

    def _row(self, i: int) -> _Row:
        label = str(self.table.columns[self._sensor][i]).strip()
        if label not in self._numbers:
            names = ", ".join(shown(site.name) for site in self.sites)
            raise self.table.fault(i, self._sensor, f"a sensor among {names}, or its number from 1")
        s = self._numbers[label]
        time, pose = self._seconds(i), self._pose(i, s)
        return _Row(time, s, self._measured(i, s, pose), pose)

    def _seconds(self, i: int) -> float:
        """The time of a row, all as dates or all as numbers."""
        cell = self.table.columns[self._time][i]
        try:
            time = seconds(cell)
        except (TypeError, ValueError, OverflowError):
            time = math.nan
        if not abs(time) <= LATEST or is_number(cell) == self.is_utc:
            wanted = "an ISO 8601 time" if self.is_utc else "a finite number of seconds"
            raise self.table.fault(i, self._time, wanted)
        return time

    def _value(self, i: int, quantity: str) -> float:
        name, unit = self._columns[quantity]
        try:
            value = unit * number(self.table.columns[name][i])
        except (TypeError, ValueError, OverflowError):
            value = math.nan
        if not math.isfinite(value):
            raise self.table.fault(i, name, "a finite number")
        most = MOST.get(quantity, FARTHEST)
        if abs(value) > most * (1.0 + 1e-9) or (quantity == "range" and value < 0.0):
            limits = f"from {0 if quantity == 'range' else -most / unit:g} to {most / unit:g}"
            raise self.table.fault(i, name, f"a number {limits}")
        return value

    def _angle(self, i: int, quantity: str, s: int, place: Sequence[float]) -> float:
        """A bearing or heading of a sensor at a place, as an angle of the plane."""
        return float(turned(self._value(i, quantity), self.bearings[s], self.compass, place))

    def _measured(self, i: int, s: int, pose: Sequence[float]) -> tuple[float, ...] | None:
        """As filters take it; None of a scan that found nothing."""
        site = self.sites[s]
        quantities: tuple[str, ...] = COMPONENTS[site.kind]
        if site.kind == "position" and "lon" in self._columns:
            quantities = ("lon", "lat")
        cells = [self.table.columns[self._columns[quantity][0]][i] for quantity in quantities]
        if all(map(is_empty, cells)):
            return None
        if quantities[0] == "lon":
            return self._plane(i, *quantities)
        return tuple(
            self._angle(i, quantity, s, pose) if quantity == "bearing" else self._value(i, quantity)
            for quantity in quantities
        )

    def _pose(self, i: int, s: int) -> tuple[float, ...]:
        """Where the sensor was, as far as the row says."""
        site = self.sites[s]
        place: tuple[float, ...] = site.pose[:2]
        if {"own_lon", "own_lat"} <= set(self._columns):
            place = self._plane(i, "own_lon", "own_lat")
        elif {"own_x", "own_y"} <= set(self._columns):
            place = self._value(i, "own_x"), self._value(i, "own_y")
        has_heading = "own_heading" in self._columns
        heading = self._angle(i, "own_heading", s, place) if has_heading else site.pose[2]
        return (*place, heading, *site.pose[3:])

    def _plane(self, i: int, lon: str, lat: str) -> tuple[float, ...]:
        assert self.origin is not None  # as was checked
        degrees = self._value(i, lon), self._value(i, lat)
        if (place := self.origin.nearby(*degrees)) is None:
            wanted = f"with latitude {degrees[1]:g} a longitude within {PLANE_REACH / 1000.0:g} km of the origin"
            raise self.table.fault(i, self._columns[lon][0], f"{wanted} (are they exchanged?)")
        return place


def _at_instants(rows: list[_Row], how: _Rows, skipped: tuple[str, ...]) -> RecordedScans:
    """Rows of one sensor and time as a scan, scans of one time as an instant."""
    looks, sites, gather = [], how.sites, how.conventions.gather
    for s, site in enumerate(sites):
        own = sorted((row for row in rows if row.sensor == s), key=lambda row: row.time)
        for group in _groups(own, gather):
            time = math.fsum(row.time for row in group) / len(group) if gather > 0.0 else group[0].time
            looks.append(Look(time, s, _scan(group, site), np.array(group[-1].pose)))
    first = np.zeros((len(sites), max(len(site.pose) for site in sites)))
    for s, site in enumerate(sites):
        first[s, : len(site.pose)] = site.pose
    return in_order(looks, first, 0.0, how.is_utc, skipped, how.bearings)


def _groups(rows: list[_Row], gather: float) -> list[list[_Row]]:
    groups: list[list[_Row]] = []
    for row in rows:
        if groups and row.time - groups[-1][0].time <= gather:
            groups[-1].append(row)
        else:
            groups.append([row])
    return groups


def _scan(rows: list[_Row], site: Site) -> Floats:
    measured = [row.measured for row in rows if row.measured is not None]
    return np.array(measured, np.float64).reshape(len(measured), len(COMPONENTS[site.kind]))
