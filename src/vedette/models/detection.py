"""Detection models: with what probability a sensor at a pose detects a target."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from vedette.errors import ModelError
from vedette.kernels.base.types import Floats
from vedette.models import detection_functions as functions
from vedette.models.arguments import params_vector, pose_vector, positive, probability, reject, state_table
from vedette.models.detection_functions import MAX_PROB_DETECTION
from vedette.models.functions import ModelFunction, describe, numbers_at, require_kind
from vedette.models.probe import probe_probability


@dataclass(frozen=True, slots=True, eq=False)
class DetectionModel:
    """Probability of detection as a function of state and pose (paper: P_D(x_k, u_k)).

    Attributes:
        function: model function of kind `prob_detection`.
        params: its parameter vector.
        mean_function: model function of kind `mean_prob_detection` (same parameters): the mean over a Gaussian, where
            it is known; None: it is taken by nodes, see `SensorModel.detection_at`.
        reach: m; farther than this from the sensor the probability is known to be 0, so that who asks of many places
            need not ask there; inf: nothing is known.
    """

    function: ModelFunction
    params: Floats = field(default_factory=lambda: np.empty(0))
    mean_function: ModelFunction | None = None
    reach: float = math.inf

    def __post_init__(self) -> None:
        require_kind("DetectionModel.function", self.function, "prob_detection")
        if self.mean_function is not None:
            require_kind("DetectionModel.mean_function", self.mean_function, "mean_prob_detection")
        if self.reach != math.inf:
            positive("DetectionModel.reach", self.reach)
        object.__setattr__(self, "params", params_vector("DetectionModel.params", self.params))

    def prob(self, states: ArrayLike, pose: ArrayLike) -> Floats:
        """(n,) detection probabilities of (n, state_dim) states."""
        table, at = state_table("states", states), pose_vector("pose", pose)
        return numbers_at(self.function, table, at, self.params)

    def check(self, states: ArrayLike, pose: ArrayLike) -> None:
        """Try the functions at each state (the mean: variances of 1).

        Raises:
            ModelError: they do not give probabilities, or one above 0 beyond `reach`.
        """
        at = pose_vector("pose", pose)
        for state in state_table("states", states):
            chance, offset = probe_probability(self.function, (state, at, self.params)), state[:2] - at[:2]
            if chance > 0.0 and offset @ offset > self.reach**2:
                told = f"0, as its reach is {self.reach:g} m; got {chance:g}"
                raise ModelError(f"{describe(self.function, state, at, self.params)}: expected {told}")
            if self.mean_function is not None:
                probe_probability(self.mean_function, (state, np.eye(len(state)), at, self.params))


def _guarded(prob_detection: float, field: str = "prob_detection") -> float:
    return min(probability(field, prob_detection), MAX_PROB_DETECTION)


def _half_width(half_width_rad: float, name: str = "half_width_rad") -> float:
    if positive(name, half_width_rad) > math.pi:
        raise reject(name, "an angle in radians, in (0, pi] (is it in degrees?)", half_width_rad)
    return float(half_width_rad)


def _edge(max_range: float, outside: float) -> float:
    """How far there is anything to detect."""
    return float(max_range) if outside == 0.0 else math.inf


def constant_detection(prob_detection: float) -> DetectionModel:
    """The same detection probability everywhere; 1 is taken as `MAX_PROB_DETECTION`."""
    return DetectionModel(functions.constant, np.array([_guarded(prob_detection)]), functions.mean_constant)


def gaussian_detection(sigma: float) -> DetectionModel:
    """exp(-d^2 / (2 sigma^2)) at distance d (paper section IV, sigma_D = 10000 m; paper-notes 4), capped alike."""
    return DetectionModel(functions.gaussian, np.array([positive("sigma", sigma)]), functions.mean_gaussian)


def limited_range(prob_detection: float, max_range: float, outside: float = 0.0) -> DetectionModel:
    """Constant up to `max_range` metres, `outside` beyond."""
    params = np.array([_guarded(prob_detection), positive("max_range", max_range), _guarded(outside, "outside")])
    return DetectionModel(functions.limited_range, params, functions.mean_limited_range, _edge(max_range, outside))


def limited_sector(
    prob_detection: float, max_range: float, half_width_rad: float, outside: float = 0.0
) -> DetectionModel:
    """Constant up to `max_range` metres, within `half_width_rad`, in (0, pi], of the heading; else `outside`."""
    params = [_guarded(prob_detection), positive("max_range", max_range), _half_width(half_width_rad)]
    return DetectionModel(
        functions.limited_sector,
        np.array([*params, _guarded(outside, "outside")]),
        functions.mean_limited_sector,
        _edge(max_range, outside),
    )


def soft_sector(
    prob_detection: float,
    max_range: float,
    half_width_rad: float = math.pi,
    *,
    range_slope: float,
    angle_slope: float | None = None,
    cut: bool = False,
) -> DetectionModel:
    """Detection that falls off gradually at the edges of a sector, as logistic functions of distance and angle.

    p / (1 + exp(range_slope (rho - max_range))) / (1 + exp(angle_slope (|dtheta| - half_width_rad))) at the distance
    rho and the angle dtheta from the heading. A target at the sensor itself is straight ahead.

    Args:
        prob_detection: p, deep within the sector; 1 is taken as `MAX_PROB_DETECTION`.
        max_range: m; p / 2 there, straight ahead.
        half_width_rad: in (0, pi]. With pi and no `angle_slope` detection does not depend on the angle.
        range_slope: 1/m, above 0.
        angle_slope: 1/rad, above 0; None: the edges at `half_width_rad` are sharp.
        cut: whether nothing at all is detected beyond `max_range` and `half_width_rad`.
    """
    slope = 0.0 if angle_slope is None else positive("angle_slope", angle_slope)
    if not isinstance(cut, bool):
        raise reject("cut", "true or false", cut)
    params = [_guarded(prob_detection), positive("max_range", max_range), _half_width(half_width_rad)]
    params += [positive("range_slope", range_slope), slope, float(cut)]
    return DetectionModel(functions.soft_sector, np.array(params), reach=float(max_range) if cut else math.inf)


def camera(prob_detection: float, max_range: float, reference_half_width_rad: float | None = None) -> DetectionModel:
    """Constant up to a range and within the pose's half width of its pointing; 0 elsewhere.

    The pose is [px, py, heading_rad, pointing_rad, half_width_rad], see `vedette.platforms.Pointing`.

    Args:
        prob_detection: within the field of view; 1 is taken as `MAX_PROB_DETECTION`.
        max_range: m.
        reference_half_width_rad: where the camera zooms, the half width at which it sees as far as `max_range`; it sees
            as many times farther as its field is narrower; in (0, pi]. None: as far at every width.
    """
    given = reference_half_width_rad
    reference = 0.0 if given is None else _half_width(given, "reference_half_width_rad")
    params = np.array([_guarded(prob_detection), positive("max_range", max_range), reference])
    reach = float(max_range) if reference == 0.0 else math.inf
    return DetectionModel(functions.camera, params, functions.mean_camera, reach)
