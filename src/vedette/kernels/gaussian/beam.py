"""Where a target is when the turning beam of a radar passes it, and the slope of what is then measured.

A scan of a turning radar is one turn. Its time is the middle of the turn; a target is passed up to half a turn earlier
or later, and until then both the target and the radar move straight on. The pose of such a scan has the radar's
velocity in components 6 and 7, the bearing of the beam in the middle of the turn in component 8 (rad), and the turn
rate in component 9 (rad/s, counter-clockwise positive). A shorter pose, or a turn rate of 0, is of a scan at one time.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from vedette.kernels.base.compile import borrowing, inlined
from vedette.kernels.base.types import Floats
from vedette.kernels.gaussian.scratch import wrap_angle

OWN_VELOCITY = 6  # first component of a pose that is of its velocity, m/s
BEAM = 8  # bearing of the beam in the middle of the turn, rad; the turn rate follows, rad/s
_NEWTON_STEPS = 3


class Passage(NamedTuple):
    """A target as the beam passes it.

    dx, dy: its offset from the sensor then, m. vx, vy: its velocity relative to the sensor, m/s. lag: when, s after the
    time of the scan; 0 of a scan at one time.
    """

    dx: float
    dy: float
    vx: float
    vy: float
    lag: float


@inlined
def turns(pose: Floats) -> bool:
    """Whether the pose is of a scan by a turning beam."""
    return pose.shape[0] > BEAM + 1 and pose[BEAM + 1] != 0.0


@inlined
def own_lag(bearing: float, pose: Floats) -> float:
    """Seconds from the time of a turn to when its beam points in a direction, in half a turn either way."""
    return wrap_angle(bearing - pose[BEAM]) / pose[BEAM + 1]


@borrowing
def _passage(state: Floats, pose: Floats) -> Passage:
    """Solves theta(lag) = bearing + rate * lag by Newton's method, from the direction at the time of the scan."""
    x, y = state[0] - pose[0], state[1] - pose[1]
    moves = state.shape[0] >= 4
    vx = (state[2] if moves else 0.0) - pose[OWN_VELOCITY]
    vy = (state[3] if moves else 0.0) - pose[OWN_VELOCITY + 1]
    rate, lag = pose[BEAM + 1], own_lag(math.atan2(y, x), pose)
    dx, dy = x + vx * lag, y + vy * lag
    for _ in range(_NEWTON_STEPS):
        square = dx * dx + dy * dy
        turning = (dx * vy - dy * vx) / square if square > 0.0 else 0.0
        if abs(turning) > 0.5 * abs(rate):  # so near that it outruns the beam: it is passed where it stood
            return Passage(x, y, vx, vy, 0.0)
        # The lag may leave half a turn by this, so the residual alone is wrapped.
        lag += wrap_angle(math.atan2(dy, dx) - pose[BEAM] - rate * lag) / (rate - turning)
        dx, dy = x + vx * lag, y + vy * lag
    return Passage(dx, dy, vx, vy, lag)


@inlined
def passage(state: Floats, pose: Floats) -> Passage:
    """A target as the beam passes it; at the time of the scan where nothing turns, its velocity then not worked out."""
    if turns(pose):
        return _passage(state, pose)
    return Passage(state[0] - pose[0], state[1] - pose[1], 0.0, 0.0, 0.0)


@inlined
def offset_at_beam(state: Floats, pose: Floats) -> tuple[float, float]:
    """The target's offset from the sensor as the beam passes it, m."""
    at = passage(state, pose)
    return at.dx, at.dy


@inlined
def own_place(bearing: float, pose: Floats) -> tuple[float, float]:
    """Where the sensor is when it measures in a direction, m."""
    if not turns(pose):
        return pose[0], pose[1]
    lag = own_lag(bearing, pose)
    return pose[0] + pose[OWN_VELOCITY] * lag, pose[1] + pose[OWN_VELOCITY + 1] * lag


@inlined
def to_scan_time(at: Passage, pose: Floats, moves_with_target: bool, out: Floats) -> None:
    """Make derivatives (meas_dim, state_dim) by the state at the passage those by the state at the time of the scan.

    With p the position, v the velocity and b the gradient of the bearing, lag changes by

        d lag = b' (dp + lag dv) / (rate - b' v),

    and the offset by dp + lag dv + v d lag.

    at: the passage. moves_with_target: whether what is measured is a place, which moves with the target alone, and not
    an offset from the sensor.
    """
    square = at.dx * at.dx + at.dy * at.dy
    if at.lag == 0.0 or square == 0.0:
        return
    bx, by = -at.dy / square, at.dx / square
    share = pose[BEAM + 1] - (bx * at.vx + by * at.vy)
    vx, vy = at.vx, at.vy
    if moves_with_target:
        vx, vy = vx + pose[OWN_VELOCITY], vy + pose[OWN_VELOCITY + 1]
    for row in range(out.shape[0]):
        along = (out[row, 0] * vx + out[row, 1] * vy) / share
        out[row, 0] += along * bx
        out[row, 1] += along * by
        if out.shape[1] >= 4:
            out[row, 2] += at.lag * out[row, 0]
            out[row, 3] += at.lag * out[row, 1]
