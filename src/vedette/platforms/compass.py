"""Directions by compass: azimuths clockwise from true north, and the angles of the plane that they are.

The library counts angles counter-clockwise from the x axis of the plane. On charts and in messages of ships they are
counted clockwise from true north at the place of the sensor, which is not the y axis away from the origin.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from vedette.kernels.base.types import Floats


@runtime_checkable
class Compass(Protocol):
    """Where true north is, at a place of the plane."""

    def angle(self, azimuth: ArrayLike, place: ArrayLike) -> Floats:
        """Return angles of the plane, rad in [-pi, pi], of azimuths, rad clockwise from true north at `place`, (2,) m.

        `place` may also be one of many poses, of which the first two numbers count.
        """
        ...

    def azimuth(self, angle: ArrayLike, place: ArrayLike) -> Floats:
        """Return azimuths, rad in [-pi, pi], of angles of the plane: the inverse of `angle`."""
        ...


@dataclass(frozen=True, slots=True)
class PlaneCompass:
    """The compass of a plane that lies nowhere on the Earth: north is along y everywhere."""

    def angle(self, azimuth: ArrayLike, place: ArrayLike) -> Floats:
        """Return pi / 2 less the azimuth."""
        return wrapped(math.pi / 2.0 - np.asarray(azimuth, np.float64))

    def azimuth(self, angle: ArrayLike, place: ArrayLike) -> Floats:
        """Return pi / 2 less the angle."""
        return self.angle(angle, place)


def wrapped(angles: ArrayLike) -> Floats:
    """Return angles in [-pi, pi], rad."""
    given = np.asarray(angles, np.float64)
    return np.asarray(given - 2.0 * math.pi * np.rint(given / (2.0 * math.pi)))


def course_deg(compass: Compass, angle: ArrayLike, place: ArrayLike) -> Floats:
    """Return courses, degrees in [0, 360) clockwise from true north at `place`, of angles of the plane, rad."""
    return np.asarray(np.degrees(compass.azimuth(angle, place)) % 360.0)


def courses_of(compass: Compass, states: Floats) -> Floats:
    """Return (num, 2) course, deg in [0, 360), and speed, m/s, of states [px, py, vx, vy, ...] of targets."""
    courses = [course_deg(compass, math.atan2(state[3], state[2]), state) for state in states.tolist()]
    return np.column_stack([np.array(courses).reshape(-1), np.hypot(states[:, 2], states[:, 3])])
