"""With what probability a sensor detects a target of which a Gaussian is believed."""

from __future__ import annotations

import math

import numpy as np

from vedette.errors import ModelError
from vedette.kernels.base.compile import inlined, kernel
from vedette.kernels.base.types import Floats, Sensor

AT_CENTRE = 0
CLOSED_FORM = 1
BY_NODES = 2


@inlined
def checked(detection: float) -> float:
    if not 0.0 <= detection <= 1.0:
        raise ModelError("detection model: probability is not in [0, 1]")
    return detection


@inlined
def _mean_of_nodes(sensor: Sensor, pose: Floats, mean: Floats, cov: Floats, state: Floats) -> float:
    """Sum of weight * P_D at mean + L (standard deviates), L L' the covariance of the position."""
    a = math.sqrt(max(cov[0, 0], 0.0))
    b = cov[1, 0] / a if a > 0.0 else 0.0
    c = math.sqrt(max(cov[1, 1] - b * b, 0.0))
    for j in range(mean.shape[0]):
        state[j] = mean[j]
    nodes, total = sensor.detection_nodes, 0.0
    for i in range(nodes.shape[0]):
        state[0] = mean[0] + a * nodes[i, 1]
        state[1] = mean[1] + b * nodes[i, 1] + c * nodes[i, 2]
        total += nodes[i, 0] * checked(sensor.prob_detection(state, pose, sensor.detection_params))
    return min(total, 1.0)  # weights sum to 1 but for rounding


@inlined
def detection_probability(sensor: Sensor, pose: Floats, mean: Floats, cov: Floats, state: Floats) -> float:
    """Of a target at the mean, or the mean over N(mean, cov), by `sensor.detection_rule`.

    By nodes the position varies and the rest of the state stays at its mean. state: (state_dim,) to be written.
    """
    if sensor.detection_rule == AT_CENTRE:
        return checked(sensor.prob_detection(mean, pose, sensor.detection_params))
    if sensor.detection_rule == CLOSED_FORM:
        return checked(sensor.mean_prob_detection(mean, cov, pose, sensor.detection_params))
    return _mean_of_nodes(sensor, pose, mean, cov, state)


@kernel
def detection_probabilities(sensor: Sensor, pose: Floats, means: Floats, covs: Floats) -> Floats:
    """(num,) of each of (num, state_dim) means and (num, state_dim, state_dim) covariances."""
    out, state = np.empty(len(means)), np.empty(means.shape[1])
    for i in range(len(means)):
        out[i] = detection_probability(sensor, pose, means[i], covs[i], state)
    return out
