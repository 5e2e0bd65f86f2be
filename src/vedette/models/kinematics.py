"""Built-in motion models: nearly constant velocity, also with height, and the coordinated turn, for any time step.

States are [px, py, vx, vy] (the order of the paper's F and Q, paper-notes 1). The coordinated turn appends a turn rate
in rad/s, positive to the left. The model with height appends height and vertical velocity.
"""

import math
from typing import Literal

import numpy as np

from vedette.kernels.base.compile import inlined, kernel
from vedette.kernels.base.types import STATE_COMPONENTS, Floats
from vedette.models.arguments import non_negative, one_of
from vedette.models.fields import NonNegative, part
from vedette.models.functions import model_function
from vedette.models.motion import MotionModel

# Below this angle of turn the derivatives use their series: the closed forms have errors of about 1e-16 / angle^2.
_SERIES_ANGLE = 0.1


@inlined
def acceleration_cov(dt: float, sigma_v: float, out: Floats) -> None:
    """Write the covariance of positions and velocities for an acceleration constant within the step, zero elsewhere."""
    variance = sigma_v * sigma_v
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = 0.0
    for axis in range(2):
        out[axis, axis] = 0.25 * dt**4 * variance
        out[axis, axis + 2] = 0.5 * dt**3 * variance
        out[axis + 2, axis] = out[axis, axis + 2]
        out[axis + 2, axis + 2] = dt**2 * variance


@inlined
def identity(out: Floats) -> None:
    """Write the identity matrix."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = 1.0 if i == j else 0.0


@model_function("transition")
def _cv_transition(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    out[0] = state[0] + dt * state[2]
    out[1] = state[1] + dt * state[3]
    out[2] = state[2]
    out[3] = state[3]


@model_function("transition_jacobian")
def _cv_jacobian(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    identity(out)
    out[0, 2] = dt
    out[1, 3] = dt


@model_function("process_noise_cov")
def _cv_noise(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    acceleration_cov(dt, params[0], out)


@model_function("process_noise_cov")
def _cv_continuous_noise(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    variance = params[0] * params[0]
    for i in range(4):
        for j in range(4):
            out[i, j] = 0.0
    for axis in range(2):
        out[axis, axis] = dt**3 / 3.0 * variance
        out[axis, axis + 2] = 0.5 * dt**2 * variance
        out[axis + 2, axis] = out[axis, axis + 2]
        out[axis + 2, axis + 2] = dt * variance


@part("constant_velocity", "motion")
def constant_velocity(
    sigma_v: NonNegative = 5.0,
    *,
    noise_model: Literal["discrete_white", "continuous_white"] = "discrete_white",
    method: str = "auto",
) -> MotionModel:
    """Constant velocity with white acceleration noise. State [px, py, vx, vy].

    For an acceleration that is constant within a step (paper section IV, F_k and Q_k), the noise of an axis is
    sigma_v^2 [[dt^4/4, dt^3/2], [dt^3/2, dt^2]]. For white noise in continuous time (Bar-Shalom, Li and Kirubarajan
    2001, section 6.2.2), it is sigma_v^2 [[dt^3/3, dt^2/2], [dt^2/2, dt]], and two steps have the same noise as one
    step of their total length.

    Args:
        sigma_v: standard deviation of the acceleration (paper: 5), or under continuous_white the root of its spectral
            density, in m/s^1.5 [m/s^2].
        noise_model: discrete_white: the acceleration is constant within a step, as in the paper, and independent
            between steps. continuous_white: it is white in continuous time.
        method: Gaussian method, see `MotionModel`.
    """
    one_of("noise_model", noise_model, _CV_NOISE)
    params = np.array([non_negative("sigma_v", sigma_v)])
    return MotionModel(4, _cv_transition, _CV_NOISE[noise_model], np.empty(0), params, _cv_jacobian, method)


_CV_NOISE = {"discrete_white": _cv_noise, "continuous_white": _cv_continuous_noise}


@model_function("transition")
def _cv_height_transition(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    for j in range(6):
        out[j] = state[j]
    out[0] += dt * state[2]
    out[1] += dt * state[3]
    out[4] += dt * state[5]


@model_function("transition_jacobian")
def _cv_height_jacobian(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    identity(out)
    out[0, 2] = dt
    out[1, 3] = dt
    out[4, 5] = dt


@model_function("process_noise_cov")
def _cv_height_noise(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    for i in range(6):
        for j in range(6):
            out[i, j] = 0.0
    for axis in range(3):
        p, v, sigma = (4, 5, params[1]) if axis == 2 else (axis, axis + 2, params[0])
        out[p, p] = dt**3 / 3.0 * sigma * sigma
        out[p, v] = 0.5 * dt**2 * sigma * sigma
        out[v, p] = out[p, v]
        out[v, v] = dt * sigma * sigma


@part("constant_velocity_height", "motion")
def constant_velocity_height(
    sigma_v: NonNegative = 5.0, sigma_climb: NonNegative = 1.0, *, method: str = "auto"
) -> MotionModel:
    """Constant velocity in space with white acceleration noise in continuous time. State [px, py, vx, vy, pz, vz].

    For measurements that depend on a height (`vedette.models.heights`). The noise of an axis is sigma^2 [[dt^3/3,
    dt^2/2], [dt^2/2, dt]] (Bar-Shalom, Li and Kirubarajan 2001, section 6.2.2).

    Args:
        sigma_v: root of the spectral density of the horizontal acceleration, in m/s^1.5 [m/s^2].
        sigma_climb: the same of the vertical acceleration [m/s^2].
        method: Gaussian method, see `MotionModel`.
    """
    params = np.array([non_negative("sigma_v", sigma_v), non_negative("sigma_climb", sigma_climb)])
    functions = _cv_height_transition, _cv_height_noise, np.empty(0), params, _cv_height_jacobian
    return MotionModel(6, *functions, method, STATE_COMPONENTS["constant_velocity_height"])


@kernel
def _along(angle: float) -> float:
    """Return sin(a) / a."""
    return math.sin(angle) / angle if angle != 0.0 else 1.0


@kernel
def _across(angle: float) -> float:
    """Return (1 - cos(a)) / a, without cancellation."""
    half = _along(0.5 * angle)
    return 0.5 * angle * half * half


@kernel
def _along_slope(angle: float) -> float:
    """Derivative of sin(a) / a."""
    if abs(angle) > _SERIES_ANGLE:
        return (math.cos(angle) - math.sin(angle) / angle) / angle
    square = angle * angle
    return angle * (-1.0 / 3.0 + square * (1.0 / 30.0 + square * (-1.0 / 840.0 + square / 45360.0)))


@kernel
def _across_slope(angle: float) -> float:
    """Derivative of (1 - cos(a)) / a."""
    if abs(angle) > _SERIES_ANGLE:
        return (angle * math.sin(angle) - 1.0 + math.cos(angle)) / (angle * angle)
    square = angle * angle
    return 0.5 + square * (-1.0 / 8.0 + square * (1.0 / 144.0 - square / 5760.0))


@model_function("transition")
def _ct_transition(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    angle = state[4] * dt
    sine, cosine = math.sin(angle), math.cos(angle)
    along, across = dt * _along(angle), dt * _across(angle)
    out[0] = state[0] + along * state[2] - across * state[3]
    out[1] = state[1] + across * state[2] + along * state[3]
    out[2] = cosine * state[2] - sine * state[3]
    out[3] = sine * state[2] + cosine * state[3]
    out[4] = state[4]


@model_function("transition_jacobian")
def _ct_jacobian(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    angle = state[4] * dt
    sine, cosine = math.sin(angle), math.cos(angle)
    along, across = dt * _along(angle), dt * _across(angle)
    along_rate, across_rate = dt * dt * _along_slope(angle), dt * dt * _across_slope(angle)
    identity(out)
    out[0, 2] = along
    out[0, 3] = -across
    out[0, 4] = along_rate * state[2] - across_rate * state[3]
    out[1, 2] = across
    out[1, 3] = along
    out[1, 4] = across_rate * state[2] + along_rate * state[3]
    out[2, 2] = cosine
    out[2, 3] = -sine
    out[2, 4] = -dt * (sine * state[2] + cosine * state[3])
    out[3, 2] = sine
    out[3, 3] = cosine
    out[3, 4] = dt * (cosine * state[2] - sine * state[3])


@model_function("process_noise_cov")
def _ct_noise(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    acceleration_cov(dt, params[0], out)
    out[4, 4] = (dt * params[1]) ** 2


@part("coordinated_turn", "motion", sigma_turn_rate_deg="sigma_turn_rate")
def coordinated_turn(
    sigma_v: NonNegative = 5.0,
    sigma_turn_rate: NonNegative = math.radians(1.0),  # noqa: B008 # a number
    *,
    method: str = "auto",
) -> MotionModel:
    """Turn at an unknown rate, exact if it is constant within a step. State [px, py, vx, vy, turn rate in rad/s].

    Noise B B' with B = blkdiag([dt^2/2; dt] sigma_v, the same for the other axis, dt sigma_turn_rate).

    Args:
        sigma_v: standard deviation of the acceleration on each axis [m/s^2].
        sigma_turn_rate: standard deviation of the turn acceleration [rad/s^2].
        method: Gaussian method, see `MotionModel`.
    """
    params = np.array([non_negative("sigma_v", sigma_v), non_negative("sigma_turn_rate", sigma_turn_rate)])
    functions = _ct_transition, _ct_noise, np.empty(0), params, _ct_jacobian
    return MotionModel(5, *functions, method, STATE_COMPONENTS["coordinated_turn"])
