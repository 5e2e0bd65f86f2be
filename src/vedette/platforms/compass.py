"""Compass directions: azimuths clockwise from true north, and their conversion to angles in the plane.

The library measures angles counter-clockwise from the x axis of the plane. Charts and ship reports measure them
clockwise from true north at the position of the sensor, which differs from the y axis away from the origin.
"""

import math
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from vedette.kernels.base.types import VX, VY, Floats


@runtime_checkable
class Compass(Protocol):
    """The direction of true north at a position in the plane."""

    def angle(self, azimuth: ArrayLike, place: ArrayLike) -> Floats:
        """Return angles in the plane, rad in [-pi, pi], of azimuths, rad clockwise from true north at `place`, (2,) m.

        `place` may also be an array of poses, whose first two components are used.
        """

    def azimuth(self, angle: ArrayLike, place: ArrayLike) -> Floats:
        """Return azimuths, rad in [-pi, pi], of angles in the plane: the inverse of `angle`."""


@dataclass(frozen=True, slots=True)
class PlaneCompass:
    """The compass of a plane without a position on the Earth: north is along y everywhere."""

    def angle(self, azimuth: ArrayLike, place: ArrayLike) -> Floats:
        """Return pi / 2 minus the azimuth."""
        return wrapped(math.pi / 2.0 - np.asarray(azimuth, np.float64))

    def azimuth(self, angle: ArrayLike, place: ArrayLike) -> Floats:
        """Return pi / 2 minus the angle."""
        return self.angle(angle, place)


def wrapped(angles: ArrayLike) -> Floats:
    """Return angles in rad, wrapped to [-pi, pi]."""
    given = np.asarray(angles, np.float64)
    return np.asarray(given - 2.0 * math.pi * np.rint(given / (2.0 * math.pi)))


def course_deg(compass: Compass, angle: ArrayLike, place: ArrayLike) -> Floats:
    """Return courses, degrees in [0, 360) clockwise from true north at `place`, of angles in the plane, rad."""
    return np.asarray(np.degrees(compass.azimuth(angle, place)) % 360.0)


def courses_of(compass: Compass, states: Floats) -> Floats:
    """Return (num, 2) course, deg in [0, 360), and speed, m/s, of states [px, py, vx, vy, ...] of targets."""
    courses = [course_deg(compass, math.atan2(state[VY], state[VX]), state) for state in states.tolist()]
    return np.column_stack([np.array(courses).reshape(-1), np.hypot(states[:, VX], states[:, VY])])
