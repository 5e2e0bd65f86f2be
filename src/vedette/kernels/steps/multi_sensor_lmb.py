"""From the combinations of all tracks at all sensors to the LMB of the exact posterior's existences and densities."""

from __future__ import annotations

import math

import numpy as np

from vedette.kernels.association.truncation import Truncation
from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Floats, Ints, Lmb, Tracks
from vedette.kernels.gaussian.linalg import log_add, log_sum
from vedette.kernels.gaussian.mixtures import copy_component, require_gaussians
from vedette.kernels.steps.lmb import LmbReport, Reduction, append_reduced, labels_to_keep
from vedette.kernels.steps.multi_sensor_combinations import Combinations
from vedette.kernels.steps.multi_sensor_marginals import Choices, choice_marginals

# Sets of taken measurements that are followed in a cluster whatever the cap on hypotheses.
LEAST_STATES = 4096


@kernel
def _choices(combinations: Combinations) -> Choices:
    num_tracks, num = len(combinations.log_absent), len(combinations.tracks)
    offsets, log_weights = np.zeros(num_tracks + 1, np.int64), np.empty(num)
    for i in range(num):
        offsets[combinations.tracks[i] + 1] = i + 1
        first, last = combinations.rows.offsets[i], combinations.rows.offsets[i + 1]
        log_weights[i] = log_sum(combinations.rows.log_weights[first:last])
    for track in range(num_tracks):
        offsets[track + 1] = max(offsets[track + 1], offsets[track])
    return Choices(offsets, combinations.columns, log_weights, combinations.log_absent)


@kernel
def _widest(kept: Ints, combinations: Combinations, choices: Choices) -> tuple[int, int]:
    """Components of the kept track that has most, and of all kept tracks."""
    widest, total, offsets = 0, 0, combinations.rows.offsets
    for track in kept:
        width = offsets[choices.offsets[track + 1]] - offsets[choices.offsets[track]]
        widest, total = max(widest, width), total + width
    return widest, total


@kernel
def _reduced_tracks(
    kept: Ints, combinations: Combinations, choices: Choices, marginals: Floats, reduction: Reduction
) -> Tracks:
    """Each kept track's mixture over its combinations, reduced."""
    rows, dim = combinations.rows, combinations.rows.means.shape[1]
    widest, total = _widest(kept, combinations, choices)
    labels, offsets = np.empty((len(kept), 2), np.int64), np.zeros(len(kept) + 1, np.int64)
    log_weights, means, covs = np.empty(total), np.empty((total, dim)), np.empty((total, dim, dim))
    wide_weights, wide_means, wide_covs = np.empty(widest), np.empty((widest, dim)), np.empty((widest, dim, dim))
    filled = 0
    for i in range(len(kept)):
        first, last, width = choices.offsets[kept[i]], choices.offsets[kept[i] + 1], 0
        labels[i, 0], labels[i, 1] = rows.labels[first, 0], rows.labels[first, 1]
        for choice in range(first, last):
            for c in range(rows.offsets[choice], rows.offsets[choice + 1]):
                weight = rows.log_weights[c] + marginals[choice] - choices.log_weights[choice]
                if weight > -math.inf:
                    copy_component(rows.means, rows.covs, c, wide_means, wide_covs, width)
                    wide_weights[width] = weight
                    width += 1
        filled = append_reduced(
            wide_weights[:width], wide_means[:width], wide_covs[:width], reduction, filled, log_weights, means, covs
        )
        offsets[i + 1] = filled
    return Tracks(labels, offsets, log_weights[:filled], means[:filled], covs[:filled])


@kernel
def update_lmb(
    combinations: Combinations, num_columns: int, truncation: Truncation, reduction: Reduction
) -> tuple[Lmb, LmbReport]:
    """Associate, marginalise and reduce once the combinations are there; clutter is left to those who made them.

    Tracks that cannot be there any more are dropped. num_columns: measurements of all sensors.
    """
    choices = _choices(combinations)
    num_tracks = len(choices.log_absent)
    marginals, absent = np.empty(len(choices.log_weights)), np.empty(num_tracks)
    log_total, num_inexact, log_kept = choice_marginals(
        choices, num_columns, max(LEAST_STATES, truncation.max_hypotheses), marginals, absent
    )
    logits = np.empty(num_tracks)
    for track in range(num_tracks):
        present = -math.inf
        for choice in range(choices.offsets[track], choices.offsets[track + 1]):
            present = log_add(present, marginals[choice])
        logits[track] = present - absent[track] if present > -math.inf else -math.inf
    kept, dropped = labels_to_keep(logits, reduction)
    tracks = _reduced_tracks(kept, combinations, choices, marginals, reduction)
    require_gaussians(tracks.means, tracks.covs)
    kept_logits = np.empty(len(kept))
    for i in range(len(kept)):
        kept_logits[i] = logits[kept[i]]
    return Lmb(tracks, kept_logits), LmbReport(log_total, 0.0, 0, num_inexact, log_kept, dropped)
