"""Detection models: with what probability a sensor at a pose detects a target."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from vedette.kernels.base.types import Floats
from vedette.kernels.gaussian.scratch import wrap_angle
from vedette.models.arguments import params_vector, pose_vector, positive, probability, reject, state_table
from vedette.models.functions import ModelFunction, call, model_function, require_kind
from vedette.models.probe import probe_probability

# The built-in models stay at or below this: certain detection would make a single missed detection impossible, and with
# it every hypothesis that holds the target (paper-notes 4).
MAX_PROB_DETECTION = 1.0 - 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class DetectionModel:
    """Probability of detection as a function of state and pose (paper: P_D(x_k, u_k)).

    Attributes:
        function: model function of kind `prob_detection`.
        params: its parameter vector.
    """

    function: ModelFunction
    params: Floats = field(default_factory=lambda: np.empty(0))

    def __post_init__(self) -> None:
        require_kind("DetectionModel.function", self.function, "prob_detection")
        object.__setattr__(self, "params", params_vector("DetectionModel.params", self.params))

    def prob(self, states: ArrayLike, pose: ArrayLike) -> Floats:
        """(n,) detection probabilities of (n, state_dim) states."""
        table, at = state_table("states", states), pose_vector("pose", pose)
        return np.array([call(self.function, state, at, self.params) for state in table], dtype=np.float64)

    def check(self, states: ArrayLike, pose: ArrayLike) -> None:
        """Try the function at each state; `ModelError` unless it gives a probability."""
        at = pose_vector("pose", pose)
        for state in state_table("states", states):
            probe_probability(self.function, (state, at, self.params))


@model_function("prob_detection")
def _constant(state: Floats, pose: Floats, params: Floats) -> float:
    return params[0]  # type: ignore[no-any-return]


@model_function("prob_detection")
def _gaussian(state: Floats, pose: Floats, params: Floats) -> float:
    dx, dy = state[0] - pose[0], state[1] - pose[1]
    return min(math.exp(-0.5 * (dx * dx + dy * dy) / (params[0] * params[0])), MAX_PROB_DETECTION)


@model_function("prob_detection")
def _limited_range(state: Floats, pose: Floats, params: Floats) -> float:
    dx, dy = state[0] - pose[0], state[1] - pose[1]
    return params[0] if dx * dx + dy * dy <= params[1] * params[1] else 0.0


@model_function("prob_detection")
def _limited_sector(state: Floats, pose: Floats, params: Floats) -> float:
    dx, dy = state[0] - pose[0], state[1] - pose[1]
    square = dx * dx + dy * dy
    if square > params[1] * params[1]:
        return 0.0
    if square > 0.0 and abs(wrap_angle(math.atan2(dy, dx) - pose[2])) > params[2]:
        return 0.0
    return params[0]  # type: ignore[no-any-return]


@model_function("prob_detection")
def _camera(state: Floats, pose: Floats, params: Floats) -> float:
    if len(pose) < 5:
        raise ValueError("camera: expected a pose with pointing_rad and half_width_rad")
    dx, dy = state[0] - pose[0], state[1] - pose[1]
    # The same pixels over a narrower field see farther.
    reach = params[1] * params[2] / pose[4] if params[2] > 0.0 and pose[4] > 0.0 else params[1]
    square = dx * dx + dy * dy
    if square > reach * reach:
        return 0.0
    if square > 0.0 and abs(wrap_angle(math.atan2(dy, dx) - pose[3])) > pose[4]:
        return 0.0
    return params[0]  # type: ignore[no-any-return]


def _guarded(prob_detection: float) -> float:
    return min(probability("prob_detection", prob_detection), MAX_PROB_DETECTION)


def constant_detection(prob_detection: float) -> DetectionModel:
    """The same detection probability everywhere; 1 is taken as `MAX_PROB_DETECTION`."""
    return DetectionModel(_constant, np.array([_guarded(prob_detection)]))


def gaussian_detection(sigma: float) -> DetectionModel:
    """exp(-d^2 / (2 sigma^2)) at distance d (paper section IV, sigma_D = 10000 m; paper-notes 4), capped alike."""
    return DetectionModel(_gaussian, np.array([positive("sigma", sigma)]))


def limited_range(prob_detection: float, max_range: float) -> DetectionModel:
    """Constant up to `max_range` metres, 0 beyond."""
    return DetectionModel(_limited_range, np.array([_guarded(prob_detection), positive("max_range", max_range)]))


def limited_sector(prob_detection: float, max_range: float, half_width_rad: float) -> DetectionModel:
    """Constant up to `max_range` metres and within `half_width_rad`, in (0, pi], of the heading; 0 elsewhere."""
    if positive("half_width_rad", half_width_rad) > math.pi:
        raise reject("half_width_rad", "an angle in (0, pi]", half_width_rad)
    params = np.array([_guarded(prob_detection), positive("max_range", max_range), half_width_rad])
    return DetectionModel(_limited_sector, params)


def camera(prob_detection: float, max_range: float, reference_half_width_rad: float | None = None) -> DetectionModel:
    """Constant up to a range and within the pose's half width of its pointing; 0 elsewhere.

    The pose is [px, py, heading_rad, pointing_rad, half_width_rad], see `vedette.platforms.Pointing`.

    Args:
        prob_detection: within the field of view; 1 is taken as `MAX_PROB_DETECTION`.
        max_range: m.
        reference_half_width_rad: where the camera zooms, the half width at which it sees as far as `max_range`; it sees
            as many times farther as its field is narrower. None: as far at every width.
    """
    reference = (
        0.0 if reference_half_width_rad is None else positive("reference_half_width_rad", reference_half_width_rad)
    )
    params = np.array([_guarded(prob_detection), positive("max_range", max_range), reference])
    return DetectionModel(_camera, params)
