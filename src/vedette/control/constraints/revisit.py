"""Places that some platform must visit again and again."""

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

# Horizons before a place is due at which a platform sets out: one in which it may still go away, and one for the way.
_HORIZONS = 2.0


@dataclass(frozen=True, slots=True)
class Revisit(PerSensorConstraint):
    """Maximum time between visits of each place, by any platform.

    Poses have the seconds since their platforms were at each place (`Patrolling`). When the time that is left is little
    more than that of the way, the platform that is there earliest takes only courses that come to the place, or nearest
    to it. Platforms share out the places. Ways are straight, at the speed of the fastest course.

    Attributes:
        places: (num_places, 2) m, those of `Patrolling`.
        radius: m, within which a platform is at a place, as of `Patrolling`.
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
        """(num_courses,) m that each course stays further from the place of its sensor than the nearest one."""
        found = [np.zeros(len(own)) for own in situation.courses]
        poses = situation.poses
        if poses is None:
            return tuple(found)
        if poses.shape[1] < CLOCKS + len(self.places):
            wanted = f"poses of {CLOCKS + len(self.places)} components, the last of them seconds since the last visits"
            raise InputError(f"constraint {self.name}: expected {wanted} (see Patrolling); got {poses.shape[1]}")
        for sensor, place in self._sent(situation, poses):
            gaps = _gaps(situation.ways(sensor), np.array(self.places[place])) - self.radius
            if len(gaps):
                gaps = np.maximum(gaps, 0.0)
                found[sensor] = gaps - gaps.min()
        return tuple(found)

    def _sent(self, situation: ConstraintContext, poses: Floats) -> list[tuple[int, int]]:
        """Sensors that must go to a place, with the place.

        The place that was not visited for longest comes first: by the way that is left, a sensor would turn round again
        and again. Each goes to the sensor that is there earliest, maybe by way of others. A sensor goes to its first
        place when any of its places is due.
        """
        patrols = np.flatnonzero(poses[:, CLOCKS] >= 0.0)
        speed = max((_speed(situation, s) for s in patrols.tolist()), default=0.0)
        if speed <= 0.0:
            return []
        places = np.array(self.places)
        left = self.every - poses[patrols, CLOCKS : CLOCKS + len(places)].min(axis=0)
        at, ready = poses[patrols, :2].copy(), np.zeros(len(patrols))
        first: dict[int, int] = {}
        due: set[int] = set()
        for place in np.argsort(left, kind="stable").tolist():
            ways = np.hypot(*(at - places[place]).T)
            arrival = ready + np.maximum(ways - self.radius, 0.0) / speed
            own = int(np.argmin(arrival))
            first.setdefault(own, place)
            if left[place] - arrival[own] <= _HORIZONS * _horizon(situation.times):
                due.add(own)
            at[own], ready[own] = places[place], arrival[own]
        return [(int(patrols[own]), first[own]) for own in sorted(due)]


def _horizon(times: Floats) -> float:
    """s from one decision to the next, of steps of one length."""
    step = times[0] if len(times) == 1 else times[1] - times[0]
    return float(times[-1] - times[0] + step)


def _speed(situation: ConstraintContext, sensor: int) -> float:
    """m/s of the fastest course of a sensor; 0 of one whose courses are not known."""
    ways = situation.ways(sensor)
    lengths = np.hypot(*np.diff(ways, axis=1).transpose(2, 0, 1)).sum(axis=1)
    return float(lengths.max(initial=0.0)) / _horizon(situation.times)


def _gaps(ways: Floats, place: Floats) -> Floats:
    """(num_courses,) least distance of each way from a place, m."""
    return np.asarray(np.sqrt(least_on_legs(ways[..., 0] - place[0], ways[..., 1] - place[1]).min(axis=1)))
