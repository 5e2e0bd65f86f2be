"""Predicted ideal measurements: the scan that a sensor would take of a sampled multi-target state (Mahler 2004)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vedette.errors import ModelError
from vedette.kernels.compile import kernel
from vedette.kernels.gaussian import wrap_angle
from vedette.kernels.linalg import cholesky
from vedette.kernels.types import Floats, Ints, Motion, Sensor

IDEAL = 0
EXPECTED = 1
SAMPLED = 2


class Futures(NamedTuple):
    """Sampled multi-target states over the horizon, and the random numbers of their measurements.

    Targets of sample `j` are `offsets[j]:offsets[j + 1]`. states: (horizon_steps, num_targets, state_dim).
    uniforms: (horizon_steps, num_targets) decide detection. normals: (horizon_steps, num_targets, meas_dim) the noise.
    """

    offsets: Ints
    states: Floats
    uniforms: Floats
    normals: Floats


@kernel
def propagate_samples(motion: Motion, states: Floats, dt: float, horizon_steps: int) -> Floats:
    """(horizon_steps, num_targets, state_dim) noise-free future of the sampled states."""
    num, dim = states.shape
    out = np.empty((horizon_steps, num, dim))
    for h in range(horizon_steps):
        for i in range(num):
            before = states[i] if h == 0 else out[h - 1, i]
            motion.transition(before, dt, motion.transition_params, out[h, i])
    return out


@kernel
def ideal_scan(
    sensor: Sensor, pose: Floats, futures: Futures, sample: int, step: int, mode: int, threshold: float, out: Floats
) -> int:
    """Write the ideal measurements of a sample at a horizon step into `out`; returns their number.

    IDEAL: without noise, of the targets whose detection probability is at least `threshold`. EXPECTED: without noise, each
    target seen with its detection probability. SAMPLED: seen likewise, with measurement noise. Never any clutter.
    """
    dim = out.shape[1]
    count = 0
    for i in range(futures.offsets[sample], futures.offsets[sample + 1]):
        state = futures.states[step, i]
        detection = sensor.prob_detection(state, pose, sensor.detection_params)
        seen = detection >= threshold if mode == IDEAL else futures.uniforms[step, i] < detection
        if not seen:
            continue
        sensor.measurement(state, pose, sensor.measurement_params, out[count])
        if mode == SAMPLED:
            noise, factor = np.empty((dim, dim)), np.empty((dim, dim))
            sensor.measurement_noise_cov(state, pose, sensor.noise_params, noise)
            if not cholesky(noise, factor):
                raise ModelError("measurement noise model: covariance is not positive definite or not finite")
            for a in range(dim):
                for b in range(a + 1):
                    out[count, a] += factor[a, b] * futures.normals[step, i, b]
                if sensor.angular[a]:
                    out[count, a] = wrap_angle(out[count, a])
        count += 1
    return count
