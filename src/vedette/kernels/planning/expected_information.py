"""Expected information of scans about each label, without samples: information weighted by detection probability.

Along the predicted path of a label, a scan with detection probability P_D adds P_D times the information of a
measurement, and the label is missed by all scans with the product of the 1 - P_D. P_D is the mean over the predicted
Gaussian. As a change of a Bernoulli row, only the information matrix and log (1 - q) are set.
"""

import math
from typing import NamedTuple

import numpy as np

from vedette.errors import NumericalError
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Sensor
from vedette.kernels.gaussian.beam import turns
from vedette.kernels.gaussian.detection import BY_NODES, detection_probability, root_of_position
from vedette.kernels.gaussian.innovation import Innovation, expect_measurement, make_innovation
from vedette.kernels.gaussian.linalg import cholesky, inverse_from_factor
from vedette.kernels.gaussian.prediction import predict
from vedette.kernels.gaussian.relinearisation import Pair, PairWork, learn_at_mean
from vedette.kernels.gaussian.row_noise import no_row_noise
from vedette.kernels.gaussian.scratch import Scratch, make_scratch
from vedette.kernels.gaussian.sigma_points import LINEARISED, SWITCHED
from vedette.kernels.planning.batched_models import Offsets, fill_detection, find_offsets, make_offsets
from vedette.kernels.planning.bernoulli_rows import log_miss
from vedette.kernels.planning.ideal import Decision
from vedette.kernels.planning.known_changes import Entries
from vedette.kernels.planning.reach import Belief, is_beyond


class _Work(NamedTuple):
    """Working arrays in which one label is followed over the horizon."""

    scratch: Scratch
    seen: Innovation  # of one entry
    predicted_mean: Floats  # (state_dim,)
    predicted_cov: Floats  # (state_dim, state_dim)
    cov: Floats  # (state_dim, state_dim)
    factor: Floats  # (state_dim, state_dim)
    inverse: Floats  # (state_dim, state_dim)
    offsets: Offsets  # of the nodes of the detection probability
    nodes: Floats  # (3, num_nodes) weights and two standard deviates
    states: Floats  # (state_dim, num_nodes) at the nodes in reach
    found: Floats  # (2, num_nodes) weights and P_D there


@kernel
def _make_work(dim: int, meas_dim: int, nodes: Floats) -> _Work:
    return _Work(
        make_scratch(dim, meas_dim),
        make_innovation(1, dim, meas_dim),
        np.empty(dim),
        np.empty((dim, dim)),
        np.empty((dim, dim)),
        np.empty((dim, dim)),
        np.empty((dim, dim)),
        make_offsets(len(nodes)),
        nodes.T.copy(),
        np.empty((dim, len(nodes))),
        np.empty((2, len(nodes))),
    )


@inlined
def _invert(matrix: Floats, factor: Floats, out: Floats) -> None:
    if not cholesky(matrix, factor):
        raise NumericalError("expected information: covariance of a track is not positive definite")
    inverse_from_factor(factor, out)


@inlined
def _update_cov(
    sensor: Sensor, pose: Floats, mean: Floats, cov: Floats, detection: float, work: _Work, out: Floats
) -> None:
    """Write the covariance after `detection` times the information of a measurement.

    If the measurement is too nonlinear, the information is that of a target at the mean.
    """
    n, prior, updated = len(mean), work.inverse, work.predicted_cov
    if sensor.method == LINEARISED or sensor.method == SWITCHED:
        pair = Pair(pose, mean, cov, work.seen.predicted[0], no_row_noise(work.seen.factor))
        learn_at_mean(sensor, pair, detection, PairWork(work.seen, work.scratch))
        for i in range(n):
            for j in range(n):
                out[i, j] = work.seen.covs[0, i, j]
        return
    expect_measurement(sensor, pose, mean, cov, no_row_noise(work.seen.factor), 0, work.seen, work.scratch)
    _invert(cov, work.factor, prior)
    _invert(work.seen.covs[0], work.factor, updated)
    for i in range(n):
        for j in range(n):
            updated[i, j] = prior[i, j] + detection * (updated[i, j] - prior[i, j])
    _invert(updated, work.factor, out)


@borrowing
def _detection(decision: Decision, pose: Floats, mean: Floats, cov: Floats, reach: float, work: _Work) -> float:
    """Return the detection probability of a Gaussian. Nodes beyond `reach`, where P_D is 0, are not evaluated."""
    sensor, x, y, squares, num = decision.sensor, work.states[0], work.states[1], work.offsets.squares, 0
    if sensor.detection_rule != BY_NODES:
        return detection_probability(sensor, pose, mean, cov, work.scratch.points[0])
    weights, u, v, found, root = work.nodes[0], work.nodes[1], work.nodes[2], work.found[1], root_of_position(cov)
    limit = math.inf if turns(pose) else reach * reach  # a turning beam passes targets elsewhere
    middle_x, middle_y, px, py, total = mean[0], mean[1], pose[0], pose[1], 0.0
    for i in range(len(u)):
        x[i] = middle_x + root[0] * u[i]
    for i in range(len(u)):
        y[i] = middle_y + root[1] * u[i] + root[2] * v[i]
    for i in range(len(u)):
        squares[i] = (x[i] - px) ** 2 + (y[i] - py) ** 2
    for i in range(len(u)):
        num += squares[i] <= limit
    if num == 0:
        return 0.0
    if num < len(u):
        weights, num = work.found[0], 0
        for i in range(len(u)):
            if squares[i] <= limit:
                x[num], y[num], weights[num] = x[i], y[i], work.nodes[0, i]
                num += 1
    for j in range(2, len(mean)):
        work.states[j, :num] = mean[j]
    find_offsets(pose, work.states, num, work.offsets)
    fill_detection(sensor, decision.forms, pose, work.states, work.offsets, num, work.scratch, found)
    for i in range(num):
        total += weights[i] * found[i]
    return min(total, 1.0)  # weights sum to 1 up to rounding


@borrowing
def _is_seen(
    belief: Belief,
    decision: Decision,
    course: int,
    label: int,
    least: float,
    reach: float,
    work: _Work,
    detections: Floats,
) -> bool:
    """Return True if a label's detection probability is at least `least` at some step. Writes the probabilities."""
    paths, seen = belief.paths, False
    for h in range(len(detections)):
        pose, detections[h] = decision.horizon.poses[course, h], 0.0
        if not is_beyond(belief.paths, belief.radii, decision.horizon, course, label, h, reach):
            mean, cov = paths.means[label, h], paths.covs[label, h]
            detections[h] = _detection(decision, pose, mean, cov, reach, work)
            seen |= detections[h] >= least
    return seen


@borrowing
def _expected_cov(
    belief: Belief,
    decision: Decision,
    course: int,
    label: int,
    detections: Floats,
    least: float,
    work: _Work,
    out: Floats,
) -> float:
    """Write the expected covariance at the end of the horizon. Returns the log probability of never being detected.

    A scan with a detection probability below `least` gives no information about the state.
    """
    paths, horizon, n = belief.paths, decision.horizon, out.shape[0]
    missed, was_seen = 0.0, False
    for h in range(horizon.poses.shape[1]):
        mean, cov, detection = paths.means[label, h], paths.covs[label, h], detections[h]
        if was_seen:
            before, cov = paths.means[label, h - 1], work.cov
            predict(decision.motion, 0, horizon.dt, before, out, work.predicted_mean, cov, work.scratch)
        missed += log_miss(detection)
        if detection < least:
            if was_seen:
                for i in range(n):
                    for j in range(n):
                        out[i, j] = cov[i, j]
            continue
        was_seen = True
        _update_cov(decision.sensor, horizon.poses[course, h], mean, cov, detection, work, out)
    return missed


@kernel
def fill_expected_changes(
    belief: Belief,
    decision: Decision,
    entries: Entries,
    bases: Floats,
    least: float,
    reach: float,
    first: int,
    last: int,
    changes: Floats,
) -> None:
    """Write changes (num_entries, bernoulli_size, 1) for courses `first:last`. See `known_changes.fill_changes`.

    They are zero for a label whose detection probability is below `least` at every step, for example beyond `reach`, m.
    P_D is that of the prediction, even if earlier scans of the horizon are expected to have reduced its covariance.
    """
    dim, size = belief.paths.means.shape[2], bases.shape[1]
    work = _make_work(dim, len(decision.sensor.periods), decision.sensor.detection_nodes)
    cov, information, detections = np.empty((dim, dim)), np.empty((dim, dim)), np.empty(belief.paths.means.shape[1])
    for course in range(first, last):
        for entry in range(entries.first[course], entries.last[course]):
            label, row, at = entries.own[entry], changes[entry, :, 0], 0
            for k in range(size):
                row[k] = 0.0
            if not _is_seen(belief, decision, course, label, least, reach, work, detections):
                continue
            row[size - 1] = _expected_cov(belief, decision, course, label, detections, least, work, cov)
            _invert(cov, work.factor, information)
            for i in range(dim):
                for j in range(i + 1):
                    row[at] = information[i, j] - bases[label, at]
                    at += 1
