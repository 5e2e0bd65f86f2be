"""Conversions between labelled densities: delta-GLMB to marginalised GLMB and to LMB, LMB to GLMB."""

from __future__ import annotations

import math

import numpy as np

from vedette.kernels.compile import kernel
from vedette.kernels.linalg import log_sum
from vedette.kernels.mixtures import copy_component, descending_order, match_components, reduce_mixture
from vedette.kernels.subsets import smallest_sums
from vedette.kernels.types import Floats, Glmb, Ints, Lmb, Tracks

_HASH_BITS = 0x7FFFFFFF


@kernel
def _same_labels(glmb: Glmb, a: int, b: int) -> bool:
    start_a, start_b = glmb.hyp_offsets[a], glmb.hyp_offsets[b]
    size = glmb.hyp_offsets[a + 1] - start_a
    if glmb.hyp_offsets[b + 1] - start_b != size:
        return False
    labels = glmb.tracks.labels
    for k in range(size):
        s, t = glmb.hyp_tracks[start_a + k], glmb.hyp_tracks[start_b + k]
        if s != t and (labels[s, 0] != labels[t, 0] or labels[s, 1] != labels[t, 1]):
            return False
    return True


@kernel
def group_by_label_set(glmb: Glmb) -> tuple[Ints, Ints]:
    """Label sets of a GLMB, numbered by first occurrence.

    Returns (num_hyps,) the number of each hypothesis's label set, and (num_sets,) the first hypothesis of each set.
    """
    num_hyps, labels = len(glmb.hyp_log_weights), glmb.tracks.labels
    key = np.empty(len(labels), np.int64)
    for t in range(len(labels)):
        # Masked so that products stay below 2^62: signed overflow warns when the compiler is off.
        key[t] = ((labels[t, 0] & _HASH_BITS) * 73856093 + (labels[t, 1] & _HASH_BITS) * 19349663) & _HASH_BITS
    slots = 8
    while slots < 2 * num_hyps:
        slots *= 2
    table = np.full(slots, -1, np.int64)
    group_of, first, num_groups = np.empty(num_hyps, np.int64), np.empty(num_hyps, np.int64), 0
    for h in range(num_hyps):
        code = 0
        for e in range(glmb.hyp_offsets[h], glmb.hyp_offsets[h + 1]):
            code += key[glmb.hyp_tracks[e]]
        slot = (code ^ (code >> 15)) & (slots - 1)
        while table[slot] >= 0 and not _same_labels(glmb, first[table[slot]], h):
            slot = (slot + 1) & (slots - 1)
        if table[slot] < 0:
            table[slot] = num_groups
            first[num_groups] = h
            num_groups += 1
        group_of[h] = table[slot]
    return group_of, first[:num_groups].copy()


@kernel
def _members(group_of: Ints, num_groups: int) -> tuple[Ints, Ints]:
    """Items of each group, in their order, as (offsets, items). Negative group numbers belong to no group."""
    offsets = np.zeros(num_groups + 1, np.int64)
    for group in group_of:
        if group >= 0:
            offsets[group + 1] += 1
    for group in range(num_groups):
        offsets[group + 1] += offsets[group]
    items, fill = np.empty(offsets[num_groups], np.int64), offsets[:num_groups].copy()
    for i in range(len(group_of)):
        if group_of[i] >= 0:
            items[fill[group_of[i]]] = i
            fill[group_of[i]] += 1
    return offsets, items


@kernel
def _pool(track: int, weight: float, slot_of: Ints, pool: Ints, weights: Floats, end: int) -> int:
    """Add `weight` to `track`'s place in the open pool, or give it the place `end`; the new end of the pool."""
    slot = slot_of[track]
    if slot < 0:
        slot_of[track] = end
        pool[end] = track
        weights[end] = weight
        return end + 1
    weights[slot] += weight
    return end


@kernel
def _gather(
    tracks: Tracks, pool: Ints, weights: Floats, low: int, high: int, components: Ints, component_weights: Floats
) -> int:
    """Components of the pool `low:high` and their linear weights, into the last two arguments; their number."""
    count = 0
    for p in range(low, high):
        for source in range(tracks.offsets[pool[p]], tracks.offsets[pool[p] + 1]):
            components[count] = source
            log_weight = tracks.log_weights[source]
            component_weights[count] = weights[p] if log_weight == 0.0 else weights[p] * math.exp(log_weight)
            count += 1
    return count


@kernel
def _reduced_components(
    tracks: Tracks,
    components: Ints,
    weights: Floats,
    log_min_weight: float,
    merge_distance: float,
    max_components: int,
) -> tuple[Floats, Floats, Floats]:
    """The normalised, reduced mixture of `components` under linear weights."""
    num, n = len(components), tracks.means.shape[1]
    log_weights, means, covs, total = np.empty(num), np.empty((num, n)), np.empty((num, n, n)), 0.0
    for weight in weights:
        total += weight
    for c in range(num):
        share = weights[c] / total if total > 0.0 else 1.0 / num
        log_weights[c] = math.log(share) if share > 0.0 else -math.inf
        copy_component(tracks.means, tracks.covs, components[c], means, covs, c)
    return reduce_mixture(log_weights, means, covs, log_min_weight, merge_distance, max_components)


@kernel
def _pooled_tracks(
    tracks: Tracks,
    labels: Ints,
    pool_offsets: Ints,
    pool: Ints,
    weights: Floats,
    log_min_weight: float,
    merge_distance: float,
    max_components: int,
) -> Tracks:
    """One track for each pool of tracks: the mixture of the pool under its linear weights, reduced."""
    num, n, used, largest, room = len(labels), tracks.means.shape[1], 0, 0, 0
    for i in range(num):
        size = 0
        for p in range(pool_offsets[i], pool_offsets[i + 1]):
            size += tracks.offsets[pool[p] + 1] - tracks.offsets[pool[p]]
        largest = max(largest, size)
        room += min(size, max_components)
    components, component_weights = np.empty(largest, np.int64), np.empty(largest)
    offsets, log_weights, means, covs = (
        np.zeros(num + 1, np.int64),
        np.zeros(room),
        np.empty((room, n)),
        np.empty((room, n, n)),
    )
    for i in range(num):
        count = _gather(tracks, pool, weights, pool_offsets[i], pool_offsets[i + 1], components, component_weights)
        if max_components == 1 or count == 1:
            match_components(components, component_weights, count, tracks.means, tracks.covs, means[used], covs[used])
            used += 1
        else:
            reduced_log_weights, reduced_means, reduced_covs = _reduced_components(
                tracks, components[:count], component_weights[:count], log_min_weight, merge_distance, max_components
            )
            for c in range(len(reduced_log_weights)):
                log_weights[used] = reduced_log_weights[c]
                copy_component(reduced_means, reduced_covs, c, means, covs, used)
                used += 1
        offsets[i + 1] = used
    if used < room:
        log_weights, means, covs = log_weights[:used].copy(), means[:used].copy(), covs[:used].copy()
    return Tracks(labels, offsets, log_weights, means, covs)


@kernel
def _set_weights(glmb: Glmb, group_of: Ints, num_sets: int) -> tuple[Floats, Floats]:
    """(num_sets,) log weight of each label set, and (num_hyps,) linear weights relative to the heaviest of the set."""
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
def marginalise(glmb: Glmb, log_min_weight: float, merge_distance: float, max_components: int) -> Glmb:
    """Marginalised GLMB: one hypothesis a label set, over all association histories (paper eq. 8).

    Each track of a label set is the mixture of that label's tracks in the set's hypotheses, weighted by them, and reduced
    by `kernels.mixtures.reduce_mixture` under the three limits; with `max_components` 1 it is one moment-matched Gaussian.
    Each (label set, label) has its own entry in the track table, in the order of the hypotheses. Hypotheses come out by
    descending weight, equal weights in the order of their first occurrence; one of weight zero is kept.
    """
    group_of, first = group_by_label_set(glmb)
    num_sets, num_entries = len(first), len(glmb.hyp_tracks)
    set_log_weights, relative = _set_weights(glmb, group_of, num_sets)
    order = descending_order(set_log_weights)
    member_offsets, members = _members(group_of, num_sets)
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
                end = _pool(track, relative[members[m]], slot_of, pool, weights, end)
            for p in range(pool_offsets[i], end):
                slot_of[pool[p]] = -1
            labels[i, 0] = glmb.tracks.labels[pool[end - 1], 0]
            labels[i, 1] = glmb.tracks.labels[pool[end - 1], 1]
            i += 1
            pool_offsets[i] = end
    tracks = _pooled_tracks(
        glmb.tracks, labels, pool_offsets, pool, weights, log_min_weight, merge_distance, max_components
    )
    return Glmb(tracks, hyp_offsets, np.arange(num_tracks), hyp_log_weights)


@kernel
def _label_place(unique: Ints, count: int, step: int, index: int) -> int:
    """Place of the label (step, index) among the first `count` of `unique`, which are in increasing order."""
    low, high = 0, count
    while low < high:
        middle = (low + high) // 2
        if unique[middle, 0] < step or (unique[middle, 0] == step and unique[middle, 1] < index):
            low = middle + 1
        else:
            high = middle
    return low


@kernel
def _increasing_labels(glmb: Glmb) -> Ints:
    """Labels that occur in the hypotheses, once each, in increasing order."""
    labels, count = glmb.tracks.labels, 0
    unique, seen = np.empty((len(labels), 2), np.int64), np.zeros(len(labels), np.int64)
    for track in glmb.hyp_tracks:
        if seen[track] == 1:
            continue
        seen[track] = 1
        step, index = labels[track, 0], labels[track, 1]
        place = _label_place(unique, count, step, index)
        if place < count and unique[place, 0] == step and unique[place, 1] == index:
            continue
        for k in range(count, place, -1):
            unique[k, 0], unique[k, 1] = unique[k - 1, 0], unique[k - 1, 1]
        unique[place, 0], unique[place, 1] = step, index
        count += 1
    return unique[:count].copy()


@kernel
def _log_sum_where(log_weights: Floats, mark: Ints, value: int, equal: bool) -> float:
    """log-sum-exp over the places whose mark is `value`, or over those where it is not."""
    peak, total = -math.inf, 0.0
    for h in range(len(log_weights)):
        if (mark[h] == value) == equal:
            peak = max(peak, log_weights[h])
    if peak == -math.inf:
        return peak
    for h in range(len(log_weights)):
        if (mark[h] == value) == equal:
            total += math.exp(log_weights[h] - peak)
    return peak + math.log(total)


@kernel
def glmb_to_lmb(glmb: Glmb, log_min_weight: float, merge_distance: float, max_components: int) -> Lmb:
    """LMB of the same existence probabilities and, up to the reduction of mixtures, the same track densities.

    Reuter, Vo, Vo and Dietmayer 2014, "The labeled multi-Bernoulli filter", eq. 43-45. The logit of existence is the
    difference of the log weights with and without the label, so that nothing is lost near existence 1. A label all of
    whose hypotheses have weight zero keeps logit -inf and the plain mean of its tracks. The limits are those of
    `kernels.mixtures.reduce_mixture`.
    """
    labels, num_entries = _increasing_labels(glmb), len(glmb.hyp_tracks)
    num_labels, log_weights = len(labels), glmb.hyp_log_weights
    hyp_of, label_of = np.empty(num_entries, np.int64), np.empty(num_entries, np.int64)
    for h in range(len(log_weights)):
        for e in range(glmb.hyp_offsets[h], glmb.hyp_offsets[h + 1]):
            track = glmb.hyp_tracks[e]
            hyp_of[e] = h
            label_of[e] = _label_place(labels, num_labels, glmb.tracks.labels[track, 0], glmb.tracks.labels[track, 1])
    entry_offsets, entries = _members(label_of, num_labels)
    pool_offsets, existence_logit = np.zeros(num_labels + 1, np.int64), np.empty(num_labels)
    pool, weights = np.empty(num_entries, np.int64), np.empty(num_entries)
    slot_of, mark = np.full(len(glmb.tracks.labels), -1, np.int64), np.full(len(log_weights), -1, np.int64)
    for i in range(num_labels):
        low, high, end = entry_offsets[i], entry_offsets[i + 1], pool_offsets[i]
        for m in range(low, high):
            mark[hyp_of[entries[m]]] = i
        log_with = _log_sum_where(log_weights, mark, i, True)
        existence_logit[i] = log_with - _log_sum_where(log_weights, mark, i, False)
        for m in range(low, high):
            relative = 0.0 if log_with == -math.inf else math.exp(log_weights[hyp_of[entries[m]]] - log_with)
            end = _pool(glmb.hyp_tracks[entries[m]], relative, slot_of, pool, weights, end)
        for p in range(pool_offsets[i], end):
            slot_of[pool[p]] = -1
        pool_offsets[i + 1] = end
    tracks = _pooled_tracks(
        glmb.tracks, labels, pool_offsets, pool, weights, log_min_weight, merge_distance, max_components
    )
    return Lmb(tracks, existence_logit)


@kernel
def lmb_to_glmb(lmb: Lmb, max_hyps: int) -> tuple[Glmb, float]:
    """GLMB of the `max_hyps` most probable label subsets of an LMB, by descending weight, and the weight left out.

    The GLMB shares the LMB's track table; its weights are normalised. Subsets of weight zero are never listed, so with
    a large `max_hyps` all the others are there and the weight left out is zero. Equal weights come in the order in which
    the search finds them, which is the same every time.
    """
    num = len(lmb.existence_logit)
    costs, base = np.empty(num), 0.0
    for i in range(num):
        costs[i] = abs(lmb.existence_logit[i])
        base -= math.log1p(math.exp(-costs[i]))
    flips, previous, order, complete = smallest_sums(costs, max_hyps)
    num_hyps = len(order)
    hyp_offsets, hyp_log_weights = np.zeros(num_hyps + 1, np.int64), np.empty(num_hyps)
    hyp_tracks, flipped = np.empty(num_hyps * num, np.int64), np.zeros(num, np.int64)
    end = 0
    for h in range(num_hyps):
        hyp_log_weights[h] = base
        node = order[h]
        while node > 0:
            flipped[flips[node]] = h + 1
            hyp_log_weights[h] -= costs[flips[node]]
            node = previous[node]
        for i in range(num):
            if (lmb.existence_logit[i] > 0.0) != (flipped[i] == h + 1):
                hyp_tracks[end] = i
                end += 1
        hyp_offsets[h + 1] = end
    log_kept = log_sum(hyp_log_weights)
    for h in range(num_hyps):
        hyp_log_weights[h] -= log_kept
    discarded = 0.0 if complete else max(0.0, -math.expm1(log_kept))
    return Glmb(lmb.tracks, hyp_offsets, hyp_tracks[:end].copy(), hyp_log_weights), discarded


__all__ = ["glmb_to_lmb", "group_by_label_set", "lmb_to_glmb", "marginalise"]
