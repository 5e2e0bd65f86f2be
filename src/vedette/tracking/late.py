"""Scans in whatever order they come: one that is late is put in its place, and what came after is worked again."""

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
        sensor: which of the tracker's sensors it is of, from 0.
        time: s, when it was taken.
        measurements: (num, meas_dim), in any order; angles in radians. Empty where nothing was found.
        pose: [px, py, heading_rad, ...] of the sensor then.
    """

    sensor: int
    time: float
    measurements: Any
    pose: Any


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Instant(SummaryRepr):
    """A time at which sensors scanned, and what was believed after it.

    Attributes:
        time: s.
        scans: of the sensors that scanned, by their numbers.
        poses: (num_sensors, 3 or more) of all sensors, each where its last scan was.
        state: the tracker's, after these scans.
        info: what its step reported.
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
    """The instants that a late scan may still come before, and what was believed at the one before them.

    Attributes:
        settled: the state before all instants, which no scan changes any more.
        settled_poses: (num_sensors, 3 or more) of the sensors then.
        instants: in order of time.
        newest: s, the latest time of all scans that came; None before the first.
        num_taken: scans that are in the beliefs.
        num_late: of these, how many came after a later one.
        num_dropped: scans that came too late.
        num_repeated: scans that came again.
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
        """What is believed at the latest instant."""
        return self.instants[-1].state if self.instants else self.settled

    @property
    def poses(self) -> Floats:
        """(num_sensors, 3 or more) where each sensor was last, at the latest instant."""
        return self.instants[-1].poses if self.instants else self.settled_poses

    def to_table(self) -> dict[str, list[Any]]:
        """A row an instant, by columns: `time_s`, `num_scans` and `num_measurements`, of all sensors."""
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
    """What was done with scans that arrived.

    Attributes:
        steps: reports of the tracker's steps that were made, in order of time.
        num_worked_again: how many of these steps had been made before, with fewer scans.
        dropped: the scans that came too late.
    """

    steps: tuple[TrackerInfo, ...]
    num_worked_again: int
    dropped: tuple[SensorScan, ...]


@dataclass(frozen=True, slots=True, eq=False)
class LateScans:
    """A tracker for scans that come late, early or not at all, each with its own time.

    Scans of one time are one step of the tracker. A scan that comes after later ones is put in its place, and the
    steps since then are made again from the state before it: inside the window the beliefs are bit for bit those of
    the same scans in order. One that is older than the window is counted and dropped.

    Steps are numbered in order of time, and so are the labels of births: a target that is born after the time of a
    late scan, within the window, gets the label that it would have had.

    Attributes:
        tracker: any.
        poses: (num_sensors, 3 or more) where each sensor is before its first scan.
        window: s, from the latest scan back.
        seed: of the random numbers of filters that draw; those of a step are the same whenever it is made.
        max_instants: most times of scans that are kept; of more, as in a flood, the window becomes shorter.

    Raises:
        InputError: something else than a tracker, not one pose a sensor, no positive window or number of instants.
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
        """Before the first scan."""
        return Timeline(self.tracker.initial(), self._start)

    def take(self, timeline: Timeline, scans: Iterable[SensorScan]) -> tuple[Timeline, LateInfo]:
        """Take in scans, in the order in which they arrived; those of one call are worked at once.

        Args:
            timeline: as the call before left it.
            scans: of whatever sensors and times.

        Returns:
            The timeline with them, and what was done.

        Raises:
            InputError: a sensor that there is not, a time that is no finite number, a pose or measurements that no
                scan of the sensor has, two different scans of a sensor at one time. The timeline given stays as it was.
            ModelError, NumericalError: as of the tracker's step.
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
        """What is believed of a time from the latest instant on, by what has come so far: predicted, and kept nowhere.

        Raises:
            InputError: a time before the latest instant.
        """
        return self.predicted(timeline, time)[0]

    def predicted(self, timeline: Timeline, time: float) -> tuple[State, TrackerInfo]:
        """As `at`, with what the tracker reports of it."""
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
        """The tracker's steps with the scans that came, on from the instants that stay as they are."""
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
        """The random numbers of each sensor at a step."""
        return tuple(
            np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(step, s)))
            for s in range(len(self.tracker.sensors))
        )

    def _settled(self, timeline: Timeline) -> Timeline:
        """Without the instants that no scan can come before any more."""
        if timeline.newest is None:
            return timeline
        past = max(_place(timeline, timeline.newest - self.window), len(timeline.instants) - self.max_instants)
        if past == 0:
            return timeline
        last = timeline.instants[past - 1]
        return replace(timeline, settled=last.state, settled_poses=last.poses, instants=timeline.instants[past:])


def own_scan(scan: SensorScan, num_sensors: int) -> SensorScan:
    """The scan with arrays of its own, so that what is worked again is what came; measurements: of whatever shape.

    What a scan of the sensor may hold is for the tracker to check, which does so whenever it takes it. Raises
    `InputError` for a sensor that there is not, a time that is no finite number, a pose or measurements that are none.
    """
    instance("scan", scan, SensorScan)
    if count("scan.sensor", scan.sensor) >= num_sensors:
        raise reject("scan.sensor", f"a whole number from 0 to {num_sensors - 1}", scan.sensor)
    real("scan.time", scan.time)
    pose = pose_vector(f"{name_of(scan)}, pose", scan.pose)
    measured = as_array(f"{name_of(scan)}: scan", scan.measurements, "fiu", "numbers in an array")
    return SensorScan(int(scan.sensor), float(scan.time), np.array(measured, float), pose.copy())


def name_of(scan: SensorScan) -> str:
    """As errors call it."""
    return f"scan of sensor {scan.sensor} at {scan.time:g} s"


def _place(timeline: Timeline, time: float) -> int:
    """How many instants are before a time."""
    return bisect_left(timeline.instants, time, key=_TIME)


def _is_settled(timeline: Timeline, time: float) -> bool:
    """Whether a time is not after all that no scan changes any more."""
    return timeline.settled.time is not None and time <= timeline.settled.time


def _scans_at(timeline: Timeline, time: float) -> dict[int, SensorScan]:
    """The scans of a time that are in the timeline already."""
    place = _place(timeline, time)
    found = timeline.instants[place : place + 1]
    return found[0].scans if found and found[0].time == time else {}


def _check_same(there: SensorScan, again: SensorScan) -> None:
    """Raise `InputError` where a sensor has scanned at a time already, and measured something else, in any order."""
    if not np.array_equal(_in_order(there.measurements), _in_order(again.measurements)) or not np.array_equal(
        there.pose, again.pose
    ):
        place = f"scan of sensor {again.sensor} at {again.time:g} s"
        raise InputError(f"{place}: expected one scan of a sensor at a time; got a second one that differs")


def _in_order(measurements: Floats) -> Floats:
    """The rows by their first number, then the second, and so on."""
    return (
        measurements[np.lexsort(measurements.T[::-1])] if measurements.ndim == 2 and measurements.size else measurements
    )
