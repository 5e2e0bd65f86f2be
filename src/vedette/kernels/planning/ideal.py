"""Predicted ideal measurements: the scan of a sampled multi-target state by a sensor (Mahler 2004)."""

from typing import NamedTuple

import numpy as np

from vedette.errors import ModelError
from vedette.kernels.association.truncation import Truncation
from vedette.kernels.base.bundle_types import typed_by_fields
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Bools, Floats, Ints, Lmb, Motion, Sensor
from vedette.kernels.gaussian.linalg import cholesky
from vedette.kernels.gaussian.scratch import Scratch, wrap
from vedette.kernels.planning.batched_models import ModelForms

IDEAL = 0
EXPECTED = 1
SAMPLED = 2


class SampledTrajectories(NamedTuple):
    """Sampled multi-target states over the horizon, and the random numbers of their measurements."""

    offsets: Ints  # (num_samples + 1,) first target of each sample
    states: Floats  # (horizon_steps, num_targets, state_dim)
    uniforms: Floats  # (horizon_steps, num_targets) for detections
    normals: Floats  # (horizon_steps, num_targets, meas_dim) for the noise


@kernel
def propagate_samples(motion: Motion, states: Floats, dt: float, horizon_steps: int) -> Floats:
    """Return (horizon_steps, num_targets, state_dim) the noise-free future of the sampled states."""
    num, dim = states.shape
    out = np.empty((horizon_steps, num, dim))
    for h in range(horizon_steps):
        for i in range(num):
            # Without process noise: the spread of the trajectories is that of the samples.
            before = states[i] if h == 0 else out[h - 1, i]
            motion.transition(before, dt, motion.transition_params[0], out[h, i])
    return out


class Horizon(NamedTuple):
    """The poses and times at which a sensor will scan."""

    poses: Floats  # (num_actions, horizon_steps, pose_dim) poses of each action
    scans: Bools  # (num_actions, horizon_steps) whether it scans at each step
    dt: float  # seconds per step
    mode: int  # IDEAL, EXPECTED or SAMPLED measurements
    threshold: float  # minimum detection probability of a measured target, for IDEAL


@typed_by_fields
class Decision(NamedTuple):
    """The inputs of one sensor's pseudo-updates besides its prior."""

    birth: Lmb  # empty: no births over the horizon
    motion: Motion  # no deaths
    sensor: Sensor
    forms: ModelForms
    horizon: Horizon
    futures: SampledTrajectories  # with the random numbers of this sensor
    truncation: Truncation


@borrowing
def most_targets(futures: SampledTrajectories) -> int:
    """Return the number of targets of the largest sample."""
    most = 0
    for sample in range(len(futures.offsets) - 1):
        most = max(most, futures.offsets[sample + 1] - futures.offsets[sample])
    return most


@inlined
def add_noise(sensor: Sensor, state: Floats, pose: Floats, normals: Floats, scratch: Scratch, out: Floats) -> None:
    """Add measurement noise, from standard deviates `normals`, to the measurement of a state."""
    noise, factor = scratch.measurement_noise, scratch.innovation_cov
    sensor.measurement_noise_cov(state, pose, sensor.noise_params, noise)
    if not cholesky(noise, factor):
        raise ModelError("measurement noise model: covariance is not positive definite or not finite")
    for a in range(out.shape[0]):
        for b in range(a + 1):
            out[a] += factor[a, b] * normals[b]
        out[a] = wrap(out[a], sensor.periods[a])


@inlined
def ideal_measurement(decision: Decision, action: int, target: int, step: int, scratch: Scratch, out: Floats) -> bool:
    """Write the ideal measurement of a sampled target at a step of an action. Returns False if there is none.

    IDEAL: without noise, of a target whose detection probability is at least the threshold. EXPECTED: without noise, of
    a target detected at random with its detection probability. SAMPLED: detected likewise, with measurement noise.
    """
    sensor, horizon, futures = decision.sensor, decision.horizon, decision.futures
    state, pose = futures.states[step, target], horizon.poses[action, step]
    detection = sensor.prob_detection(state, pose, sensor.detection_params)
    # The uniforms are the same for all actions, so actions are compared on common random numbers.
    seen = detection >= horizon.threshold if horizon.mode == IDEAL else futures.uniforms[step, target] < detection
    seen = seen and horizon.scans[action, step]
    if seen:
        sensor.measurement(state, pose, sensor.measurement_params, out)
        if horizon.mode == SAMPLED:
            add_noise(sensor, state, pose, futures.normals[step, target], scratch, out)
    return seen


@inlined
def ideal_scan(decision: Decision, action: int, sample: int, step: int, scratch: Scratch, out: Floats) -> int:
    """Write the ideal measurements of a sample at a step of an action into `out`. Returns their number. No clutter."""
    futures, count = decision.futures, 0
    for target in range(futures.offsets[sample], futures.offsets[sample + 1]):
        if ideal_measurement(decision, action, target, step, scratch, out[count]):
            count += 1
    return count
