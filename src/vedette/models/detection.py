"""Detection models: probability that a sensor at a pose detects a target."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from vedette.errors import ModelError
from vedette.kernels.base.types import Floats
from vedette.models import detection_functions as functions
from vedette.models.arguments import params_vector, pose_vector, positive, probability, reject, state_table
from vedette.models.detection_functions import MAX_PROB_DETECTION
from vedette.models.fields import HalfWidth, Positive, Probability, half_width, part
from vedette.models.functions import ModelFunction, describe, numbers_at, require_kind
from vedette.models.probe import probe_probability


@dataclass(frozen=True, slots=True, eq=False)
class DetectionModel:
    """Probability of detection as a function of state and pose (paper: P_D(x_k, u_k)).

    Attributes:
        function: model function of kind `prob_detection`.
        params: its parameter vector.
        mean_function: model function of kind `mean_prob_detection` (same parameters): the mean over a Gaussian in
            closed form. None: it is computed with nodes, see `SensorModel.detection_at`.
        reach: distance in m from the sensor beyond which the probability is 0, so that evaluations there can be
            skipped. inf: no such distance is known.
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

    @property
    def is_constant(self) -> bool:
        """True for `constant_detection`, which is the same everywhere."""
        return self.function is functions.constant

    def prob(self, states: ArrayLike, pose: ArrayLike) -> Floats:
        """Return the detection probabilities of (n, state_dim) states, (n,)."""
        table, at = state_table("states", states), pose_vector("pose", pose)
        return numbers_at(self.function, table, at, self.params)

    def check(self, states: ArrayLike, pose: ArrayLike) -> None:
        """Check the functions at each state (the mean function with variances of 1).

        Raises:
            ModelError: a value that is not a probability, or is above 0 beyond `reach`.
        """
        at = pose_vector("pose", pose)
        for state in state_table("states", states):
            chance, offset = probe_probability(self.function, (state, at, self.params)), state[:2] - at[:2]
            if chance > 0.0 and offset @ offset > self.reach**2:
                expected = f"0, as its reach is {self.reach:g} m; got {chance:g}"
                raise ModelError(f"{describe(self.function, state, at, self.params)}: expected {expected}")
            if self.mean_function is not None:
                probe_probability(self.mean_function, (state, np.eye(len(state)), at, self.params))


def _guarded(prob_detection: float, field: str = "prob_detection") -> float:
    return min(probability(field, prob_detection), MAX_PROB_DETECTION)


def _edge(max_range: float, outside: float) -> float:
    """Return the distance beyond which the probability of detection is 0, in m."""
    return float(max_range) if outside == 0.0 else math.inf


@part("constant", "detection", probability="prob_detection")
def constant_detection(prob_detection: Probability) -> DetectionModel:
    """The same probability of detection everywhere.

    Args:
        prob_detection: probability of detection. 1 is replaced by `MAX_PROB_DETECTION`.
    """
    return DetectionModel(functions.constant, np.array([_guarded(prob_detection)]), functions.mean_constant)


@part("gaussian", "detection")
def gaussian_detection(sigma: Positive = 10000.0) -> DetectionModel:
    """Probability of detection exp(-d^2 / (2 sigma^2)) at distance d (paper section IV, paper-notes 4).

    Args:
        sigma: length scale of the decrease with distance. The probability is capped at `MAX_PROB_DETECTION` [m].
    """
    return DetectionModel(functions.gaussian, np.array([positive("sigma", sigma)]), functions.mean_gaussian)


@part("limited_range", "detection", probability="prob_detection")
def limited_range(prob_detection: Probability, max_range: Positive, outside: Probability = 0.0) -> DetectionModel:
    """Detection within a distance, and less or none beyond.

    Args:
        prob_detection: probability of detection within `max_range`. 1 is replaced by `MAX_PROB_DETECTION`.
        max_range: greatest distance [m].
        outside: probability of detection beyond it.
    """
    params = np.array([_guarded(prob_detection), positive("max_range", max_range), _guarded(outside, "outside")])
    return DetectionModel(functions.limited_range, params, functions.mean_limited_range, _edge(max_range, outside))


@part("limited_sector", "detection", probability="prob_detection")
def limited_sector(
    prob_detection: Probability, max_range: Positive, half_width_rad: HalfWidth, outside: Probability = 0.0
) -> DetectionModel:
    """Detection within a distance and a sector (field of view) around the sensor's heading, less or none beyond.

    Args:
        prob_detection: probability of detection within the sector. 1 is replaced by `MAX_PROB_DETECTION`.
        max_range: greatest distance [m].
        half_width_rad: greatest angle from the heading, either side, up to a half turn [rad].
        outside: probability of detection outside the sector.
    """
    params = [_guarded(prob_detection), positive("max_range", max_range), half_width("half_width_rad", half_width_rad)]
    return DetectionModel(
        functions.limited_sector,
        np.array([*params, _guarded(outside, "outside")]),
        functions.mean_limited_sector,
        _edge(max_range, outside),
    )


@part("soft_sector", "detection", probability="prob_detection")
def soft_sector(
    prob_detection: Probability,
    max_range: Positive,
    half_width_rad: HalfWidth = math.pi,
    *,
    range_slope: Positive,
    angle_slope: Positive | None = None,
    hard_limit: bool = False,
) -> DetectionModel:
    """Detection that falls off gradually at the edges of a sector around the sensor's heading.

    In distance and angle by logistic functions:
    p / (1 + exp(range_slope (rho - max_range))) / (1 + exp(angle_slope (|dtheta| - half_width_rad))) at the distance
    rho and the angle dtheta from the heading. A target at the sensor itself is straight ahead.

    Args:
        prob_detection: probability of detection deep within the sector, p. 1 is replaced by
            `MAX_PROB_DETECTION`.
        max_range: distance at which half of it is left, straight ahead [m].
        half_width_rad: angle from the heading, either side, at which half of it is left. With a half turn and no
            `angle_slope` detection does not depend on the angle [rad].
        range_slope: steepness of the edge in range [1/m].
        angle_slope: steepness of the edges in angle. none: sharp ones, and at a half turn none at all [1/rad].
        hard_limit: True if there is no detection beyond `max_range` and the half width.
    """
    slope = 0.0 if angle_slope is None else positive("angle_slope", angle_slope)
    if not isinstance(hard_limit, bool):
        raise reject("hard_limit", "true or false", hard_limit)
    params = [_guarded(prob_detection), positive("max_range", max_range), half_width("half_width_rad", half_width_rad)]
    params += [positive("range_slope", range_slope), slope, float(hard_limit)]
    return DetectionModel(functions.soft_sector, np.array(params), reach=float(max_range) if hard_limit else math.inf)


@part("camera", "detection", probability="prob_detection")
def camera(
    prob_detection: Probability, max_range: Positive, reference_half_width_rad: HalfWidth | None = None
) -> DetectionModel:
    """Detection within the field of view of a camera: along its pointing, as far to either side as its half width.

    The pose is [px, py, heading_rad, pointing_rad, half_width_rad], see `vedette.platforms.Pointing`.

    Args:
        prob_detection: probability of detection within the field of view. 1 is replaced by
            `MAX_PROB_DETECTION`.
        max_range: greatest distance [m].
        reference_half_width_rad: half width of a zooming camera at which its range is `max_range`. The range is
            inversely proportional to the half width. none: the same range at every width [rad].
    """
    given = reference_half_width_rad
    reference = 0.0 if given is None else half_width("reference_half_width_rad", given)
    params = np.array([_guarded(prob_detection), positive("max_range", max_range), reference])
    reach = float(max_range) if reference == 0.0 else math.inf
    return DetectionModel(functions.camera, params, functions.mean_camera, reach)
