"""Pseudo-updates and reward tables of a planning decision (paper, Algorithms 2 and 3), with the filters' own kernels.

A case is one action of one sensor with one sample; case `action * num_samples + sample`. Every case keeps all label sets
of the sensor's prior (labels, for an LMB), so that all cases and the prediction are compared on one support.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vedette.errors import NumericalError
from vedette.kernels.arrays import filled_ints
from vedette.kernels.compile import kernel
from vedette.kernels.conversions import marginalise
from vedette.kernels.fused_divergence import Cases, Prediction, fused_glmb_divergence, fused_lmb_divergence
from vedette.kernels.gaussian import make_scratch, predict
from vedette.kernels.glmb import finish_step, prepare_rows
from vedette.kernels.ideal import Futures, ideal_scan
from vedette.kernels.information import to_information
from vedette.kernels.lmb import Reduction, finish_lmb, weigh_by_existence
from vedette.kernels.mixtures import copy_component, match_components
from vedette.kernels.truncation import Truncation
from vedette.kernels.types import Floats, Glmb, Ints, Lmb, Motion, Sensor


class Horizon(NamedTuple):
    """poses: (num_actions, horizon_steps, 3) where each action takes the sensor. dt: seconds a step.
    mode, threshold: of the ideal measurements.
    """

    poses: Floats
    dt: float
    mode: int
    threshold: float


@kernel
def predict_tracks(motion: Motion, dt: float, num_steps: int, means: Floats, covs: Floats) -> tuple[Floats, Floats]:
    """Each Gaussian after `num_steps` predictions, without birth or death."""
    new_means, new_covs = np.empty_like(means), np.empty_like(covs)
    dim = means.shape[1]
    scratch = make_scratch(dim, dim)
    old_means, old_covs = np.empty((1, dim)), np.empty((1, dim, dim))
    for c in range(len(means)):
        copy_component(means, covs, c, new_means, new_covs, c)
        for _ in range(num_steps):
            copy_component(new_means, new_covs, c, old_means, old_covs, 0)
            predict(motion, dt, old_means[0], old_covs[0], new_means[c], new_covs[c], scratch)
    return new_means, new_covs


@kernel
def pseudo_update_glmb(
    prior: Glmb, groups: Ints, no_birth: Lmb, motion: Motion, sensor: Sensor, horizon: Horizon, futures: Futures,
    truncation: Truncation, first: int, last: int, set_offsets: Ints, log_weights: Floats, means: Floats, covs: Floats,
) -> None:
    """Cases `first:last` of one sensor. Writes log_weights (num_cases, num_sets) and the single Gaussian of each member,
    means (num_cases, num_members, dim) and covs; members `set_offsets[g]:set_offsets[g + 1]` are the labels of set `g`.
    """
    scratch = make_scratch(prior.tracks.means.shape[1], len(sensor.angular))
    num_samples = len(futures.offsets) - 1
    most = 0
    for sample in range(num_samples):
        most = max(most, futures.offsets[sample + 1] - futures.offsets[sample])
    scan = np.empty((most, len(sensor.angular)))
    first_rows = prepare_rows(prior.tracks, no_birth, horizon.poses[0, 0], horizon.dt, motion, sensor, scratch)
    prepared_action = 0
    for case in range(first, last):
        action, sample = case // num_samples, case % num_samples
        belief, belief_groups = prior, groups
        for step in range(horizon.poses.shape[1]):
            pose = horizon.poses[action, step]
            num = ideal_scan(sensor, pose, futures, sample, step, horizon.mode, horizon.threshold, scan)
            rows = first_rows
            if step > 0 or action != prepared_action:
                rows = prepare_rows(belief.tracks, no_birth, pose, horizon.dt, motion, sensor, scratch)
            if step == 0:
                # The first prediction is the same for every sample of an action.
                first_rows, prepared_action = rows, action
            belief, parents, _ = finish_step(belief, 0, rows, scan[:num], pose, sensor, truncation, belief_groups)
            if len(parents) == 0:
                raise NumericalError("pseudo-update: no hypothesis has positive weight; do the models forbid the ideal scan?")
            inherited = np.empty(len(parents), np.int64)
            for h in range(len(parents)):
                inherited[h] = belief_groups[parents[h]]
            belief_groups = inherited
        _write_marginal(belief, belief_groups, set_offsets, log_weights[case], means[case], covs[case])


@kernel
def _write_marginal(
    belief: Glmb, groups: Ints, set_offsets: Ints, log_weights: Floats, means: Floats, covs: Floats
) -> None:
    """Marginalise to one Gaussian a (label set, label) and store it in the place of its label set."""
    marginal = marginalise(belief, -math.inf, 0.0, 1)
    for at in range(len(log_weights)):
        log_weights[at] = -math.inf
    found = filled_ints(len(log_weights), 0)
    next_set = 0
    for h in range(len(groups)):
        # Hypotheses and marginal sets both come by descending weight of the set only after marginalising: match by labels.
        group = groups[h]
        if found[group]:
            continue
        found[group] = 1
        next_set = _find_set(marginal, belief, h)
        log_weights[group] = marginal.hyp_log_weights[next_set]
        start = marginal.hyp_offsets[next_set]
        for k in range(set_offsets[group + 1] - set_offsets[group]):
            track = marginal.hyp_tracks[start + k]
            copy_component(marginal.tracks.means, marginal.tracks.covs, track, means, covs, set_offsets[group] + k)


@kernel
def _find_set(marginal: Glmb, belief: Glmb, hyp: int) -> int:
    """Hypothesis of `marginal` with the label set of hypothesis `hyp` of `belief`."""
    start, size = belief.hyp_offsets[hyp], belief.hyp_offsets[hyp + 1] - belief.hyp_offsets[hyp]
    for candidate in range(len(marginal.hyp_log_weights)):
        at = marginal.hyp_offsets[candidate]
        if marginal.hyp_offsets[candidate + 1] - at != size:
            continue
        same = True
        for k in range(size):
            a, b = belief.hyp_tracks[start + k], marginal.hyp_tracks[at + k]
            for part in range(2):
                same &= belief.tracks.labels[a, part] == marginal.tracks.labels[b, part]
        if same:
            return candidate
    return -1


@kernel
def pseudo_update_lmb(
    prior: Lmb, no_birth: Lmb, motion: Motion, sensor: Sensor, horizon: Horizon, futures: Futures,
    truncation: Truncation, reduction: Reduction, first: int, last: int, logits: Floats, means: Floats, covs: Floats,
) -> None:
    """Cases `first:last` of one sensor. Writes existence logits (num_cases, num_labels) and single Gaussians."""
    scratch = make_scratch(prior.tracks.means.shape[1], len(sensor.angular))
    num_samples = len(futures.offsets) - 1
    most = 0
    for sample in range(num_samples):
        most = max(most, futures.offsets[sample + 1] - futures.offsets[sample])
    scan = np.empty((most, len(sensor.angular)))
    first_rows = prepare_rows(prior.tracks, no_birth, horizon.poses[0, 0], horizon.dt, motion, sensor, scratch)
    weigh_by_existence(prior.existence_logit, first_rows)
    prepared_action = 0
    for case in range(first, last):
        action, sample = case // num_samples, case % num_samples
        belief = prior
        for step in range(horizon.poses.shape[1]):
            pose = horizon.poses[action, step]
            num = ideal_scan(sensor, pose, futures, sample, step, horizon.mode, horizon.threshold, scan)
            rows = first_rows
            if step > 0 or action != prepared_action:
                rows = prepare_rows(belief.tracks, no_birth, pose, horizon.dt, motion, sensor, scratch)
                weigh_by_existence(belief.existence_logit, rows)
            if step == 0:
                first_rows, prepared_action = rows, action
            belief, report = finish_lmb(rows, scan[:num], pose, sensor, truncation, reduction)
            if report.log_total == -math.inf:
                raise NumericalError("pseudo-update: no association has positive weight; do the models forbid the ideal scan?")
        for i in range(len(belief.existence_logit)):
            logits[case, i] = belief.existence_logit[i]
            copy_component(belief.tracks.means, belief.tracks.covs, i, means[case], covs[case], i)


@kernel
def write_rows(
    first: int, last: int, known: Ints, means: Floats, covs: Floats, references: Floats, power: float, rows: Floats
) -> None:
    """Information rows of cases `first:last`, scaled by the sensor's weight; zeros where `known` is 0."""
    dim = means.shape[2]
    factor, precision = np.empty((dim, dim)), np.empty((dim, dim))
    for case in range(first, last):
        for m in range(means.shape[1]):
            if known[m] == 0:
                for k in range(rows.shape[2]):
                    rows[case, m, k] = 0.0
            elif not to_information(means[case, m], covs[case, m], references[m], power, rows[case, m], factor, precision):
                raise NumericalError("covariance of a pseudo-updated track is not positive definite")


@kernel
def fill_missing(
    log_weights: Floats, means: Floats, covs: Floats, source_members: Ints, source_sets: Ints, source_offsets: Ints,
    missing_sets: Ints, floor: float, first: int, last: int,
) -> None:
    """Stand-ins in cases `first:last` for label sets that the sensor lacks, as in `vedette.fusion.CmDeltaGlmb`.

    missing_sets: the sets lacking; their weight becomes the least of `floor` and the weights that are there. The Gaussian of
    member `m` is matched to those of members `source_members[source_offsets[m]:source_offsets[m + 1]]` weighted by their
    sets `source_sets`; a member without sources is left as it is.
    """
    most = 0
    for m in range(len(source_offsets) - 1):
        most = max(most, source_offsets[m + 1] - source_offsets[m])
    shares = np.empty(most)
    for case in range(first, last):
        peak, least = -math.inf, floor
        for weight in log_weights[case]:
            peak = max(peak, weight)
            if weight > -math.inf:
                least = min(least, weight)
        for m in range(len(source_offsets) - 1):
            low, high = source_offsets[m], source_offsets[m + 1]
            for i in range(low, high):
                shares[i - low] = math.exp(log_weights[case, source_sets[i]] - peak)
            if high > low:
                match_components(
                    source_members[low:high], shares, high - low, means[case], covs[case], means[case, m], covs[case, m]
                )
        for at in missing_sets:
            log_weights[case, at] = least


@kernel
def reward_table(
    cases: Cases, first_cases: Ints, actions: Ints, num_samples: int, prediction: Prediction, dim: int,
    log_unit_volume: float, is_lmb: bool, first: int, last: int, rewards: Floats,
) -> None:
    """Rewards (num_joint, num_samples) of joint actions `first:last`.

    actions: (num_joint, num_sensors) one action of each sensor. first_cases: (num_sensors,) its first case.
    """
    num_sensors = actions.shape[1]
    chosen = np.empty(num_sensors, np.int64)
    work = np.empty((2, cases.rows.shape[2]))
    for joint in range(first, last):
        for sample in range(num_samples):
            for s in range(num_sensors):
                chosen[s] = first_cases[s] + actions[joint, s] * num_samples + sample
            if is_lmb:
                rewards[joint, sample] = fused_lmb_divergence(cases, chosen, prediction, dim, log_unit_volume, work)
            else:
                rewards[joint, sample] = fused_glmb_divergence(cases, chosen, prediction, dim, log_unit_volume, work)
