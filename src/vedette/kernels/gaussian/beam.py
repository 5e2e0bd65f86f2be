"""Position of a target when the turning beam of a radar passes it, and derivatives of the measurement at that time.

A scan of a turning radar is one turn, and its time is the middle of the turn. The beam passes a target up to half a
turn earlier or later. Target and radar have constant velocity in between. The pose of such a scan holds the velocity of
the radar in components 6 and 7 (m/s), the bearing of the beam in the middle of the turn in component 8 (rad), and the
turn rate in component 9 (rad/s, counter-clockwise positive). With a shorter pose or a turn rate of 0, all measurements
of the scan have one time.
"""

import math
from typing import NamedTuple

from vedette.kernels.base.compile import borrowing, inlined
from vedette.kernels.base.types import BEAM, OWN_HEIGHT, OWN_VELOCITY, TURN_RATE, VX, VY, Floats
from vedette.kernels.gaussian.scratch import wrap_angle

_NEWTON_STEPS = 3


class Rise(NamedTuple):
    """The height in states that a measurement depends on, by places that are -1 for none."""

    height: int  # place of the height
    climb: int  # place of the vertical velocity
    speed: float  # vertical velocity, m/s


LEVEL = Rise(-1, -1, 0.0)  # no height


class Passage(NamedTuple):
    """A target at the time when the beam passes it.

    dx, dy: offset from the sensor, m. vx, vy: velocity relative to the sensor, m/s. lag: that time, s after the time of
    the scan, or 0 if all measurements have one time.
    """

    dx: float
    dy: float
    vx: float
    vy: float
    lag: float


@inlined
def turns(pose: Floats) -> bool:
    """Return True if the pose belongs to a scan of a turning beam."""
    return pose.shape[0] > TURN_RATE and pose[TURN_RATE] != 0.0


@inlined
def own_lag(bearing: float, pose: Floats) -> float:
    """Return the time at which the beam points in a direction, s after the scan time, within half a turn."""
    return wrap_angle(bearing - pose[BEAM]) / pose[TURN_RATE]


@borrowing
def _passage(state: Floats, pose: Floats) -> Passage:
    """Solve theta(lag) = bearing + rate * lag by Newton's method, starting from the direction at the scan time."""
    x, y = state[0] - pose[0], state[1] - pose[1]
    moves = state.shape[0] > VY
    vx = (state[VX] if moves else 0.0) - pose[OWN_VELOCITY]
    vy = (state[VY] if moves else 0.0) - pose[OWN_VELOCITY + 1]
    rate, lag = pose[TURN_RATE], own_lag(math.atan2(y, x), pose)
    dx, dy = x + vx * lag, y + vy * lag
    for _ in range(_NEWTON_STEPS):
        square = dx * dx + dy * dy
        turning = (dx * vy - dy * vx) / square if square > 0.0 else 0.0
        if abs(turning) > 0.5 * abs(rate):  # a target this close may outrun the beam: use its position at the scan time
            return Passage(x, y, vx, vy, 0.0)
        # Only the residual is wrapped: the lag itself may exceed half a turn.
        lag += wrap_angle(math.atan2(dy, dx) - pose[BEAM] - rate * lag) / (rate - turning)
        dx, dy = x + vx * lag, y + vy * lag
    return Passage(dx, dy, vx, vy, lag)


@inlined
def passage(state: Floats, pose: Floats) -> Passage:
    """Return the target at its passage, or at the scan time, with velocity 0, if the sensor does not turn."""
    if turns(pose):
        return _passage(state, pose)
    return Passage(state[0] - pose[0], state[1] - pose[1], 0.0, 0.0, 0.0)


@inlined
def offset_at_beam(state: Floats, pose: Floats) -> tuple[float, float]:
    """Return the target's offset from the sensor when the beam passes it, m."""
    at = passage(state, pose)
    return at.dx, at.dy


@inlined
def angle_of_extent(extent: float, square: float) -> float:
    """Return the variance in bearing, rad^2, of an error of `extent` m across the line of sight, at most 1.

    square: squared distance, m^2.
    """
    return extent * extent / max(square, extent * extent, 1e-300)


@inlined
def own_height(pose: Floats) -> float:
    """Return the sensor's height, m."""
    return pose[OWN_HEIGHT] if pose.shape[0] > OWN_HEIGHT else 0.0


@inlined
def own_place(bearing: float, pose: Floats) -> tuple[float, float]:
    """Return the sensor's position when the beam points in a direction, m."""
    if not turns(pose):
        return pose[0], pose[1]
    lag = own_lag(bearing, pose)
    return pose[0] + pose[OWN_VELOCITY] * lag, pose[1] + pose[OWN_VELOCITY + 1] * lag


@inlined
def to_scan_time(at: Passage, pose: Floats, moves_with_target: bool, rise: Rise, out: Floats) -> None:
    """Convert derivatives (meas_dim, state_dim) by the state at the passage into those by the state at the scan time.

    With position p, velocity v and bearing gradient b, the lag changes by

        d lag = b' (dp + lag dv) / (rate - b' v),

    and the offset by dp + lag dv + v d lag.

    at: the passage. moves_with_target: True if the measurement is the target's position, False if it depends on the
    offset from the sensor. rise: the height that it depends on, or `LEVEL`.
    """
    square = at.dx * at.dx + at.dy * at.dy
    if at.lag == 0.0 or square == 0.0:
        return
    bx, by = -at.dy / square, at.dx / square
    share = pose[TURN_RATE] - (bx * at.vx + by * at.vy)
    vx, vy = at.vx, at.vy
    if moves_with_target:
        vx, vy = vx + pose[OWN_VELOCITY], vy + pose[OWN_VELOCITY + 1]
    for row in range(out.shape[0]):
        along = (out[row, 0] * vx + out[row, 1] * vy) / share
        if rise.climb >= 0:
            along += out[row, rise.height] * rise.speed / share
            out[row, rise.climb] += at.lag * out[row, rise.height]
        out[row, 0] += along * bx
        out[row, 1] += along * by
        if out.shape[1] > VY:
            out[row, VX] += at.lag * out[row, 0]
            out[row, VY] += at.lag * out[row, 1]
