"""Conversions between labelled densities: delta-GLMB to marginalised GLMB and to LMB, products to GLMB."""

import math

import numpy as np

from vedette.kernels.base.arrays import group_members
from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import FactoredGlmb, Floats, Glmb, Ints, Lmb
from vedette.kernels.gaussian.linalg import log_sum
from vedette.kernels.gaussian.mixtures import descending_order
from vedette.kernels.gaussian.pooling import add_to_pool, pooled_tracks
from vedette.kernels.gaussian.reduction import MixtureCaps
from vedette.kernels.labelled.labels import group_by_label_set, increasing_labels, label_place
from vedette.kernels.labelled.subsets import smallest_sums


@kernel
def _set_weights(glmb: Glmb, group_of: Ints, num_sets: int) -> tuple[Floats, Floats]:
    """Log weight of each label set, (num_sets,), and linear weights relative to the set's heaviest, (num_hyps,)."""
    peaks, sums = np.full(num_sets, -math.inf), np.zeros(num_sets)
    relative = np.zeros(len(group_of))
    for h in range(len(group_of)):
        peaks[group_of[h]] = max(peaks[group_of[h]], glmb.hyp_log_weights[h])
    for h in range(len(group_of)):
        if glmb.hyp_log_weights[h] > -math.inf:
            relative[h] = math.exp(glmb.hyp_log_weights[h] - peaks[group_of[h]])
            sums[group_of[h]] += relative[h]
    for s in range(num_sets):
        if peaks[s] > -math.inf:
            peaks[s] += math.log(sums[s])
    return peaks, relative


@kernel
def marginalise(glmb: Glmb, caps: MixtureCaps) -> Glmb:
    """Return the marginalised GLMB: one hypothesis per label set, over all association histories (paper eq. 10).

    Each track of a label set is the mixture of that label's tracks in the set's hypotheses, weighted by them, and
    reduced under the caps. With `max_components` 1 it is one Gaussian of the mixture's moments. Each (label set, label)
    has its own entry in the track table, in the order of the hypotheses. Hypotheses are in order of descending weight,
    equal weights in the order of their first occurrence. A label set of weight zero is kept.
    """
    group_of, first = group_by_label_set(glmb)
    return marginalise_sets(glmb, group_of, first, caps)[0]


@kernel
def marginalise_sets(glmb: Glmb, group_of: Ints, first: Ints, caps: MixtureCaps) -> tuple[Glmb, Ints]:
    """Marginalise hypotheses with given numbers of label sets, and also return the set of each resulting hypothesis.

    group_of: (num_hyps,) number of each hypothesis's label set. first: (num_sets,) the first hypothesis of each set.
    """
    num_sets, num_entries = len(first), len(glmb.hyp_tracks)
    set_log_weights, relative = _set_weights(glmb, group_of, num_sets)
    order = descending_order(set_log_weights)
    member_offsets, members = group_members(group_of, num_sets)
    hyp_offsets, hyp_log_weights = np.zeros(num_sets + 1, np.int64), np.empty(num_sets)
    for s in range(num_sets):
        hyp_offsets[s + 1] = hyp_offsets[s] + glmb.hyp_offsets[first[order[s]] + 1] - glmb.hyp_offsets[first[order[s]]]
        hyp_log_weights[s] = set_log_weights[order[s]]
    num_tracks = hyp_offsets[num_sets]
    labels, pool_offsets = np.empty((num_tracks, 2), np.int64), np.zeros(num_tracks + 1, np.int64)
    pool, weights = np.empty(num_entries, np.int64), np.empty(num_entries)
    slot_of, i = np.full(len(glmb.tracks.labels), -1, np.int64), 0
    for s in range(num_sets):
        low, high = member_offsets[order[s]], member_offsets[order[s] + 1]
        for k in range(hyp_offsets[s + 1] - hyp_offsets[s]):
            end = pool_offsets[i]
            for m in range(low, high):
                track = glmb.hyp_tracks[glmb.hyp_offsets[members[m]] + k]
                end = add_to_pool(track, relative[members[m]], slot_of, pool, weights, end)
            for p in range(pool_offsets[i], end):
                slot_of[pool[p]] = -1
            labels[i, 0] = glmb.tracks.labels[pool[end - 1], 0]
            labels[i, 1] = glmb.tracks.labels[pool[end - 1], 1]
            i += 1
            pool_offsets[i] = end
    tracks = pooled_tracks(glmb.tracks, labels, pool_offsets, pool, weights, caps)
    return Glmb(tracks, hyp_offsets, np.arange(num_tracks), hyp_log_weights), order


@kernel
def _log_sum_where(log_weights: Floats, mark: Ints, low: int, high: int, value: int, equal: bool) -> float:
    """Return the log-sum-exp over the places of `low:high` with mark `value`, or over the other places."""
    peak, total = -math.inf, 0.0
    for h in range(low, high):
        if (mark[h] == value) == equal:
            peak = max(peak, log_weights[h])
    if peak == -math.inf:
        return peak
    for h in range(low, high):
        if (mark[h] == value) == equal:
            total += math.exp(log_weights[h] - peak)
    return peak + math.log(total)


@kernel
def glmb_to_lmb(glmb: Glmb, caps: MixtureCaps) -> Lmb:
    """Return the LMB of the same existence probabilities and, up to mixture reduction, the same track densities.

    Reuter, Vo, Vo and Dietmayer 2014, "The labeled multi-Bernoulli filter", eq. 43-45. The logit of existence is the
    difference of the log weights with and without the label, so that no precision is lost near existence 1. A label
    whose hypotheses all have weight zero keeps logit -inf and the plain mean of its tracks.
    """
    labels, num_entries = increasing_labels(glmb), len(glmb.hyp_tracks)
    num_labels, label_of = len(labels), np.empty(num_entries, np.int64)
    for e in range(num_entries):
        step, index = glmb.tracks.labels[glmb.hyp_tracks[e], 0], glmb.tracks.labels[glmb.hyp_tracks[e], 1]
        label_of[e] = label_place(labels, num_labels, step, index)
    firsts, ends = np.zeros(num_labels, np.int64), np.full(num_labels, len(glmb.hyp_log_weights))
    return factors_to_lmb(glmb, labels, label_of, firsts, ends, caps)


@kernel
def factors_to_lmb(glmb: Glmb, labels: Ints, label_of: Ints, firsts: Ints, ends: Ints, caps: MixtureCaps) -> Lmb:
    """Apply `glmb_to_lmb` to densities over disjoint labels, with concatenated hypotheses.

    labels: (num_labels, 2) that occur in them, increasing. label_of: place of the label of each entry of `hyp_tracks`.
    firsts, ends: (num_labels,) range of the hypotheses of the density with the label.
    """
    num_labels, num_entries, log_weights = len(labels), len(glmb.hyp_tracks), glmb.hyp_log_weights
    hyp_of = np.empty(num_entries, np.int64)
    for h in range(len(log_weights)):
        for e in range(glmb.hyp_offsets[h], glmb.hyp_offsets[h + 1]):
            hyp_of[e] = h
    entry_offsets, entries = group_members(label_of, num_labels)
    pool_offsets, existence_logit = np.zeros(num_labels + 1, np.int64), np.empty(num_labels)
    pool, weights = np.empty(num_entries, np.int64), np.empty(num_entries)
    slot_of, mark = np.full(len(glmb.tracks.labels), -1, np.int64), np.full(len(log_weights), -1, np.int64)
    for i in range(num_labels):
        low, high, end = entry_offsets[i], entry_offsets[i + 1], pool_offsets[i]
        for m in range(low, high):
            mark[hyp_of[entries[m]]] = i
        log_with = _log_sum_where(log_weights, mark, firsts[i], ends[i], i, True)
        existence_logit[i] = log_with - _log_sum_where(log_weights, mark, firsts[i], ends[i], i, False)
        for m in range(low, high):
            relative = 0.0 if log_with == -math.inf else math.exp(log_weights[hyp_of[entries[m]]] - log_with)
            end = add_to_pool(glmb.hyp_tracks[entries[m]], relative, slot_of, pool, weights, end)
        # Resets only the used entries: a loop over all tracks for each label would be quadratic.
        for p in range(pool_offsets[i], end):
            slot_of[pool[p]] = -1
        pool_offsets[i + 1] = end
    tracks = pooled_tracks(glmb.tracks, labels, pool_offsets, pool, weights, caps)
    return Lmb(tracks, existence_logit)


@kernel
def _normalise_kept(log_weights: Floats, complete: bool) -> float:
    """Normalise the log weights of the kept hypotheses, and return the weight left out, 0 if the list is complete."""
    log_kept = log_sum(log_weights)
    for h in range(len(log_weights)):
        log_weights[h] -= log_kept
    return 0.0 if complete else max(0.0, -math.expm1(log_kept))


@kernel
def factored_to_glmb(density: FactoredGlmb, label_of: Ints, num_labels: int, max_hypotheses: int) -> tuple[Glmb, float]:
    """Return the GLMB of the `max_hypotheses` heaviest products of one hypothesis per factor, and the weight left out.

    The GLMB shares the track table. Its weights are normalised. Products of weight zero are never listed, so with a
    large `max_hypotheses` all the others are listed and the weight left out is zero. Equal weights are in the order in
    which the search finds them, which is deterministic. label_of: (num_tracks,) place of the label of each track
    among all labels, `num_labels`.
    """
    num, sorted_hyps = len(density.factor_offsets) - 1, np.empty(len(density.hyp_log_weights), np.int64)
    costs, base = np.empty(len(sorted_hyps)), 0.0
    for f in range(num):
        low, high = density.factor_offsets[f], density.factor_offsets[f + 1]
        order = descending_order(density.hyp_log_weights[low:high])
        best = density.hyp_log_weights[low + order[0]]
        base += best
        for k in range(high - low):
            sorted_hyps[low + k] = low + order[k]
            costs[low + k] = best - density.hyp_log_weights[low + order[k]]
    lists, places, previous, order, complete = smallest_sums(costs, density.factor_offsets, max_hypotheses)
    num_hyps, chosen = len(order), np.empty(num, np.int64)
    hyp_offsets, hyp_log_weights = np.zeros(num_hyps + 1, np.int64), np.empty(num_hyps)
    hyp_tracks, track_of, end = np.empty(num_hyps * num_labels, np.int64), np.full(num_labels, -1, np.int64), 0
    for h in range(num_hyps):
        for f in range(num):
            chosen[f] = density.factor_offsets[f]
        hyp_log_weights[h] = base
        node = order[h]
        while node > 0:
            chosen[lists[node]] = density.factor_offsets[lists[node]] + places[node]
            hyp_log_weights[h] -= costs[chosen[lists[node]]]
            node = previous[node]
        for f in range(num):
            hyp = sorted_hyps[chosen[f]]
            for e in range(density.hyp_offsets[hyp], density.hyp_offsets[hyp + 1]):
                track_of[label_of[density.hyp_tracks[e]]] = density.hyp_tracks[e]
        for i in range(num_labels):
            if track_of[i] >= 0:
                hyp_tracks[end] = track_of[i]
                track_of[i] = -1
                end += 1
        hyp_offsets[h + 1] = end
    discarded = _normalise_kept(hyp_log_weights, complete)
    return Glmb(density.tracks, hyp_offsets, hyp_tracks[:end].copy(), hyp_log_weights), discarded
