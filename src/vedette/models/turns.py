"""Turning radars: poses with a beam, and the time at which the beam points in a direction."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from vedette.kernels.base.types import BEAM, OWN_VELOCITY, TURN_RATE, Floats
from vedette.models.arguments import float_array, pose_vector
from vedette.models.fields import Positive, check_fields


@dataclass(frozen=True, slots=True)
class Turn:
    """Rotation of a radar.

    Attributes:
        period: time of one turn [s].
        clockwise: direction seen from above. True for most radars.
    """

    period: Positive
    clockwise: bool = True

    def __post_init__(self) -> None:
        check_fields(self, "Turn.")

    @property
    def rate(self) -> float:
        """Turn rate, rad/s, counter-clockwise positive."""
        return (-2.0 if self.clockwise else 2.0) * math.pi / self.period


def with_beam(pose: ArrayLike, velocity: ArrayLike, bearing: float, rate: float) -> Floats:
    """Return the pose of a scan that is one turn of the beam. See `vedette.kernels.gaussian.beam`.

    Args:
        pose: (3 or more,) pose of the sensor at the time of the scan, the middle of the turn.
        velocity: (2,) velocity of the sensor, m/s.
        bearing: bearing of the beam at that time, rad from east.
        rate: turn rate, rad/s, counter-clockwise positive. 0: the sensor does not turn.

    Raises:
        InputError: an array has another shape or a number that is not finite.
    """
    own = pose_vector("pose", pose)
    pose_with_beam = np.zeros(max(len(own), BEAM + 2))
    pose_with_beam[: len(own)] = own
    pose_with_beam[OWN_VELOCITY:BEAM] = float_array("velocity", velocity, (2,))
    pose_with_beam[BEAM : BEAM + 2] = bearing, rate
    return pose_with_beam


def is_turn(poses: Floats) -> bool:
    """Return True if a pose, or any of several, shape (..., pose_dim), is that of a scan of one turn of the beam."""
    return poses.shape[-1] > TURN_RATE and bool(np.any(poses[..., TURN_RATE]))


def lags(bearings: Floats, pose: Floats) -> Floats:
    """Return when the beam points in each direction, shape (num,), s after the scan time, or 0 without a turn."""
    if not is_turn(pose):
        return np.zeros(len(bearings))
    off = np.remainder(bearings - pose[BEAM] + math.pi, 2.0 * math.pi) - math.pi
    return np.asarray(off / pose[TURN_RATE])


def longest_lag(pose: Floats) -> float:
    """Return half the time of a turn, s, or 0 without a turn."""
    return math.pi / abs(float(pose[TURN_RATE])) if is_turn(pose) else 0.0


def own_places(bearings: Floats, pose: Floats) -> Floats:
    """Return the sensor's position when its beam points in each direction (rad), shape (num, 2), m."""
    if not is_turn(pose):
        return np.broadcast_to(pose[:2], (len(bearings), 2))
    return np.asarray(pose[:2] + lags(bearings, pose)[:, np.newaxis] * pose[OWN_VELOCITY:BEAM])
