"""Platforms that track the time since they last visited each of several places."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vedette.errors import InputError
from vedette.kernels.base.types import VISITS, Floats
from vedette.models.arguments import float_array, positive
from vedette.platforms.base import courses_of
from vedette.platforms.wrapper import PlatformWrapper

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
