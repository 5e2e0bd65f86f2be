"""Labels that are only the improbable other name of a target take the name that it is known by.

One target may have been first detected as the label (1, 0) or, had that been clutter, as (2, 0). No later scan can
tell, so such a pair would stay for good. As a set of states without labels the density does not change when hypotheses
that hold the second label and not the first give its track the first label.
"""

from __future__ import annotations

import numpy as np

from vedette.kernels.base.arrays import filled_ints
from vedette.kernels.base.compile import borrowing, kernel
from vedette.kernels.base.types import Floats, Glmb, Ints, Tracks
from vedette.kernels.gaussian.linalg import log_sum
from vedette.kernels.gaussian.mixtures import copy_component, descending_order
from vedette.kernels.labelled.splitting import Choices, choices_of, existences_of

# A label is another's name where it exists beside that one in less than this share of its own probability, and the
# other exists with at least this.
_BESIDE, _KNOWN = 0.1, 0.5


@borrowing
def _known_name(choices: Choices, existences: Floats, label: int) -> int:
    """The most probable label that another one stands in for, -1 for none."""
    best = -1
    for known in range(len(existences)):
        if known == label or existences[known] < _KNOWN or (best >= 0 and existences[known] <= existences[best]):
            continue
        beside = 0.0
        for h in range(len(choices.weights)):
            if choices.symbols[h, label] >= 0 and choices.symbols[h, known] >= 0:
                beside += choices.weights[h]
        if beside <= _BESIDE * existences[label]:
            best = known
    return best


@borrowing
def _rename(choices: Choices, existences: Floats, label: int, known: int, name_of: Ints) -> None:
    """Give the tracks of a label to another. Hypotheses that hold both lose their weight."""
    for h in range(len(choices.weights)):
        track = choices.symbols[h, label]
        if track < 0:
            continue
        if choices.symbols[h, known] >= 0:
            choices.weights[h] = 0.0
        else:
            choices.symbols[h, known] = track
        choices.symbols[h, label] = -1
        name_of[track] = known
    existences[label] = 0.0


@kernel
def with_known_names(glmb: Glmb, choices: Choices, max_error: float) -> tuple[Glmb, Choices, float]:
    """The GLMB in which improbable other names of targets are given up, its choices, and the L1 change of the density.

    choices: of the GLMB, heaviest first; written. max_error: of the labelled density, twice the existence of the labels
    that are given up; the least probable ones first.
    """
    num_labels, spent = len(choices.labels), 0.0
    if num_labels < 2:
        return glmb, choices, 0.0
    existences, name_of = existences_of(choices), filled_ints(len(glmb.tracks.labels), -1)
    for label in descending_order(-existences):
        error = 2.0 * existences[label]
        if spent + error > max_error:
            break
        known = _known_name(choices, existences, label)
        if known >= 0:
            _rename(choices, existences, label, known, name_of)
            spent += error
    if spent == 0.0:
        return glmb, choices, 0.0
    renamed = _rebuilt(glmb, choices, name_of)
    return renamed, choices_of(renamed), spent


@kernel
def _rebuilt(glmb: Glmb, choices: Choices, name_of: Ints) -> Glmb:
    """The hypotheses that have a weight, and the tracks that these hold. name_of: (num_tracks,) -1: its own name."""
    num, num_labels, tracks = len(choices.weights), len(choices.labels), glmb.tracks
    number, kept, num_kept = filled_ints(len(name_of), -1), np.empty(len(name_of), np.int64), 0
    offsets, members, filled = np.zeros(num + 1, np.int64), np.empty(num * num_labels, np.int64), 0
    log_weights, num_hyps = np.empty(num), 0
    for h in range(num):
        if choices.weights[h] == 0.0:
            continue
        for k in range(num_labels):
            track = choices.symbols[h, k]
            if track < 0:
                continue
            if number[track] < 0:
                number[track], kept[num_kept] = num_kept, track
                num_kept += 1
            members[filled] = number[track]
            filled += 1
        log_weights[num_hyps] = glmb.hyp_log_weights[h]
        num_hyps += 1
        offsets[num_hyps] = filled
    taken = _taken_tracks(tracks, kept[:num_kept])
    for i in range(num_kept):
        name = name_of[kept[i]]
        if name >= 0:
            taken.labels[i, 0], taken.labels[i, 1] = choices.labels[name, 0], choices.labels[name, 1]
    log_total = log_sum(log_weights[:num_hyps])
    for h in range(num_hyps):
        log_weights[h] -= log_total
    return Glmb(taken, offsets[: num_hyps + 1].copy(), members[:filled].copy(), log_weights[:num_hyps].copy())


@kernel
def _taken_tracks(tracks: Tracks, kept: Ints) -> Tracks:
    """Some tracks, in the order given."""
    num_components, dim, end = 0, tracks.means.shape[1], 0
    for track in kept:
        num_components += tracks.offsets[track + 1] - tracks.offsets[track]
    out = Tracks(
        np.empty((len(kept), 2), np.int64),
        np.zeros(len(kept) + 1, np.int64),
        np.empty(num_components),
        np.empty((num_components, dim)),
        np.empty((num_components, dim, dim)),
    )
    for i in range(len(kept)):
        out.labels[i, 0], out.labels[i, 1] = tracks.labels[kept[i], 0], tracks.labels[kept[i], 1]
        for c in range(tracks.offsets[kept[i]], tracks.offsets[kept[i] + 1]):
            out.log_weights[end] = tracks.log_weights[c]
            copy_component(tracks.means, tracks.covs, c, out.means, out.covs, end)
            end += 1
        out.offsets[i + 1] = end
    return out
