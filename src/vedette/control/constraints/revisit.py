"""Places that platforms must visit repeatedly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from vedette.control.constraints.protocol import ConstraintContext, PerSensorConstraint, least_on_legs
from vedette.errors import InputError
from vedette.kernels.base.types import Floats
from vedette.models.arguments import float_array, positive
from vedette.platforms.patrolling import CLOCKS

# Horizons of lead before a place is due: one in which a platform may still move away, and one for the way.
_HORIZONS = 2.0


@dataclass(frozen=True, slots=True)
class Revisit(PerSensorConstraint):
    """A maximum time between visits of each place, by any platform.

    Poses contain the seconds since their platforms were at each place (`Patrolling`). When the remaining time is little
    more than the travel time, the platform that can arrive first takes only courses that come to the place, or nearest
    to it. Platforms share the places. Ways are straight, at the speed of the fastest course.

    Attributes:
        places: (num_places, 2) m, those of `Patrolling`.
        radius: m, distance within which a platform is at a place, as in `Patrolling`.
        every: s.

    Raises:
        InputError: places of another shape, or a radius or time that is not above 0.
    """

    places: Sequence[tuple[float, float]]
    radius: float
    every: float
    name: ClassVar[str] = "revisit"
    needs_beliefs: ClassVar[bool] = False

    def __post_init__(self) -> None:
        places = float_array("places", self.places, (None, 2))
        object.__setattr__(self, "places", tuple(map(tuple, places.tolist())))
        positive("radius", self.radius)
        positive("every", self.every)

    def violations(self, situation: ConstraintContext) -> tuple[Floats, ...]:
        """Return (num_courses,) m, the distance of each course from its sensor's place, less that of the nearest."""
        violations = [np.zeros(len(own)) for own in situation.courses]
        poses = situation.poses
        if poses is None:
            return tuple(violations)
        if poses.shape[1] < CLOCKS + len(self.places):
            expected = (
                f"poses of {CLOCKS + len(self.places)} components, the last of them seconds since the last visits"
            )
            raise InputError(f"constraint {self.name}: expected {expected} (see Patrolling); got {poses.shape[1]}")
        for sensor, place in self._sent(situation, poses):
            gaps = _gaps(situation.ways(sensor), np.array(self.places[place])) - self.radius
            if len(gaps):
                gaps = np.maximum(gaps, 0.0)
                violations[sensor] = gaps - gaps.min()
        return tuple(violations)

    def _sent(self, situation: ConstraintContext, poses: Floats) -> list[tuple[int, int]]:
        """Return the sensors that must go to a place, each with the place.

        The place that was not visited for longest comes first: with an order by remaining distance, a sensor would turn
        back and forth. Each place goes to the sensor that can arrive first, possibly by way of other places. A sensor
        moves to its first place when any of its places is due.
        """
        patrols = np.flatnonzero(poses[:, CLOCKS] >= 0.0)
        speed = max((_speed(situation, s) for s in patrols.tolist()), default=0.0)
        if speed <= 0.0:
            return []
        places = np.array(self.places)
        time_left = self.every - poses[patrols, CLOCKS : CLOCKS + len(places)].min(axis=0)
        at, ready = poses[patrols, :2].copy(), np.zeros(len(patrols))
        first: dict[int, int] = {}
        due: set[int] = set()
        for place in np.argsort(time_left, kind="stable").tolist():
            distances = np.hypot(*(at - places[place]).T)
            arrival = ready + np.maximum(distances - self.radius, 0.0) / speed
            sensor = int(np.argmin(arrival))
            first.setdefault(sensor, place)
            if time_left[place] - arrival[sensor] <= _HORIZONS * _horizon(situation.times):
                due.add(sensor)
            at[sensor], ready[sensor] = places[place], arrival[sensor]
        return [(int(patrols[sensor]), first[sensor]) for sensor in sorted(due)]


def _horizon(times: Floats) -> float:
    """Return the time in s from one decision to the next, with steps of equal length."""
    step = times[0] if len(times) == 1 else times[1] - times[0]
    return float(times[-1] - times[0] + step)


def _speed(situation: ConstraintContext, sensor: int) -> float:
    """Return the speed in m/s of the fastest course of a sensor; 0 if its courses are not known."""
    ways = situation.ways(sensor)
    lengths = np.hypot(*np.diff(ways, axis=1).transpose(2, 0, 1)).sum(axis=1)
    return float(lengths.max(initial=0.0)) / _horizon(situation.times)


def _gaps(ways: Floats, place: Floats) -> Floats:
    """Return the least distance (num_courses,) m of each way from a place."""
    return np.asarray(np.sqrt(least_on_legs(ways[..., 0] - place[0], ways[..., 1] - place[1]).min(axis=1)))
