"""Removal of alternative labels: an improbable second label of a target is replaced by its established label.

One target may have been first detected as the label (1, 0) or, had that been clutter, as (2, 0). No later scan can
distinguish the two, so such a pair would remain forever. As a density of unlabelled states nothing changes if
hypotheses that hold the second label and not the first give its track the first label.
"""

import numpy as np

from vedette.kernels.base.compile import borrowing, kernel
from vedette.kernels.base.types import Floats, Glmb, Ints, Tracks
from vedette.kernels.gaussian.linalg import normalise_logs
from vedette.kernels.gaussian.mixtures import descending_order
from vedette.kernels.labelled.splitting import Choices, choices_of, existences_of

# A label is an alternative of another one if both exist together with at most this share of its own probability, and
# the other one exists with at least this probability.
_BESIDE, _KNOWN = 0.1, 0.5


@borrowing
def _established_label(choices: Choices, existences: Floats, label: int) -> int:
    """Return the most probable label that another one is an alternative of, -1 for none."""
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
def _rename(choices: Choices, existences: Floats, label: int, known: int, labels: Ints) -> None:
    """Give the tracks of a label to another one. Hypotheses that hold both lose their weight.

    labels: (num_tracks, 2) of the tracks, written.
    """
    for h in range(len(choices.weights)):
        track = choices.symbols[h, label]
        if track < 0:
            continue
        if choices.symbols[h, known] >= 0:
            choices.weights[h] = 0.0
        else:
            choices.symbols[h, known] = track
            labels[track, 0], labels[track, 1] = choices.labels[known, 0], choices.labels[known, 1]
        choices.symbols[h, label] = -1
    existences[label] = 0.0


@kernel
def with_established_labels(glmb: Glmb, choices: Choices, max_error: float) -> tuple[Glmb, Choices, float]:
    """Return the GLMB without improbable alternative labels, its choices, and the L1 change of the density.

    choices: of the GLMB, heaviest first, written. max_error: bound on the L1 error of the labelled density, twice the
    existence of the removed labels. The least probable ones are removed first. Tracks without a hypothesis stay in the
    table.
    """
    num_labels, spent = len(choices.labels), 0.0
    if num_labels < 2:
        return glmb, choices, 0.0
    existences, labels = existences_of(choices), glmb.tracks.labels.copy()
    for label in descending_order(-existences):
        error = 2.0 * existences[label]
        if spent + error > max_error:
            break
        known = _established_label(choices, existences, label)
        if known >= 0:
            _rename(choices, existences, label, known, labels)
            spent += error
    if spent == 0.0:
        return glmb, choices, 0.0
    tracks = glmb.tracks
    relabelled = Tracks(labels, tracks.offsets, tracks.components)
    renamed = _with_weight(relabelled, choices, glmb.hyp_log_weights)
    return renamed, choices_of(renamed), spent


@kernel
def _with_weight(tracks: Tracks, choices: Choices, log_weights: Floats) -> Glmb:
    """Return the hypotheses that still have a weight, normalised."""
    num, num_labels = choices.symbols.shape
    offsets, members, filled = np.zeros(num + 1, np.int64), np.empty(num * num_labels, np.int64), 0
    kept, num_kept = np.empty(num), 0
    for h in range(num):
        if choices.weights[h] == 0.0:
            continue
        for k in range(num_labels):
            if choices.symbols[h, k] >= 0:
                members[filled] = choices.symbols[h, k]
                filled += 1
        kept[num_kept] = log_weights[h]
        num_kept += 1
        offsets[num_kept] = filled
    normalise_logs(kept[:num_kept])
    return Glmb(tracks, offsets[: num_kept + 1].copy(), members[:filled].copy(), kept[:num_kept].copy())
