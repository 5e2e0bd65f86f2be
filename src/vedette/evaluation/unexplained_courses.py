"""Unexplained measurements on straight courses: targets faster than assumed."""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from vedette.evaluation.innovations import Assumed, Compared
from vedette.internal.text import pluralise
from vedette.kernels.base.types import VELOCITY, VY, Bools, Floats
from vedette.models.sensor import SensorModel

_GATE = 4.0  # standard deviations of the third measurement as predicted from two
_MAX_SPEED = 1500.0  # m/s
_SPEED_FACTOR = 1.5  # times the speed that births assume; faster courses are reported
_MIN_LENGTH = 5  # measurements of a course
_MAX_CHANCE_COURSES = 0.01  # expected number of courses by chance in a recording
_MAX_PER_SCAN = 100  # unexplained measurements of a scan; with more there is no result
_MAX_COURSES = 20


class _UnexplainedScan(NamedTuple):
    """Measurements of a scan that no track explains: time [s], (num, 2) positions and (num,) stds [m]."""

    time: float
    places: Floats
    stds: Floats


class _Course(NamedTuple):
    """A course: first and last time in s, first place in m, number of measurements, and mean speed in m/s."""

    begin: float
    end: float
    first: Floats
    number: int
    speed: float


def unexplained_course_warnings(instants: Sequence[Compared], assumed: Assumed) -> tuple[str, ...]:
    """Return a warning for each sensor whose unexplained measurements follow each other on straight courses.

    Three measurements of successive scans that no track explains are on one course if the difference of the last two
    equals that of the first two, within the noise. The expected number of courses by chance is a hundredth. Only
    courses faster than births from measurements assume count.
    """
    model, warnings = assumed.scenario.model, list[str]()
    if (births := model.birth.from_measurements) is None or len(births.std) <= VY:  # without velocities
        return ()
    speed, area = max(births.std[VELOCITY]), model.region.build().area
    for s, (name, sensor) in enumerate(zip(model.sensor_names, assumed.sensors, strict=True)):
        if courses := _courses(_unexplained_scans(instants, s, sensor), _SPEED_FACTOR * speed, area):
            warnings.append(_warning(courses, name, instants[0].own[s], speed))
    return tuple(warnings)


def _warning(courses: list[_Course], name: str, sensor_position: Floats, assumed: float) -> str:
    speeds, first = [course.speed for course in courses], min(courses, key=lambda course: course.begin)
    distance = float(np.hypot(*(first.first - sensor_position)))
    span = f"from {first.begin:g} to {max(course.end for course in courses):g} s, the first {distance:.0f} m away"
    count = pluralise(sum(course.number for course in courses), "measurement")
    speed_range = f"{min(speeds):.0f} to {max(speeds):.0f} m/s"
    step = 10.0 ** math.floor(math.log10(max(speeds)))
    advice = f"`--max-target-speed {0.5 * step * math.ceil(2.2 * max(speeds) / step):g}`, or `birth` and `motion`"
    finding = f"{count} that no track explains ({span}) lie on straight courses at {speed_range}"
    return f"{name}: {finding}, and new tracks are expected at about {assumed:g} m/s: give {advice} for such targets"


def _unexplained_scans(instants: Sequence[Compared], s: int, sensor: SensorModel) -> list[_UnexplainedScan]:
    """Return the scans of a sensor, with only the measurements that no track explains."""
    least, scans = sensor.noise.least_stds, list[_UnexplainedScan]()
    stds = np.zeros(2) if least is None else np.asarray(least)[:2]
    for instant in instants:
        if (fit := instant.fits[s]) is not None and sensor.measurement.places is not None:
            place_stds = np.full(len(fit.unexplained), stds.max())
            if sensor.measurement.components[:1] == ("bearing",):
                place_stds = np.maximum(stds[1], stds[0] * np.hypot(*fit.unexplained.T))
            scans.append(_UnexplainedScan(instant.time, fit.unexplained + instant.own[s], place_stds))
    return scans


def _courses(scans: list[_UnexplainedScan], slowest: float, area: float) -> list[_Course]:
    """Return the courses faster than `slowest`, the longest first, each without the measurements of those before it."""
    sizes = [len(scan.places) for scan in scans]
    if len(scans) < _MIN_LENGTH or max(sizes) > _MAX_PER_SCAN or not any(sizes):
        return []
    spread = float(np.quantile(np.concatenate([scan.stds for scan in scans]), 0.75))
    # Expected number of measurements in the next scan that continue a pair by chance.
    by_chance = max(sizes) * 6.0 * math.pi * (_GATE * spread) ** 2 / area
    if not 0.0 < by_chance < 0.5:
        return []
    pairs = sum(a * b for a, b in pairwise(sizes))
    min_length = max(_MIN_LENGTH, 2 + math.ceil(math.log(_MAX_CHANCE_COURSES / max(pairs, 1)) / math.log(by_chance)))
    courses, free = list[_Course](), [np.ones(size, np.bool_) for size in sizes]
    while len(courses) < _MAX_COURSES and (longest := _longest(scans, free, slowest)) and len(longest) >= min_length:
        for k, i in longest:
            free[k][i] = False
        points = np.array([scans[k].places[i] for k, i in longest])
        begin, end = scans[longest[0][0]].time, scans[longest[-1][0]].time
        speed = float(np.hypot(*(points[-1] - points[0]))) / (end - begin)
        if speed >= slowest:  # else noise makes its steps fast
            courses.append(_Course(begin, end, points[0], len(longest), speed))
    return courses


def _longest(scans: list[_UnexplainedScan], free: list[Bools], slowest: float) -> list[tuple[int, int]]:
    """Return the longest course of free measurements as pairs (scan, measurement)."""
    best: list[tuple[int, int]] = []
    courses: dict[tuple[int, int], list[tuple[int, int]]] = {}  # by the last two measurements, of the scan previous
    for k in range(1, len(scans)):
        current, previous, step = scans[k], scans[k - 1], scans[k].time - scans[k - 1].time
        continued: dict[tuple[int, int], list[tuple[int, int]]] = {}
        if step > 0.0 and len(current.places) and len(previous.places):
            moves = current.places[None] - previous.places[:, None]
            speeds = np.hypot(moves[..., 0], moves[..., 1]) / step
            usable = (speeds >= slowest) & (speeds <= _MAX_SPEED) & free[k - 1][:, None] & free[k][None]
            for i, j in zip(*(each.tolist() for each in np.nonzero(usable)), strict=True):
                continued[i, j] = [(k - 1, i), (k, j)]
            ends, before = np.array(list(courses), np.int64).reshape(-1, 2), list(courses.values())
            ratio = step / (previous.time - scans[k - 2].time) if before else 0.0
            last = previous.places[ends[:, 1]]
            gaps = current.places[None] - (last + ratio * (last - scans[k - 2].places[ends[:, 0]]))[:, None]
            gates = _GATE * current.stds * math.sqrt(1.0 + (1.0 + ratio) ** 2 + ratio**2)
            near = (np.hypot(gaps[..., 0], gaps[..., 1]) <= gates) & usable[ends[:, 1]]
            for c, j in np.argwhere(near).tolist():
                if len(before[c]) >= len(continued[i := int(ends[c, 1]), j]):
                    continued[i, j] = [*before[c], (k, j)]
        courses = continued
        best = max([best, *courses.values()], key=len)
    return best
