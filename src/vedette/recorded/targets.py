"""Recorded trajectories as targets: aircraft, ships, or anything that reports its position."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from vedette.errors import InputError
from vedette.kernels.base.types import CLIMB, HEIGHT, PLANE, STATE_COMPONENTS, VELOCITY, place_of
from vedette.models.arguments import real, reject
from vedette.recorded.cleaning import Cleaning, CleaningCounts, RecordedTrack
from vedette.recorded.files import read_table
from vedette.recorded.reports import Reports, parse_reports
from vedette.recorded.tables import as_table, seconds
from vedette.simulation.truth import TIME_TOLERANCE, Truth, scan_times

_FIRST_DATE, _LAST_DATE = 1e8, 1e10  # s of the Unix epoch, 1973 and 2286


@dataclass(frozen=True, slots=True, eq=False)
class RecordedTargets:
    """Targets that follow recorded reports. Between them, a cubic through positions and velocities (Hermite).

    A target exists from its first report to its last. States are [px, py, vx, vy], or [px, py, vx, vy, pz, vz] with
    `with_height`. Ids count the tracks in order of their first report.

    Attributes:
        reports: see `from_file` and `from_columns`.
        time_origin: recorded time of the first scan: seconds, or an ISO 8601 time. None: the earliest report.
        cleaning: settings of the steps from reports to tracks.
        with_height: True for states with the recorded altitudes, between which heights change steadily.
        tracks: the tracks, in order of target id.
        counts: of what the cleaning left out.

    Raises:
        InputError: no track is left after the cleaning, or heights are wanted, and no altitudes are recorded.
    """

    reports: Reports
    time_origin: float | str | None = None
    cleaning: Cleaning = field(default_factory=Cleaning)
    with_height: bool = False
    tracks: tuple[RecordedTrack, ...] = field(init=False)
    counts: CleaningCounts = field(init=False)

    def __post_init__(self) -> None:
        tracks, counts = self.cleaning.apply(self.reports)
        if not tracks:
            raise InputError(
                f"recorded targets: expected at least one track after cleaning; got none of {counts.in_words()}"
            )
        if self.with_height and self.reports.altitudes is None:
            raise InputError("recorded targets: expected a column altitude_m of every report, for heights; got none")
        try:
            origin = float(self.reports.times.min()) if self.time_origin is None else seconds(self.time_origin)
        except (TypeError, ValueError):
            raise reject("time_origin", "a number of seconds or an ISO 8601 time", self.time_origin) from None
        for name, value in (("tracks", tracks), ("counts", counts), ("time_origin", real("time_origin", origin))):
            object.__setattr__(self, name, value)

    @classmethod
    def from_file(
        cls,
        path: str | Path,
        *,
        columns: Mapping[str, str] | None = None,
        origin_deg: tuple[float, float] | None = None,
        usual_origin_deg: tuple[float, float] | None = None,
        time_origin: float | str | None = None,
        cleaning: Cleaning | None = None,
        sha256: str | None = None,
    ) -> "RecordedTargets":
        """Return targets from a file with columns time, id and x, y or longitude, latitude (and optionally vx, vy).

        Args:
            path: of a file that `read_table` reads, such as .csv or .parquet.
            columns: names in the file if they differ, {"time": "Time", "id": "MMSI", "longitude": "lon", ...}.
            origin_deg: longitude and latitude of (0, 0), for the tangent plane, only for longitudes and latitudes.
            usual_origin_deg: used if `origin_deg` is None, and ignored for x and y. None: the median of the reports.
            time_origin, cleaning: see the class.
            sha256: see `read_table`.

        Raises:
            InputError: names the file, row, column, and the expected and given values.
        """
        table = read_table(path, reports=True, sha256=sha256)
        reports = parse_reports(table, columns=columns, origin_deg=origin_deg, usual_origin_deg=usual_origin_deg)
        return cls(reports, time_origin, cleaning or Cleaning())

    @classmethod
    def from_columns(
        cls,
        table: Any,
        *,
        columns: Mapping[str, str] | None = None,
        origin_deg: tuple[float, float] | None = None,
        time_origin: float | str | None = None,
        cleaning: Cleaning | None = None,
    ) -> "RecordedTargets":
        """Return targets from columns in memory, a mapping or a data frame. See `from_file`.

        Messages count rows from 1.
        """
        reports = parse_reports(as_table(table), columns=columns, origin_deg=origin_deg)
        return cls(reports, time_origin, cleaning or Cleaning())

    def truth(self, times: ArrayLike, *, rng: np.random.Generator) -> Truth:
        """Return the tracks at the scan times, with the first scan at `time_origin`. `rng` is not used.

        Raises:
            InputError: no track exists at any of the scans.
        """
        from scipy.interpolate import CubicHermiteSpline

        scans = scan_times(times)
        recorded = real("time_origin", self.time_origin) + (scans - scans[0])
        alive = np.zeros((len(self.tracks), len(scans)), np.bool_)
        components = STATE_COMPONENTS["constant_velocity_height"] if self.with_height else PLANE
        states = np.zeros((len(self.tracks), len(scans), len(components)))
        for i, track in enumerate(self.tracks):
            alive[i] = (recorded >= track.times[0] - TIME_TOLERANCE) & (recorded <= track.times[-1] + TIME_TOLERANCE)
            path = CubicHermiteSpline(track.times, track.positions, track.velocities)
            states[i, alive[i], :2] = path(recorded[alive[i]])
            states[i, alive[i], VELOCITY] = path(recorded[alive[i]], 1)
            if self.with_height and track.altitudes is not None:
                at = recorded[alive[i]]
                states[i, alive[i], place_of(HEIGHT, components)] = np.interp(at, track.times, track.altitudes)
                climbs = np.diff(track.altitudes) / np.diff(track.times)
                leg = np.clip(np.searchsorted(track.times, at, side="right") - 1, 0, len(climbs) - 1)
                states[i, alive[i], place_of(CLIMB, components)] = climbs[leg]
        if not alive.any():
            first, last = min(track.times[0] for track in self.tracks), max(track.times[-1] for track in self.tracks)
            expected = f"scans between the first and last report, {_span(first, last)}"
            raise reject("times", expected, f"{_span(recorded[0], recorded[-1])} of recorded time")
        return Truth.from_arrays(scans, alive, states)


def _span(first: float, last: float) -> str:
    """Return two recorded times for a message: as dates if they are seconds of the Unix epoch."""
    if not _FIRST_DATE <= first <= last <= _LAST_DATE:
        return f"{first:.6g} to {last:.6g} s"
    return " to ".join(datetime.fromtimestamp(time, UTC).isoformat(timespec="seconds") for time in (first, last))
