"""Turns of a radar's beam: how a pose tells them, and when the beam points where."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from vedette.kernels.base.types import Floats
from vedette.kernels.gaussian.beam import BEAM, OWN_VELOCITY
from vedette.models.arguments import float_array, pose_vector, positive


@dataclass(frozen=True, slots=True)
class Turn:
    """How a radar turns.

    Attributes:
        period: s, of one turn.
        clockwise: seen from above, as most radars do.

    Raises:
        InputError: a period that is not above 0.
    """

    period: float
    clockwise: bool = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "period", positive("Turn.period", self.period))

    @property
    def rate(self) -> float:
        """rad/s, counter-clockwise positive."""
        return (-2.0 if self.clockwise else 2.0) * math.pi / self.period


def with_beam(pose: ArrayLike, velocity: ArrayLike, bearing: float, rate: float) -> Floats:
    """Return the pose of a scan that is a turn of the beam; see `vedette.kernels.gaussian.beam`.

    Args:
        pose: (3 or more,) of the sensor at the time of the scan, the middle of the turn.
        velocity: (2,) of the sensor, m/s.
        bearing: of the beam then, rad from east.
        rate: rad/s, counter-clockwise positive; 0: nothing turns.

    Raises:
        InputError: arrays of other shapes, or with numbers that are not finite.
    """
    own = pose_vector("pose", pose)
    found = np.zeros(max(len(own), BEAM + 2))
    found[: len(own)] = own
    found[OWN_VELOCITY:BEAM] = float_array("velocity", velocity, (2,))
    found[BEAM : BEAM + 2] = bearing, rate
    return found


def is_turn(pose: Floats) -> bool:
    """Whether the pose is of a scan that is a turn of the beam."""
    return len(pose) > BEAM + 1 and bool(pose[BEAM + 1] != 0.0)


def lags(bearings: Floats, pose: Floats) -> Floats:
    """(num,) s after the time of the scan at which the beam points in directions (rad); 0 of a scan at one time."""
    if not is_turn(pose):
        return np.zeros(len(bearings))
    off = np.remainder(bearings - pose[BEAM] + math.pi, 2.0 * math.pi) - math.pi
    return np.asarray(off / pose[BEAM + 1])


def longest_lag(pose: Floats) -> float:
    """s, half a turn; 0 of a scan at one time."""
    return math.pi / abs(float(pose[BEAM + 1])) if is_turn(pose) else 0.0


def own_places(bearings: Floats, pose: Floats) -> Floats:
    """(num, 2) where the sensor is when it measures in directions (rad), m."""
    if not is_turn(pose):
        return np.broadcast_to(pose[:2], (len(bearings), 2))
    return np.asarray(pose[:2] + lags(bearings, pose)[:, np.newaxis] * pose[OWN_VELOCITY:BEAM])
