"""Conversion of Stone Soup's transition models into motion models, and the layout of its states.

Its noise is that of an acceleration that is white in continuous time. Its coefficients are spectral densities.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from stonesoup.models.transition.linear import (
    CombinedLinearGaussianTransitionModel,
    ConstantAcceleration,
    ConstantNthDerivative,
    ConstantVelocity,
    KnownTurnRate,
    RandomWalk,
)
from stonesoup.models.transition.nonlinear import ConstantTurn

from vedette.kernels.base.types import PLANE, Floats
from vedette.models import MotionModel, constant_velocity, coordinated_turn, model_function
from vedette.models.arguments import float_array, non_negative, reject


@dataclass(frozen=True, slots=True)
class StateLayout:
    """Positions of the components of a Vedette state [px, py, vx, vy, ...] in a Stone Soup state.

    Attributes:
        order: for each component, its index in Stone Soup's state: (0, 2, 1, 3) for [x, vx, y, vy].
    """

    order: tuple[int, ...]

    @property
    def position(self) -> tuple[int, int]:
        """Indices of the position in Stone Soup's state: the `mapping` of its measurement models."""
        return self.order[0], self.order[1]

    def states(self, vectors: ArrayLike) -> Floats:
        """Return Stone Soup states, one per row, in Vedette's order, shape (n, state_dim)."""
        return np.ascontiguousarray(np.asarray(vectors, np.float64)[:, self.order])

    def covs(self, covs: ArrayLike) -> Floats:
        """Return covariances in Vedette's order, shape (n, state_dim, state_dim)."""
        return np.ascontiguousarray(np.asarray(covs, np.float64)[:, self.order][:, :, self.order])

    def inverse(self) -> "StateLayout":
        """Return the inverse layout."""
        return StateLayout(tuple(int(place) for place in np.argsort(self.order)))


@model_function("transition")
def _taylor(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    num = state.shape[0] // 2
    for i in range(num):
        for axis in range(2):
            term, total = 1.0, state[2 * i + axis]
            for j in range(i + 1, num):
                term *= dt / (j - i)
                total += term * state[2 * j + axis]
            out[2 * i + axis] = total


@model_function("transition_jacobian")
def _taylor_jacobian(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    out[:, :] = 0.0
    num = state.shape[0] // 2
    for i in range(num):
        term = 1.0
        for j in range(i, num):
            if j > i:
                term *= dt / (j - i)
            for axis in range(2):
                out[2 * i + axis, 2 * j + axis] = term


@model_function("process_noise_cov")
def _integrated_noise(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    """Process noise.

    params: spectral density of the last derivative along x and y, and of the turn rate if there is one.
    """
    out[:, :] = 0.0
    num = state.shape[0] // 2
    for i in range(num):
        for j in range(num):
            a, b = num - 1 - i, num - 1 - j
            value = dt ** (a + b + 1) / (a + b + 1)
            for k in range(2, a + 1):
                value /= k
            for k in range(2, b + 1):
                value /= k
            for axis in range(2):
                out[2 * i + axis, 2 * j + axis] = value * params[axis]
    if state.shape[0] % 2:
        out[2 * num, 2 * num] = params[2] * dt


@model_function("transition")
def _known_turn(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    rate, angle = params[0], params[0] * dt
    along, across = math.sin(angle) / rate, (1.0 - math.cos(angle)) / rate
    out[0] = state[0] + along * state[2] - across * state[3]
    out[1] = state[1] + across * state[2] + along * state[3]
    out[2] = math.cos(angle) * state[2] - math.sin(angle) * state[3]
    out[3] = math.sin(angle) * state[2] + math.cos(angle) * state[3]


@model_function("transition_jacobian")
def _known_turn_jacobian(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    rate, angle = params[0], params[0] * dt
    along, across = math.sin(angle) / rate, (1.0 - math.cos(angle)) / rate
    out[:, :] = 0.0
    out[0, 0], out[0, 2], out[0, 3] = 1.0, along, -across
    out[1, 1], out[1, 2], out[1, 3] = 1.0, across, along
    out[2, 2], out[2, 3] = math.cos(angle), -math.sin(angle)
    out[3, 2], out[3, 3] = math.sin(angle), math.cos(angle)


def _of_axes(model: Any) -> tuple[MotionModel, StateLayout]:
    """Convert two axes with the same number of derivatives."""
    axes = list(model.model_list)
    kinds = (RandomWalk, ConstantVelocity, ConstantAcceleration, ConstantNthDerivative)
    if len(axes) != 2 or any(type(axis) not in kinds for axis in axes):
        wanted = f"two of {', '.join(kind.__name__ for kind in kinds)}, for x and y"
        raise reject("transition_model.model_list", wanted, ", ".join(type(axis).__name__ for axis in axes) or "none")
    orders = [int(axis.constant_derivative) for axis in axes]
    if orders[0] != orders[1]:
        raise reject("transition_model.model_list", "two models of one constant_derivative", str(orders))
    num = orders[0] + 1
    noise = _densities([axis.noise_diff_coeff for axis in axes], "model_list: noise_diff_coeff")
    layout = StateLayout(tuple(axis * num + i for i in range(num) for axis in range(2)))
    if num == 2 and noise[0] == noise[1]:
        return constant_velocity(math.sqrt(noise[0]), noise_model="continuous_white"), layout
    functions = _taylor, _integrated_noise, np.empty(0), noise, _taylor_jacobian
    return MotionModel(2 * num, *functions, components=(*PLANE, "ax", "ay") if num == 3 else ()), layout


def _of_turn(model: Any) -> tuple[MotionModel, StateLayout]:
    noise = _densities([*np.ravel(model.linear_noise_coeffs), model.turn_noise_coeff], "linear_noise_coeffs")
    turn = replace(coordinated_turn(), process_noise_cov=_integrated_noise, noise_params=noise)
    return turn, StateLayout((0, 2, 1, 3, 4))


def _of_known_turn(model: Any) -> tuple[MotionModel, StateLayout]:
    noise = _densities(np.ravel(model.turn_noise_diff_coeffs), "turn_noise_diff_coeffs")
    rate = float(model.turn_rate)
    if rate == 0.0:
        raise reject("transition_model.turn_rate", "a rate other than 0, by which it divides", 0.0)
    turn = MotionModel(4, _known_turn, _integrated_noise, np.array([rate]), noise, _known_turn_jacobian)
    return turn, StateLayout((0, 2, 1, 3))


def _densities(given: Any, field: str) -> Floats:
    values = float_array(f"transition_model.{field}", [float(value) for value in given], (None,))
    for value in values:
        non_negative(f"transition_model.{field}", float(value))
    return values


_MOTIONS: dict[type, Callable[[Any], tuple[MotionModel, StateLayout]]] = {
    CombinedLinearGaussianTransitionModel: _of_axes,
    ConstantTurn: _of_turn,
    KnownTurnRate: _of_known_turn,
}


def convert_motion(transition_model: Any) -> tuple[MotionModel, StateLayout]:
    """Convert a transition model of Stone Soup into a motion model, and return the layout of its states.

    `CombinedLinearGaussianTransitionModel` of two `RandomWalk`, `ConstantVelocity`, `ConstantAcceleration` or
    `ConstantNthDerivative`, whose densities may differ; `ConstantTurn`; `KnownTurnRate`.

    Raises:
        InputError: another model. The message names the model, the field and the value.
    """
    if type(transition_model) not in _MOTIONS:
        wanted = f"one of {', '.join(kind.__name__ for kind in _MOTIONS)}"
        raise reject("transition_model", wanted, type(transition_model).__name__)
    return _MOTIONS[type(transition_model)](transition_model)
