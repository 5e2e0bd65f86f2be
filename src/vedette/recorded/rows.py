"""Rows of measurements, in any units and conventions, as filters take them."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from vedette.errors import InputError
from vedette.internal.covariances import SMALLEST_VARIANCE
from vedette.internal.quantities import ANGLES, COMPONENTS, HEIGHT_DEPENDENT, QUANTITIES, is_doppler, is_position
from vedette.internal.text import pluralise, shown
from vedette.kernels.base.types import HEADING, OWN_HEIGHT, OWN_VELOCITY, Floats
from vedette.models.pose_noise import PoseStds, pose_noise
from vedette.recorded.columns import ScanColumns
from vedette.recorded.conventions import GAPS, MOST, ONE_PLACE, ONE_PLACE_SHARE, OVER_A_TURN, OWN_SPEEDS, UNITS
from vedette.recorded.geography import PLANE_REACH
from vedette.recorded.scan_times import turned
from vedette.recorded.tables import FARTHEST, LATEST, across_midnight, attempt, is_empty, is_number, number, seconds

_OWN_POSE = ("own_x", "own_y", "own_lon", "own_lat", "own_heading")


class Brought(NamedTuple):
    """Noise and likelihood ratios of a row, see `vedette.models.ScanRows`."""

    noise: Floats  # (m, m)
    added_noise: Floats  # (m, m)
    log_ratio: float
    class_ratios: tuple[float, ...]  # of each class, or () if the features of classes are not measured


@dataclass(frozen=True, slots=True)
class Row:
    """A row: index in the table, time, sensor, measurement for filters (None: empty) with noise, pose, accuracy."""

    index: int
    time: float
    sensor: int
    measured: tuple[float, ...] | None
    brought: Brought | None
    pose: tuple[float, ...]
    accuracy: tuple[float, ...]


class Rows(ScanColumns):
    """The rows of a table as scans."""

    def read(self) -> tuple[list[Row], tuple[str, ...]]:
        """Return the rows that can be read, and the faults of the others."""
        readable, skipped = list[Row](), list[str]()
        own = [self.table.columns[self._columns[name][0]] for name in _OWN_POSE if name in self._columns]
        self._moving = {
            self._label(i) for i, cells in enumerate(zip(*own, strict=True)) if not all(map(is_empty, cells))
        }
        for i in range(len(self.table.rows)):
            try:
                readable.append(self._row(i))
            except InputError as error:
                if self.conventions.bad_rows == "refuse":
                    raise
                skipped.append(str(error))
        return self._over_midnight(readable), tuple(skipped)

    def _over_midnight(self, rows: list[Row]) -> list[Row]:
        """Return the rows with times that increase over midnight, and note if seconds of the day pass it."""
        clock = np.array([row.time for row in rows])
        times = clock if self.is_utc else across_midnight(clock)
        if (times == clock).all():
            return rows
        num = int(np.count_nonzero(times > clock))
        pass_it = f"{self.table.source}: times are seconds of the day and pass midnight: {pluralise(num, 'row')}"
        self.notes.append(f"{pass_it} counted from the day before (else give dates)")
        return [replace(row, time=time) for row, time in zip(rows, times.tolist(), strict=True)]

    def _row(self, i: int) -> Row:
        s = self._site(i)
        time, pose = self._seconds(i), self._pose(i, s)
        accuracy = {name: self._accuracy_value(i, s, name) for name in self.accuracy[s] or ()}
        measured = self._measured(i, s, pose)
        brought = None if measured is None else self._brought(i, s, measured, pose, accuracy)
        return Row(i, time, s, measured, brought, pose, tuple(accuracy.values()))

    def _site(self, i: int) -> int:
        """Return the sensor of a row, or without a column of sensors, the only one."""
        if self._sensor is None:
            return 0
        if (label := self._label(i)) not in self._numbers:
            names = ", ".join(shown(site.name) for site in self.sites)
            raise self.table.fault(i, self._sensor, f"a sensor among {names}, or its number from 1")
        return self._numbers[label]

    def _label(self, i: int) -> str:
        return "" if self._sensor is None else str(self.table.columns[self._sensor][i]).strip()

    def _seconds(self, i: int) -> float:
        """Return the time of a row, all as dates or all as numbers."""
        cell = self.table.columns[self._time][i]
        read = attempt(seconds, cell)
        time = math.nan if read is None else read * (1.0 if self.is_utc else self._time_unit)
        if not abs(time) <= LATEST or is_number(cell) == self.is_utc:
            limits = f"number of seconds from {-LATEST:g} to {LATEST:g} (of milliseconds: `units: {{time: ms}}`)"
            number = limits if abs(time) > LATEST else "finite number of seconds"
            raise self.table.fault(i, self._time, "an ISO 8601 time" if self.is_utc else f"a {number}")
        return time

    def _value(self, i: int, quantity: str) -> float:
        name, unit = self._columns[quantity]
        read = attempt(number, self.table.columns[name][i])
        if read is None or not math.isfinite(value := unit * read):
            raise self.table.fault(i, name, "a finite number")
        limit = MOST.get(quantity, FARTHEST)
        over = OVER_A_TURN if UNITS[quantity] is ANGLES else 1e-9 * limit
        least = max(-limit, QUANTITIES[quantity].least) if quantity in QUANTITIES else -limit
        if not least - (over if least else 0.0) <= value <= limit + over:
            limits = f"from {least / unit:g} to {limit / unit:g}"
            raise self.table.fault(i, name, f"a number {limits}")
        return value

    def _angle(self, i: int, quantity: str, s: int, place: Sequence[float]) -> float:
        """Return a bearing or heading of a sensor at a place, as an angle of the plane."""
        return float(turned(self._value(i, quantity), self.bearings[s], self.compass, place))

    def _measured(self, i: int, s: int, pose: Sequence[float]) -> tuple[float, ...] | None:
        """Return the measurement as filters take it, or None for a scan without measurements."""
        site = self.sites[s]
        quantities: tuple[str, ...] = COMPONENTS[site.kind]
        if is_position(site.kind) and "lon" in self._columns:
            quantities = ("lon", "lat", *quantities[2:])
        cells = [self.table.columns[self._columns[quantity][0]][i] for quantity in quantities]
        if all(map(is_empty, cells)):
            return None
        if quantities[0] == "lon":
            place = self._agreed(i, self._plane(i, "lon", "lat"), "x", "y")
            return (*place, *(self._third(i, quantity) for quantity in quantities[2:]))
        return tuple(
            self._angle(i, quantity, s, pose) if quantity == "bearing" else self._third(i, quantity)
            for quantity in quantities
        )

    def _third(self, i: int, quantity: str) -> float:
        """Return a measured value, or of a third component that the row does not have, what stands in for it."""
        return GAPS[quantity] if quantity in GAPS and self._is_blank(i, quantity) else self._value(i, quantity)

    def _accuracy_value(self, i: int, s: int, name: str) -> float:
        if self._is_blank(i, name):
            return math.nan
        if name == "class":
            return self._report(i, s)
        if name == "xy_correlation":
            return self._correlation(i)
        return self._value(i, name) if name == "snr" else self._positive(i, name)

    def _report(self, i: int, s: int) -> float:
        """Return the index of the class that a row reports."""
        features, column = self.sites[s].features, self._columns["class"][0]
        assert features is not None  # else the column is not read
        report = str(self.table.columns[column][i]).strip()
        if report not in features.reports:
            raise self.table.fault(i, column, f"one of {', '.join(map(shown, features.reports))}, or an empty cell")
        return float(features.reports.index(report))

    def _brought(
        self, i: int, s: int, measured: Sequence[float], pose: Sequence[float], accuracy: Mapping[str, float]
    ) -> Brought | None:
        """Return covariances and log likelihood ratios of a row, or None if rows of the sensor bring none."""
        if self.accuracy[s] is None:
            return None
        own, site = {name: value for name, value in accuracy.items() if not math.isnan(value)}, self.sites[s]
        names = COMPONENTS[self.sites[s].kind]
        missing = [name in GAPS and self._is_blank(i, name) for name in names]
        stds = [math.inf if gap else own.get(f"{name}_std", 0.0) for name, gap in zip(names, missing, strict=True)]
        noise = np.zeros((len(names), len(names)))
        np.fill_diagonal(noise, np.square(stds))
        noise[0, 1] = noise[1, 0] = stds[0] * stds[1] * own.get("xy_correlation", 0.0) if len(names) > 1 else 0.0
        ratio = site.signal.log_likelihood_ratio(own["snr"]) if site.signal is not None and "snr" in own else 0.0
        classes: Sequence[float] = ()
        if site.features is not None:
            report = int(own["class"]) if "class" in own else None
            classes = site.features.log_ratios(report, own.get("size")).tolist()
        of_pose = PoseStds(**{name: own.get(f"own_{name}_std", 0.0) for name in PoseStds._fields})
        added = pose_noise(measured, names, pose, of_pose) if any(of_pose) else np.zeros(noise.shape)
        return Brought(noise, added, ratio, tuple(classes))

    def _is_blank(self, i: int, quantity: str) -> bool:
        return is_empty(self.table.columns[self._columns[quantity][0]][i])

    def _positive(self, i: int, quantity: str) -> float:
        value, least = self._value(i, quantity), math.sqrt(SMALLEST_VARIANCE)
        if value < least:
            expected = f"a {'size' if quantity == 'size' else 'standard deviation'} above 0, at least {least:g}"
            raise self.table.fault(i, self._columns[quantity][0], f"{expected}, or an empty cell")
        return value

    def _correlation(self, i: int) -> float:
        if abs(value := self._value(i, "xy_correlation")) >= 1.0:
            raise self.table.fault(i, self._columns["xy_correlation"][0], "a correlation above -1 and below 1")
        return value

    def _pose(self, i: int, s: int) -> tuple[float, ...]:
        """Return the pose of the sensor. The site gives what is not in the row."""
        site = self.sites[s]
        place: tuple[float, ...] = site.pose[:2]
        is_blank = all(self._is_blank(i, name) for name in _OWN_POSE if name in self._columns)
        # Positions do not depend on it, and files of several sensors leave it empty.
        at_site = is_blank and (site.kind == "position" or self._label(i) not in self._moving)
        if {"own_lon", "own_lat"} <= set(self._columns) and not at_site:
            place = self._agreed(i, self._plane(i, "own_lon", "own_lat"), "own_x", "own_y")
        elif {"own_x", "own_y"} <= set(self._columns) and not at_site:
            place = self._value(i, "own_x"), self._value(i, "own_y")
        has_heading = "own_heading" in self._columns and not at_site
        heading = self._angle(i, "own_heading", s, place) if has_heading else site.pose[HEADING]
        pose = [*place, heading, *site.pose[HEADING + 1 :]]
        if is_doppler(site.kind) and self._has(i, OWN_SPEEDS, at_site):
            pose[OWN_VELOCITY : OWN_VELOCITY + 2] = (self._value(i, quantity) for quantity in OWN_SPEEDS)
        if site.kind in HEIGHT_DEPENDENT and self._has(i, ("own_height",), at_site):
            pose += [0.0] * (OWN_HEIGHT + 1 - len(pose))
            pose[OWN_HEIGHT] = self._value(i, "own_height")
        return tuple(pose)

    def _has(self, i: int, names: Sequence[str], at_site: bool) -> bool:
        """Return True if a row has these columns. Cells may be empty only where the sensor is at its site."""
        return {*names} <= set(self._columns) and not (at_site and any(self._is_blank(i, name) for name in names))

    def _agreed(self, i: int, place: tuple[float, ...], x: str, y: str) -> tuple[float, ...]:
        """Return a place given in degrees. Raises if the row has one in metres, too, that does not agree."""
        if not {x, y} <= set(self._columns) or self._is_blank(i, x) or self._is_blank(i, y):
            return place
        apart = math.hypot(self._value(i, x) - place[0], self._value(i, y) - place[1])
        if apart > ONE_PLACE + ONE_PLACE_SHARE * math.hypot(*place):
            where = f"the place of its longitude and latitude ({place[0]:.0f}, {place[1]:.0f} m)"
            raise self.table.fault(
                i, self._columns[x][0], f"{x}, {y} at {where}, not {apart:.0f} m away, or one of both"
            )
        return place

    def _plane(self, i: int, lon: str, lat: str) -> tuple[float, ...]:
        assert self.origin is not None  # checked before
        degrees = self._value(i, lon), self._value(i, lat)
        if (place := self.origin.nearby(*degrees)) is None:
            expected = f"with latitude {degrees[1]:g} a longitude within {PLANE_REACH / 1000.0:g} km of the origin"
            raise self.table.fault(i, self._columns[lon][0], f"{expected} (are they exchanged?)")
        return place
