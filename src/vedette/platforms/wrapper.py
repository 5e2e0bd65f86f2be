"""Platforms that add components to the poses of another platform: its velocity, or the times since visits."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vedette.errors import InputError
from vedette.kernels.base.types import OWN_VELOCITY, VISITS, Bools, Floats
from vedette.models.arguments import float_array, positive
from vedette.platforms.base import Platform, check_platform, courses_of, prices_of, scans_of


@dataclass(frozen=True, slots=True)
class PlatformWrapper:
    """A platform with the actions, prices and scans of another one. Subclasses extend its `courses`."""

    platform: Platform

    def __post_init__(self) -> None:
        check_platform("platform", self.platform)

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of the platform."""
        return tuple(self.platform.columns)

    def actions(self, pose: Floats) -> Floats:
        """Return (num_actions, num_columns) the actions of the platform."""
        return np.asarray(self.platform.actions(pose))

    def course(self, pose: Floats, action: Floats, times: Floats) -> Floats:
        """Return the course of one action, see `courses`."""
        return np.asarray(self.courses(pose, action[np.newaxis], times)[0])

    def courses(self, pose: Floats, actions: Floats, times: Floats) -> Floats:
        """Return the courses of the platform."""
        return courses_of("platform", self.platform, pose, actions, times)

    def prices(self, actions: Floats) -> Floats:
        """Return prices (num_actions,) of the platform."""
        return prices_of("platform", self.platform, actions)

    def scans(self, pose: Floats, actions: Floats, times: Floats) -> Bools:
        """Return (num_actions, num_times) the scans of the platform."""
        return scans_of("platform", self.platform, pose, actions, times)


_STEP = 1e-3  # s, time step of the differences that give velocities


@dataclass(frozen=True, slots=True)
class WithVelocity(PlatformWrapper):
    """A platform whose poses have its velocity, m/s, as components 6 and 7. Poses need 8 components.

    The velocity at a time is the mean over the millisecond before it.

    Attributes:
        platform: the platform that moves.

    Raises:
        InputError: no platform.
    """

    def courses(self, pose: Floats, actions: Floats, times: Floats) -> Floats:
        """Return the courses of the platform, with its velocity."""
        before = np.maximum(times - _STEP, 0.0)
        courses = courses_of("platform", self.platform, pose, actions, times)
        moved = courses[..., :2] - courses_of("platform", self.platform, pose, actions, before)[..., :2]
        stretches = np.where(times > before, times - before, 1.0)
        courses[..., OWN_VELOCITY : OWN_VELOCITY + 2] = moved / stretches[:, np.newaxis]
        return courses


_PARTS = 16  # straight segments that approximate a course, up to the last requested time


@dataclass(frozen=True, slots=True)
class Patrolling(PlatformWrapper):
    """A platform whose pose has the seconds since it last visited each place, from component 11 on.

    A course is assumed to be straight between the requested times and sixteen more.

    Attributes:
        platform: the platform that moves.
        places: (num_places, 2) m.
        radius: m, distance within which it is at a place.

    Raises:
        InputError: no platform, places of another shape, or a radius that is not above 0.
    """

    places: Sequence[tuple[float, float]]
    radius: float

    def __post_init__(self) -> None:
        PlatformWrapper.__post_init__(self)
        positive("radius", self.radius)
        places = float_array("places", self.places, (None, 2))
        object.__setattr__(self, "places", tuple(map(tuple, places.tolist())))

    def courses(self, pose: Floats, actions: Floats, times: Floats) -> Floats:
        """Return the courses of the platform, with the seconds since each place was visited."""
        if len(pose) < VISITS + len(self.places):
            wanted = f"{VISITS + len(self.places)} components, the last of them the seconds since it was at each place"
            raise InputError(f"pose: expected {wanted}; got {len(pose)}")
        nodes = np.union1d(times, np.linspace(0.0, times.max(), _PARTS + 1)[1:])
        courses = courses_of("platform", self.platform, pose, actions, nodes)
        start = np.broadcast_to(pose[:2], (len(courses), 1, 2))
        ways, at = np.concatenate([start, courses[..., :2]], axis=1), np.concatenate([[0.0], nodes])
        for k, place in enumerate(self.places):
            last = np.maximum.accumulate(_last_inside(ways, at, np.array(place), self.radius), axis=1)
            courses[..., VISITS + k] = np.where(last >= 0.0, nodes - last, pose[VISITS + k] + nodes)
        return courses[:, np.searchsorted(nodes, times)]


def _last_inside(ways: Floats, at: Floats, place: Floats, radius: float) -> Floats:
    """Return (num, num_legs) the last time of each straight leg within a radius of a place. -1: never.

    ways: (num, num_legs + 1, 2) m, at: (num_legs + 1,) s.
    """
    begin, leg = ways[:, :-1] - place, np.diff(ways, axis=1)
    square, along = (leg * leg).sum(axis=2), (leg * begin).sum(axis=2)
    beyond = (begin * begin).sum(axis=2) - radius**2
    moves = square > 0.0
    root: Any = np.sqrt(np.maximum(along**2 - square * beyond, 0.0))
    leaves = np.where(moves, (root - along) / np.where(moves, square, 1.0), 1.0)
    enters = np.where(moves, (-root - along) / np.where(moves, square, 1.0), 0.0)
    crosses = np.where(moves, (along**2 >= square * beyond) & (leaves >= 0.0) & (enters <= 1.0), beyond <= 0.0)
    return np.where(crosses, at[:-1] + np.minimum(leaves, 1.0) * np.diff(at), -1.0)
