"""Built-in motion models of targets that turn, accelerate, stop or diffuse, for any time step.

They are the usual modes of targets that change their motion (`vedette.models.modes`).
"""

import math

import numpy as np

from vedette.kernels.base.compile import inlined
from vedette.kernels.base.types import STATE_COMPONENTS, Floats
from vedette.models.arguments import non_negative, positive, real
from vedette.models.fields import NonNegative, Positive, Real, part
from vedette.models.functions import model_function
from vedette.models.kinematics import acceleration_cov, identity
from vedette.models.motion import MotionModel

# Below this number of time constants the variance of a position uses its series: the closed form cancels.
_SHORT = 0.1


@model_function("transition")
def _walk_transition(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    out[0] = state[0]
    out[1] = state[1]


@model_function("transition_jacobian")
def _walk_jacobian(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    identity(out)


@model_function("process_noise_cov")
def _walk_noise(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    identity(out)
    out[0, 0] = out[1, 1] = dt * params[0] * params[0]


@part("random_walk", "motion")
def random_walk(sigma: Positive = 1.0, *, method: str = "auto") -> MotionModel:
    """Brownian motion, without a velocity. State [px, py].

    The noise of an axis is sigma^2 dt.

    Args:
        sigma: standard deviation of the way along each axis in 1 s. It grows with the root of the time [m].
        method: Gaussian method, see `MotionModel`.
    """
    functions = _walk_transition, _walk_noise, np.empty(0), np.array([positive("sigma", sigma)]), _walk_jacobian
    return MotionModel(2, *functions, method, STATE_COMPONENTS["random_walk"])


@inlined
def _long_way_variance(a: float) -> float:
    """2 a - 3 + 4 exp(-a) - exp(-2 a)."""
    if a > _SHORT:
        return 2.0 * a - 3.0 + 4.0 * math.exp(-a) - math.exp(-2.0 * a)
    total, power = 0.0, 0.5 * a * a
    for n in range(3, 12):
        power *= -a / n
        total += (4.0 - 2.0**n) * power
    return total


@model_function("transition")
def _wander_transition(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    decay, way = math.exp(-dt / params[0]), -params[0] * math.expm1(-dt / params[0])
    out[0], out[1] = state[0] + way * state[2], state[1] + way * state[3]
    out[2], out[3] = decay * state[2], decay * state[3]


@model_function("transition_jacobian")
def _wander_jacobian(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    identity(out)
    out[0, 2] = out[1, 3] = -params[0] * math.expm1(-dt / params[0])
    out[2, 2] = out[3, 3] = math.exp(-dt / params[0])


@model_function("process_noise_cov")
def _wander_noise(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    tau, variance, gone = params[1], params[0] * params[0], -math.expm1(-dt / params[1])
    out[:, :] = 0.0
    for axis in range(2):
        out[axis, axis] = variance * tau * tau * _long_way_variance(dt / tau)
        out[axis, axis + 2] = out[axis + 2, axis] = variance * tau * gone * gone
        out[axis + 2, axis + 2] = variance * gone * (2.0 - gone)


@part("ornstein_uhlenbeck", "motion")
def ornstein_uhlenbeck(
    speed: NonNegative = 5.0, time_constant: Positive = 10.0, *, method: str = "auto"
) -> MotionModel:
    """A velocity that is forgotten: an Ornstein-Uhlenbeck process of mean 0. State [px, py, vx, vy].

    With a small speed and a short time constant the target stands still. With a = dt / time_constant and e = exp(-a),
    the noise of an axis is speed^2 [[tau^2 (2 a - 3 + 4 e - e^2), tau (1 - e)^2], [tau (1 - e)^2, 1 - e^2]].

    Args:
        speed: standard deviation of the velocity along each axis, once the first velocity is forgotten [m/s].
        time_constant: time after which 37 % of a velocity is left (tau) [s].
        method: Gaussian method, see `MotionModel`.
    """
    tau = positive("time_constant", time_constant)
    noise = np.array([non_negative("speed", speed), tau])
    return MotionModel(4, _wander_transition, _wander_noise, np.array([tau]), noise, _wander_jacobian, method)


@inlined
def _turned(dt: float, rate: float) -> tuple[float, float, float, float]:
    """Return cosine and sine of the turn, and the ways along and across a velocity of 1."""
    angle = rate * dt
    half = 0.5 * angle
    chord = dt * math.sin(half) / half if half != 0.0 else dt
    return math.cos(angle), math.sin(angle), chord * math.cos(half), chord * math.sin(half)


@model_function("transition")
def _turn_transition(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    cosine, sine, along, across = _turned(dt, params[0])
    out[0] = state[0] + along * state[2] - across * state[3]
    out[1] = state[1] + across * state[2] + along * state[3]
    out[2] = cosine * state[2] - sine * state[3]
    out[3] = sine * state[2] + cosine * state[3]


@model_function("transition_jacobian")
def _turn_jacobian(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    cosine, sine, along, across = _turned(dt, params[0])
    identity(out)
    out[0, 2], out[0, 3], out[1, 2], out[1, 3] = along, -across, across, along
    out[2, 2], out[2, 3], out[3, 2], out[3, 3] = cosine, -sine, sine, cosine


@model_function("process_noise_cov")
def _turn_noise(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    acceleration_cov(dt, params[0], out)


@part("constant_turn", "motion", turn_rate_deg="turn_rate")
def constant_turn(
    turn_rate: Real = math.radians(3.0),  # noqa: B008 # a number
    sigma_v: NonNegative = 5.0,
    *,
    method: str = "auto",
) -> MotionModel:
    """Turn at a known rate, with an acceleration that is constant within a step. State [px, py, vx, vy].

    The noise is that of `constant_velocity`.

    Args:
        turn_rate: rate of the turn, positive to the left [rad/s].
        sigma_v: standard deviation of the acceleration on each axis [m/s^2].
        method: Gaussian method, see `MotionModel`.
    """
    noise = np.array([non_negative("sigma_v", sigma_v)])
    rate = np.array([real("turn_rate", turn_rate)])
    return MotionModel(4, _turn_transition, _turn_noise, rate, noise, _turn_jacobian, method)


@model_function("transition")
def _acceleration_transition(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    for axis in range(2):
        out[axis] = state[axis] + dt * state[axis + 2] + 0.5 * dt * dt * state[axis + 4]
        out[axis + 2] = state[axis + 2] + dt * state[axis + 4]
        out[axis + 4] = state[axis + 4]


@model_function("transition_jacobian")
def _acceleration_jacobian(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    identity(out)
    for axis in range(2):
        out[axis, axis + 2] = out[axis + 2, axis + 4] = dt
        out[axis, axis + 4] = 0.5 * dt * dt


@model_function("process_noise_cov")
def _acceleration_noise(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    density = params[0] * params[0]
    out[:, :] = 0.0
    for axis in range(2):
        p, v, a = axis, axis + 2, axis + 4
        out[p, p], out[v, v], out[a, a] = density * dt**5 / 20.0, density * dt**3 / 3.0, density * dt
        out[p, v] = out[v, p] = density * dt**4 / 8.0
        out[p, a] = out[a, p] = density * dt**3 / 6.0
        out[v, a] = out[a, v] = density * dt**2 / 2.0


@part("constant_acceleration", "motion")
def constant_acceleration(sigma_a: NonNegative = 1.0, *, method: str = "auto") -> MotionModel:
    """Constant acceleration with white jerk in continuous time. State [px, py, vx, vy, ax, ay].

    The noise of an axis is sigma_a^2 [[dt^5/20, dt^4/8, dt^3/6], [dt^4/8, dt^3/3, dt^2/2], [dt^3/6, dt^2/2, dt]]
    (Bar-Shalom, Li and Kirubarajan 2001, section 6.2.3).

    Args:
        sigma_a: standard deviation of the change of the acceleration along each axis in 1 s. It grows with the root of
            the time [m/s^2].
        method: Gaussian method, see `MotionModel`.
    """
    noise = np.array([non_negative("sigma_a", sigma_a)])
    functions = _acceleration_transition, _acceleration_noise, np.empty(0), noise, _acceleration_jacobian
    return MotionModel(6, *functions, method, STATE_COMPONENTS["constant_acceleration"])
