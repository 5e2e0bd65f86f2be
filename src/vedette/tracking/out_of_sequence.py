"""Tracking with scans in any order of arrival: the steps since the time of a late scan are computed again."""

import math
from bisect import bisect_left
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from operator import attrgetter
from typing import Any

import numpy as np

from vedette.errors import InputError
from vedette.internal.representation import SummaryRepr, TabularRepr
from vedette.internal.text import pluralise
from vedette.kernels.base.types import Floats
from vedette.models.arguments import as_array, count, instance, pose_vector, real, reject
from vedette.models.fields import Count, Limit, Natural, check_fields
from vedette.models.scan_rows import ScanLike, ScanRows, table_of
from vedette.tracking.base import State, Tracker, TrackerInfo

_TIME = attrgetter("time")


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SensorScan(SummaryRepr):
    """One scan of one sensor, as it arrives.

    Attributes:
        sensor: number of the sensor in the tracker, from 0.
        time: time of the scan in s.
        measurements: (num, meas_dim), in any order, with angles in radians. Empty without detections.
        pose: [px, py, heading_rad, ...] of the sensor at that time.
    """

    sensor: int
    time: float
    measurements: Any
    pose: Any


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class TimelineEntry(SummaryRepr):
    """A time at which sensors scanned, and the state of the tracker after it.

    Attributes:
        time: time in s.
        scans: scans by the number of their sensor.
        poses: (num_sensors, 3 or more) pose of each sensor at its last scan.
        state: state of the tracker after these scans.
        info: report of the tracker's step.
    """

    time: float
    scans: dict[int, SensorScan]
    poses: Floats
    state: State
    info: TrackerInfo

    def _summary(self) -> str:
        return f"at {self.time:g} s, {pluralise(len(self.scans), 'scan')}"

    def _detail(self) -> str:
        return self.state.in_short()


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Timeline(TabularRepr):
    """The instants in the window, which late scans may still change, and the final state before them.

    Attributes:
        final_state: state before all entries. Later scans do not change it.
        final_poses: (num_sensors, 3 or more) poses of the sensors in that state.
        entries: in order of time.
        newest: latest time of all scans that arrived, in s, or None before the first.
        num_processed: number of scans that were used.
        num_late: number of these that arrived after a scan of a later time.
        num_dropped: number of scans that arrived too late.
        num_repeated: number of scans that arrived again.
    """

    final_state: State
    final_poses: Floats
    entries: tuple[TimelineEntry, ...] = ()
    newest: float | None = None
    num_processed: int = 0
    num_late: int = 0
    num_dropped: int = 0
    num_repeated: int = 0

    @property
    def state(self) -> State:
        """State at the latest instant."""
        return self.entries[-1].state if self.entries else self.final_state

    @property
    def poses(self) -> Floats:
        """Last pose of each sensor at the latest instant, (num_sensors, 3 or more)."""
        return self.entries[-1].poses if self.entries else self.final_poses

    def to_table(self) -> dict[str, list[Any]]:
        """Return one row per instant as columns: `time_s`, `num_scans` and `num_measurements` over all sensors."""
        num_measurements = [sum(len(scan.measurements) for scan in instant.scans.values()) for instant in self.entries]
        scans = [len(instant.scans) for instant in self.entries]
        return {"time_s": [i.time for i in self.entries], "num_scans": scans, "num_measurements": num_measurements}

    def _summary(self) -> str:
        counts = f"{self.num_late} late, {self.num_dropped} dropped, {self.num_repeated} repeated"
        return f"of {pluralise(len(self.entries), 'instant')}, {pluralise(self.num_processed, 'scan')} taken, {counts}"

    def _detail(self) -> str:
        return self.state.in_short()


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class OutOfSequenceInfo(SummaryRepr):
    """Report on the processing of scans that arrived.

    Attributes:
        steps: reports of the tracker's steps, in order of time.
        num_recomputed: number of instants that were computed before and had to be computed again.
        dropped: scans that arrived too late.
    """

    steps: tuple[TrackerInfo, ...]
    num_recomputed: int
    dropped: tuple[SensorScan, ...]


@dataclass(frozen=True, slots=True, eq=False)
class OutOfSequenceTracker:
    """Wrapper of a tracker for scans that arrive late, early or not at all, each with its own time.

    Scans of one time are one step of the tracker. If a scan arrives after scans of later times, the steps since its
    time are computed again from the state before it. Inside the window the beliefs are bit for bit those of the same
    scans in order. A scan older than the window is counted and dropped.

    Steps are numbered in order of time, and so are the labels of births: a target born after the time of a late scan,
    within the window, gets the label that it would have had with the scans in order.

    Attributes:
        tracker: the wrapped tracker.
        poses: (num_sensors, 3 or more) pose of each sensor before its first scan.
        window: length of the window in s, back from the latest scan.
        seed: seed for filters that draw random numbers. A step has the same numbers whenever it is computed.
        max_entries: largest number of instants in the window. With more of them, the window becomes shorter.

    Raises:
        InputError: `tracker` is not a tracker, the number of poses differs from that of the sensors, or a window or
            number of instants that is not positive.
    """

    tracker: Tracker
    poses: Any
    window: Limit = 30.0
    seed: Natural = 0
    max_entries: Count = 10_000
    _start: Floats = field(init=False, repr=False)

    def __post_init__(self) -> None:
        check_fields(self)
        num = len(self.tracker.sensors)
        given = [pose_vector(f"poses[{s}]", pose) for s, pose in enumerate(self.poses)]
        if len(given) != num:
            raise reject("poses", f"{num}, one a sensor", len(given))
        start = np.zeros((num, max(map(len, given))))
        for s, pose in enumerate(given):
            start[s, : len(pose)] = pose
        object.__setattr__(self, "_start", start)

    def initial(self) -> Timeline:
        """Return the timeline before the first scan."""
        return Timeline(self.tracker.initial(), self._start)

    def process(self, timeline: Timeline, scans: Iterable[SensorScan]) -> tuple[Timeline, OutOfSequenceInfo]:
        """Process scans in their order of arrival. The scans of one call are processed together.

        Args:
            timeline: timeline that the previous call returned.
            scans: scans of any sensors and times.

        Returns:
            The timeline with these scans, and a report.

        Raises:
            InputError: an unknown sensor, a time that is not finite, an invalid pose or invalid measurements, or two
                different scans of a sensor at one time. The given timeline is not changed.
            ModelError, NumericalError: from the tracker's step.
        """
        arrived: dict[float, dict[int, SensorScan]] = {}
        first, newest, dropped = math.inf, timeline.newest, list[SensorScan]()
        settled = -math.inf if timeline.final_state.time is None else timeline.final_state.time
        num_processed = num_late = num_repeated = 0
        for given in scans:
            scan = copy_scan(given, len(self.tracker.sensors))
            if len(scan.pose) > self._start.shape[1]:
                expected = f"at most {self._start.shape[1]} numbers, as of poses"
                raise reject(f"{scan_name(scan)}, pose", expected, len(scan.pose))
            if newest is not None and (scan.time < newest - self.window or scan.time <= settled):
                dropped.append(scan)
                continue
            known = _scans_at(timeline, scan.time) | arrived.get(scan.time, {})
            if scan.sensor in known:
                _check_equal(known[scan.sensor], scan)
                num_repeated += 1
                continue
            arrived.setdefault(scan.time, {})[scan.sensor] = scan
            num_processed, num_late = num_processed + 1, num_late + (newest is not None and scan.time < newest)
            first, newest = min(first, scan.time), scan.time if newest is None else max(newest, scan.time)
        unchanged = timeline.entries[: _num_before(timeline, first)]
        recomputed = self._recompute(timeline, len(unchanged), arrived)
        updated = replace(
            timeline,
            entries=unchanged + recomputed,
            newest=newest,
            num_processed=timeline.num_processed + num_processed,
            num_late=timeline.num_late + num_late,
            num_dropped=timeline.num_dropped + len(dropped),
            num_repeated=timeline.num_repeated + num_repeated,
        )
        info = OutOfSequenceInfo(
            tuple(i.info for i in recomputed), len(timeline.entries) - len(unchanged), tuple(dropped)
        )
        return self._finalise(updated), info

    def state_at(self, timeline: Timeline, time: float) -> State:
        """Return the state predicted to `time` from the scans so far. The timeline does not change.

        Raises:
            InputError: a time before the latest instant.
        """
        return self.predict(timeline, time)[0]

    def predict(self, timeline: Timeline, time: float) -> tuple[State, TrackerInfo]:
        """Return the same state as `at`, and the tracker's report."""
        state, now = timeline.state, real("time", time)
        if state.time == now and timeline.entries:
            return state, timeline.entries[-1].info
        if state.time is not None and now < state.time:
            raise reject("time", f"one from {state.time:g} s on, the latest of all scans that came", now)
        no_scans = [None] * len(self._start)
        return self.tracker.step(state, no_scans, timeline.poses, now, rngs=self._generators(state.step + 1))

    def _recompute(
        self, timeline: Timeline, num_unchanged: int, arrived: dict[float, dict[int, SensorScan]]
    ) -> tuple[TimelineEntry, ...]:
        """Return the instants after the first `num_unchanged` of the timeline, computed with the scans that arrived."""
        scans_by_time = {i.time: i.scans for i in timeline.entries[num_unchanged:]}
        for time, scans in arrived.items():
            scans_by_time[time] = scans_by_time.get(time, {}) | scans
        before = timeline.entries[num_unchanged - 1] if num_unchanged else None
        state = timeline.final_state if before is None else before.state
        poses = timeline.final_poses if before is None else before.poses
        entries = []
        for time in sorted(scans_by_time):
            poses = poses.copy()
            for s, scan in scans_by_time[time].items():
                poses[s, : len(scan.pose)] = scan.pose
            measured = [
                scans_by_time[time][s].measurements if s in scans_by_time[time] else None for s in range(len(poses))
            ]
            try:
                state, info = self.tracker.step(state, measured, poses, time, rngs=self._generators(state.step + 1))
            except InputError as error:
                if time not in arrived:
                    raise
                raise InputError(f"{', '.join(map(scan_name, arrived[time].values()))}: {error}") from None
            entries.append(TimelineEntry(time, scans_by_time[time], poses, state, info))
        return tuple(entries)

    def _generators(self, step: int) -> tuple[np.random.Generator, ...]:
        """Return the random generator of each sensor at a step."""
        return tuple(
            np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(step, s)))
            for s in range(len(self.tracker.sensors))
        )

    def _finalise(self, timeline: Timeline) -> Timeline:
        """Return the timeline without the instants older than the window or beyond `max_entries`."""
        if timeline.newest is None:
            return timeline
        num_final = max(_num_before(timeline, timeline.newest - self.window), len(timeline.entries) - self.max_entries)
        if num_final == 0:
            return timeline
        last = timeline.entries[num_final - 1]
        return replace(timeline, final_state=last.state, final_poses=last.poses, entries=timeline.entries[num_final:])


def copy_scan(scan: SensorScan, num_sensors: int) -> SensorScan:
    """Return a copy of the scan with its own arrays, so that later changes by the caller have no effect.

    The shape and values of the measurements are not checked here. The tracker checks them at its step. Raises
    `InputError` for an unknown sensor, a time that is not finite, an invalid pose, or measurements without numbers.
    """
    instance("scan", scan, SensorScan)
    if count("scan.sensor", scan.sensor) >= num_sensors:
        raise reject("scan.sensor", f"a whole number from 0 to {num_sensors - 1}", scan.sensor)
    real("scan.time", scan.time)
    pose = pose_vector(f"{scan_name(scan)}, pose", scan.pose)
    measured = scan.measurements
    if not isinstance(measured, ScanRows):
        measured = np.array(as_array(f"{scan_name(scan)}: scan", measured, "fiu", "numbers in an array"), float)
    return SensorScan(int(scan.sensor), float(scan.time), measured, pose.copy())


def scan_name(scan: SensorScan) -> str:
    """Return the name of a scan in error messages."""
    return f"scan of sensor {scan.sensor} at {scan.time:g} s"


def _num_before(timeline: Timeline, time: float) -> int:
    """Return the number of instants before a time."""
    return bisect_left(timeline.entries, time, key=_TIME)


def _scans_at(timeline: Timeline, time: float) -> dict[int, SensorScan]:
    """Return the scans of a time that are already in the timeline, by sensor."""
    index = _num_before(timeline, time)
    entries = timeline.entries[index : index + 1]
    return entries[0].scans if entries and entries[0].time == time else {}


def _check_equal(first: SensorScan, second: SensorScan) -> None:
    """Raise `InputError` if two scans of a sensor at one time differ in their pose or, in any order, measurements."""
    if not np.array_equal(_sorted_rows(first.measurements), _sorted_rows(second.measurements)) or not np.array_equal(
        first.pose, second.pose
    ):
        place = f"scan of sensor {second.sensor} at {second.time:g} s"
        raise InputError(f"{place}: expected one scan of a sensor at a time; got a second one that differs")


def _sorted_rows(measurements: ScanLike) -> Floats:
    """Return the rows, with all that they bring, sorted by their first number, then the second, and so on."""
    table = table_of(measurements)
    return table[np.lexsort(table.T[::-1])] if table.ndim == 2 and table.size else table
