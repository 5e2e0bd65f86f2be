"""Pseudo-updates with known association: each ideal measurement comes from its own label, or from clutter.

Labels are then independent, no joint associations are ranked, and the cost of a label does not depend on the number of
others. For a label predicted as N(m, P) with existence odds o, an ideal measurement z of the sampled target makes

    odds o (1 - P_D + P_D N(z; h(m), S) / kappa(z)),   density N(m + K (z - h(m)), P - K S K'),

and a scan in which the sampled target is not detected, or absent, odds o (1 - P_D) and an unchanged density. A label is
followed with all samples side by side.
"""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.association.options import log_clutter_at
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.elementary import exponentials, logs, logs_of_one_and
from vedette.kernels.base.types import Bools, Floats
from vedette.kernels.gaussian.scratch import wrap
from vedette.kernels.planning.batched_innovation import expect_batch, relinearise_batch
from vedette.kernels.planning.batched_models import fill_detection, fill_measurements, find_offsets
from vedette.kernels.planning.batched_prediction import (
    BatchedGaussians,
    BatchWork,
    make_batch,
    make_batch_work,
    predict_batch,
)
from vedette.kernels.planning.bernoulli_rows import LEAST_MISS
from vedette.kernels.planning.ideal import IDEAL, SAMPLED, Decision, add_noise
from vedette.kernels.planning.lanes import copy_rows, place, put_state, set_row, subtract_product, take_state
from vedette.kernels.planning.reach import Belief

# Samples followed at a time: their numbers stay in the fastest cache.
MOST_LANES = 64

# Upper limit of the log likelihood relative to a miss: its exponential is a double, and far beyond 1e16.
_LARGEST_EXPONENT = 600.0


class Followed(NamedTuple):
    """The present state of a label for some samples, side by side."""

    means: Floats  # (state_dim, room)
    covs: Floats  # (state_dim (state_dim + 1) / 2, room) lower triangles
    log_odds: Floats  # (room,) factor on the odds of its existence
    log_miss: Floats  # (room,) log probability that no scan detects it
    is_measured: Bools  # (room,) whether some scan has measured it


class Work(NamedTuple):
    """Working arrays in which samples are followed."""

    batch: BatchedGaussians
    own: BatchWork
    targets: Floats  # (state_dim, room) the label's targets; its predicted mean if it is absent
    measurements: Floats  # (meas_dim, room) of the targets, then the whitened residuals
    is_seen: Bools  # (room,) the targets that are measured
    detection: Floats  # (room,) detection probabilities of the targets
    levels: Floats  # (room,) log weights of a detection
    missed: Floats  # (room,) log (1 - P_D)


@kernel
def make_followed(dim: int, room: int) -> Followed:
    covs = np.empty((place(dim, 0), room))
    return Followed(np.empty((dim, room)), covs, np.empty(room), np.empty(room), np.empty(room, np.bool_))


@kernel
def make_follow_work(dim: int, meas_dim: int, room: int) -> Work:
    return Work(
        make_batch(dim, meas_dim, room),
        make_batch_work(dim, meas_dim, room),
        np.empty((dim, room)),
        np.empty((meas_dim, room)),
        np.empty(room, np.bool_),
        np.empty(room),
        np.empty(room),
        np.empty(room),
    )


@inlined
def _take_path(belief: Belief, label: int, step: int, num: int, batch: BatchedGaussians) -> None:
    """Copy the label's predicted path, without any scan, at a step."""
    mean, cov = belief.paths.means[label, step], belief.paths.covs[label, step]
    for i in range(len(mean)):
        for j in range(i + 1):
            set_row(cov[i, j], num, batch.covs[place(i, j)])
        set_row(mean[i], num, batch.means[i])


@borrowing
def _detect(
    belief: Belief, decision: Decision, course: int, label: int, step: int, first: int, num: int, work: Work
) -> int:
    """Write which of the samples' targets are detected, and their ideal measurements. Returns the number detected."""
    sensor, forms, horizon, futures = decision.sensor, decision.forms, decision.horizon, decision.futures
    pose, scratch, offsets, targets = horizon.poses[course, step], work.own.scratch, work.own.offsets, work.targets
    for s in range(num):
        target = belief.targets[label, first + s]
        for j in range(targets.shape[0]):
            targets[j, s] = futures.states[step, target, j] if target >= 0 else work.batch.means[j, s]
    find_offsets(pose, targets, num, offsets)
    fill_detection(sensor, forms, pose, targets, offsets, num, scratch, work.detection)
    count = 0
    for s in range(num):
        target, seen = belief.targets[label, first + s], False
        if target >= 0:
            # The uniforms are the same for all actions, so that actions are compared on common random numbers.
            least = horizon.threshold if horizon.mode == IDEAL else futures.uniforms[step, target]
            seen = work.detection[s] >= least if horizon.mode == IDEAL else work.detection[s] > least
        work.is_seen[s] = seen
        count += 1 if seen else 0
    if count > 0:
        fill_measurements(sensor, forms.measurement, pose, targets, offsets, num, scratch, work.measurements)
    if horizon.mode == SAMPLED:
        for s in range(num):
            if work.is_seen[s]:
                take_state(work.measurements, s, scratch.residual)
                take_state(targets, s, scratch.points[0])
                normals = futures.normals[step, belief.targets[label, first + s]]
                add_noise(sensor, scratch.points[0], pose, normals, scratch, scratch.residual)
                put_state(scratch.residual, s, work.measurements)
    return count


@inlined
def _take_clutter(decision: Decision, pose: Floats, num: int, work: Work) -> None:
    """Write levels = - log clutter intensity at the measurements."""
    measurement = work.own.scratch.residual
    for s in range(num):
        level = 0.0
        if work.is_seen[s]:
            take_state(work.measurements, s, measurement)
            level = max(log_clutter_at(decision.sensor, measurement, pose), decision.truncation.log_clutter_floor)
        work.levels[s] = -level


@inlined
def _whiten(decision: Decision, num: int, work: Work) -> None:
    """Replace measurements by whitened residuals, and add log N(z; h(m), S) to the levels."""
    batch, levels = work.batch, work.levels
    for s in range(num):
        levels[s] += batch.log_norm[s]
    for a in range(batch.predicted.shape[0]):
        residuals, predicted, away = work.measurements[a], batch.predicted[a], 0
        for s in range(num):
            residuals[s] -= predicted[s]
        half = 0.5 * decision.sensor.periods[a]
        if half < math.inf:
            for s in range(num):
                away += 0 if -half < residuals[s] <= half else 1
            if away > 0:
                for s in range(num):
                    residuals[s] = residuals[s] if work.own.bends[s] else wrap(residuals[s], 2.0 * half)
        for k in range(a):
            subtract_product(batch.factor[place(a, k)], work.measurements[k], num, residuals)
        divisors = batch.factor[place(a, a)]
        for s in range(num):
            residuals[s] /= divisors[s]
        for s in range(num):
            levels[s] -= 0.5 * residuals[s] * residuals[s]


@inlined
def _update_odds(num: int, work: Work, out: Followed) -> None:
    """Multiply the odds by the likelihood of the scan.

    log (1 - P_D + P_D N / kappa) = log (1 - P_D) + log (1 + P_D exp(levels - log (1 - P_D))).
    """
    detection, levels, missed, rest = work.batch.prob_detection, work.levels, work.missed, work.detection
    for s in range(num):
        relative = levels[s] - missed[s]
        # Beyond the largest exponent the 1 is negligible.
        kept = min(max(relative, -_LARGEST_EXPONENT), _LARGEST_EXPONENT)
        rest[s] = relative - kept if relative > kept and detection[s] > 0.0 else 0.0
        levels[s] = kept
    exponentials(levels[:num], work.own.offsets.bits)
    for s in range(num):
        levels[s] *= detection[s]
    logs_of_one_and(levels[:num], work.own.offsets.bits, work.own.offsets.more_bits)
    for s in range(num):
        out.log_odds[s] += levels[s] + rest[s] if work.is_seen[s] else 0.0


@inlined
def _update(num: int, work: Work, out: Followed) -> None:
    """Update the predicted means and covariances of the detected samples."""
    batch, seen, dim = work.batch, work.is_seen, out.means.shape[0]
    for i in range(dim):
        means = out.means[i]
        for a in range(batch.predicted.shape[0]):
            whitened, cross = work.measurements[a], batch.whitened_cross[a * dim + i]
            for s in range(num):
                means[s] += cross[s] * whitened[s] if seen[s] else 0.0
    for k in range(out.covs.shape[0]):
        updated, covs = batch.posterior[k], out.covs[k]
        for s in range(num):
            covs[s] = updated[s] if seen[s] else covs[s]
    for s in range(num):
        out.is_measured[s] |= seen[s]


@borrowing
def follow(
    belief: Belief, decision: Decision, course: int, label: int, first: int, num: int, work: Work, out: Followed
) -> None:
    """Follow a label over a course, with `num` samples from `first` on."""
    sensor, forms, horizon, is_path = decision.sensor, decision.forms, decision.horizon, True
    batch, own, missed = work.batch, work.own, work.missed
    for s in range(num):
        out.log_odds[s], out.log_miss[s], out.is_measured[s] = 0.0, 0.0, False
    for step in range(horizon.poses.shape[1]):
        pose = horizon.poses[course, step]
        # Until the first measurement the label is the same in all samples.
        if is_path:
            _take_path(belief, label, step, num, batch)
        else:
            predict_batch(decision.motion, forms, horizon.dt, out.means, out.covs, num, batch, own)
        copy_rows(batch.means, num, out.means)
        copy_rows(batch.covs, num, out.covs)
        if not horizon.scans[course, step]:
            continue
        expect_batch(sensor, forms, pose, num, batch, own)
        for s in range(num):
            missed[s] = max(1.0 - batch.prob_detection[s], LEAST_MISS)
        logs(missed[:num], own.offsets.bits, own.offsets.more_bits)
        for s in range(num):
            out.log_miss[s] += missed[s]
            out.log_odds[s] += missed[s]
        if _detect(belief, decision, course, label, step, first, num, work) > 0:
            _take_clutter(decision, pose, num, work)
            relinearise_batch(sensor, pose, work.measurements, work.is_seen, num, batch, own)
            _whiten(decision, num, work)
            _update_odds(num, work, out)
            _update(num, work, out)
            is_path = False
