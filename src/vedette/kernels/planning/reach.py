"""Labels predicted over the horizon without scans, and the labels that a course may detect."""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Ints, Lmb, Motion
from vedette.kernels.gaussian.detection import detection_probability
from vedette.kernels.gaussian.prediction import predict
from vedette.kernels.gaussian.scratch import make_scratch
from vedette.kernels.planning.ideal import Decision, Horizon


class Paths(NamedTuple):
    """Labels predicted over the horizon without scans."""

    means: Floats  # (num_labels, horizon_steps, state_dim)
    covs: Floats  # (num_labels, horizon_steps, state_dim, state_dim)


class Belief(NamedTuple):
    """A sensor's labels before the decision, and their indices among the sampled targets."""

    prior: Lmb  # one Gaussian per label
    paths: Paths
    targets: Ints  # (num_labels, num_samples) index of the label's sampled target, -1 if absent
    radii: Floats  # (num_labels, horizon_steps) m, radii about the paths' means that contain the label


@kernel
def predict_paths(motion: Motion, dt: float, num_steps: int, means: Floats, covs: Floats) -> Paths:
    """Return the Gaussians of means (num, state_dim) after each of `num_steps` steps, without births or deaths."""
    num, dim = means.shape
    scratch = make_scratch(dim, dim)
    paths = Paths(np.empty((num, num_steps, dim)), np.empty((num, num_steps, dim, dim)))
    for i in range(num):
        for h in range(num_steps):
            mean = means[i] if h == 0 else paths.means[i, h - 1]
            cov = covs[i] if h == 0 else paths.covs[i, h - 1]
            predict(motion, 0, dt, mean, cov, paths.means[i, h], paths.covs[i, h], scratch)
    return paths


@kernel
def label_radii(paths: Paths, targets: Ints, states: Floats) -> Floats:
    """Return (num_labels, horizon_steps) distances from a label's predicted mean that contain all of its samples.

    At least 5.3 standard deviations of its position along its longest axis, beyond which is less than 1e-6 of its
    Gaussian. states: (horizon_steps, num_targets, state_dim) of the samples.
    """
    num_labels, num_steps = paths.means.shape[:2]
    radii = np.empty((num_labels, num_steps))
    for label in range(num_labels):
        for h in range(num_steps):
            cov, square = paths.covs[label, h], 0.0
            for sample in range(targets.shape[1]):
                if targets[label, sample] >= 0:
                    at, mean = states[h, targets[label, sample]], paths.means[label, h]
                    square = max(square, (at[0] - mean[0]) ** 2 + (at[1] - mean[1]) ** 2)
            mean_variance, skew = 0.5 * (cov[0, 0] + cov[1, 1]), 0.5 * (cov[0, 0] - cov[1, 1])
            longest = mean_variance + math.sqrt(skew * skew + cov[1, 0] * cov[1, 0])
            radii[label, h] = math.sqrt(max(square, 5.3 * 5.3 * longest))
    return radii


@inlined
def is_beyond(paths: Paths, radii: Floats, horizon: Horizon, course: int, label: int, step: int, reach: float) -> bool:
    """Return True if, at a step of a course, a label is beyond the sensor's reach, or the sensor does not scan."""
    if not horizon.scans[course, step]:
        return True
    pose, mean, most = horizon.poses[course, step], paths.means[label, step], reach + radii[label, step]
    dx, dy = mean[0] - pose[0], mean[1] - pose[1]
    return dx * dx + dy * dy > most * most


@borrowing
def _detects(
    belief: Belief, decision: Decision, course: int, label: int, step: int, least: float, state: Floats
) -> bool:
    """Return True if the detection probability of a label or of a sample is at least `least` at a step of a course."""
    sensor, pose = decision.sensor, decision.horizon.poses[course, step]
    mean, cov = belief.paths.means[label, step], belief.paths.covs[label, step]
    if detection_probability(sensor, pose, mean, cov, state) >= least:
        return True
    for sample in range(belief.targets.shape[1]):
        target = belief.targets[label, sample]
        if target >= 0:
            at = decision.futures.states[step, target]
            if sensor.prob_detection(at, pose, sensor.detection_params) >= least:
                return True
    return False


@kernel
def fill_reach(
    belief: Belief, decision: Decision, least: float, reach: float, first: int, last: int, out: Ints
) -> None:
    """Set out[course, label] to 1 if a course may detect a label with probability `least` or more, else to 0.

    Evaluated for the samples and for the prediction, at every step. reach: m, maximum detection range of the sensor.
    """
    state = np.empty(belief.prior.tracks.components.means.shape[1])
    for course in range(first, last):
        for label in range(out.shape[1]):
            out[course, label] = 0
            for h in range(decision.horizon.poses.shape[1]):
                if is_beyond(belief.paths, belief.radii, decision.horizon, course, label, h, reach):
                    continue
                if _detects(belief, decision, course, label, h, least, state):
                    out[course, label] = 1
                    break


@kernel
def fill_within(paths: Paths, radii: Floats, horizon: Horizon, reach: float, first: int, last: int, out: Ints) -> None:
    """Set the same entries as `fill_reach`, by distance alone."""
    for course in range(first, last):
        for label in range(out.shape[1]):
            out[course, label] = 0
            for h in range(horizon.poses.shape[1]):
                if not is_beyond(paths, radii, horizon, course, label, h, reach):
                    out[course, label] = 1
                    break
