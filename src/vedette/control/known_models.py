"""Inputs of a sensor's pseudo-updates besides its prior, with the closed forms of built-in models."""

import math
from functools import lru_cache

import numpy as np

from vedette.control.prediction import ALWAYS_SURVIVES
from vedette.control.settings import IDEAL_MODES, MobileSensor, PlanningSettings
from vedette.filters.inputs import no_births_for_kernel
from vedette.kernels.base.types import Bools, Floats, Motion, Sensor
from vedette.kernels.gaussian.sigma_points import LINEARISED
from vedette.kernels.planning.batched_models import (
    ANY,
    BEARING_RANGE,
    CONSTANT,
    GAUSSIAN,
    GROWING,
    POSITION,
    SAME,
    SOFT_EDGE,
    ModelForms,
)
from vedette.kernels.planning.ideal import Decision, Horizon, SampledTrajectories
from vedette.models import (
    bearing_range,
    constant_detection,
    constant_noise,
    constant_velocity,
    gaussian_detection,
    kernel_motion,
    position,
    range_dependent_noise,
    soft_sector,
)
from vedette.models.detection_functions import MAX_PROB_DETECTION
from vedette.models.functions import ModelFunction
from vedette.models.turns import is_turn

# Identified by the functions themselves: a custom model has none of these forms.
_LINEAR = {
    (own.transition, own.process_noise_cov)
    for own in (constant_velocity(1.0, noise_model=kind) for kind in ("discrete_white", "continuous_white"))
}

_MEASUREMENTS = {bearing_range().function: BEARING_RANGE, position().function: POSITION}

_NOISES = {
    range_dependent_noise(1.0, 0.0, 1.0, 0.0).function: GROWING,
    constant_noise([1.0]).function: CONSTANT,
}

_DETECTIONS = {
    gaussian_detection(1.0).function: GAUSSIAN,
    constant_detection(0.5).function: SAME,
    soft_sector(0.5, 1.0, range_slope=1.0).function: SOFT_EDGE,
}


def decision_of(
    sensor: MobileSensor,
    courses: Floats,
    futures: SampledTrajectories,
    settings: PlanningSettings,
    scans: Bools,
    detection_at: str | None = None,
) -> Decision:
    """Return the inputs of a sensor's pseudo-updates besides its prior.

    scans: (num_courses, horizon_steps) whether it scans at each step. detection_at: as in `SensorModel.to_kernel`.
    """
    horizon = Horizon(
        np.ascontiguousarray(courses),
        scans,
        float(settings.horizon_period),
        IDEAL_MODES[settings.ideal_measurements],
        float(settings.detection_threshold),
    )
    targets, own = sensor.filter.targets, sensor.filter.sensor
    motion, sees = kernel_motion(targets.motion, ALWAYS_SURVIVES), own.to_kernel(detection_at)
    return Decision(
        no_births_for_kernel(targets.state_dim),
        motion,
        sees,
        forms_of(motion, sees, horizon.dt, targets.state_dim, is_turn(courses[:, 0])),
        horizon,
        futures,
        settings.limits.truncation(own.meas_dim),
    )


def forms_of(motion: Motion, sensor: Sensor, dt: float, state_dim: int, turns: bool = False) -> ModelForms:
    """Return the closed forms of models in kernel form, over steps of `dt` seconds.

    turns: whether the sensor is a rotating radar, whose measurements have none of the forms.
    """
    detection, seen = ANY if turns else _DETECTIONS.get(sensor.prob_detection, ANY), sensor.detection_params
    if detection == SOFT_EDGE and (seen[2] < math.pi or seen[4] > 0.0):  # with an angular edge
        detection = ANY
    is_linear = motion.method == LINEARISED and (motion.transition, motion.process_noise_cov) in _LINEAR
    if is_linear:
        functions = motion.transition_jacobian, motion.process_noise_cov
        step = _linear_step(
            *functions, motion.transition_params.tobytes(), motion.noise_params.tobytes(), dt, state_dim
        )
    else:
        step = np.zeros((2, state_dim, state_dim))
    return ModelForms(
        int(is_linear),
        step[0],
        step[1],
        ANY if turns else _MEASUREMENTS.get(sensor.measurement, ANY),
        ANY if turns else _NOISES.get(sensor.measurement_noise_cov, ANY),
        detection,
        MAX_PROB_DETECTION,
    )


@lru_cache(maxsize=100)
def _linear_step(
    jacobian: ModelFunction, noise_cov: ModelFunction, params: bytes, noise_params: bytes, dt: float, state_dim: int
) -> Floats:
    """Return (2, state_dim, state_dim) transition and noise of a linear motion, the same at every state."""
    anywhere, step = np.zeros(state_dim), np.zeros((2, state_dim, state_dim))
    jacobian(anywhere, dt, np.frombuffer(params).copy(), step[0])
    noise_cov(anywhere, dt, np.frombuffer(noise_params).copy(), step[1])
    return step
