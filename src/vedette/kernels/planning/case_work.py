"""Working arrays of the pseudo-updates of a GLMB, allocated once and grown when a case needs more.

They are kept from case to case: a decision is about five thousand filter steps of 5 to 20 microseconds, and a step that
allocated its own arrays would spend more time on them than on the filter.
"""

from typing import NamedTuple

import numpy as np

from vedette.kernels.association.assignment import Options
from vedette.kernels.association.children import Children, Parents, grown_children, make_children
from vedette.kernels.association.gating import Near, all_measurements
from vedette.kernels.association.options import make_options
from vedette.kernels.association.predicted import Rows, make_rows
from vedette.kernels.association.search import WIDEST, Search, grown_search, make_search
from vedette.kernels.base.arrays import counted_ints, filled_ints
from vedette.kernels.base.compile import inlined, kernel
from vedette.kernels.base.types import Floats, Ints, Measurements, Tracks
from vedette.kernels.gaussian.components import borrowed_components, make_components
from vedette.kernels.gaussian.marks import no_marks
from vedette.kernels.gaussian.relinearisation import PairWork, make_pair_work
from vedette.kernels.gaussian.row_noise import bare_measurements
from vedette.kernels.steps.assembly import Naming, make_naming


class CaseBelief(NamedTuple):
    """A GLMB with one Gaussian per track, whose hypotheses are grouped by label set."""

    tracks: Tracks
    hyps: Parents
    groups: Ints  # (num_hyps,) label set of each hypothesis


class GlmbWork(NamedTuple):
    """Working arrays of a case."""

    needed: Ints  # (1,) number of tracks that a case needs
    pair: PairWork  # and scratch arrays
    measurements: Measurements  # room for the ideal ones, which bring nothing
    log_clutter: Floats  # (most_measurements,)
    first_rows: Rows  # of the prior, for all samples of an action
    rows: Rows  # of a later belief
    near: Near  # every measurement with every row: ideal scans are small
    options: Options
    search: Search
    children: Children
    naming: Naming
    all_children: Ints  # 0, 1, 2, ...: all children are kept
    even: CaseBelief  # after steps 0, 2, ...; the two beliefs alternate: one is read, the other written
    odd: CaseBelief  # after steps 1, 3, ...
    seen: Ints  # (num_sets,)
    heads: Ints  # (num_sets,) first hypothesis of each label set
    following: Ints  # (num_hyps,) next hypothesis of the same set
    relative: Floats  # (num_hyps,) weight relative to the heaviest of the set
    pool_weights: Floats  # (num_options,)


@inlined
def has_rows(work: GlmbWork, num: int) -> bool:
    """Return True if there is capacity for `num` tracks."""
    return num <= len(work.rows.log_absent)


@kernel
def _make_belief(num_tracks: int, num_hyps: int, num_entries: int, dim: int) -> CaseBelief:
    room = make_components(num_tracks, dim, no_marks())
    tracks = Tracks(np.empty((num_tracks, 2), np.int64), np.empty(num_tracks + 1, np.int64), room)
    hyps = Parents(np.empty(num_hyps + 1, np.int64), np.empty(num_entries, np.int64), np.empty(num_hyps))
    return CaseBelief(tracks, hyps, np.empty(num_hyps, np.int64))


@inlined
def view_belief(belief: CaseBelief, num_tracks: int, num_hyps: int, num_entries: int) -> CaseBelief:
    """Return the part of the arrays that is filled."""
    tracks, hyps = belief.tracks, belief.hyps
    return CaseBelief(
        Tracks(
            tracks.labels[:num_tracks],
            tracks.offsets[: num_tracks + 1],
            borrowed_components(tracks.components, num_tracks),
        ),
        Parents(hyps.offsets[: num_hyps + 1], hyps.rows[:num_entries], hyps.log_weights[:num_hyps]),
        belief.groups[:num_hyps],
    )


@kernel
def grown_work(work: GlmbWork) -> GlmbWork:
    """Return arrays with capacity for `needed` tracks, and for more children than now."""
    most_measurements, meas_dim = work.measurements.values.shape
    dim = work.rows.components.means.shape[1]
    rows, options, num = work.rows, work.options, work.needed[0]
    # Doubled, because a longer horizon will need still more tracks.
    if not has_rows(work, num):
        rows = make_rows(2 * num, 2 * num, rows.components, meas_dim)
        options = make_options(2 * num, 2 * num, most_measurements, dim, meas_dim)
    children = grown_children(work.children, work.search.sizes[WIDEST])
    num_options, num_hyps, num_entries = len(options.columns), len(children.parents), len(children.options)
    return GlmbWork(
        work.needed,
        work.pair,
        work.measurements,
        work.log_clutter,
        work.first_rows,
        rows,
        work.near,
        options,
        grown_search(work.search),
        children,
        make_naming(num_options),
        counted_ints(num_hyps),
        _make_belief(num_options, num_hyps, num_entries, dim),
        _make_belief(num_options, num_hyps, num_entries, dim),
        work.seen,
        work.heads,
        np.empty(num_hyps, np.int64),
        np.empty(num_hyps),
        np.empty(num_options),
    )


@kernel
def make_work(num_tracks: int, num_sets: int, dim: int, meas_dim: int, most_measurements: int) -> GlmbWork:
    """Return arrays for the start, with the sizes of a prior with `num_tracks` tracks and `num_sets` label sets."""
    none, belief = np.empty(0, np.int64), _make_belief(0, 0, 0, dim)
    like = belief.tracks.components
    work = GlmbWork(
        filled_ints(1, 2 * num_tracks),
        make_pair_work(dim, meas_dim),
        bare_measurements(np.empty((most_measurements, meas_dim))),
        np.empty(most_measurements),
        make_rows(num_tracks, num_tracks, like, meas_dim),
        make_rows(0, 0, like, meas_dim),
        all_measurements(),
        make_options(0, 0, most_measurements, dim, meas_dim),
        make_search(0),
        make_children(64, 512),
        make_naming(0),
        none,
        belief,
        belief,
        np.empty(num_sets, np.int64),
        np.empty(num_sets, np.int64),
        none,
        np.empty(0),
        np.empty(0),
    )
    return grown_work(work)
