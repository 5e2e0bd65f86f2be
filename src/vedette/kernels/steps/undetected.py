"""One scan of the intensity of targets not yet found: who lives on, and whom a sensor misses, cell by cell."""

from __future__ import annotations

import numpy as np

from vedette.errors import ModelError
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Motion, Sensor


@inlined
def mean_detection(sensor: Sensor, pose: Floats, states: Floats, node_weights: Floats) -> float:
    """Sum of weight * P_D over the (num_nodes, state_dim) states of a cell."""
    total = 0.0
    for i in range(states.shape[0]):
        detection = sensor.prob_detection(states[i], pose, sensor.detection_params)
        if not 0.0 <= detection <= 1.0:
            raise ModelError("detection model: probability is not in [0, 1]")
        total += node_weights[i] * detection
    return min(total, 1.0)  # weights sum to 1 but for rounding


@borrowing
def _write_missed(
    sensor: Sensor, pose: Floats, states: Floats, node_weights: Floats, expected: Floats, out: Floats
) -> None:
    for c in range(len(expected)):
        out[c] = expected[c] * (1.0 - mean_detection(sensor, pose, states[c], node_weights))


@kernel
def take_out_detected(sensor: Sensor, pose: Floats, states: Floats, node_weights: Floats, expected: Floats) -> Floats:
    """(num_cells,) expected times the mean over the cell of 1 - P_D.

    states: (num_cells, num_nodes, state_dim) of targets at the nodes of each cell; node_weights: (num_nodes,), sum 1.
    """
    out = np.empty_like(expected)
    _write_missed(sensor, pose, states, node_weights, expected, out)
    return out


@kernel
def survival_probabilities(motion: Motion, dt: float, states: Floats) -> Floats:
    """(num,) probability of living through `dt` seconds at each of (num, state_dim) states."""
    out = np.empty(len(states))
    for i in range(len(states)):
        out[i] = motion.prob_survival(states[i], dt, motion.survival_params)
        if not 0.0 <= out[i] <= 1.0:
            raise ModelError("survival model: probability is not in [0, 1]")
    return out
