"""Joint prediction and update of an LMB density (Reuter, Vo, Vo, Dietmayer 2014), with exact association marginals."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.association.assignment import ABSENT, Options
from vedette.kernels.association.marginals import option_marginals
from vedette.kernels.association.options import Rows, clutter_levels, list_options
from vedette.kernels.association.truncation import Truncation
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Ints, Lmb, Motion, Sensor, Tracks
from vedette.kernels.gaussian.kalman import make_scratch
from vedette.kernels.gaussian.linalg import log_add, normalise_logs
from vedette.kernels.gaussian.mixtures import copy_component, descending_order, reduce_mixture, require_gaussians
from vedette.kernels.steps.assembly import write_updated
from vedette.kernels.steps.glmb import prepare_rows
from vedette.kernels.steps.matching import make_mixture, match_rows


class Reduction(NamedTuple):
    """How track mixtures and the label set are kept small.

    log_min_weight: components below are pruned. merge_distance: Mahalanobis distance within which components merge.
    max_components: cap a track; 1 is one moment-matched Gaussian. min_existence_logit, max_labels: which labels stay.
    """

    log_min_weight: float
    merge_distance: float
    max_components: int
    min_existence_logit: float
    max_labels: int


class LmbReport(NamedTuple):
    """log_total: log of the sum of all joint weights, relative to clutter alone. log_clutter, num_raised: as in
    `StepReport`. num_ranked: clusters summed over their heaviest choices only. log_kept: log of the least share of
    all joint weight that is in the sum; 0 where no cluster was ranked. dropped_existence: summed existence of
    dropped labels.
    """

    log_total: float
    log_clutter: float
    num_raised: int
    num_ranked: int
    log_kept: float
    dropped_existence: float


@inlined
def _log_presence(logit: float) -> tuple[float, float]:
    """log existence and log (1 - existence)."""
    if logit >= 0.0:
        log_existence = -math.log1p(math.exp(-logit))
        return log_existence, log_existence - logit
    log_absence = -math.log1p(math.exp(logit))
    return log_absence + logit, log_absence


@borrowing
def weigh_by_existence(existence_logit: Floats, rows: Rows) -> None:
    """Make the first rows, predicted as if certain, uncertain by the prior existence of their tracks."""
    for i in range(len(existence_logit)):
        log_existence, log_absence = _log_presence(existence_logit[i])
        rows.log_absent[i] = log_add(log_absence, log_existence + rows.log_absent[i])
        for c in range(rows.offsets[i], rows.offsets[i + 1]):
            rows.log_weights[c] += log_existence


@borrowing
def fill_existence(options: Options, marginals: Floats, logits: Floats) -> None:
    """Posterior existence logit of every row."""
    for row in range(len(options.offsets) - 1):
        present, absent = -math.inf, -math.inf
        for option in range(options.offsets[row], options.offsets[row + 1]):
            if options.columns[option] == ABSENT:
                absent = marginals[option]
            else:
                present = log_add(present, marginals[option])
        logits[row] = present - absent


@kernel
def labels_to_keep(logits: Floats, reduction: Reduction) -> tuple[Ints, float]:
    """Rows to keep, in label order, and the expected number of targets lost with the others."""
    marks = np.zeros(len(logits), np.int64)
    kept, dropped = 0, 0.0
    for row in descending_order(logits):
        if kept < reduction.max_labels and logits[row] >= reduction.min_existence_logit:
            marks[row] = 1
            kept += 1
        else:
            dropped += 1.0 / (1.0 + math.exp(-logits[row]))
    rows = np.empty(kept, np.int64)
    kept = 0
    for row in range(len(logits)):
        if marks[row] == 1:
            rows[kept] = row
            kept += 1
    return rows, dropped


@kernel
def _most_components(kept: Ints, rows: Rows, options: Options) -> tuple[int, int]:
    """Components of the widest row and of all kept rows together, before reduction."""
    widest, total = 0, 0
    for row in kept:
        width = (rows.offsets[row + 1] - rows.offsets[row]) * max(1, options.offsets[row + 1] - options.offsets[row])
        widest = max(widest, width)
        total += width
    return widest, total


@kernel
def _matched_tracks(kept: Ints, rows: Rows, options: Options, marginals: Floats) -> Tracks:
    """One Gaussian for each kept row."""
    num, dim = len(kept), rows.means.shape[1]
    widest, _ = _most_components(kept, rows, options)
    labels, offsets = np.empty((num, 2), np.int64), np.zeros(num + 1, np.int64)
    log_weights, means, covs = np.zeros(num), np.empty((num, dim)), np.empty((num, dim, dim))
    for i in range(num):
        labels[i, 0], labels[i, 1] = rows.labels[kept[i], 0], rows.labels[kept[i], 1]
        offsets[i + 1] = i + 1
    match_rows(kept, rows, options, marginals, make_mixture(widest, dim), means, covs)
    return Tracks(labels, offsets, log_weights, means, covs)


@kernel
def _reduced_tracks(kept: Ints, rows: Rows, options: Options, marginals: Floats, reduction: Reduction) -> Tracks:
    """Each kept row's mixture over its options, reduced."""
    dim = rows.means.shape[1]
    widest, total = _most_components(kept, rows, options)
    labels, offsets = np.empty((len(kept), 2), np.int64), np.zeros(len(kept) + 1, np.int64)
    log_weights, means, covs = np.empty(total), np.empty((total, dim)), np.empty((total, dim, dim))
    wide_weights, wide_means, wide_covs = np.empty(widest), np.empty((widest, dim)), np.empty((widest, dim, dim))
    filled = 0
    for i in range(len(kept)):
        row = kept[i]
        labels[i, 0], labels[i, 1] = rows.labels[row, 0], rows.labels[row, 1]
        width = 0
        for option in range(options.offsets[row], options.offsets[row + 1]):
            if options.columns[option] == ABSENT or marginals[option] == -math.inf:
                continue
            end = write_updated(row, option, rows, options, width, wide_weights, wide_means, wide_covs)
            for c in range(width, end):
                wide_weights[c] += marginals[option] - options.log_weights[option]
            width = end
        if width == 0:
            # Existence 0: any density will do, as long as it is one.
            for c in range(rows.offsets[row], rows.offsets[row + 1]):
                copy_component(rows.means, rows.covs, c, wide_means, wide_covs, width)
                wide_weights[width] = 0.0
                width += 1
        filled = append_reduced(
            wide_weights[:width], wide_means[:width], wide_covs[:width], reduction, filled, log_weights, means, covs
        )
        offsets[i + 1] = filled
    return Tracks(labels, offsets, log_weights[:filled], means[:filled], covs[:filled])


@kernel
def append_reduced(
    wide_weights: Floats,
    wide_means: Floats,
    wide_covs: Floats,
    reduction: Reduction,
    filled: int,
    log_weights: Floats,
    means: Floats,
    covs: Floats,
) -> int:
    """Append the reduced mixture, its weights normalised to one; returns the new end."""
    few_weights, few_means, few_covs = reduce_mixture(
        wide_weights,
        wide_means,
        wide_covs,
        reduction.log_min_weight,
        reduction.merge_distance,
        reduction.max_components,
    )
    normalise_logs(few_weights)
    for c in range(len(few_weights)):
        log_weights[filled] = few_weights[c]
        copy_component(few_means, few_covs, c, means, covs, filled)
        filled += 1
    return filled


@kernel
def finish_lmb(
    rows: Rows, scan: Floats, pose: Floats, sensor: Sensor, truncation: Truncation, reduction: Reduction
) -> tuple[Lmb, LmbReport]:
    """Associate, marginalise and reduce once the rows are prepared and weighed by existence."""
    levels = np.empty(len(scan))
    log_clutter, num_raised = clutter_levels(sensor, scan, pose, truncation.log_clutter_floor, levels)
    options = list_options(rows, scan, levels, sensor, truncation.gate)
    marginals = np.empty(options.offsets[-1])
    log_total, num_ranked, log_kept = option_marginals(
        options, len(scan), truncation.max_hypotheses, truncation.max_log_gap, truncation.max_nodes, marginals
    )
    logits = np.empty(len(rows.log_absent))
    fill_existence(options, marginals, logits)
    kept, dropped = labels_to_keep(logits, reduction)
    if reduction.max_components == 1:
        tracks = _matched_tracks(kept, rows, options, marginals)
    else:
        tracks = _reduced_tracks(kept, rows, options, marginals, reduction)
    require_gaussians(tracks.means, tracks.covs)
    kept_logits = np.empty(len(kept))
    for i in range(len(kept)):
        kept_logits[i] = logits[kept[i]]
    return Lmb(tracks, kept_logits), LmbReport(log_total, log_clutter, num_raised, num_ranked, log_kept, dropped)


@kernel
def step_lmb(
    prior: Lmb,
    birth: Lmb,
    scan: Floats,
    pose: Floats,
    dt: float,
    motion: Motion,
    sensor: Sensor,
    truncation: Truncation,
    reduction: Reduction,
) -> tuple[Lmb, LmbReport]:
    """One scan."""
    scratch = make_scratch(prior.tracks.means.shape[1], len(sensor.angular))
    rows = prepare_rows(prior.tracks, birth, pose, dt, motion, sensor, scratch)
    weigh_by_existence(prior.existence_logit, rows)
    return finish_lmb(rows, scan, pose, sensor, truncation, reduction)
