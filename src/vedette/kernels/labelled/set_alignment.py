"""Alignment of marginalised GLMBs of several sensors, or products of them, on the union of their label sets."""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Bools, Floats, Glmb, Ints, Lmb, Tracks
from vedette.kernels.gaussian.reduction import MixtureCaps
from vedette.kernels.labelled.conversions import factors_to_lmb
from vedette.kernels.labelled.labels import group_by_label_set, increasing_labels, label_place
from vedette.kernels.labelled.stacking import joined_tracks


class Sets(NamedTuple):
    """The label sets of all sensors, each once per sensor, of positive weight."""

    hyps: Glmb  # by sensor, then by group
    sensor_of: Ints  # (num_hyps,) increasing
    group_of: Ints  # (num_hyps,)


class Aligned(NamedTuple):
    """All sensors on the union of their label sets. A member is a (label set, label)."""

    offsets: Ints  # (num_sets + 1,) into members
    groups: Ints  # (num_sets,) the group of each set: densities are products over the groups
    labels: Ints  # (num_members, 2)
    label_of: Ints  # (num_members,) number of the label, of `num_labels`
    num_labels: int
    chosen: Ints  # (num_members, num_sensors) place in `tracks`, -1 if the sensor does not know the label
    tracks: Tracks
    log_weights: Floats  # (num_sets, num_sensors) of the set, or a floor
    held: Bools  # (num_sets, num_sensors) whether it is the sensor's own
    num_missing_labels: Ints  # (num_sensors,) number of labels that the sensor does not know


@kernel
def label_existence(aligned: Aligned, log_weights: Floats) -> Floats:
    """Existence of each label under (num_sets,) weights of the sets, shape (num_labels,)."""
    out = np.zeros(aligned.num_labels)
    for k in range(len(log_weights)):
        for member in range(aligned.offsets[k], aligned.offsets[k + 1]):
            out[aligned.label_of[member]] += math.exp(log_weights[k])
    return out


@kernel
def _numbered(sets: Sets, num_groups: int) -> tuple[Ints, Ints]:
    """Return the number of each hypothesis's label set, and the first of each. Each group has its own empty set."""
    set_of, first = group_by_label_set(sets.hyps)
    of_set, of_empty = np.full(len(first), -1, np.int64), np.full(num_groups, -1, np.int64)
    numbers, firsts, num = np.empty(len(set_of), np.int64), np.empty(len(set_of), np.int64), 0
    for h in range(len(set_of)):
        is_empty = sets.hyps.hyp_offsets[h + 1] == sets.hyps.hyp_offsets[h]
        number = of_empty[sets.group_of[h]] if is_empty else of_set[set_of[h]]
        if number < 0:
            number, firsts[num] = num, h
            num += 1
            if is_empty:
                of_empty[sets.group_of[h]] = number
            else:
                of_set[set_of[h]] = number
        numbers[h] = number
    return numbers, firsts[:num].copy()


@kernel
def _marginal_labels(sets: Sets, sensor: int, num_groups: int, caps: MixtureCaps) -> Lmb:
    """Return one sensor's labels, with their marginal densities over its sets."""
    low, high = np.searchsorted(sets.sensor_of, sensor), np.searchsorted(sets.sensor_of, sensor + 1)
    start, end = sets.hyps.hyp_offsets[low], sets.hyps.hyp_offsets[high]
    offsets, members = sets.hyps.hyp_offsets[low : high + 1] - start, sets.hyps.hyp_tracks[start:end]
    own = Glmb(sets.hyps.tracks, offsets, members, sets.hyps.hyp_log_weights[low:high])
    labels = increasing_labels(own)
    firsts = np.zeros(len(labels), np.int64)
    ends = np.zeros(len(labels), np.int64)
    label_of = np.empty(end - start, np.int64)
    group_first, group_end = np.full(num_groups, -1, np.int64), np.zeros(num_groups, np.int64)
    for h in range(high - low):
        group = sets.group_of[low + h]
        group_first[group], group_end[group] = (h if group_first[group] < 0 else group_first[group]), h + 1
    for h in range(high - low):
        group = sets.group_of[low + h]
        for e in range(offsets[h], offsets[h + 1]):
            label = own.tracks.labels[members[e]]
            place = label_place(labels, len(labels), label[0], label[1])
            label_of[e], firsts[place], ends[place] = place, group_first[group], group_end[group]
    return factors_to_lmb(own, labels, label_of, firsts, ends, caps)


@kernel
def _stand_in(
    marginal: Lmb, first_track: int, sensor: int, lacking: Bools, labels: Ints, label_of: Ints, chosen: Ints, seen: Ints
) -> int:
    """Use the sensor's marginal densities in members of sets that it lacks.

    Return the number of labels it does not know.

    seen: (num_labels,) working array, below `sensor` + 1 everywhere.
    """
    known, unknown = marginal.tracks.labels, 0
    for member in range(len(label_of)):
        if not lacking[member]:
            continue
        step, index = labels[member, 0], labels[member, 1]
        place = label_place(known, len(known), step, index)
        if place < len(known) and known[place, 0] == step and known[place, 1] == index:
            chosen[member, sensor] = first_track + place
        elif seen[label_of[member]] != sensor + 1:
            seen[label_of[member]] = sensor + 1
            unknown += 1
    return unknown


@kernel
def _own_weights(
    sets: Sets, numbers: Ints, firsts: Ints, num_sensors: int, num_groups: int, floor: float
) -> tuple[Ints, Floats]:
    """Hypothesis of each set, or -1, and its log weight, or the floor, both of shape (num_sets, num_sensors).

    The floor is the least of `floor` and the sensor's own log weights in the group.
    """
    num_sets, hyp_of = len(firsts), np.full((len(firsts), num_sensors), -1, np.int64)
    floors = np.full((num_groups, num_sensors), floor)
    for h in range(len(numbers)):
        group, s = sets.group_of[h], sets.sensor_of[h]
        hyp_of[numbers[h], s] = h
        floors[group, s] = min(floors[group, s], sets.hyps.hyp_log_weights[h])
    log_weights = np.empty((num_sets, num_sensors))
    for k in range(num_sets):
        for s in range(num_sensors):
            h = hyp_of[k, s]
            log_weights[k, s] = sets.hyps.hyp_log_weights[h] if h >= 0 else floors[sets.group_of[firsts[k]], s]
    return hyp_of, log_weights


@kernel
def aligned_sets(sets: Sets, num_sensors: int, num_groups: int, floor: float, caps: MixtureCaps) -> Aligned:
    """Return the label sets of all sensors, aligned.

    If a sensor lacks a set, its weight is the least of `floor` and the weights that it has in the group, and the
    density of each label its marginal density over the sensor's sets, reduced by the caps.
    """
    hyps, (numbers, firsts) = sets.hyps, _numbered(sets, num_groups)
    hyp_of, log_weights = _own_weights(sets, numbers, firsts, num_sensors, num_groups, floor)
    num_sets, held = len(firsts), hyp_of >= 0
    offsets = np.zeros(num_sets + 1, np.int64)
    for k in range(num_sets):
        offsets[k + 1] = offsets[k] + hyps.hyp_offsets[firsts[k] + 1] - hyps.hyp_offsets[firsts[k]]
    num, distinct, tracks = offsets[num_sets], increasing_labels(hyps), hyps.tracks
    labels, label_of = np.empty((num, 2), np.int64), np.empty(num, np.int64)
    chosen, lacking = np.full((num, num_sensors), -1, np.int64), np.zeros((num_sensors, num), np.bool_)
    for k in range(num_sets):
        for place in range(offsets[k + 1] - offsets[k]):
            member = offsets[k] + place
            label = tracks.labels[hyps.hyp_tracks[hyps.hyp_offsets[firsts[k]] + place]]
            labels[member, 0], labels[member, 1] = label[0], label[1]
            label_of[member] = label_place(distinct, len(distinct), label[0], label[1])
            for s in range(num_sensors):
                lacking[s, member] = not held[k, s]
                if held[k, s]:
                    chosen[member, s] = hyps.hyp_tracks[hyps.hyp_offsets[hyp_of[k, s]] + place]
    num_missing_labels, seen = np.zeros(num_sensors, np.int64), np.zeros(len(distinct), np.int64)
    for s in range(num_sensors):
        if held[:, s].all():
            continue
        marginal, first_track = _marginal_labels(sets, s, num_groups, caps), len(tracks.labels)
        num_missing_labels[s] = _stand_in(marginal, first_track, s, lacking[s], labels, label_of, chosen, seen)
        tracks = joined_tracks(tracks, marginal.tracks)
    groups = sets.group_of[firsts]
    missing = num_missing_labels
    return Aligned(offsets, groups, labels, label_of, len(distinct), chosen, tracks, log_weights, held, missing)
