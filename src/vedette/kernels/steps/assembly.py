"""Posterior from the kept joint choices of a scan: updated tracks, each stored once, and hypotheses over them."""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.association.assignment import ABSENT, MISSED, Options
from vedette.kernels.association.children import Children, Parents
from vedette.kernels.association.predicted import Rows
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Glmb, Ints, Mixture, Tracks
from vedette.kernels.gaussian.components import components_between, components_like, copy_component, copy_gaussian
from vedette.kernels.gaussian.innovation import update_mean
from vedette.kernels.gaussian.linalg import normalise_logs
from vedette.kernels.gaussian.marks import copy_updated_marks
from vedette.kernels.gaussian.relinearisation import copy_updated


class Naming(NamedTuple):
    """Tracks of a posterior, numbered by first use: one for each option that one of its hypotheses takes."""

    track_of: Ints  # (num_options,) number of the track that an option makes, -1 for none
    options: Ints  # (num_options,) option of each track
    rows: Ints  # (num_options,) row of each track


@kernel
def make_naming(num_options: int) -> Naming:
    return Naming(np.empty(num_options, np.int64), np.empty(num_options, np.int64), np.empty(num_options, np.int64))


@inlined
def write_updated(row: int, option: int, rows: Rows, options: Options, start: int, out: Mixture) -> int:
    """Write the updated components of a row under one of its options from `start` on, and return the end.

    Their log weights sum to the option's own. Components outside the gate are left out.
    """
    first, entry = rows.offsets[row], options.entries[option]
    detected, predicted = options.columns[option] != MISSED, rows.components
    for i in range(rows.offsets[row + 1] - first):
        c, weight = first + i, options.component_log_weights[entry + i]
        # A component outside the gate cannot have caused this measurement.
        if weight == -math.inf:
            continue
        copy_component(predicted, c, out, start)
        out.log_weights[start] = weight
        if rows.innovation.bends[c] if detected else rows.innovation.at_edge[c]:
            copy_updated(options.updated[entry + i], out.means[start], out.covs[start])
        elif detected:
            copy_gaussian(predicted.means, rows.innovation.covs, c, out.means, out.covs, start)
            update_mean(rows.innovation, c, options.whitened[entry + i], predicted.means[c], out.means[start])
        if detected:
            copy_updated_marks(options.marks, entry + i, out.marks, start)
        start += 1
    return start


@borrowing
def name_tracks(
    children: Children, kept: Ints, parents: Parents, options: Options, naming: Naming, out: Parents
) -> tuple[int, int, float]:
    """Write the hypotheses of the `kept` children, normalised, over the tracks of `naming`.

    They are the parents of the next scan. Returns the numbers of tracks and of entries of `out.rows`, and the log of
    the sum of the children's weights.
    """
    for option in range(options.offsets[len(options.offsets) - 1]):
        naming.track_of[option] = -1
    num_tracks, filled = 0, 0
    out.offsets[0] = 0
    for h in range(len(kept)):
        child = kept[h]
        out.log_weights[h] = children.log_weights[child]
        start, first_row = children.offsets[child], parents.offsets[children.parents[child]]
        for i in range(children.offsets[child + 1] - start):
            option = children.options[start + i]
            if options.columns[option] == ABSENT:
                continue
            # An option also determines the row, so it identifies the updated track in every hypothesis.
            if naming.track_of[option] < 0:
                naming.track_of[option] = num_tracks
                naming.options[num_tracks], naming.rows[num_tracks] = option, parents.rows[first_row + i]
                num_tracks += 1
            out.rows[filled] = naming.track_of[option]
            filled += 1
        out.offsets[h + 1] = filled
    return num_tracks, filled, normalise_logs(out.log_weights[: len(kept)])


@borrowing
def update_tracks(naming: Naming, num_tracks: int, rows: Rows, options: Options, out: Tracks) -> int:
    """Write the named tracks with normalised mixtures, and return the number of components."""
    filled, components = 0, out.components
    out.offsets[0] = 0
    for i in range(num_tracks):
        row, option = naming.rows[i], naming.options[i]
        out.labels[i, 0], out.labels[i, 1] = rows.labels[row, 0], rows.labels[row, 1]
        end = write_updated(row, option, rows, options, filled, components)
        if end == filled + 1:
            components.log_weights[filled] = 0.0
        else:
            normalise_logs(components.log_weights[filled:end])
        filled = end
        out.offsets[i + 1] = filled
    return filled


@kernel
def assemble(
    children: Children, kept: Ints, parents: Parents, members: Ints, rows: Rows, options: Options
) -> tuple[Glmb, float, Naming]:
    """Return the normalised posterior of the kept children, the log of their unnormalised sum, and its naming.

    members: (num_rows,) place in `rows` of each row of the options and parents.
    """
    naming = make_naming(options.offsets[-1])
    hyps = Parents(np.empty(len(kept) + 1, np.int64), np.empty(children.filled[1], np.int64), np.empty(len(kept)))
    num, filled, log_total = name_tracks(children, kept, parents, options, naming, hyps)
    most = 0
    for i in range(num):
        row = members[naming.rows[i]]
        naming.rows[i] = row
        most += rows.offsets[row + 1] - rows.offsets[row]
    room = components_like(rows.components, most)
    tracks = Tracks(np.empty((num, 2), np.int64), np.empty(num + 1, np.int64), room)
    last = update_tracks(naming, num, rows, options, tracks)
    trimmed = Tracks(tracks.labels, tracks.offsets, components_between(room, 0, last))
    return Glmb(trimmed, hyps.offsets, hyps.rows[:filled].copy(), hyps.log_weights), log_total, naming
