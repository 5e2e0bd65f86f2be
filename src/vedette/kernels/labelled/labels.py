"""Labels and label sets of a GLMB: grouping of hypotheses, ordering of labels."""

import numpy as np

from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Glmb, Ints

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
    """Number the label sets of a GLMB by first occurrence.

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
def label_place(unique: Ints, count: int, step: int, index: int) -> int:
    """Return the place of the label (step, index) among the first `count` of `unique`, which are increasing."""
    low, high = 0, count
    while low < high:
        middle = (low + high) // 2
        if unique[middle, 0] < step or (unique[middle, 0] == step and unique[middle, 1] < index):
            low = middle + 1
        else:
            high = middle
    return low


@kernel
def increasing_labels(glmb: Glmb) -> Ints:
    """Return the labels that occur in the hypotheses, once each, in increasing order."""
    labels, count = glmb.tracks.labels, 0
    unique, seen = np.empty((len(labels), 2), np.int64), np.zeros(len(labels), np.int64)
    for track in glmb.hyp_tracks:
        if seen[track] == 1:
            continue
        seen[track] = 1
        step, index = labels[track, 0], labels[track, 1]
        place = label_place(unique, count, step, index)
        if place < count and unique[place, 0] == step and unique[place, 1] == index:
            continue
        for k in range(count, place, -1):
            unique[k, 0], unique[k, 1] = unique[k - 1, 0], unique[k - 1, 1]
        unique[place, 0], unique[place, 1] = step, index
        count += 1
    return unique[:count].copy()
