"""The arrays in which the pseudo-updates of a GLMB are worked on, made once and grown when a case needs more."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vedette.kernels.association.assignment import Options
from vedette.kernels.association.children import Children, grown_children, make_children
from vedette.kernels.association.options import Rows, make_options, make_rows
from vedette.kernels.association.search import WIDEST, Search, grown_search, make_search
from vedette.kernels.base.compile import inlined, kernel
from vedette.kernels.base.types import Floats, Glmb, Ints, Tracks
from vedette.kernels.gaussian.kalman import Scratch, make_scratch


class GlmbWork(NamedTuple):
    """Arrays in which a case is worked on. Those of `rows`, `beliefs` and `groups` are shared by two: the first half of
    the rows is of the prior, which all samples of an action share; the beliefs take turns.

    needed: (1,) tracks that a case has asked for. scan, levels: the measurements and their clutter levels. used: as in
    `run_search`. numbers: 0, 1, 2, ... track_of, used_options, used_rows: as in `name_tracks`. seen, heads:
    (num_sets,). following, relative: (num_hyps,). pool_weights: (num_tracks,).
    """

    needed: Ints
    scratch: Scratch
    scan: Floats
    levels: Floats
    rows: Rows
    options: Options
    search: Search
    children: Children
    used: Ints
    numbers: Ints
    track_of: Ints
    used_options: Ints
    used_rows: Ints
    beliefs: Glmb
    groups: Ints
    seen: Ints
    heads: Ints
    following: Ints
    relative: Floats
    pool_weights: Floats


@inlined
def has_rows(rows: Rows, num: int) -> bool:
    """Whether each half has room for `num`, and their offsets do not touch."""
    return 2 * num + 2 <= len(rows.log_absent)


@kernel
def grown_work(work: GlmbWork) -> GlmbWork:
    """Room for `needed` tracks, and for more children than there are."""
    meas_dim, most_measurements, dim = work.scan.shape[1], len(work.scan), work.rows.means.shape[1]
    rows, options, num = work.rows, work.options, work.needed[0]
    if not has_rows(rows, num):
        rows = make_rows(4 * num + 2, 4 * num + 2, dim, meas_dim)
        options = make_options(2 * num, 2 * num, most_measurements, meas_dim)
    children = grown_children(work.children, work.used, work.search.sizes[WIDEST])
    num_options, num_hyps, num_entries = len(options.columns), len(children.parents), len(children.options)
    numbers = np.empty(num_hyps, np.int64)
    for h in range(num_hyps):
        numbers[h] = h
    tracks = Tracks(
        np.empty((2 * num_options, 2), np.int64),
        np.empty(2 * num_options + 2, np.int64),
        np.empty(2 * num_options),
        np.empty((2 * num_options, dim)),
        np.empty((2 * num_options, dim, dim)),
    )
    beliefs = Glmb(
        tracks, np.empty(2 * num_hyps + 2, np.int64), np.empty(2 * num_entries, np.int64), np.empty(2 * num_hyps)
    )
    return GlmbWork(
        work.needed,
        work.scratch,
        work.scan,
        work.levels,
        rows,
        options,
        grown_search(work.search),
        children,
        work.used,
        numbers,
        np.empty(num_options, np.int64),
        np.empty(num_options, np.int64),
        np.empty(num_options, np.int64),
        beliefs,
        np.empty(2 * num_hyps, np.int64),
        work.seen,
        work.heads,
        np.empty(num_hyps, np.int64),
        np.empty(num_hyps),
        np.empty(num_options),
    )


@kernel
def make_work(prior: Glmb, num_sets: int, meas_dim: int, most_measurements: int) -> GlmbWork:
    dim, none = prior.tracks.means.shape[1], np.empty(0, np.int64)
    needed = np.empty(1, np.int64)
    needed[0] = 2 * len(prior.tracks.labels)
    work = GlmbWork(
        needed,
        make_scratch(dim, meas_dim),
        np.empty((most_measurements, meas_dim)),
        np.empty(most_measurements),
        make_rows(0, 0, dim, meas_dim),
        make_options(0, 0, most_measurements, meas_dim),
        make_search(),
        make_children(),
        np.zeros(2, np.int64),
        none,
        none,
        none,
        none,
        prior,
        none,
        np.empty(num_sets, np.int64),
        np.empty(num_sets, np.int64),
        none,
        np.empty(0),
        np.empty(0),
    )
    return grown_work(work)


@inlined
def view_belief(beliefs: Glmb, half: int, num_tracks: int, num_hyps: int, num_entries: int) -> Glmb:
    """The belief in one half of the arrays, of one Gaussian a track."""
    track, offset = half * (len(beliefs.tracks.labels) // 2), half * (len(beliefs.tracks.offsets) // 2)
    hyp, hyp_offset = half * (len(beliefs.hyp_log_weights) // 2), half * (len(beliefs.hyp_offsets) // 2)
    entry = half * (len(beliefs.hyp_tracks) // 2)
    tracks = Tracks(
        beliefs.tracks.labels[track : track + num_tracks],
        beliefs.tracks.offsets[offset : offset + num_tracks + 1],
        beliefs.tracks.log_weights[track : track + num_tracks],
        beliefs.tracks.means[track : track + num_tracks],
        beliefs.tracks.covs[track : track + num_tracks],
    )
    return Glmb(
        tracks,
        beliefs.hyp_offsets[hyp_offset : hyp_offset + num_hyps + 1],
        beliefs.hyp_tracks[entry : entry + num_entries],
        beliefs.hyp_log_weights[hyp : hyp + num_hyps],
    )
