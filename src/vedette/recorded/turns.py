"""Turns of a radar in the rows of a recording: found from bearings and times, and rows put into scans of one turn."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np

from vedette.kernels.base.types import Floats, Ints
from vedette.models.turns import Turn, with_beam
from vedette.quantities import COMPONENTS

# What a sensor's scans are: turns as given; as its rows show, if they do; or rows of one time.
Turning = Turn | Literal["found", "none"]

_FEWEST_ROWS, _FEWEST_TURNS = 16, 3.0  # of which a turn is found
_PERIODS = 0.5, 60.0  # s, least and largest of turns that are found
_SEARCHED_ROWS, _SEARCHED_TIME = 300, 300.0  # rows and seconds by which the period is found; all rows refine it
_STEPS = 8.0  # frequencies tried in the width of a peak
# Mean of the unit vectors at what is left of bearings without the turn: 1 of an exact beam, e^(-s^2 / 2) with noise s.
_ALIKE, _FOUND = 0.95, 0.98
_ANYWHERE = 0.98  # the same of the bearings themselves, above which they are nearly one and show no turn
_FEWEST_PLACES = 4  # of rows that tell how a sensor moves
_SECTORS, _NEAR = 72, 12  # directions in which rows are counted, and how many on a side count as near


def bearings_of(scan: Floats, poses: Floats, kind: str) -> Floats:
    """(num,) rad from east, of measurements from poses (num, 3 or more) or (3 or more,); (0,) of a kind without."""
    if kind == "position":
        off = scan - poses[..., :2]
        return np.asarray(np.arctan2(off[:, 1], off[:, 0]))
    return scan[:, 0] if "bearing" in COMPONENTS.get(kind, ()) else np.empty(0)


class Swept(NamedTuple):
    """A scan of one turn: its time, the rows that are in it, and the pose with the beam."""

    time: float
    rows: Ints
    pose: Floats


def found_turn(times: Floats, bearings: Floats) -> Turn | None:
    """Return how a radar turns by its rows; None where they show no turn.

    The slowest turn that leaves bearings nearly alike is taken: a faster one that passes the same directions at the
    same times says less.

    Args:
        times: (num_rows,) s, increasing.
        bearings: (num_rows,) rad from east.
    """
    if len(times) < _FEWEST_ROWS or abs(np.exp(1j * bearings).mean()) > _ANYWHERE:
        return None
    some = np.flatnonzero(times <= times[0] + _SEARCHED_TIME)[:_SEARCHED_ROWS]
    near, beams, span = times[some] - times[0], np.exp(1j * bearings[some]), float(times[some[-1]] - times[0])
    if span < _FEWEST_TURNS * _PERIODS[0]:
        return None
    frequencies = np.arange(max(1.0 / _PERIODS[1], _FEWEST_TURNS / span), 1.0 / _PERIODS[0], 1.0 / (_STEPS * span))
    for frequency in frequencies.tolist():
        for sign in (-1.0, 1.0):
            rate = 2.0 * math.pi * sign * frequency
            if abs((beams * np.exp(-1j * rate * near)).mean()) < _ALIKE:
                continue
            rate = _refined(near, bearings[some], rate)
            if abs((beams * np.exp(-1j * rate * near)).mean()) >= _FOUND:
                return Turn(2.0 * math.pi / abs(rate), clockwise=rate < 0.0)
    return None


def _refined(times: Floats, bearings: Floats, rate: float) -> float:
    """The rate with the line through what it leaves of the bearings added, twice."""
    for _ in range(2):
        left = np.exp(1j * (bearings - rate * times))
        middle = left.mean()
        rate += float(np.polyfit(times, np.angle(left / middle), 1)[0])
    return rate


class _Beam:
    """Where a beam pointed at any time: a steady turn, and what the rows about a time say beyond it."""

    def __init__(self, times: Floats, bearings: Floats, turn: Turn) -> None:
        self.rate, self._start = turn.rate, float(times[0])
        left = bearings - self.rate * (times - self._start)
        turn_of = np.floor((times - self._start) / turn.period).astype(np.int64)
        self._at, self._phases = np.empty(0), np.empty(0)
        centres, phases = list[float](), list[float]()
        for number in np.unique(turn_of).tolist():
            lows, highs = np.searchsorted(turn_of, [number - 1, number + 2])
            own = left[lows:highs]
            middle = float(np.angle(np.exp(1j * own).mean()))
            before = phases[-1] if phases else middle
            phases.append(before + math.remainder(middle - before, 2.0 * math.pi))
            centres.append(float(times[lows:highs].mean()))
        self._at, self._phases = np.array(centres), np.array(phases)

    def at(self, times: Floats) -> Floats:
        """(num,) the bearing at times, rad, not wrapped."""
        return np.asarray(self.rate * (times - self._start) + np.interp(times, self._at, self._phases))

    def when(self, bearing: float) -> float:
        """s at which it has turned to a bearing that is not wrapped."""
        time = self._start + (bearing - self._phases[0]) / self.rate
        for _ in range(5):  # the phases change slowly
            time += (bearing - float(self.at(np.array([time]))[0])) / self.rate
        return float(time)


def swept(times: Floats, bearings: Floats, poses: Floats, turn: Turn) -> list[Swept]:
    """Return the scans of a turning radar, turns without rows too, from the first row to the last.

    A turn begins in the direction in which the fewest rows lie, as a target there may be in either turn.

    Args:
        times: (num_rows,) s, increasing.
        bearings: (num_rows,) rad from east.
        poses: (num_rows, 3 or more) of the sensor at each row.
        turn: how it turns, nearly.
    """
    beam = _Beam(times, bearings, turn)
    sense, whole = math.copysign(1.0, beam.rate), 2.0 * math.pi
    seam = _emptiest(bearings)
    expected = beam.at(times)
    exact = expected + np.remainder(bearings - expected + math.pi, whole) - math.pi
    numbers = np.floor(sense * (exact - seam) / whole).astype(np.int64)
    found = []
    for number in range(int(numbers.min()), int(numbers.max()) + 1):
        edges = [seam + sense * whole * (number + part) for part in (0.0, 0.5, 1.0)]
        begin, middle, end = map(beam.when, edges)
        pose = _moving(times, poses, middle, end - begin)
        beamed = with_beam(pose.place, pose.velocity, math.remainder(edges[1], whole), sense * whole / (end - begin))
        found.append(Swept(middle, np.flatnonzero(numbers == number), beamed))
    return found


def _emptiest(bearings: Floats) -> float:
    """The direction near which the fewest rows lie, rad."""
    counts, _ = np.histogram(np.remainder(bearings, 2.0 * math.pi), _SECTORS, (0.0, 2.0 * math.pi))
    weights = 1.0 - np.abs(np.arange(-_NEAR, _NEAR + 1)) / (_NEAR + 1.0)
    near = np.convolve(np.concatenate([counts[-_NEAR:], counts, counts[:_NEAR]]), weights, "valid")
    return float((near.argmin() + 0.5) * 2.0 * math.pi / _SECTORS)


class _Moving(NamedTuple):
    place: Floats  # (3 or more,) the pose
    velocity: Floats  # (2,) m/s


def _moving(times: Floats, poses: Floats, time: float, period: float) -> _Moving:
    """The pose at a time and the velocity, by a line through the places of the rows within a turn, or the nearest."""
    nearest = int(np.abs(times - time).argmin())
    pose, own = poses[nearest].copy(), np.flatnonzero(np.abs(times - time) <= period)
    if len(own) < _FEWEST_PLACES:
        own = np.sort(np.abs(times - time).argsort(kind="stable")[:_FEWEST_PLACES])
    if len(own) < 2 or (poses[own, :2] == pose[:2]).all() or times[own[-1]] == times[own[0]]:
        return _Moving(pose, np.zeros(2))
    slope, place = np.polyfit(times[own] - time, poses[own, :2], 1)
    pose[:2] = place
    return _Moving(pose, slope)
