"""Pseudo-updates with known association: each ideal measurement is of its own label, or else clutter.

Labels are then independent, no joint choice is ranked, and one label costs the same whatever the number of others. Of a
label predicted as N(m, P) with existence odds o, an ideal measurement z of the sampled target makes

    odds o (1 - P_D + P_D N(z; h(m), S) / kappa(z)),   density N(m + K (z - h(m)), P - K S K'),

and a scan in which the sampled target is not seen, or not there, odds o (1 - P_D) and the density as it was.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vedette.errors import NumericalError
from vedette.kernels.association.options import log_clutter_at
from vedette.kernels.association.predicted import log_or_minus_inf
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.gaussian.information import move_row, to_information
from vedette.kernels.gaussian.innovation import Innovation, expect, make_innovation, update_mean, whiten
from vedette.kernels.gaussian.linalg import log_add
from vedette.kernels.gaussian.prediction import predict
from vedette.kernels.gaussian.scratch import Scratch, make_scratch
from vedette.kernels.planning.bernoulli_rows import ALL_BUT_CERTAIN, bernoulli_size, log_miss
from vedette.kernels.planning.ideal import Decision, ideal_measurement
from vedette.kernels.planning.pseudo_lmb import LmbResults
from vedette.kernels.planning.reach import Belief


class Entries(NamedTuple):
    """Which of a sensor's own labels each of its courses reaches."""

    first: Ints  # (num_courses,) its first entry
    last: Ints  # (num_courses,) the one after its last
    own: Ints  # (num_entries,) place among the sensor's labels


class Work(NamedTuple):
    """Arrays in which one label is followed over the horizon."""

    scratch: Scratch
    unseen: Innovation  # one entry a step: of the label as it is without any measurement so far
    seen: Innovation  # of one entry: of the label after some measurement
    measurement: Floats  # (meas_dim,)
    whitened: Floats  # (meas_dim,)
    predicted_mean: Floats  # (state_dim,)
    predicted_cov: Floats  # (state_dim, state_dim)
    mean: Floats  # (state_dim,)
    cov: Floats  # (state_dim, state_dim)
    factor: Floats  # (state_dim, state_dim)
    inverse: Floats  # (state_dim, state_dim)


class Followed(NamedTuple):
    """What became of a label; its mean and covariance are in the work where it was measured."""

    log_odds: float  # factor on the odds of its existence
    log_miss: float  # of the probability that no scan detects it
    measured: bool
    first_at_end: bool  # measured at the last step alone, after which its covariance is the same for all samples


@kernel
def make_known_work(dim: int, meas_dim: int, num_steps: int) -> Work:
    return Work(
        make_scratch(dim, meas_dim),
        make_innovation(num_steps, dim, meas_dim),
        make_innovation(1, dim, meas_dim),
        np.empty(meas_dim),
        np.empty(meas_dim),
        np.empty(dim),
        np.empty((dim, dim)),
        np.empty(dim),
        np.empty((dim, dim)),
        np.empty((dim, dim)),
        np.empty((dim, dim)),
    )


@borrowing
def expect_unseen(belief: Belief, decision: Decision, course: int, label: int, work: Work) -> None:
    """What the label's scans over the course look like until it is measured, the same for all samples."""
    paths = belief.paths
    for h in range(decision.horizon.poses.shape[1]):
        pose = decision.horizon.poses[course, h]
        expect(decision.sensor, pose, paths.means[label, h], paths.covs[label, h], h, work.unseen, work.scratch)


@inlined
def _take(innovation: Innovation, at: int, decision: Decision, pose: Floats, mean: Floats, work: Work) -> float:
    """Update by the measurement in `work`, into its mean and covariance; returns the log factor on the odds."""
    distance = whiten(innovation, at, work.measurement, decision.sensor.angular, math.inf, work.whitened)
    update_mean(innovation, at, work.whitened, mean, work.mean)
    _copy_matrix(innovation.covs[at], work.cov)
    detection = innovation.prob_detection[at]
    clutter = max(log_clutter_at(decision.sensor, work.measurement, pose), decision.truncation.log_clutter_floor)
    likelihood = innovation.log_norm[at] - 0.5 * distance - clutter
    return log_add(log_miss(detection), log_or_minus_inf(detection) + likelihood)


@inlined
def _copy_matrix(given: Floats, out: Floats) -> None:
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = given[i, j]


@borrowing
def follow(belief: Belief, decision: Decision, course: int, label: int, sample: int, work: Work) -> Followed:
    """Follow a label with a sample over a course, once `expect_unseen` has been called for the two."""
    motion, horizon, target = decision.motion, decision.horizon, belief.targets[label, sample]
    log_odds, missed, measured, first_at_end = 0.0, 0.0, False, False
    for h in range(horizon.poses.shape[1]):
        pose = horizon.poses[course, h]
        if measured:
            predict(motion, horizon.dt, work.mean, work.cov, work.predicted_mean, work.predicted_cov, work.scratch)
            expect(decision.sensor, pose, work.predicted_mean, work.predicted_cov, 0, work.seen, work.scratch)
        detection = work.seen.prob_detection[0] if measured else work.unseen.prob_detection[h]
        missed += log_miss(detection)
        if target >= 0 and ideal_measurement(decision, course, target, h, work.scratch, work.measurement):
            if measured:
                log_odds += _take(work.seen, 0, decision, pose, work.predicted_mean, work)
            else:
                log_odds += _take(work.unseen, h, decision, pose, belief.paths.means[label, h], work)
                first_at_end = h == horizon.poses.shape[1] - 1
            measured = True
            continue
        log_odds += log_miss(detection)
        if measured:
            for j in range(len(work.mean)):
                work.mean[j] = work.predicted_mean[j]
            _copy_matrix(work.predicted_cov, work.cov)
    return Followed(log_odds, missed, measured, first_at_end)


@kernel
def rows_without_scans(means: Floats, covs: Floats, logits: Floats, references: Floats) -> Floats:
    """(num, bernoulli_size) Bernoulli rows of labels of one Gaussian each; certain ones as all but that."""
    num, dim = means.shape
    rows, factor, inverse = np.empty((num, bernoulli_size(dim))), np.empty((dim, dim)), np.empty((dim, dim))
    for i in range(num):
        if not to_information(means[i], covs[i], references[i], 1.0, rows[i], factor, inverse):
            raise NumericalError("prediction: covariance of a track is not positive definite")
        rows[i, -2] = min(max(logits[i], -ALL_BUT_CERTAIN), ALL_BUT_CERTAIN)
        rows[i, -1] = 0.0
    return rows


@inlined
def _write_row(mean: Floats, cov: Floats, reference: Floats, row: Floats, work: Work) -> None:
    if not to_information(mean, cov, reference, 1.0, row, work.factor, work.inverse):
        raise NumericalError("pseudo-update: covariance of a track is not positive definite")


@kernel
def fill_changes(
    belief: Belief,
    decision: Decision,
    entries: Entries,
    references: Floats,
    bases: Floats,
    first: int,
    last: int,
    changes: Floats,
) -> None:
    """Changes (num_entries, bernoulli_size, num_samples) of the Bernoulli rows, for courses `first:last` of a sensor.

    references: (num_labels, state_dim) about which the rows are taken. bases: (num_labels, bernoulli_size) the sensor's
    rows without scans. Both in the order of the sensor's own labels.
    """
    dim, num_samples, steps = references.shape[1], belief.targets.shape[1], decision.horizon.poses.shape[1]
    work, size = make_known_work(dim, len(decision.sensor.angular), steps), bases.shape[1]
    at_end, row = np.empty(size), np.empty(size)
    for course in range(first, last):
        for entry in range(entries.first[course], entries.last[course]):
            label = entries.own[entry]
            expect_unseen(belief, decision, course, label, work)
            _write_row(
                belief.paths.means[label, steps - 1], work.unseen.covs[steps - 1], references[label], at_end, work
            )
            for sample in range(num_samples):
                found = follow(belief, decision, course, label, sample, work)
                if not found.measured:
                    row[:] = 0.0
                else:
                    if found.first_at_end:
                        move_row(at_end, belief.paths.means[label, steps - 1], work.mean, references[label], row)
                    else:
                        _write_row(work.mean, work.cov, references[label], row, work)
                    for k in range(size - 2):
                        row[k] -= bases[label, k]
                row[size - 2], row[size - 1] = found.log_odds, found.log_miss
                for k in range(size):
                    changes[entry, k, sample] = row[k]


@kernel
def pseudo_update_known(belief: Belief, decision: Decision, first: int, last: int, results: LmbResults) -> None:
    """Densities of courses `first:last` of one sensor, for every sample: case `course * num_samples + sample`."""
    tracks, paths, steps = belief.prior.tracks, belief.paths, decision.horizon.poses.shape[1]
    num_samples = belief.targets.shape[1]
    work = make_known_work(tracks.means.shape[1], len(decision.sensor.angular), steps)
    for course in range(first, last):
        for label in range(len(tracks.labels)):
            expect_unseen(belief, decision, course, label, work)
            for sample in range(num_samples):
                found, case = follow(belief, decision, course, label, sample, work), course * num_samples + sample
                results.logits[case, label] = belief.prior.existence_logit[label] + found.log_odds
                mean = work.mean if found.measured else paths.means[label, steps - 1]
                cov = work.cov if found.measured else paths.covs[label, steps - 1]
                for j in range(len(mean)):
                    results.means[case, label, j] = mean[j]
                _copy_matrix(cov, results.covs[case, label])
