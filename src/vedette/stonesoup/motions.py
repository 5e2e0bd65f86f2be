"""Conversion of Stone Soup's transition models into motion models, and the layout of its states.

Its noise is that of an acceleration that is white in continuous time. Its coefficients are spectral densities.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
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
from vedette.models import (
    Modes,
    MotionModel,
    constant_acceleration,
    constant_turn,
    constant_velocity,
    coordinated_turn,
    model_function,
    random_walk,
)
from vedette.models.arguments import float_array, non_negative, positive, reject


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
    if num in _BUILT_IN and noise[0] == noise[1] > 0.0:
        return _BUILT_IN[num](math.sqrt(noise[0])), layout
    functions = _taylor, _integrated_noise, np.empty(0), noise, _taylor_jacobian
    return MotionModel(2 * num, *functions, components=(*PLANE, "ax", "ay") if num == 3 else ()), layout


# Motion of both axes with one spectral density, by the number of derivatives.
_BUILT_IN: dict[int, Callable[[float], MotionModel]] = {
    1: random_walk,
    2: partial(constant_velocity, noise_model="continuous_white"),
    3: constant_acceleration,
}


def _of_turn(model: Any) -> tuple[MotionModel, StateLayout]:
    noise = _densities([*np.ravel(model.linear_noise_coeffs), model.turn_noise_coeff], "linear_noise_coeffs")
    turn = replace(coordinated_turn(), process_noise_cov=_integrated_noise, noise_params=noise)
    return turn, StateLayout((0, 2, 1, 3, 4))


def _of_known_turn(model: Any) -> tuple[MotionModel, StateLayout]:
    noise = _densities(np.ravel(model.turn_noise_diff_coeffs), "turn_noise_diff_coeffs")
    rate = float(model.turn_rate)
    if rate == 0.0:
        raise reject("transition_model.turn_rate", "a rate other than 0, by which it divides", 0.0)
    turn = replace(constant_turn(rate), process_noise_cov=_integrated_noise, noise_params=noise)
    if noise[0] == noise[1]:
        alike = constant_velocity(math.sqrt(noise[0]), noise_model="continuous_white")
        turn = replace(turn, process_noise_cov=alike.process_noise_cov, noise_params=alike.noise_params)
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
    `ConstantNthDerivative`, whose densities may differ; `ConstantTurn`; `KnownTurnRate`. A motion of Vedette with the
    layout of its states, such as the result of `convert_modes`, is returned as it is.

    Raises:
        InputError: another model. The message names the model, the field and the value.
    """
    match transition_model:
        case (MotionModel() as motion, StateLayout() as layout) if len(layout.order) == motion.state_dim:
            return motion, layout
    if type(transition_model) not in _MOTIONS:
        wanted = f"one of {', '.join(kind.__name__ for kind in _MOTIONS)}, or a motion of Vedette with its StateLayout"
        raise reject("transition_model", wanted, type(transition_model).__name__)
    return _MOTIONS[type(transition_model)](transition_model)


def convert_modes(
    transition_models: Sequence[Any],
    *,
    stay_s: ArrayLike | None = None,
    transition_matrix: ArrayLike | None = None,
    interval_s: float = 1.0,
    **more: Any,
) -> tuple[Modes, StateLayout]:
    """Convert transition models of Stone Soup into the modes of one motion, for `convert` in place of a model.

    Args:
        transition_models: of each mode, see `convert_motion`. The two axes of a mode have one spectral density.
        stay_s: (num_modes,) mean time in each mode, s.
        transition_matrix: instead, (num_modes, num_modes) probability of each mode (column) after each (row).
        interval_s: time between the two modes of `transition_matrix`, s.
        more: other arguments of `vedette.models.Modes`, such as `names` and `detection_factors`.

    Raises:
        InputError: models whose states differ or that cannot be mixed, or a matrix that is not that of a chain in
            continuous time.
    """
    given = [convert_motion(model) for model in transition_models]
    layout = max((layout for _, layout in given), key=lambda own: len(own.order), default=StateLayout(()))
    for i, (_, own) in enumerate(given):
        if own.order != layout.order[: len(own.order)]:
            raise reject(f"transition_models[{i}]", f"states with the components {layout.order}", own.order)
    if (stay_s is None) == (transition_matrix is None):
        raise reject("stay_s, transition_matrix", "one of the two", "neither" if stay_s is None else "both")
    stays: Any = stay_s
    if transition_matrix is not None:
        matrix = float_array("transition_matrix", transition_matrix, (len(given), len(given)))
        stays, more["to"] = _chain_of(matrix, positive("interval_s", interval_s))
    return Modes([motion for motion, _ in given], stays, **more), layout


def _chain_of(matrix: Floats, interval_s: float) -> tuple[Floats, Floats]:
    """Return the mean times in modes and the probabilities of the next ones, from those after an interval."""
    from scipy.linalg import expm, logm  # imported here, as it takes a third of a second

    num, wanted = len(matrix), "rows of probabilities that sum to 1, with the largest ones on the diagonal"
    if (matrix < 0.0).any() or np.abs(matrix.sum(axis=1) - 1.0).max() > 1e-6 or (np.diag(matrix) <= 0.5).any():
        raise reject("transition_matrix", f"{wanted}, above 0.5", matrix.tolist())
    logarithm = np.real(logm(matrix))
    changes = np.maximum(logarithm, 0.0) * (1.0 - np.eye(num))
    if np.abs(expm(changes - np.diag(changes.sum(axis=1))) - matrix).max() > 1e-6:
        wanted = "probabilities of a chain in continuous time, or stay_s and to instead"
        raise reject("transition_matrix", wanted, matrix.tolist())
    leaving, others = changes.sum(axis=1), (1.0 - np.eye(num)) / max(num - 1, 1)
    stays = np.divide(interval_s, leaving, out=np.full(num, np.inf), where=leaving > 0.0)
    shares = np.divide(changes, leaving[:, np.newaxis], out=others, where=leaving[:, np.newaxis] > 0.0)
    return stays, shares
