"""Merging of nearly equal versions of a track, and of the hypotheses that then no longer differ.

Hypotheses that explain a scan differently give a label different tracks. With more measurements these converge, and
their different origin becomes irrelevant. Without merging they would multiply from scan to scan.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.base.arrays import counted_ints, filled_ints, group_members
from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Floats, Glmb, Ints, Tracks
from vedette.kernels.gaussian.distances import l1_bound
from vedette.kernels.gaussian.linalg import cholesky, log_sum, solve_lower
from vedette.kernels.gaussian.mixtures import descending_order
from vedette.kernels.gaussian.pooling import Moments, moments_of, pooled_tracks
from vedette.kernels.gaussian.reduction import MixtureCaps
from vedette.kernels.labelled.groups import group_log_sums
from vedette.kernels.labelled.splitting import Choices, choices_of, group_choices


class _Pairs(NamedTuple):
    """For each version, a heavier one of its label that it may be merged with, and the cost."""

    costs: Floats  # (num_tracks,) inf if there is none within the distance
    heavier: Ints  # (num_tracks,)


@kernel
def _likeliest_heavier(versions: Ints, weights: Floats, moments: Moments) -> Ints:
    """Place of the heavier version with probably the least merging cost, -1 for none, shape (num_versions,).

    Uses only diagonals: for near Gaussians the squared L1 distance grows as sum d^2 / P + (log P - log Q)^2 / 2.
    """
    num, dim = len(versions), moments.means.shape[1]
    means, inverses, logs = np.empty((num, dim)), np.empty((num, dim)), np.empty((num, dim))
    for k in range(num):
        for a in range(dim):
            variance = moments.covs[versions[k], a, a]
            means[k, a], inverses[k, a], logs[k, a] = moments.means[versions[k], a], 1.0 / variance, math.log(variance)
    found = filled_ints(num, -1)
    for k in range(1, num):
        least, weight = math.inf, weights[versions[k]]
        for i in range(k):
            gap = 0.0
            for a in range(dim):
                offset, ratio = means[k, a] - means[i, a], logs[k, a] - logs[i, a]
                gap += offset * offset * inverses[i, a] + 0.5 * ratio * ratio
            # For weights v <= w only w / (v + w) differs between heavier versions.
            share = weights[versions[i]] / (weights[versions[i]] + weight) if weight > 0.0 else 1.0
            if share * share * gap < least:
                least, found[k] = share * share * gap, i
    return found


@kernel
def _find_pairs(versions: Ints, weights: Floats, moments: Moments, distance: float, pairs: _Pairs) -> None:
    """Find the pairs of one label. versions: heaviest first.

    Merging two versions of weights v and w into their mixture changes the density by at most 2 v w / (v + w) times the
    L1 distance between them: by that much if the version determines the other labels, and not at all if it is
    independent of them.
    """
    dim, places = moments.means.shape[1], _likeliest_heavier(versions, weights, moments)
    factor, offset = np.empty((dim, dim)), np.empty(dim)
    for k in range(1, len(versions)):
        if places[k] < 0:
            continue
        other, heavier, squared = versions[k], versions[places[k]], 0.0
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
def _leaders(glmb: Glmb, choices: Choices, weights: Floats, distance: float, max_error: float) -> tuple[Ints, int]:
    """Version that represents each track, shape (num_tracks,), and the number of such versions.

    Cheapest pairs are merged first, while their costs sum to at most `max_error`.
    """
    moments, versions, labels = (
        moments_of(glmb.tracks, 0, len(weights)),
        np.empty(len(weights), np.int64),
        glmb.tracks.labels,
    )
    pairs = _Pairs(np.full(len(weights), math.inf), filled_ints(len(weights), -1))
    for k in range(len(choices.labels)):
        count = 0
        for track in range(len(weights)):
            if labels[track, 0] == choices.labels[k, 0] and labels[track, 1] == choices.labels[k, 1]:
                versions[count] = track
                count += 1
        order = descending_order(weights[versions[:count]])
        _find_pairs(versions[:count][order], weights, moments, distance, pairs)
    leader, num_leaders, spent = counted_ints(len(weights)), len(weights), 0.0
    for track in descending_order(-pairs.costs):
        spent += pairs.costs[track]
        if spent > max_error:
            break
        leader[track] = pairs.heavier[track]
        num_leaders -= 1
    for track in range(len(leader)):
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
    track is the mixture of its versions, each weighted by all hypotheses that hold it, and reduced; hypotheses that are
    then equal are merged. The result is heaviest first.
    """
    if not (caps.merge_distance > 0.0 and max_error > 0.0):
        return glmb, choices, 0.0
    weights = np.zeros(len(glmb.tracks.labels))
    for h in range(len(choices.weights)):
        for e in range(glmb.hyp_offsets[h], glmb.hyp_offsets[h + 1]):
            weights[glmb.hyp_tracks[e]] += choices.weights[h]
    leader, num_leaders = _leaders(glmb, choices, weights, caps.merge_distance, max_error)
    if num_leaders == len(leader):
        return glmb, choices, 0.0
    number, tracks = _merged_tracks(glmb.tracks, leader, num_leaders, weights, caps)
    num_labels, filled = len(choices.labels), 0
    symbols, groups = np.empty(choices.symbols.shape, np.int64), np.empty(len(choices.weights), np.int64)
    for h in range(len(groups)):
        for k in range(num_labels):
            track = choices.symbols[h, k]
            symbols[h, k] = number[leader[track]] if track >= 0 else -1
    firsts = group_choices(symbols, filled_ints(num_labels, 0), 0, groups)
    log_weights = group_log_sums(glmb.hyp_log_weights, groups, len(firsts))
    order, log_total = descending_order(log_weights), log_sum(log_weights)
    offsets, members = np.zeros(len(order) + 1, np.int64), np.empty(len(order) * num_labels, np.int64)
    sorted_weights = np.empty(len(order))
    for i in range(len(order)):
        for k in range(num_labels):
            if symbols[firsts[order[i]], k] >= 0:
                members[filled] = symbols[firsts[order[i]], k]
                filled += 1
        offsets[i + 1], sorted_weights[i] = filled, log_weights[order[i]] - log_total
    error = _pooling_error(glmb, tracks, leader, number, weights)
    merged = Glmb(tracks, offsets, members[:filled].copy(), sorted_weights)
    return merged, choices_of(merged), error


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
