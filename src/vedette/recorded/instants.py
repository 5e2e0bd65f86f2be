"""Recorded scans in order of time, and what becomes of them without the biases of the sensors."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from vedette.internal.quantities import COMPONENTS, angles, is_position
from vedette.internal.representation import SummaryRepr
from vedette.internal.text import pluralise
from vedette.kernels.base.types import BEAM, Floats
from vedette.models import Bias
from vedette.models.arguments import float_array
from vedette.models.bias import NO_BIAS, with_offsets
from vedette.models.turns import is_turn
from vedette.platforms.compass import Compass, PlaneCompass, course_deg, wrapped
from vedette.recorded.turns import Turning
from vedette.simulation.records import ScansFile
from vedette.tracking import SensorScan

Bearings = Literal["east", "north"]
_Change = Callable[[Floats], Floats]


def turned(angles: ArrayLike, bearings: Bearings | None, compass: Compass, place: ArrayLike) -> Floats:
    """Return angles of the plane, rad in [-pi, pi], of angles that a sensor at `place` counts as `bearings` says."""
    return compass.angle(angles, place) if bearings == "north" else wrapped(angles)


def with_wrapped_angles(values: Floats, kind: str) -> Floats:
    """Return measurements of a kind, or their differences (..., meas_dim), with angles in [-pi, pi)."""
    found = values.copy()
    for place in angles(COMPONENTS[kind]):
        found[..., place] = np.remainder(found[..., place] + math.pi, 2.0 * math.pi) - math.pi
    return found


@dataclass(frozen=True, slots=True)
class Site:
    """A sensor of a recording.

    Attributes:
        name: as the rows name it; its number, from 1, will do too.
        kind: of its measurements, a key of `vedette.internal.quantities.COMPONENTS`.
        pose: [px, py, heading_rad, ...] where the rows do not say.
        bias: what the rows say too much, which is taken off as they are read; ranges that would be below 1 m without it
            are taken as 1 m.
        compass: whether it tells bearings in degrees clockwise from true north, where the rows say nothing else.
        reach: m, beyond which it measures nothing; inf: not known.
        north: where true north is; an `Origin` knows it at every place, without one it is along y.
        turn: how its beam turns, where its scans are turns; "found": as its rows show, if they do; "none": it does not.
    """

    name: str
    kind: str
    pose: tuple[float, ...]
    bias: Bias = NO_BIAS
    compass: bool = False
    reach: float = math.inf
    north: Compass = field(default_factory=PlaneCompass)
    turn: Turning = "found"

    def measured(self, told: ArrayLike, pose: ArrayLike | None = None) -> Floats:
        """Return (num, meas_dim) measurements for filters, bias included, from those that the sensor gives.

        pose: of the sensor then; None: the site's own.

        Raises:
            InputError: another shape, or numbers that are not finite.
        """
        found, at = float_array("told", told, (None, len(COMPONENTS[self.kind]))), self._place(pose)
        return self._with_angles(found, lambda angles: self.north.angle(np.radians(angles), at), np.radians)

    def told(self, measured: ArrayLike, pose: ArrayLike | None = None) -> Floats:
        """Return the inverse of `measured`; bearings from 0 to 360 degrees."""
        found, at = float_array("measured", measured, (None, len(COMPONENTS[self.kind]))), self._place(pose)
        return self._with_angles(found, lambda angles: course_deg(self.north, angles, at), np.degrees)

    def _place(self, pose: ArrayLike | None) -> Floats:
        return np.asarray(self.pose if pose is None else pose, np.float64)[:2]

    def _with_angles(self, measurements: Floats, bearing: _Change, other: _Change) -> Floats:
        """Return the measurements with bearings and other angles changed, of a sensor with a compass."""
        found, names = measurements.copy(), COMPONENTS[self.kind]
        for place in angles(names) if self.compass else ():
            found[:, place] = (bearing if names[place] == "bearing" else other)(found[:, place])
        return found


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RecordedScans(SummaryRepr):
    """Scans at the instants at which any sensor scanned.

    Attributes:
        times: (num_instants,) s after the first, increasing.
        start: s; the recorded time of the first: since 1970 UTC where times were dates.
        is_utc: whether they were.
        scans: for each instant one a sensor: (num, meas_dim) measurements as filters take them; None: it did not scan.
        poses: (num_instants, num_sensors, 3 or more), each sensor where it was when it scanned last, or will be when it
            first does.
        skipped: what was wrong with the rows that were left out.
        bearings: for each sensor, from where its rows counted bearings, whose direction a bearing's bias has; None: it
            has none.
        unused: columns that were not read.
        notes: what may mislead: slant ranges; of a sensor whose measurements were merged, how many and how wide.
        file: that the rows came from.
        gathered: for each sensor, the median time between the first and the last row of a gathered scan, s; () if none
            were gathered.
    """

    times: Floats
    start: float
    is_utc: bool
    scans: tuple[tuple[Floats | None, ...], ...]
    poses: Floats
    skipped: tuple[str, ...]
    bearings: tuple[Bearings | None, ...]
    unused: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    file: ScansFile = field(default_factory=ScansFile)
    gathered: tuple[float, ...] = ()

    def _summary(self) -> str:
        sizes = f"{pluralise(len(self.times), 'instant')}, {pluralise(self.poses.shape[1], 'sensor')}"
        return (
            f"of {sizes}, {pluralise(self.num_measurements, 'measurement')}, "
            f"{pluralise(len(self.skipped), 'row')} skipped"
        )

    def between(self, begin: float, end: float) -> RecordedScans:
        """The instants from `begin` to before `end`, s of `times`; they start anew where there are any."""
        low, high = np.searchsorted(self.times, [begin, end]).tolist()
        first = float(self.times[low]) if low < high else 0.0
        parts = (
            self.times[low:high] - first,
            self.start + first,
            self.is_utc,
            self.scans[low:high],
            self.poses[low:high],
        )
        return RecordedScans(*parts, self.skipped, self.bearings)

    def arrivals(self) -> Iterator[SensorScan]:
        """Every scan by itself, in order of time, as `LateScans` takes them; times as of `times`."""
        for time, scans, poses in zip(self.times.tolist(), self.scans, self.poses, strict=True):
            for s, scan in enumerate(scans):
                if scan is not None:
                    yield SensorScan(s, time, scan, poses[s])

    @property
    def num_measurements(self) -> int:
        """Of all scans."""
        return sum(len(scan) for scans in self.scans for scan in scans if scan is not None)


class Look(NamedTuple):
    """A scan of one sensor: when, which, (num, meas_dim) what it measured and (3 or more,) from where."""

    time: float
    sensor: int
    scan: Floats
    pose: Floats


def in_order(
    looks: Iterable[Look],
    poses: Floats,
    start: float,
    is_utc: bool,
    skipped: tuple[str, ...],
    bearings: tuple[Bearings | None, ...],
) -> RecordedScans:
    """The scans of a recording, those of one time as an instant.

    Args:
        looks: in any order, at most one of a sensor at a time.
        poses: (num_sensors, 3 or more) the sensors that never scan.
        start: of the times of the looks, see `RecordedScans`.
        is_utc, skipped, bearings: as of `RecordedScans`.
    """
    instants: dict[float, dict[int, Look]] = {}
    for look in looks:
        instants.setdefault(look.time, {})[look.sensor] = look
    times, at = np.array(sorted(instants)), poses.copy()
    for time in reversed(times.tolist()):  # before its first scan a sensor was where it then is
        for s, look in instants[time].items():
            at[s, : len(look.pose)] = look.pose
    found, places = [], np.empty((len(times), *poses.shape))
    for k, time in enumerate(times.tolist()):
        for s, look in instants[time].items():
            at[s, : len(look.pose)] = look.pose
        places[k] = at
        found.append(tuple(instants[time][s].scan if s in instants[time] else None for s in range(len(poses))))
    return RecordedScans(times - times[0], start + float(times[0]), is_utc, tuple(found), places, skipped, bearings)


def without_biases(recording: RecordedScans, sites: Sequence[Site]) -> RecordedScans:
    """The recording as its sensors would have made it without their biases."""
    looks = []
    for time, scans, poses in zip(recording.times.tolist(), recording.scans, recording.poses, strict=True):
        for s, scan in enumerate(scans):
            if scan is not None:
                look = Look(time, s, scan, poses[s])
                looks.append(without_bias(look, sites[s], recording.bearings[s]))
    told = recording.start, recording.is_utc, recording.skipped, recording.bearings
    return in_order(looks, recording.poses[0], *told)


def bias_of(site: Site, bearings: Bearings | None) -> tuple[Floats, Floats]:
    """Return what the bias of a sensor adds to measurements, (meas_dim,) in rad and m, and to its place, (2,) in m."""
    bias, is_place = site.bias, is_position(site.kind)
    measured = np.array([getattr(bias, component) for component in COMPONENTS[site.kind]])
    if bearings == "north" and "bearing" in COMPONENTS[site.kind]:
        measured[COMPONENTS[site.kind].index("bearing")] *= -1.0
    return measured, np.zeros(2) if is_place else np.array([bias.x, bias.y])


def without_bias(look: Look, site: Site, bearings: Bearings | None) -> Look:
    """A scan as its sensor would have made it without its bias."""
    if site.bias == NO_BIAS:
        return look
    measured, place = bias_of(site, bearings)
    scan, pose = with_offsets(look.scan, -measured, COMPONENTS[site.kind]), look.pose.copy()
    pose[:2] -= place
    if is_turn(pose) and "bearing" in COMPONENTS[site.kind]:
        pose[BEAM] -= measured[0]
    return Look(look.time - site.bias.clock, look.sensor, scan, pose)
