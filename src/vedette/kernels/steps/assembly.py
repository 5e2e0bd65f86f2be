"""From the kept joint choices of a scan to the posterior: updated tracks, each held once, and hypotheses over them."""

from __future__ import annotations

import math

import numpy as np

from vedette.kernels.association.assignment import ABSENT, MISSED, Options
from vedette.kernels.association.children import Children, Parents
from vedette.kernels.association.options import Rows
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Glmb, Ints, Tracks
from vedette.kernels.gaussian.kalman import update_mean
from vedette.kernels.gaussian.linalg import normalise_logs
from vedette.kernels.gaussian.mixtures import copy_component


@inlined
def write_updated(
    row: int, option: int, rows: Rows, options: Options, start: int, log_weights: Floats, means: Floats, covs: Floats
) -> int:
    """Write the updated components of a row under one of its options from `start` on; returns the end.

    Their log weights sum to the option's own; components outside the gate are left out.
    """
    first, entry = rows.offsets[row], options.entries[option]
    detected = options.columns[option] != MISSED
    for i in range(rows.offsets[row + 1] - first):
        weight = options.component_log_weights[entry + i]
        if weight == -math.inf:
            continue
        log_weights[start] = weight
        if detected:
            copy_component(rows.means, rows.innovation.covs, first + i, means, covs, start)
            update_mean(rows.innovation, first + i, options.whitened[entry + i], rows.means[first + i], means[start])
        else:
            copy_component(rows.means, rows.covs, first + i, means, covs, start)
        start += 1
    return start


@borrowing
def name_tracks(
    children: Children,
    kept: Ints,
    parents: Parents,
    options: Options,
    track_of: Ints,
    used_options: Ints,
    used_rows: Ints,
    hyp_offsets: Ints,
    hyp_tracks: Ints,
    log_weights: Floats,
) -> tuple[int, int, float]:
    """Write the hypotheses of the `kept` children, normalised, over tracks numbered by first use.

    track_of: (num_options,) to work in. used_options, used_rows: the option and row of each track are written there.
    Returns the numbers of tracks and of entries of `hyp_tracks`, and the log of the sum of the children's weights.
    """
    for option in range(options.offsets[len(options.offsets) - 1]):
        track_of[option] = -1
    num_used, filled = 0, 0
    hyp_offsets[0] = 0
    for h in range(len(kept)):
        child = kept[h]
        log_weights[h] = children.log_weights[child]
        start, first_row = children.offsets[child], parents.offsets[children.parents[child]]
        for i in range(children.offsets[child + 1] - start):
            option = children.options[start + i]
            if options.columns[option] == ABSENT:
                continue
            if track_of[option] < 0:
                track_of[option] = num_used
                used_options[num_used], used_rows[num_used] = option, parents.rows[first_row + i]
                num_used += 1
            hyp_tracks[filled] = track_of[option]
            filled += 1
        hyp_offsets[h + 1] = filled
    return num_used, filled, normalise_logs(log_weights[: len(kept)])


@borrowing
def update_tracks(used_options: Ints, used_rows: Ints, rows: Rows, options: Options, out: Tracks) -> int:
    """Write the track of each used option, its mixture normalised; returns the number of components."""
    filled = 0
    out.offsets[0] = 0
    for i in range(len(used_options)):
        row, option = used_rows[i], used_options[i]
        out.labels[i, 0], out.labels[i, 1] = rows.labels[row, 0], rows.labels[row, 1]
        end = write_updated(row, option, rows, options, filled, out.log_weights, out.means, out.covs)
        if end == filled + 1:
            out.log_weights[filled] = 0.0
        else:
            normalise_logs(out.log_weights[filled:end])
        filled = end
        out.offsets[i + 1] = filled
    return filled


@kernel
def assemble(children: Children, kept: Ints, parents: Parents, rows: Rows, options: Options) -> tuple[Glmb, float]:
    """The posterior of the kept children, normalised, and the log of their unnormalised sum."""
    num_hyps, num_entries, num_options = len(kept), len(children.options), options.offsets[-1]
    track_of, used_options, used_rows = (
        np.empty(num_options, np.int64),
        np.empty(num_options, np.int64),
        np.empty(num_options, np.int64),
    )
    hyp_offsets, hyp_tracks, log_weights = (
        np.empty(num_hyps + 1, np.int64),
        np.empty(num_entries, np.int64),
        np.empty(num_hyps),
    )
    num, filled, log_total = name_tracks(
        children, kept, parents, options, track_of, used_options, used_rows, hyp_offsets, hyp_tracks, log_weights
    )
    most = 0
    for i in range(num):
        most += rows.offsets[used_rows[i] + 1] - rows.offsets[used_rows[i]]
    dim = rows.means.shape[1]
    tracks = Tracks(
        np.empty((num, 2), np.int64),
        np.empty(num + 1, np.int64),
        np.empty(most),
        np.empty((most, dim)),
        np.empty((most, dim, dim)),
    )
    last = update_tracks(used_options[:num], used_rows[:num], rows, options, tracks)
    trimmed = Tracks(tracks.labels, tracks.offsets, tracks.log_weights[:last], tracks.means[:last], tracks.covs[:last])
    return Glmb(trimmed, hyp_offsets, hyp_tracks[:filled].copy(), log_weights), log_total
