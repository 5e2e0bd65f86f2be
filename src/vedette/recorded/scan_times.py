"""Recorded scans in order of time, and their correction for the biases of the sensors."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
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
from vedette.models.classes import ClassFeatures
from vedette.models.scan_rows import ScanLike, values_of, with_values
from vedette.models.signal import SignalModel
from vedette.models.turns import is_turn
from vedette.platforms.compass import Compass, PlaneCompass, course_deg, wrapped
from vedette.recorded.turns import Turning
from vedette.simulation.records import ScansFile
from vedette.tracking import SensorScan

Bearings = Literal["east", "north"]
_Change = Callable[[Floats], Floats]


def turned(angles: ArrayLike, bearings: Bearings | None, compass: Compass, place: ArrayLike) -> Floats:
    """Return angles of the plane, rad in [-pi, pi], from angles of a sensor at `place` in the convention `bearings`."""
    return compass.angle(angles, place) if bearings == "north" else wrapped(angles)


def with_wrapped_angles(values: Floats, kind: str) -> Floats:
    """Return measurements of a kind, or their differences (..., meas_dim), with angles in [-pi, pi)."""
    wrapped_values = values.copy()
    for axis in angles(COMPONENTS[kind]):
        wrapped_values[..., axis] = np.remainder(wrapped_values[..., axis] + math.pi, 2.0 * math.pi) - math.pi
    return wrapped_values


@dataclass(frozen=True, slots=True)
class RecordedSensor:
    """A sensor of a recording.

    Attributes:
        name: in the rows. Its number, from 1, is accepted, too.
        kind: of its measurements, a key of `vedette.internal.quantities.COMPONENTS`.
        pose: [px, py, heading_rad, ...] if the rows have none.
        bias: of its rows, removed on reading. Corrected ranges below 1 m become 1 m.
        compass: True if its bearings are degrees clockwise from true north, unless the rows give another convention.
        reach: m, beyond which it measures nothing. inf: unknown.
        north: direction of true north. An `Origin` gives it at every place, the default is along y.
        turn: how its beam turns, if its scans are turns. "found": from its rows, if they show one. "none": no turn.
        signal: signal-to-noise ratios of its measurements. None: a column of these is not read.
        features: reported classes and sizes of its measurements. None: columns of these are not read.
    """

    name: str
    kind: str
    pose: tuple[float, ...]
    bias: Bias = NO_BIAS
    compass: bool = False
    reach: float = math.inf
    north: Compass = field(default_factory=PlaneCompass)
    turn: Turning = "found"
    signal: SignalModel | None = None
    features: ClassFeatures | None = None

    def from_raw(self, raw: ArrayLike, pose: ArrayLike | None = None) -> Floats:
        """Return (num, meas_dim) measurements for filters, bias included, from the sensor's own measurements.

        pose: of the sensor then. None: the site's own.

        Raises:
            InputError: another shape, or numbers that are not finite.
        """
        values, at = float_array("raw", raw, (None, len(COMPONENTS[self.kind]))), self._place(pose)
        return self._with_angles(values, lambda angles: self.north.angle(np.radians(angles), at), np.radians)

    def to_raw(self, measurements: ArrayLike, pose: ArrayLike | None = None) -> Floats:
        """Return the inverse of `from_raw`, with bearings from 0 to 360 degrees."""
        values, at = float_array("measurements", measurements, (None, len(COMPONENTS[self.kind]))), self._place(pose)
        return self._with_angles(values, lambda angles: course_deg(self.north, angles, at), np.degrees)

    def _place(self, pose: ArrayLike | None) -> Floats:
        return np.asarray(self.pose if pose is None else pose, np.float64)[:2]

    def _with_angles(self, measurements: Floats, bearing: _Change, other: _Change) -> Floats:
        """Return the measurements with bearings and other angles converted, if the sensor has a compass."""
        converted, names = measurements.copy(), COMPONENTS[self.kind]
        for axis in angles(names) if self.compass else ():
            converted[:, axis] = (bearing if names[axis] == "bearing" else other)(converted[:, axis])
        return converted


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RecordedScans(SummaryRepr):
    """Scans at the instants at which any sensor scanned.

    Attributes:
        times: (num_instants,) s after the first, increasing.
        start: s, the recorded time of the first: since 1970 UTC if times were dates.
        is_utc: True if times were dates.
        scans: for each instant one per sensor: (num, meas_dim) measurements as filters take them, with their noise
            (`vedette.models.ScanRows`) if the rows have it. None: it did not scan.
        poses: (num_instants, num_sensors, 3 or more), each sensor at its last scan, or before it at its first one.
        skipped: faults of the rows that were left out.
        bearings: for each sensor, the convention of bearings in its rows, in which a bearing's bias counts. None: it
            has none.
        unused: columns that were not read.
        notes: warnings: slant ranges, and for a sensor whose measurements were merged, their number and spread.
        file: of the rows.
        accuracy: for each instant one per sensor: (num, num_columns) values of columns of accuracy as they were read,
            SI units, NaN for an empty cell. None: no scan, or no such columns.
        accuracy_columns: for each sensor, their quantities, such as "range_std" or "snr". A
            "class" is the index of its name in the sensor's `features.reports`.
        gathered: for each sensor, the median time between the first and the last row of its scans of several rows, s,
            or 0 for a sensor without such scans or whose scans are turns, and () if the scans are not from rows.
        empty: descriptions of the scans without a row that were found, one for each sensor with any.
    """

    times: Floats
    start: float
    is_utc: bool
    scans: tuple[tuple[ScanLike | None, ...], ...]
    poses: Floats
    skipped: tuple[str, ...]
    bearings: tuple[Bearings | None, ...]
    unused: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    file: ScansFile = field(default_factory=ScansFile)
    gathered: tuple[float, ...] = ()
    empty: tuple[str, ...] = ()
    accuracy: tuple[tuple[Floats | None, ...], ...] = ()
    accuracy_columns: tuple[tuple[str, ...], ...] = ()

    def _summary(self) -> str:
        sizes = f"{pluralise(len(self.times), 'instant')}, {pluralise(self.poses.shape[1], 'sensor')}"
        return (
            f"of {sizes}, {pluralise(self.num_measurements, 'measurement')}, "
            f"{pluralise(len(self.skipped), 'row')} skipped"
        )

    def between(self, begin: float, end: float) -> "RecordedScans":
        """Return the instants from `begin` to before `end`, s of `times`. Their times start at 0."""
        low, high = np.searchsorted(self.times, [begin, end]).tolist()
        first = float(self.times[low]) if low < high else 0.0
        parts = {name: getattr(self, name)[low:high] for name in ("scans", "poses", "accuracy")}
        return replace(self, times=self.times[low:high] - first, start=self.start + first, **parts)

    def arrivals(self) -> Iterator[SensorScan]:
        """Yield every scan separately, in order of time (as in `times`), as `OutOfSequenceTracker` takes them."""
        for time, scans, poses in zip(self.times.tolist(), self.scans, self.poses, strict=True):
            for s, scan in enumerate(scans):
                if scan is not None:
                    yield SensorScan(s, time, scan, poses[s])

    def measured(self, sensor: int) -> list[Floats]:
        """Return the measurements of each scan of a sensor, (num, meas_dim)."""
        return [values_of(scan) for scans in self.scans if (scan := scans[sensor]) is not None]

    @property
    def num_measurements(self) -> int:
        """Number of measurements of all scans."""
        return sum(len(scan) for scans in self.scans for scan in scans if scan is not None)


class RecordedScan(NamedTuple):
    """A scan of one sensor: time, sensor, (num, meas_dim) measurements, (3 or more,) pose.

    accuracy: see `RecordedScans`.
    """

    time: float
    sensor: int
    scan: ScanLike
    pose: Floats
    accuracy: Floats | None = None


def poses_at_sites(sites: Sequence[RecordedSensor], recorded_scans: Sequence[RecordedScan]) -> Floats:
    """Return the poses of the sensors' sites, (num_sensors, longest pose of sites and scans), zeros behind them."""
    sizes = [*(len(site.pose) for site in sites), *(len(scan.pose) for scan in recorded_scans)]
    poses = np.zeros((len(sites), max(sizes)))
    for s, site in enumerate(sites):
        poses[s, : len(site.pose)] = site.pose
    return poses


def group_by_time(
    recorded_scans: Iterable[RecordedScan],
    poses: Floats,
    start: float,
    is_utc: bool,
    skipped: tuple[str, ...],
    bearings: tuple[Bearings | None, ...],
) -> RecordedScans:
    """Return the scans of a recording, those with equal times as one instant.

    Args:
        recorded_scans: in any order, at most one of a sensor at a time.
        poses: (num_sensors, 3 or more) the sensors that never scan.
        start: of the times of the scans, see `RecordedScans`.
        is_utc, skipped, bearings: see `RecordedScans`.
    """
    instants: dict[float, dict[int, RecordedScan]] = {}
    for scan in recorded_scans:
        instants.setdefault(scan.time, {})[scan.sensor] = scan
    times, at = np.array(sorted(instants)), poses.copy()
    for time in reversed(times.tolist()):  # before its first scan, a sensor has the pose of that scan
        for s, scan in instants[time].items():
            at[s, : len(scan.pose)] = scan.pose
    scans, accuracy, poses_over_time = [], [], np.empty((len(times), *poses.shape))
    for k, time in enumerate(times.tolist()):
        for s, scan in instants[time].items():
            at[s, : len(scan.pose)] = scan.pose
        poses_over_time[k] = at
        own = [instants[time].get(s) for s in range(len(poses))]
        scans.append(tuple(None if each is None else each.scan for each in own))
        accuracy.append(tuple(None if each is None else each.accuracy for each in own))
    facts = times - times[0], start + float(times[0]), is_utc, tuple(scans), poses_over_time, skipped, bearings
    return RecordedScans(*facts, accuracy=tuple(accuracy))


def remove_biases(recording: RecordedScans, sensors: Sequence[RecordedSensor]) -> RecordedScans:
    """Return the recording as its sensors would have made it without their biases."""
    accuracy = recording.accuracy or [[None] * len(sensors)] * len(recording.times)
    recorded_scans = (
        RecordedScan(time, s, scan, recording.poses[k, s], accuracy[k][s])
        for k, time in enumerate(recording.times.tolist())
        for s, scan in enumerate(recording.scans[k])
        if scan is not None
    )
    corrected = [remove_bias(each, sensors[each.sensor], recording.bearings[each.sensor]) for each in recorded_scans]
    facts = recording.start, recording.is_utc, recording.skipped, recording.bearings
    found = group_by_time(corrected, recording.poses[0], *facts)
    parts = {name: getattr(found, name) for name in ("times", "start", "scans", "poses", "accuracy")}
    return replace(recording, **parts)


def sensor_bias(sensor: RecordedSensor, bearings: Bearings | None) -> tuple[Floats, Floats]:
    """Return a sensor's bias of measurements, (meas_dim,) in rad and m, and of its place, (2,) in m."""
    bias, is_place = sensor.bias, is_position(sensor.kind)
    measured = np.array([getattr(bias, component) for component in COMPONENTS[sensor.kind]])
    if bearings == "north" and "bearing" in COMPONENTS[sensor.kind]:
        measured[COMPONENTS[sensor.kind].index("bearing")] *= -1.0
    return measured, np.zeros(2) if is_place else np.array([bias.x, bias.y])


def remove_bias(recorded: RecordedScan, sensor: RecordedSensor, bearings: Bearings | None) -> RecordedScan:
    """Return a scan as its sensor would have made it without its bias."""
    if sensor.bias == NO_BIAS:
        return recorded
    measured, place = sensor_bias(sensor, bearings)
    values, pose = with_offsets(values_of(recorded.scan), -measured, COMPONENTS[sensor.kind]), recorded.pose.copy()
    pose[:2] -= place
    if is_turn(pose) and "bearing" in COMPONENTS[sensor.kind]:
        pose[BEAM] -= measured[0]
    return recorded._replace(time=recorded.time - sensor.bias.clock, scan=with_values(recorded.scan, values), pose=pose)
