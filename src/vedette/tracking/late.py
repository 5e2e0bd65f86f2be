"""Tracking with scans in any order of arrival: the steps since the time of a late scan are computed again."""

from __future__ import annotations

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
from vedette.models.arguments import as_array, count, dimension, instance, pose_vector, positive, real, reject
from vedette.tracking.base import State, Tracker, TrackerInfo

_TIME = attrgetter("time")


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SensorScan(SummaryRepr):
    """One scan of one sensor, as it arrives.

    Attributes:
        sensor: number of the sensor in the tracker, from 0.
        time: time of the scan in s.
        measurements: (num, meas_dim), in any order; angles in radians. Empty without detections.
        pose: [px, py, heading_rad, ...] of the sensor at that time.
    """

    sensor: int
    time: float
    measurements: Any
    pose: Any


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Instant(SummaryRepr):
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
        settled: state before all instants; it is final.
        settled_poses: (num_sensors, 3 or more) poses of the sensors in that state.
        instants: in order of time.
        newest: latest time of all scans that arrived, in s; None before the first.
        num_taken: number of scans that were used.
        num_late: number of these that arrived after a scan of a later time.
        num_dropped: number of scans that arrived too late.
        num_repeated: number of scans that arrived again.
    """

    settled: State
    settled_poses: Floats
    instants: tuple[Instant, ...] = ()
    newest: float | None = None
    num_taken: int = 0
    num_late: int = 0
    num_dropped: int = 0
    num_repeated: int = 0

    @property
    def state(self) -> State:
        """State at the latest instant."""
        return self.instants[-1].state if self.instants else self.settled

    @property
    def poses(self) -> Floats:
        """Last pose of each sensor at the latest instant, (num_sensors, 3 or more)."""
        return self.instants[-1].poses if self.instants else self.settled_poses

    def to_table(self) -> dict[str, list[Any]]:
        """Return one row per instant as columns: `time_s`, `num_scans` and `num_measurements` over all sensors."""
        found = [sum(len(scan.measurements) for scan in instant.scans.values()) for instant in self.instants]
        scans = [len(instant.scans) for instant in self.instants]
        return {"time_s": [i.time for i in self.instants], "num_scans": scans, "num_measurements": found}

    def _summary(self) -> str:
        told = f"{self.num_late} late, {self.num_dropped} dropped, {self.num_repeated} repeated"
        return f"of {pluralise(len(self.instants), 'instant')}, {pluralise(self.num_taken, 'scan')} taken, {told}"

    def _detail(self) -> str:
        return self.state.in_short()


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class LateInfo(SummaryRepr):
    """Report on the processing of scans that arrived.

    Attributes:
        steps: reports of the tracker's steps, in order of time.
        num_worked_again: number of instants that were computed before and had to be computed again.
        dropped: scans that arrived too late.
    """

    steps: tuple[TrackerInfo, ...]
    num_worked_again: int
    dropped: tuple[SensorScan, ...]


@dataclass(frozen=True, slots=True, eq=False)
class LateScans:
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
        seed: seed for filters that draw random numbers; a step has the same numbers whenever it is computed.
        max_instants: largest number of instants in the window; with more of them, the window becomes shorter.

    Raises:
        InputError: `tracker` is not a tracker, the number of poses differs from that of the sensors, or a window or
            number of instants that is not positive.
    """

    tracker: Tracker
    poses: Any
    window: float = 30.0
    seed: int = 0
    max_instants: int = 10_000
    _start: Floats = field(init=False, repr=False)

    def __post_init__(self) -> None:
        instance("tracker", self.tracker, Tracker)
        if self.window != math.inf:
            positive("window", self.window)
        count("seed", self.seed)
        dimension("max_instants", self.max_instants)
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

    def take(self, timeline: Timeline, scans: Iterable[SensorScan]) -> tuple[Timeline, LateInfo]:
        """Process scans in their order of arrival; the scans of one call are processed together.

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
        came: dict[float, dict[int, SensorScan]] = {}
        first, newest, dropped = math.inf, timeline.newest, list[SensorScan]()
        taken = late = repeated = 0
        for given in scans:
            scan = own_scan(given, len(self.tracker.sensors))
            if len(scan.pose) > self._start.shape[1]:
                expected = f"at most {self._start.shape[1]} numbers, as of poses"
                raise reject(f"{name_of(scan)}, pose", expected, len(scan.pose))
            if newest is not None and (scan.time < newest - self.window or _is_settled(timeline, scan.time)):
                dropped.append(scan)
                continue
            before = _scans_at(timeline, scan.time) | came.get(scan.time, {})
            if scan.sensor in before:
                _check_same(before[scan.sensor], scan)
                repeated += 1
                continue
            came.setdefault(scan.time, {})[scan.sensor] = scan
            taken, late = taken + 1, late + (newest is not None and scan.time < newest)
            first, newest = min(first, scan.time), scan.time if newest is None else max(newest, scan.time)
        kept = timeline.instants[: _place(timeline, first)]
        made = self._worked(timeline, len(kept), came)
        after = replace(
            timeline,
            instants=kept + made,
            newest=newest,
            num_taken=timeline.num_taken + taken,
            num_late=timeline.num_late + late,
            num_dropped=timeline.num_dropped + len(dropped),
            num_repeated=timeline.num_repeated + repeated,
        )
        info = LateInfo(tuple(i.info for i in made), len(timeline.instants) - len(kept), tuple(dropped))
        return self._settled(after), info

    def at(self, timeline: Timeline, time: float) -> State:
        """Return the state predicted to `time` from the scans so far; the timeline does not change.

        Raises:
            InputError: a time before the latest instant.
        """
        return self.predicted(timeline, time)[0]

    def predicted(self, timeline: Timeline, time: float) -> tuple[State, TrackerInfo]:
        """Return the same state as `at`, and the tracker's report."""
        state, now = timeline.state, real("time", time)
        if state.time == now and timeline.instants:
            return state, timeline.instants[-1].info
        if state.time is not None and now < state.time:
            raise reject("time", f"one from {state.time:g} s on, the latest of all scans that came", now)
        nothing = [None] * len(self._start)
        return self.tracker.step(state, nothing, timeline.poses, now, rngs=self._streams(state.step + 1))

    def _worked(
        self, timeline: Timeline, num_kept: int, came: dict[float, dict[int, SensorScan]]
    ) -> tuple[Instant, ...]:
        """Return the instants after the first `num_kept` of the timeline, computed with the scans that arrived."""
        due = {i.time: i.scans for i in timeline.instants[num_kept:]}
        for time, scans in came.items():
            due[time] = due.get(time, {}) | scans
        before = timeline.instants[num_kept - 1] if num_kept else None
        state = timeline.settled if before is None else before.state
        poses = timeline.settled_poses if before is None else before.poses
        made = []
        for time in sorted(due):
            poses = poses.copy()
            for s, scan in due[time].items():
                poses[s, : len(scan.pose)] = scan.pose
            measured = [due[time][s].measurements if s in due[time] else None for s in range(len(poses))]
            try:
                state, info = self.tracker.step(state, measured, poses, time, rngs=self._streams(state.step + 1))
            except InputError as error:
                if time not in came:
                    raise
                raise InputError(f"{', '.join(map(name_of, came[time].values()))}: {error}") from None
            made.append(Instant(time, due[time], poses, state, info))
        return tuple(made)

    def _streams(self, step: int) -> tuple[np.random.Generator, ...]:
        """Return the random generator of each sensor at a step."""
        return tuple(
            np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(step, s)))
            for s in range(len(self.tracker.sensors))
        )

    def _settled(self, timeline: Timeline) -> Timeline:
        """Return the timeline without the instants older than the window or beyond `max_instants`."""
        if timeline.newest is None:
            return timeline
        past = max(_place(timeline, timeline.newest - self.window), len(timeline.instants) - self.max_instants)
        if past == 0:
            return timeline
        last = timeline.instants[past - 1]
        return replace(timeline, settled=last.state, settled_poses=last.poses, instants=timeline.instants[past:])


def own_scan(scan: SensorScan, num_sensors: int) -> SensorScan:
    """Return a copy of the scan with its own arrays, so that later changes by the caller have no effect.

    The shape and values of the measurements are not checked here; the tracker checks them at its step. Raises
    `InputError` for an unknown sensor, a time that is not finite, an invalid pose, or measurements without numbers.
    """
    instance("scan", scan, SensorScan)
    if count("scan.sensor", scan.sensor) >= num_sensors:
        raise reject("scan.sensor", f"a whole number from 0 to {num_sensors - 1}", scan.sensor)
    real("scan.time", scan.time)
    pose = pose_vector(f"{name_of(scan)}, pose", scan.pose)
    measured = as_array(f"{name_of(scan)}: scan", scan.measurements, "fiu", "numbers in an array")
    return SensorScan(int(scan.sensor), float(scan.time), np.array(measured, float), pose.copy())


def name_of(scan: SensorScan) -> str:
    """Return the name of a scan in error messages."""
    return f"scan of sensor {scan.sensor} at {scan.time:g} s"


def _place(timeline: Timeline, time: float) -> int:
    """Return the number of instants before a time."""
    return bisect_left(timeline.instants, time, key=_TIME)


def _is_settled(timeline: Timeline, time: float) -> bool:
    """Return True if a time is not after the settled state."""
    return timeline.settled.time is not None and time <= timeline.settled.time


def _scans_at(timeline: Timeline, time: float) -> dict[int, SensorScan]:
    """Return the scans of a time that are already in the timeline, by sensor."""
    place = _place(timeline, time)
    found = timeline.instants[place : place + 1]
    return found[0].scans if found and found[0].time == time else {}


def _check_same(there: SensorScan, again: SensorScan) -> None:
    """Raise `InputError` if two scans of a sensor at one time differ in their pose or, in any order, measurements."""
    if not np.array_equal(_in_order(there.measurements), _in_order(again.measurements)) or not np.array_equal(
        there.pose, again.pose
    ):
        place = f"scan of sensor {again.sensor} at {again.time:g} s"
        raise InputError(f"{place}: expected one scan of a sensor at a time; got a second one that differs")


def _in_order(measurements: Floats) -> Floats:
    """Return the rows sorted by their first number, then the second, and so on."""
    return (
        measurements[np.lexsort(measurements.T[::-1])] if measurements.ndim == 2 and measurements.size else measurements
    )
