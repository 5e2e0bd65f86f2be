"""Merging of nearly equal versions of a track, and of the hypotheses that then no longer differ.

Hypotheses that explain a scan differently give a label different tracks. With more measurements these converge, and
their different origin becomes irrelevant. Without merging they would multiply from scan to scan.
"""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.base.arrays import counted_ints, filled_ints, group_members
from vedette.kernels.base.compile import borrowing, kernel
from vedette.kernels.base.types import Floats, Glmb, Ints, Mixture, Tracks
from vedette.kernels.gaussian.distances import l1_bound
from vedette.kernels.gaussian.linalg import cholesky, log_sum, solve_lower
from vedette.kernels.gaussian.mixtures import descending_order
from vedette.kernels.gaussian.pooling import merged_mixtures, pooled_tracks
from vedette.kernels.gaussian.reduction import MixtureCaps
from vedette.kernels.labelled.groups import group_log_sums
from vedette.kernels.labelled.splitting import Choices, group_choices


class _Pairs(NamedTuple):
    """For each version, a heavier one of its label that it may be merged with, and the cost."""

    costs: Floats  # (num_tracks,) inf if there is none within the distance
    heavier: Ints  # (num_tracks,)


class _Work(NamedTuple):
    """Working arrays for the versions of one label."""

    versions: Ints  # (num_tracks,) heaviest first
    means: Floats  # (num_tracks, state_dim) of each version, and of its variances the inverses and logs
    inverses: Floats
    logs: Floats
    factor: Floats  # (state_dim, state_dim)
    offset: Floats  # (state_dim,)


@kernel
def _make_work(num: int, dim: int) -> _Work:
    return _Work(
        np.empty(num, np.int64),
        np.empty((num, dim)),
        np.empty((num, dim)),
        np.empty((num, dim)),
        np.empty((dim, dim)),
        np.empty(dim),
    )


@borrowing
def _versions_of(labels: Ints, step: int, index: int, weights: Floats, versions: Ints) -> int:
    """Write the tracks of a label, heaviest first, and return their number."""
    count = 0
    for track in range(len(weights)):
        if labels[track, 0] != step or labels[track, 1] != index:
            continue
        slot = count
        while slot > 0 and weights[versions[slot - 1]] < weights[track]:
            versions[slot] = versions[slot - 1]
            slot -= 1
        versions[slot] = track
        count += 1
    return count


@borrowing
def _write_diagonals(count: int, moments: Mixture, work: _Work) -> None:
    """Write the means, inverse variances and log variances of the first `count` versions."""
    for k in range(count):
        version = work.versions[k]
        for a in range(moments.means.shape[1]):
            variance = moments.covs[version, a, a]
            work.means[k, a], work.inverses[k, a] = moments.means[version, a], 1.0 / variance
            work.logs[k, a] = math.log(variance)


@borrowing
def _likeliest_heavier(k: int, weights: Floats, work: _Work) -> int:
    """Return the place of the heavier version with probably the least merging cost for version `k`, -1 for none.

    Uses only diagonals: for near Gaussians the squared L1 distance grows as sum d^2 / P + (log P - log Q)^2 / 2.
    """
    if k == 1:
        return 0
    versions, means, logs, found = work.versions, work.means, work.logs, -1
    least, weight = math.inf, weights[versions[k]]
    for i in range(k):
        gap = 0.0
        for a in range(means.shape[1]):
            offset, ratio = means[k, a] - means[i, a], logs[k, a] - logs[i, a]
            gap += offset * offset * work.inverses[i, a] + 0.5 * ratio * ratio
        # For weights v <= w only w / (v + w) differs between heavier versions.
        share = weights[versions[i]] / (weights[versions[i]] + weight) if weight > 0.0 else 1.0
        if share * share * gap < least:
            least, found = share * share * gap, i
    return found


@borrowing
def _find_pairs(count: int, weights: Floats, moments: Mixture, distance: float, work: _Work, pairs: _Pairs) -> None:
    """Find the pairs of one label, among the first `count` of `work.versions`.

    Merging two versions of weights v and w into their mixture changes the density by at most 2 v w / (v + w) times the
    L1 distance between them: by that much if the version determines the other labels, and not at all if it is
    independent of them.
    """
    dim, factor, offset = moments.means.shape[1], work.factor, work.offset
    if count > 2:
        _write_diagonals(count, moments, work)
    for k in range(1, count):
        place = _likeliest_heavier(k, weights, work)
        if place < 0:
            continue
        other, heavier, squared = work.versions[k], work.versions[place], 0.0
        if not cholesky(moments.covs[heavier], factor):
            continue
        for a in range(dim):
            offset[a] = moments.means[other, a] - moments.means[heavier, a]
        solve_lower(factor, offset, offset)
        for a in range(dim):
            squared += offset[a] * offset[a]
        if squared < distance * distance:
            v, w = weights[other], weights[heavier]
            apart = l1_bound(
                moments.means[other], moments.covs[other], moments.means[heavier], moments.covs[heavier], factor, offset
            )
            pairs.costs[other] = 2.0 * v * w / (v + w) * apart if v > 0.0 else 0.0
            pairs.heavier[other] = heavier


@kernel
def _leaders(glmb: Glmb, labels: Ints, weights: Floats, distance: float, max_error: float) -> tuple[Ints, int]:
    """Version that represents each track, shape (num_tracks,), and the number of such versions.

    labels: (num_labels, 2) of the tracks, each once. Cheapest pairs are merged first, while their costs sum to at most
    `max_error`.
    """
    num, leader = len(weights), counted_ints(len(weights))
    if len(labels) == num:  # every label has one version
        return leader, num
    moments = merged_mixtures(glmb.tracks.components, glmb.tracks.offsets)
    work = _make_work(num, moments.means.shape[1])
    pairs = _Pairs(np.full(num, math.inf), filled_ints(num, -1))
    for k in range(len(labels)):
        count = _versions_of(glmb.tracks.labels, labels[k, 0], labels[k, 1], weights, work.versions)
        _find_pairs(count, weights, moments, distance, work, pairs)
    num_leaders, spent = num, 0.0
    for track in descending_order(-pairs.costs):
        spent += pairs.costs[track]
        if spent > max_error:
            break
        leader[track] = pairs.heavier[track]
        num_leaders -= 1
    for track in range(num):
        while leader[leader[track]] != leader[track]:
            leader[track] = leader[leader[track]]
    return leader, num_leaders


@kernel
def _pooling_error(glmb: Glmb, merged: Tracks, leader: Ints, number: Ints, weights: Floats) -> float:
    """Bound on the L1 change of a density in which each merged track replaces its versions.

    Replacing a track by another, label by label, changes the density by at most the weight of the hypotheses that hold
    it times the distance of the two mixtures, which is at most the mean distance of their components.
    """
    tracks, error, own, pooled = glmb.tracks, 0.0, glmb.tracks.components, merged.components
    dim = pooled.means.shape[1]
    factor, offset, sizes = np.empty((dim, dim)), np.empty(dim), np.zeros(len(leader), np.int64)
    for track in range(len(leader)):
        sizes[leader[track]] += 1
    for track in range(len(leader)):
        if sizes[leader[track]] == 1:
            continue
        place = number[leader[track]]
        for a in range(tracks.offsets[track], tracks.offsets[track + 1]):
            for b in range(merged.offsets[place], merged.offsets[place + 1]):
                share = weights[track] * math.exp(own.log_weights[a] + pooled.log_weights[b])
                apart = l1_bound(own.means[a], own.covs[a], pooled.means[b], pooled.covs[b], factor, offset)
                error += share * apart
    return error


@kernel
def merge_versions(glmb: Glmb, choices: Choices, caps: MixtureCaps, max_error: float) -> tuple[Glmb, Choices, float]:
    """Return the GLMB with merged versions of labels, its choices, and a bound on the L1 change of the density.

    choices: of the given GLMB.

    Only versions within `caps.merge_distance` of a heavier one, under its covariance, are merged, those of the least
    change of the density first, while all changes sum to at most `max_error` before mixtures are reduced. A merged
    track is the mixture of its versions, each weighted by all hypotheses that hold it, and reduced. Hypotheses that are
    then equal are merged. The result is heaviest first.
    """
    if not (caps.merge_distance > 0.0 and max_error > 0.0):
        return glmb, choices, 0.0
    weights = np.zeros(len(glmb.tracks.labels))
    for h in range(len(choices.weights)):
        for e in range(glmb.hyp_offsets[h], glmb.hyp_offsets[h + 1]):
            weights[glmb.hyp_tracks[e]] += choices.weights[h]
    leader, num_leaders = _leaders(glmb, choices.labels, weights, caps.merge_distance, max_error)
    if num_leaders == len(leader):
        return glmb, choices, 0.0
    number, tracks = _merged_tracks(glmb.tracks, leader, num_leaders, weights, caps)
    merged, found = _merged_hypotheses(glmb, choices, tracks, number[leader])
    return merged, found, _pooling_error(glmb, tracks, leader, number, weights)


@kernel
def _merged_hypotheses(glmb: Glmb, choices: Choices, tracks: Tracks, track_of: Ints) -> tuple[Glmb, Choices]:
    """Return the hypotheses over merged tracks, equal ones merged, heaviest first, and their choices.

    track_of: (num_tracks,) merged track of each track.
    """
    num_labels, filled = len(choices.labels), 0
    symbols, groups = np.empty(choices.symbols.shape, np.int64), np.empty(len(choices.weights), np.int64)
    for h in range(len(groups)):
        for k in range(num_labels):
            track = choices.symbols[h, k]
            symbols[h, k] = track_of[track] if track >= 0 else -1
    firsts = group_choices(symbols, filled_ints(num_labels, 0), 0, groups)
    log_weights = group_log_sums(glmb.hyp_log_weights, groups, len(firsts))
    order, log_total = descending_order(log_weights), log_sum(log_weights)
    num = len(order)
    offsets, members = np.zeros(num + 1, np.int64), np.empty(num * num_labels, np.int64)
    sorted_symbols, sorted_logs, weights = np.empty((num, num_labels), np.int64), np.empty(num), np.empty(num)
    for i in range(num):
        for k in range(num_labels):
            track = symbols[firsts[order[i]], k]
            sorted_symbols[i, k] = track
            if track >= 0:
                members[filled] = track
                filled += 1
        offsets[i + 1], sorted_logs[i] = filled, log_weights[order[i]] - log_total
        weights[i] = math.exp(sorted_logs[i])
    merged = Glmb(tracks, offsets, members[:filled].copy(), sorted_logs)
    return merged, Choices(choices.labels, sorted_symbols, weights)


@kernel
def _merged_tracks(
    tracks: Tracks, leader: Ints, num_leaders: int, weights: Floats, caps: MixtureCaps
) -> tuple[Ints, Tracks]:
    """Number of each leader's merged track, shape (num_tracks,), and these tracks."""
    num, filled = len(leader), 0
    number, labels = filled_ints(num, -1), np.empty((num_leaders, 2), np.int64)
    for first in range(num):
        if leader[first] == first:
            number[first] = filled
            labels[filled, 0], labels[filled, 1] = tracks.labels[first, 0], tracks.labels[first, 1]
            filled += 1
    offsets, pool = group_members(number[leader], num_leaders)
    return number, pooled_tracks(tracks, labels, offsets, pool, weights[pool], caps)
