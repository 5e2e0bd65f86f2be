"""Versions of a track that have come to say the same are made one, and with them the hypotheses that differ in no more.

Hypotheses that explain a scan differently give a label different tracks; as more is measured, these draw together, and
what told them apart is forgotten. Kept apart they would multiply from scan to scan.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vedette.kernels.base.arrays import counted_ints, filled_ints
from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Floats, Glmb, Ints, Tracks
from vedette.kernels.gaussian.linalg import cholesky, log_sum, solve_lower
from vedette.kernels.gaussian.mixtures import MixtureCaps, descending_order, moment_match
from vedette.kernels.gaussian.pooling import pooled_tracks
from vedette.kernels.labelled.groups import group_log_sums
from vedette.kernels.labelled.splitting import Choices, choices_of, group_choices


class _Moments(NamedTuple):
    """Mean and covariance of every track."""

    means: Floats  # (num_tracks, state_dim)
    covs: Floats  # (num_tracks, state_dim, state_dim)


@kernel
def _moments_of(tracks: Tracks) -> _Moments:
    num, dim = len(tracks.labels), tracks.means.shape[1]
    out = _Moments(np.empty((num, dim)), np.empty((num, dim, dim)))
    for track in range(num):
        first, last = tracks.offsets[track], tracks.offsets[track + 1]
        moment_match(
            tracks.log_weights[first:last],
            tracks.means[first:last],
            tracks.covs[first:last],
            out.means[track],
            out.covs[track],
        )
    return out


@kernel
def _lead_versions(versions: Ints, moments: _Moments, distance: float, leader: Ints) -> int:
    """Lead each of a label's versions, heaviest first, to the first within `distance` of it; how many lead."""
    dim, num_leaders = moments.means.shape[1], 0
    factor, difference = np.empty((dim, dim)), np.empty(dim)
    for i in range(len(versions)):
        heaviest = versions[i]
        if leader[heaviest] >= 0:
            continue
        leader[heaviest] = heaviest
        num_leaders += 1
        if not distance > 0.0 or not cholesky(moments.covs[heaviest], factor):
            continue
        for k in range(i + 1, len(versions)):
            other = versions[k]
            if leader[other] >= 0:
                continue
            for a in range(dim):
                difference[a] = moments.means[other, a] - moments.means[heaviest, a]
            solve_lower(factor, difference, difference)
            squared = 0.0
            for a in range(dim):
                squared += difference[a] * difference[a]
            if squared < distance * distance:
                leader[other] = heaviest
    return num_leaders


@kernel
def _leaders(glmb: Glmb, choices: Choices, weights: Floats, distance: float) -> tuple[Ints, int]:
    """(num_tracks,) the version that each stands for, and how many there are."""
    leader, num_leaders = filled_ints(len(weights), -1), 0
    moments, versions = _moments_of(glmb.tracks), np.empty(len(weights), np.int64)
    for k in range(len(choices.labels)):
        count = 0
        for track in range(len(weights)):
            labels = glmb.tracks.labels
            if labels[track, 0] == choices.labels[k, 0] and labels[track, 1] == choices.labels[k, 1]:
                versions[count] = track
                count += 1
        values = np.empty(count)
        for i in range(count):
            values[i] = weights[versions[i]]
        order = descending_order(values)
        for i in range(count):
            order[i] = versions[order[i]]
        num_leaders += _lead_versions(order, moments, distance, leader)
    return leader, num_leaders


@kernel
def merge_versions(glmb: Glmb, caps: MixtureCaps) -> Glmb:
    """The GLMB with each label's versions that lie within `caps.merge_distance` of a heavier one made one track.

    Distances are of the means, under the heavier one's covariance. A merged track is the mixture of its versions, each
    weighed by all hypotheses that hold it, and reduced; hypotheses that are then equal are one. Heaviest first.
    """
    choices, weights = choices_of(glmb), np.zeros(len(glmb.tracks.labels))
    for h in range(len(choices.weights)):
        for e in range(glmb.hyp_offsets[h], glmb.hyp_offsets[h + 1]):
            weights[glmb.hyp_tracks[e]] += choices.weights[h]
    leader, num_leaders = _leaders(glmb, choices, weights, caps.merge_distance)
    if num_leaders == len(leader):
        return glmb
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
    return Glmb(tracks, offsets, members[:filled].copy(), sorted_weights)


@kernel
def _merged_tracks(
    tracks: Tracks, leader: Ints, num_leaders: int, weights: Floats, caps: MixtureCaps
) -> tuple[Ints, Tracks]:
    """(num_tracks,) the number of each leader's merged track, and these."""
    num, filled, end = len(leader), 0, 0
    number, labels = filled_ints(num, -1), np.empty((num_leaders, 2), np.int64)
    pool_offsets, pool, pooled = np.zeros(num_leaders + 1, np.int64), counted_ints(num), np.empty(num)
    for first in range(num):
        if leader[first] != first:
            continue
        number[first] = filled
        labels[filled, 0], labels[filled, 1] = tracks.labels[first, 0], tracks.labels[first, 1]
        for track in range(num):
            if leader[track] == first:
                pool[end], pooled[end] = track, weights[track]
                end += 1
        filled += 1
        pool_offsets[filled] = end
    return number, pooled_tracks(tracks, labels, pool_offsets, pool[:end].copy(), pooled[:end].copy(), caps)


__all__ = ["merge_versions"]
