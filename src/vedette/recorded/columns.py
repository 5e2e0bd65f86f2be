"""Columns of a table of scans: their quantities and units, and checks that they suit the sensors' measurements."""

from collections.abc import Mapping, Sequence

import numpy as np

from vedette.errors import InputError
from vedette.internal.quantities import ANGLES, COMPONENTS, HEIGHT_DEPENDENT, is_doppler, is_position
from vedette.internal.text import shown
from vedette.kernels.base.types import Floats
from vedette.models.arguments import reject
from vedette.models.pose_noise import pose_stds_of
from vedette.platforms.compass import PlaneCompass
from vedette.recorded.conventions import GAPS, OTHER_NAMES, OTHER_UNITS, OWN_SPEEDS, UNITS, Conventions
from vedette.recorded.geography import Origin
from vedette.recorded.scan_times import RecordedSensor
from vedette.recorded.tables import Table, are_dates, column_names, is_empty
from vedette.recorded.turns import RadarService


class ScanColumns:
    """The columns of a table as quantities. Raises `InputError` for missing or inconsistent ones."""

    def __init__(
        self, table: Table, sites: Sequence[RecordedSensor], conventions: Conventions, origin: Origin | None
    ) -> None:
        self.table, self.sites, self.conventions, self.origin = table, sites, conventions, origin
        self.compass = origin or PlaneCompass()
        self.bearings = tuple(conventions.bearings or ("north" if site.compass else table.bearings) for site in sites)
        self._columns: dict[str, tuple[str, float]] = {}
        for quantity, units in UNITS.items():
            if (column := self._found(quantity, units)) is not None:
                self._columns[quantity] = column
        self._time, self._time_unit = self._columns.get("time") or (self._plain("time"), 1.0)
        has_sensor = "sensor" in conventions.columns or "sensor" in table.columns  # a single one needs no column
        self._sensor = self._plain("sensor") if len(sites) > 1 or has_sensor else None
        self._numbers = {site.name: s for s, site in enumerate(sites)} | {
            str(s): s - 1 for s in range(1, len(sites) + 1) if str(s) not in {site.name for site in sites}
        }
        self.is_utc = are_dates(table.columns[self._time])
        self.notes = list[str]()
        self._check()
        self.accuracy = tuple(map(self._accuracy, sites))

    def service_of(self, sensor: int) -> RadarService | None:
        """Return the turn of a sensor by its service messages, or None without any."""
        return next((own for name, own in self.table.service.items() if self._numbers.get(name) == sensor), None)

    def _has_gaps(self, quantity: str) -> bool:
        """Return True if a row with a measurement has an empty cell of a third component."""
        pairs = ("bearing", "range", "x", "y", "lon", "lat")
        names = (quantity, *(name for name in pairs if name in self._columns))
        columns = (self.table.columns[self._columns[name][0]] for name in names)
        return any(is_empty(cell) and not all(map(is_empty, others)) for cell, *others in zip(*columns, strict=True))

    @property
    def unused(self) -> tuple[str, ...]:
        """Columns that are not read."""
        measured = {name for site in self.sites for name in COMPONENTS[site.kind]}
        measured |= {"lon", "lat"} if "x" in measured else set()
        own = {"own_x", "own_y", "own_lon", "own_lat", "own_heading"}
        own |= {*OWN_SPEEDS} if any(is_doppler(site.kind) for site in self.sites) else set()
        own |= {"own_height"} if any(site.kind in HEIGHT_DEPENDENT for site in self.sites) else set()
        own |= {name for names in self.accuracy for name in names or ()}
        used = {self._columns[name][0] for name in measured | own if name in self._columns} | {self._time, self._sensor}
        return tuple(name for name in self.table.columns if name not in used)

    def _accuracy(self, site: RecordedSensor) -> tuple[str, ...] | None:
        """Return the columns with accuracy, signal-to-noise ratio, class and size of the rows of a sensor.

        None if its rows bring no noise: without such columns, and with all components of the measurement.
        """
        names = [f"{name}_std" for name in COMPONENTS[site.kind]]
        if {"x_std", "y_std"} <= set(self._columns):
            names += ["xy_correlation"] * is_position(site.kind)
        names += ["snr"] * (site.signal is not None)
        if site.features is not None:
            names += ["class"] * bool(site.features.reports) + ["size"] * bool(site.features.sizes)
        names += [f"own_{each}_std" for each in pose_stds_of(COMPONENTS[site.kind], site.kind in HEIGHT_DEPENDENT)]
        own = tuple(name for name in names if name in self._columns)
        has_gaps = any(self._has_gaps(name) for name in COMPONENTS[site.kind] if name in GAPS)
        return own if own or has_gaps else None

    def without_velocity(self, poses: Floats) -> tuple[str, ...]:
        """Return a note of each moving sensor that measures range rates but has no columns of its velocity.

        poses: (num_instants, num_sensors, ...).
        """
        if {*OWN_SPEEDS} <= set(self._columns):
            return ()
        reason = (
            "measures range rates and moves, but its velocity is not given: they are taken as relative to the ground"
        )
        return tuple(
            f"{site.name} {reason} (columns {', '.join(OWN_SPEEDS)})"
            for s, site in enumerate(self.sites)
            if is_doppler(site.kind) and np.ptp(poses[:, s, :2], axis=0).any()
        )

    def _plain(self, quantity: str) -> str:
        """Return the name of the column of time or sensor."""
        names = (self.conventions.columns.get(quantity, quantity), *OTHER_NAMES.get(quantity, ()))
        for name in names:
            if name in self.table.columns:
                return name
        self.table.column(names[0])
        raise AssertionError  # the line above raises for a missing column

    def _found(self, quantity: str, units: Mapping[str, float]) -> tuple[str, float] | None:
        """Return the column of a quantity and the size of its unit in SI, or None if there is none."""
        if (named := self.conventions.columns.get(quantity)) is not None:
            self.table.column(named)
            return named, self._unit(quantity, named, units)
        is_slant = quantity == "range" and all(site.kind in HEIGHT_DEPENDENT for site in self.sites)
        slant = ("slant_range",) if is_slant else ()
        by_lower = {name.casefold(): name for name in reversed([*self.table.columns])}
        for stem in (*slant, quantity, *OTHER_NAMES.get(quantity, ())):
            if stem in self.table.columns:
                return stem, self._unit(quantity, stem, units)
            for unit in units:
                name = by_lower.get(f"{stem}_{unit}".casefold(), "")
                if name.startswith(f"{stem}_"):  # only the unit may be in capitals
                    return name, self._unit(quantity, name, units)
        return None

    def _unit(self, quantity: str, name: str, units: Mapping[str, float]) -> float:
        given = self.conventions.units.get(quantity)
        ending = name.casefold().rpartition("_")[2]
        ends = [unit for unit in units if ending == unit and unit]
        if given is None and not ends and ending in OTHER_UNITS:
            cure = f"units: {{{quantity}: {next(iter(units))}}} after conversion"
            raise InputError(
                f"{self.table.source}, column {shown(name)}: expected one of {', '.join(units)}, or {cure}; "
                f"got {ending}"
            )
        if given is None and not ends and units is ANGLES:
            if self._told_by_compass(quantity):
                return ANGLES["deg"]
            expected = f"a unit of {quantity}: a column {quantity}_deg or {quantity}_rad, or units: {{{quantity}: deg}}"
            raise InputError(f"{self.table.source}, column {shown(name)}: expected {expected}; got none")
        return units[given or (ends[0] if ends else next(iter(units)))]

    def _told_by_compass(self, quantity: str) -> bool:
        """Return True if all sensors with an angle give it in degrees, as a compass does."""
        sites = [site for site in self.sites if quantity != "bearing" or "bearing" in COMPONENTS.get(site.kind, ())]
        return bool(sites) and all(site.compass for site in sites)

    def _check(self) -> None:
        """Check that the table has the sensors' measurements, with units and conventions."""
        have = column_names(self.table.columns) or "none"
        geographic = {"lon", "lat"} <= set(self._columns)
        for site in self.sites:
            if site.kind not in COMPONENTS:
                raise reject(f"sensor {site.name}", f"measurements of kind {', '.join(COMPONENTS)}", site.kind)
            for quantity in COMPONENTS[site.kind]:
                if quantity not in self._columns and not (quantity in ("x", "y") and geographic):
                    expected = f"a column of {quantity}, as sensor {shown(site.name)} measures {site.kind}"
                    raise InputError(f"{self.table.source}: expected {expected}; got columns {have}")
        angles = {"bearing", "own_heading"} & set(self._columns)
        if angles and any(
            bearings is None and ("own_heading" in angles or "bearing" in COMPONENTS[site.kind])
            for site, bearings in zip(self.sites, self.bearings, strict=True)
        ):
            expected = "bearings: north (clockwise, a compass) or east (counter-clockwise)"
            name = shown(self._columns[min(angles)][0])
            raise InputError(f"{self.table.source}, column {name}: expected {expected}; got none")
        if {"lon", "lat", "own_lon", "own_lat"} & set(self._columns) and self.origin is None:
            expected = "an origin {lon: , lat: } for longitudes and latitudes"
            raise InputError(f"{self.table.source}: expected {expected}; got none")

        self._check_places()

    def _check_places(self) -> None:
        """Check that places have both coordinates."""
        pairs = [("own_x", "own_y"), ("own_lon", "own_lat"), OWN_SPEEDS]
        if any(is_position(site.kind) for site in self.sites):
            pairs += [("x", "y"), ("lon", "lat")]
        for pair in pairs:
            there = [name for name in pair if name in self._columns]
            if len(there) == 1:
                (missing,) = set(pair) - set(there)
                expected = (
                    f"a column of {missing} beside it, as a {'velocity' if pair is OWN_SPEEDS else 'place'} has both"
                )
                name = shown(self._columns[there[0]][0])
                raise InputError(f"{self.table.source}, column {name}: expected {expected}; got none")
