"""Turning radars in recordings: find the turn in bearings and times, and group rows into scans of one turn each."""

import math
from typing import Literal, NamedTuple

import numpy as np

from vedette.internal.quantities import COMPONENTS, is_position
from vedette.kernels.base.types import Floats, Ints
from vedette.models.scan_rows import ScanLike, values_of
from vedette.models.turns import Turn, with_beam

# The scans of a sensor: turns as given ("found": as found in its rows, if any), or rows with one time ("none").
Turning = Turn | Literal["found", "none"]

_FEWEST_ROWS, _FEWEST_TURNS = 16, 3.0  # fewest rows and turns from which a turn is found
_PERIODS = 0.5, 60.0  # s, shortest and longest turn that is found
_SEARCHED_ROWS, _SEARCHED_TIME = 300, 300.0  # number of rows and seconds that the search for a period uses
_STEPS = 8.0  # frequencies tried within the width of a peak
# Length of the mean unit vector of bearing minus beam: 1 without noise, exp(-s^2 / 2) with noise of s radians. The
# first threshold is for trial frequencies, the second for the refined rate.
_ALIKE, _FOUND = 0.95, 0.98
_ANYWHERE = 0.98  # the same for the bearings alone: above it they are nearly equal and show no turn
_FEWEST_PLACES = 4  # fewest rows for the velocity of a sensor
_SECTORS, _NEAR = 72, 12  # directions in which rows are counted, and how many on a side count as near


def bearings_of(scan: ScanLike, poses: Floats, kind: str) -> Floats:
    """Return bearings from east, rad, of measurements from poses (num, 3 or more) or (3 or more,), empty if none."""
    if is_position(kind):
        off = values_of(scan)[:, :2] - poses[..., :2]
        return np.asarray(np.arctan2(off[:, 1], off[:, 0]))
    return values_of(scan)[:, 0] if "bearing" in COMPONENTS.get(kind, ()) else np.empty(0)


class RadarService(NamedTuple):
    """Turn of a radar by its service messages, with the first and last time (s) of these."""

    turn: Turn
    first: float
    last: float


class Swept(NamedTuple):
    """A scan of one turn: its time (s), the indices of its rows, and the pose with the beam."""

    time: float
    rows: Ints
    pose: Floats


def found_turn(times: Floats, bearings: Floats) -> Turn | None:
    """Return the turn that the rows of a radar show, or None without one.

    This is the slowest turn that explains the bearings by the times. A faster one may pass the same directions at the
    same times. Rows with equal times and different bearings rule a turn out.

    Args:
        times: (num_rows,) s, increasing.
        bearings: (num_rows,) rad from east.
    """
    if len(times) < _FEWEST_ROWS or abs(np.exp(1j * bearings).mean()) > _ANYWHERE:
        return None
    at_once = np.flatnonzero(np.diff(times) == 0.0)
    if len(at_once) and np.cos(bearings[at_once + 1] - bearings[at_once]).mean() < _FOUND:
        return None
    first_rows = np.flatnonzero(times <= times[0] + _SEARCHED_TIME)[:_SEARCHED_ROWS]
    near = times[first_rows] - times[0]
    beams = np.exp(1j * bearings[first_rows])
    span = float(times[first_rows[-1]] - times[0])
    if span < _FEWEST_TURNS * _PERIODS[0]:
        return None
    frequencies = np.arange(max(1.0 / _PERIODS[1], _FEWEST_TURNS / span), 1.0 / _PERIODS[0], 1.0 / (_STEPS * span))
    for frequency in frequencies.tolist():
        for sign in (-1.0, 1.0):
            rate = 2.0 * math.pi * sign * frequency
            if abs((beams * np.exp(-1j * rate * near)).mean()) < _ALIKE:
                continue
            rate = _refined(near, bearings[first_rows], rate)
            if abs((beams * np.exp(-1j * rate * near)).mean()) >= _FOUND:
                return Turn(2.0 * math.pi / abs(rate), clockwise=rate < 0.0)
    return None


def _refined(times: Floats, bearings: Floats, rate: float) -> float:
    """Return the rate after two linear fits of the residual bearings."""
    for _ in range(2):
        residuals = np.exp(1j * (bearings - rate * times))
        middle = residuals.mean()
        rate += float(np.polyfit(times, np.angle(residuals / middle), 1)[0])
    return rate


class _Beam:
    """Bearing of the beam as a function of time: a steady turn plus the mean residual of the rows near that time."""

    def __init__(self, times: Floats, bearings: Floats, turn: Turn) -> None:
        self.rate, self._start = turn.rate, float(times[0])
        left = bearings - self.rate * (times - self._start)
        turn_of = np.floor((times - self._start) / turn.period).astype(np.int64)
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
        """Bearing at each time, shape (num,), rad, not wrapped."""
        return np.asarray(self.rate * (times - self._start) + np.interp(times, self._at, self._phases))

    def when(self, bearing: float) -> float:
        """Time (s) at which the beam reaches a bearing that is not wrapped."""
        time = self._start + (bearing - self._phases[0]) / self.rate
        for _ in range(5):  # the phases change slowly
            time += (bearing - float(self.at(np.array([time]))[0])) / self.rate
        return float(time)


def scans_of_turns(
    times: Floats, bearings: Floats, poses: Floats, turning: Turning, service: RadarService | None = None
) -> list[Swept] | None:
    """Return the scans of a turning radar, or None if it does not turn, or no turn is given or found. See `swept`."""
    if turning == "none" or not len(bearings):
        return None
    if service is not None and turning == "found":
        turning = service.turn
    turn = found_turn(times, bearings) if turning == "found" else turning
    span = times[[0, -1]] if service is None else np.array([min(times[0], service.first), max(times[-1], service.last)])
    return None if turn is None else swept(times, bearings, poses, turn, span)


def swept(times: Floats, bearings: Floats, poses: Floats, turn: Turn, span: Floats) -> list[Swept]:
    """Return the scans of a turning radar, including turns without rows.

    Turns begin in the direction with the fewest rows, because a target there may be measured in either of two turns.

    Args:
        times: (num_rows,) s, increasing.
        bearings: (num_rows,) rad from east.
        poses: (num_rows, 3 or more) of the sensor at each row.
        turn: nominal turn. The rows refine it.
        span: (2,) s, the turns from the first to the last of these times, which include those of all rows.
    """
    beam = _Beam(times, bearings, turn)
    sense, whole = math.copysign(1.0, beam.rate), 2.0 * math.pi
    seam_bearing = _emptiest(bearings)
    expected = beam.at(times)
    exact = expected + np.remainder(bearings - expected + math.pi, whole) - math.pi
    numbers = np.floor(sense * (exact - seam_bearing) / whole).astype(np.int64)
    outer = np.floor(sense * (beam.at(span) - seam_bearing) / whole).astype(np.int64)
    # Turns without rows count only if the span contains them completely.
    first, last = min(int(numbers.min()), int(outer[0]) + 1), max(int(numbers.max()), int(outer[1]) - 1)
    scans = []
    for number in range(first, last + 1):
        edges = [seam_bearing + sense * whole * (number + part) for part in (0.0, 0.5, 1.0)]
        begin, middle, end = map(beam.when, edges)
        pose = _moving(times, poses, middle, end - begin)
        beamed = with_beam(pose.place, pose.velocity, math.remainder(edges[1], whole), sense * whole / (end - begin))
        scans.append(Swept(middle, np.flatnonzero(numbers == number), beamed))
    return scans


def _emptiest(bearings: Floats) -> float:
    """Direction with the fewest rows nearby, rad."""
    counts, _ = np.histogram(np.remainder(bearings, 2.0 * math.pi), _SECTORS, (0.0, 2.0 * math.pi))
    weights = 1.0 - np.abs(np.arange(-_NEAR, _NEAR + 1)) / (_NEAR + 1.0)
    near = np.convolve(np.concatenate([counts[-_NEAR:], counts, counts[:_NEAR]]), weights, "valid")
    return float((near.argmin() + 0.5) * 2.0 * math.pi / _SECTORS)


class _Moving(NamedTuple):
    place: Floats  # (3 or more,) the pose
    velocity: Floats  # (2,) m/s


def _moving(times: Floats, poses: Floats, time: float, period: float) -> _Moving:
    """Return pose and velocity at a time, from a line through the sensor positions of the rows within a turn."""
    nearest = int(np.abs(times - time).argmin())
    pose, own = poses[nearest].copy(), np.flatnonzero(np.abs(times - time) <= period)
    if len(own) < _FEWEST_PLACES:
        own = np.sort(np.abs(times - time).argsort(kind="stable")[:_FEWEST_PLACES])
    if len(own) < 2 or (poses[own, :2] == pose[:2]).all() or times[own[-1]] == times[own[0]]:
        return _Moving(pose, np.zeros(2))
    slope, place = np.polyfit(times[own] - time, poses[own, :2], 1)
    pose[:2] = place
    return _Moving(pose, slope)
