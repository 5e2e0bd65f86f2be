"""Built-in measurements of bearings, ranges and range rates.

A bearing is atan2(dy, dx) from the +x axis in (-pi, pi] rad, not relative to the heading (paper-notes 2). A range
is in metres. A range rate is the time derivative of the range in m/s: the component of the target's velocity relative
to the sensor along the line of sight, positive if the target moves away. A target exactly at the sensor has no
bearing and no line of sight: its range rate is 0 and its Jacobian rows are zero, so that such a measurement has no
effect on the state.
"""

import math

import numpy as np

from vedette.kernels.base.compile import inlined
from vedette.kernels.base.types import OWN_VELOCITY, VX, VY, Floats
from vedette.kernels.gaussian.beam import LEVEL, offset_at_beam, passage, to_scan_time
from vedette.kernels.gaussian.scratch import FULL_TURN
from vedette.models.arguments import positive
from vedette.models.fields import Positive, part
from vedette.models.functions import model_function
from vedette.models.measurement import MeasurementModel
from vedette.models.turns import own_places


@inlined
def _bearing_row(dx: float, dy: float, out: Floats, row: int) -> None:
    square = dx * dx + dy * dy
    for j in range(out.shape[1]):
        out[row, j] = 0.0
    if square > 0.0:
        out[row, 0] = -dy / square
        out[row, 1] = dx / square


@inlined
def _range_row(dx: float, dy: float, out: Floats, row: int) -> None:
    distance = math.sqrt(dx * dx + dy * dy)
    for j in range(out.shape[1]):
        out[row, j] = 0.0
    if distance > 0.0:
        out[row, 0] = dx / distance
        out[row, 1] = dy / distance


@model_function("measurement")
def _bearing_range(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    dx, dy = offset_at_beam(state, pose)
    out[0] = math.atan2(dy, dx)
    out[1] = math.sqrt(dx * dx + dy * dy)


@model_function("measurement_jacobian")
def _bearing_range_jacobian(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    at = passage(state, pose)
    _bearing_row(at.dx, at.dy, out, 0)
    _range_row(at.dx, at.dy, out, 1)
    to_scan_time(at, pose, False, LEVEL, out)


@inlined
def _relative_velocity(state: Floats, pose: Floats) -> tuple[float, float]:
    if pose.shape[0] < OWN_VELOCITY + 2:
        return state[VX], state[VY]
    return state[VX] - pose[OWN_VELOCITY], state[VY] - pose[OWN_VELOCITY + 1]


@model_function("measurement")
def _bearing_range_rate(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    dx, dy = offset_at_beam(state, pose)
    vx, vy = _relative_velocity(state, pose)
    distance = math.sqrt(dx * dx + dy * dy)
    out[0] = math.atan2(dy, dx)
    out[1] = distance
    out[2] = (dx * vx + dy * vy) / distance if distance > 0.0 else 0.0


@model_function("measurement_jacobian")
def _bearing_range_rate_jacobian(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    at = passage(state, pose)
    dx, dy = at.dx, at.dy
    _bearing_row(dx, dy, out, 0)
    _range_row(dx, dy, out, 1)
    vx, vy = _relative_velocity(state, pose)
    square = dx * dx + dy * dy
    # Turn rate of the line of sight: the velocity across it divided by the distance.
    turning = (dx * vy - dy * vx) / square if square > 0.0 else 0.0
    for j in range(out.shape[1]):
        out[2, j] = 0.0
    out[2, 0], out[2, 1] = -turning * out[1, 1], turning * out[1, 0]
    out[2, VX], out[2, VY] = out[1, 0], out[1, 1]
    to_scan_time(at, pose, False, LEVEL, out)


@model_function("measurement")
def _bearing(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    dx, dy = offset_at_beam(state, pose)
    out[0] = math.atan2(dy, dx)


@model_function("measurement_jacobian")
def _bearing_jacobian(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    at = passage(state, pose)
    _bearing_row(at.dx, at.dy, out, 0)
    to_scan_time(at, pose, False, LEVEL, out)


@model_function("measurement")
def _range(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    dx, dy = offset_at_beam(state, pose)
    out[0] = math.sqrt(dx * dx + dy * dy)


@model_function("measurement_jacobian")
def _range_jacobian(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    at = passage(state, pose)
    _range_row(at.dx, at.dy, out, 0)
    to_scan_time(at, pose, False, LEVEL, out)


def _places(measurements: Floats, pose: Floats) -> Floats:
    bearings, ranges = measurements[:, 0], measurements[:, 1]
    x, y = own_places(bearings, pose).T
    return np.stack([x + ranges * np.cos(bearings), y + ranges * np.sin(bearings)], axis=1)


@part("bearing_range", "measurement")
def bearing_range() -> MeasurementModel:
    """z = [bearing in rad, range in m] (paper: z_k), with the bearing counter-clockwise from east, in (-pi, pi]."""
    functions = _bearing_range, np.empty(0), _bearing_range_jacobian
    return MeasurementModel(2, *functions, places=_places, components=("bearing", "range"))


@part("bearing_range_rate", "measurement")
def bearing_range_rate(max_unambiguous_range_rate: Positive | None = None) -> MeasurementModel:
    """z = [bearing in rad, range in m, range rate in m/s] of a Doppler radar, positive if the range grows.

    The range rate is relative to the sensor. The sensor's velocity in m/s is in components 6 and 7 of its pose, after
    the components of cameras and budgets. A sensor with a shorter pose is at rest. States are [px, py, vx, vy, ...].

    Range rates folded at v are measured modulo 2 v, in (-v, v]. Residuals are wrapped to that interval. A range rate
    counts once three predicted standard deviations are within v. It also gives a new track its velocity only then.

    Args:
        max_unambiguous_range_rate: v of range rates that are folded, wavelength times pulse repetition
            frequency over 4. none: they are not folded [m/s].
    """
    functions = _bearing_range_rate, np.empty(0), _bearing_range_rate_jacobian
    folded = max_unambiguous_range_rate
    period = np.inf if folded is None else 2.0 * positive("max_unambiguous_range_rate", folded)
    names, periods = ("bearing", "range", "range_rate"), np.array([FULL_TURN, np.inf, period])
    return MeasurementModel(3, *functions, places=_places, components=names, periods=periods)


@part("bearing_only", "measurement")
def bearing_only() -> MeasurementModel:
    """z = [bearing in rad], counter-clockwise from east, in (-pi, pi]."""
    return MeasurementModel(1, _bearing, np.empty(0), _bearing_jacobian, components=("bearing",))


@part("range_only", "measurement")
def range_only() -> MeasurementModel:
    """z = [range in m]."""
    return MeasurementModel(1, _range, np.empty(0), _range_jacobian, components=("range",))
