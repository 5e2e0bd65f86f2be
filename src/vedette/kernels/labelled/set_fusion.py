"""GCI of marginalised GLMBs, label set by label set, or of products of them, group by group of their labels."""

import math
from typing import NamedTuple

import numpy as np

from vedette.errors import NumericalError
from vedette.kernels.base.arrays import group_members
from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import FactoredGlmb, Floats, Glmb, Ints
from vedette.kernels.gaussian.mixtures import descending_order
from vedette.kernels.gaussian.reduction import MixtureCaps
from vedette.kernels.labelled.conversions import marginalise_sets
from vedette.kernels.labelled.gci import PowerRule, fused_tracks
from vedette.kernels.labelled.groups import group_log_sums
from vedette.kernels.labelled.labels import group_by_label_set
from vedette.kernels.labelled.set_alignment import Aligned, Sets, aligned_sets, label_existence
from vedette.kernels.labelled.stacking import taken_tracks

# Existence from which a label counts as sure at a sensor, and below which it counts as lost in the fusion.
SURE, LOST = 0.9, 0.5


class SetRule(NamedTuple):
    """Parameters of the fusion of label sets, see `CmDeltaGlmb`."""

    weights: Floats  # (num_sensors,) positive
    missing_log_weight: float
    power: PowerRule
    max_hypotheses: int  # of each group


class SetReport(NamedTuple):
    """Repairs and truncations of a fusion, see `FusionInfo`."""

    missing_sets: Ints  # (num_sensors,)
    missing_labels: Ints  # (num_sensors,)
    num_sets: int
    num_lost_labels: int
    empty_intersection: bool  # of some group
    log_normaliser: float
    log_kept: float  # log of the product over groups of the kept share of the weight


@kernel
def fuse_glmbs(stack: Glmb, sensor_of: Ints, rule: SetRule) -> tuple[Glmb, SetReport]:
    """Fuse GLMBs, delta or marginalised. stack: of all sensors. sensor_of: (num_hyps,), increasing."""
    density, report = fuse_sets(_marginalised(stack, sensor_of, len(rule.weights), rule.power.caps), 1, rule)
    return Glmb(density.tracks, density.hyp_offsets, density.hyp_tracks, density.hyp_log_weights), report


@kernel
def _marginalised(stack: Glmb, sensor_of: Ints, num_sensors: int, caps: MixtureCaps) -> Sets:
    """Return the label sets of each sensor of positive weight, sensor by sensor, heaviest first."""
    set_of, first = group_by_label_set(stack)
    number = np.full((len(first), num_sensors), -1, np.int64)
    own_set, own_first, num = np.empty(len(set_of), np.int64), np.empty(len(set_of), np.int64), 0
    for h in range(len(set_of)):
        if number[set_of[h], sensor_of[h]] < 0:
            number[set_of[h], sensor_of[h]], own_first[num] = num, h
            num += 1
        own_set[h] = number[set_of[h], sensor_of[h]]
    marginal, order = marginalise_sets(stack, own_set, own_first[:num], caps)
    sensors = np.empty(num, np.int64)
    for k in range(num):
        sensors[k] = sensor_of[own_first[order[k]]]
    _, by_sensor = group_members(sensors, num_sensors)
    offsets, log_weights = np.zeros(num + 1, np.int64), np.empty(num)
    members, kept = np.empty(len(marginal.hyp_tracks), np.int64), 0
    for k in by_sensor:
        if marginal.hyp_log_weights[k] == -math.inf:
            continue
        sensors_of_k, end = sensors[k], offsets[kept]
        for e in range(marginal.hyp_offsets[k], marginal.hyp_offsets[k + 1]):
            members[end] = marginal.hyp_tracks[e]
            end += 1
        log_weights[kept], own_set[kept] = marginal.hyp_log_weights[k], sensors_of_k
        kept += 1
        offsets[kept] = end
    hyps = Glmb(marginal.tracks, offsets[: kept + 1], members[: offsets[kept]], log_weights[:kept])
    return Sets(hyps, own_set[:kept], np.zeros(kept, np.int64))


@kernel
def fuse_sets(sets: Sets, num_groups: int, rule: SetRule) -> tuple[FactoredGlmb, SetReport]:
    """Fuse marginalised GLMBs, one factor per group. No set may have weight 0, no sensor's factor may cross groups."""
    num_sensors = len(rule.weights)
    aligned = aligned_sets(sets, num_sensors, num_groups, rule.missing_log_weight, rule.power.caps)
    weights = np.ones((len(aligned.labels), 1)) * rule.weights
    fused, log_overlaps = fused_tracks(aligned.labels, aligned.chosen, weights, aligned.tracks, rule.power)
    log_weights = _log_set_weights(aligned, rule.weights, log_overlaps)
    log_normalisers = group_log_sums(log_weights, aligned.groups, num_groups)
    taken = _heaviest(aligned, log_weights, num_groups, rule.max_hypotheses)
    entries = np.arange(len(taken.members))
    density = FactoredGlmb(
        taken_tracks(fused, taken.members),
        taken.hyp_offsets[taken.factor_offsets],
        taken.hyp_offsets,
        entries,
        taken.hyp_log_weights,
        taken.factor_offsets,
    )
    return density, _report(aligned, log_weights, log_normalisers, taken.log_kept)


@kernel
def _report(aligned: Aligned, log_weights: Floats, log_normalisers: Floats, log_kept: float) -> SetReport:
    (num, num_sensors), groups = aligned.held.shape, aligned.groups
    in_common, missing_sets = np.zeros(len(log_normalisers), np.bool_), np.zeros(num_sensors, np.int64)
    normalised, own = np.empty(num), aligned.log_weights.copy()
    for k in range(num):
        num_holding = 0
        normalised[k] = log_weights[k] - log_normalisers[groups[k]]
        for s in range(num_sensors):
            if aligned.held[k, s]:
                num_holding += 1
            else:
                own[k, s] = -math.inf
                missing_sets[s] += 1
        in_common[groups[k]] |= num_holding == num_sensors
    lost = _num_lost(aligned, own, normalised)
    missing_labels, log_normaliser = aligned.num_missing_labels, log_normalisers.sum()
    return SetReport(missing_sets, missing_labels, num, lost, not in_common.all(), log_normaliser, log_kept)


@kernel
def _log_set_weights(aligned: Aligned, weights: Floats, log_overlaps: Floats) -> Floats:
    """Log of the integral of the product of the powers, shape (num_sets,)."""
    out = np.zeros(len(aligned.groups))
    for k in range(len(out)):
        overlaps = 0.0
        for member in range(aligned.offsets[k], aligned.offsets[k + 1]):
            overlaps += log_overlaps[member]
        for s in range(len(weights)):
            out[k] += aligned.log_weights[k, s] * weights[s]
        out[k] += overlaps
    return out


@kernel
def _num_lost(aligned: Aligned, log_own: Floats, log_fused: Floats) -> int:
    """Return the number of labels that a sensor is sure of and the fused density has lost."""
    fused, sure, lost = label_existence(aligned, log_fused), np.zeros(aligned.num_labels, np.bool_), 0
    for s in range(log_own.shape[1]):
        sure |= label_existence(aligned, log_own[:, s].copy()) >= SURE
    for label in range(aligned.num_labels):
        lost += 1 if sure[label] and fused[label] < LOST else 0
    return lost


class _Taken(NamedTuple):
    """The heaviest sets of each group."""

    members: Ints  # of the alignment
    hyp_offsets: Ints
    hyp_log_weights: Floats  # normalised in each group
    factor_offsets: Ints
    log_kept: float  # log of the product over groups of the share of their weight


@kernel
def _heaviest(aligned: Aligned, log_weights: Floats, num_groups: int, most: int) -> _Taken:
    order = descending_order(log_weights)
    starts, ranked = group_members(aligned.groups[order], num_groups)
    relative, is_kept = np.empty(len(order)), np.empty(len(order), np.int64)
    factor_offsets, kept = np.zeros(num_groups + 1, np.int64), np.empty(len(order), np.int64)
    num = 0
    for group in range(num_groups):
        for rank in range(starts[group], starts[group + 1]):
            k, peak = order[ranked[rank]], log_weights[order[ranked[starts[group]]]]
            if peak == -math.inf:
                raise NumericalError(
                    "fusion: expected a label set of positive weight; the sensors' densities share no place"
                )
            # Relative to the heaviest: logs of -1e12 keep their differences.
            relative[k], is_kept[k] = log_weights[k] - peak, 1 if rank - starts[group] < most else 0
            if is_kept[k] == 1:
                kept[num] = k
                num += 1
        factor_offsets[group + 1] = num
    places = aligned.groups + num_groups * (1 - is_kept)
    log_sums, log_kept = group_log_sums(relative, places, 2 * num_groups), 0.0
    for group in range(num_groups):
        log_kept -= math.log1p(math.exp(log_sums[num_groups + group] - log_sums[group]))
    offsets, hyp_log_weights = np.zeros(num + 1, np.int64), np.empty(num)
    for i in range(num):
        offsets[i + 1] = offsets[i] + aligned.offsets[kept[i] + 1] - aligned.offsets[kept[i]]
        hyp_log_weights[i] = relative[kept[i]] - log_sums[aligned.groups[kept[i]]]
    members = np.empty(offsets[num], np.int64)
    for i in range(num):
        for e in range(offsets[i + 1] - offsets[i]):
            members[offsets[i] + e] = aligned.offsets[kept[i]] + e
    return _Taken(members, offsets, hyp_log_weights, factor_offsets, log_kept)
