"""Which models of a decision are built-in ones whose values at many states can be had side by side."""

from __future__ import annotations

import numpy as np

from vedette.kernels.base.types import Motion, Sensor
from vedette.kernels.gaussian.sigma_points import LINEARISED
from vedette.kernels.planning.forms import ANY, BEARING_RANGE, CONSTANT, GAUSSIAN, GROWING, POSITION, SAME, Forms
from vedette.models import (
    bearing_range,
    constant_detection,
    constant_noise,
    constant_velocity,
    gaussian_detection,
    position,
    range_dependent_noise,
)
from vedette.models.detection_functions import MAX_PROB_DETECTION

# By the functions themselves: a model of a user's own is none of these.
_LINEAR = {
    (own.transition, own.process_noise_cov)
    for own in (constant_velocity(1.0, acceleration=kind) for kind in ("held", "continuous"))
}
_MEASUREMENTS = {bearing_range().function: BEARING_RANGE, position().function: POSITION}
_NOISES = {
    range_dependent_noise(1.0, 0.0, 1.0, 0.0).function: GROWING,
    constant_noise([1.0]).function: CONSTANT,
}
_DETECTIONS = {gaussian_detection(1.0).function: GAUSSIAN, constant_detection(0.5).function: SAME}


def forms_of(motion: Motion, sensor: Sensor, dt: float, state_dim: int) -> Forms:
    """The forms of models as kernels take them, over steps of `dt` seconds."""
    transition, noise = np.zeros((state_dim, state_dim)), np.zeros((state_dim, state_dim))
    is_linear = motion.method == LINEARISED and (motion.transition, motion.process_noise_cov) in _LINEAR
    if is_linear:
        anywhere = np.zeros(state_dim)
        motion.transition_jacobian(anywhere, dt, motion.transition_params, transition)
        motion.process_noise_cov(anywhere, dt, motion.noise_params, noise)
    return Forms(
        int(is_linear),
        transition,
        noise,
        _MEASUREMENTS.get(sensor.measurement, ANY),
        _NOISES.get(sensor.measurement_noise_cov, ANY),
        _DETECTIONS.get(sensor.prob_detection, ANY),
        MAX_PROB_DETECTION,
    )
