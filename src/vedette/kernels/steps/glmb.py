"""Joint prediction and update of a delta-GLMB density (Vo, Vo, Hoang 2017, eq. 29-35).

A child is a prior hypothesis with one option for each of its rows: a survivor or birth site is absent, missed or
detected. Its weight is the prior one's times those of the options,

    w+ = w  prod over rows of  P(absent)                                       if it is absent,
                               P(present) <p+, 1 - p_D>                        if it is missed,
                               P(present) <p+, p_D g(z | .)> / kappa(z)        if it is detected as z,

relative to the weight of all measurements being clutter. A planner runs the same kernels in its own workspace
(`vedette.kernels.planning.pseudo_glmb`). A filter adds births, and the choice of the children to keep.
"""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.association.assignment import Options
from vedette.kernels.association.children import Children, Parents
from vedette.kernels.association.detection_coverage import (
    Associations,
    add_uncovered,
    associations_of_options,
    mark_heaviest,
)
from vedette.kernels.association.gibbs import sample_children
from vedette.kernels.association.options import weighed_options
from vedette.kernels.association.predicted import Rows, rows_of_scan
from vedette.kernels.association.ranked import rank_children
from vedette.kernels.association.totals import (
    ROUNDING,
    log_heaviest_left,
    log_row_totals,
    log_total_bound,
    log_weight_bound,
)
from vedette.kernels.association.truncation import Truncation, heaviest_first, keep_heaviest, merge_equal
from vedette.kernels.base.arrays import counted_ints, filled_ints
from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Glmb, Ints, Motion, ScanInput, Sensor
from vedette.kernels.gaussian.mixtures import require_gaussians
from vedette.kernels.steps.assembly import Naming, assemble


class StepReport(NamedTuple):
    """Sums and truncations of a step."""

    log_total: float  # log of the sum of the kept weights, relative to all measurements being clutter
    log_kept: float  # log of the least share that this is of the sum of all weights
    log_clutter: float  # sum of the log clutter intensities of the scan
    num_raised: int  # measurements whose clutter intensity was raised to the floor
    cut: bool  # the ranking stopped at its bound on nodes
    full: bool  # the number of hypotheses is at its limit
    sources: Ints  # (num_tracks, 2) prior track of each track, -1: born; its measurement, -1: missed


class Associated(NamedTuple):
    """The rows of a scan, the options of each, and the prior hypotheses over them."""

    rows: Rows
    options: Options
    parents: Parents
    log_clutter: float  # as in `StepReport`
    num_raised: int  # as in `StepReport`


@kernel
def parents_with_births(prior: Glmb, num_births: int) -> Parents:
    """Return the prior's hypotheses, each with all birth sites, as any of them may give birth in each hypothesis."""
    num_hyps, num_tracks = len(prior.hyp_log_weights), len(prior.tracks.labels)
    offsets = np.zeros(num_hyps + 1, np.int64)
    rows = np.empty(len(prior.hyp_tracks) + num_hyps * num_births, np.int64)
    filled = 0
    for h in range(num_hyps):
        for i in range(prior.hyp_offsets[h], prior.hyp_offsets[h + 1]):
            rows[filled] = prior.hyp_tracks[i]
            filled += 1
        for b in range(num_births):
            rows[filled] = num_tracks + b
            filled += 1
        offsets[h + 1] = filled
    return Parents(offsets, rows, prior.hyp_log_weights)


@kernel
def _associate(prior: Glmb, scan: ScanInput, motion: Motion, sensor: Sensor, truncation: Truncation) -> Associated:
    """Weigh the options of each row: the tracks of the prior, then birth sites."""
    rows = rows_of_scan(prior.tracks, scan, motion, sensor)
    options, log_clutter, num_raised = weighed_options(rows, scan, sensor, truncation)
    parents = parents_with_births(prior, len(rows.labels) - len(prior.tracks.labels))
    return Associated(rows, options, parents, log_clutter, num_raised)


@kernel
def kept_children(
    labels: Ints, options: Options, parents: Parents, children: Children, truncation: Truncation, is_covered: bool
) -> tuple[Children, Ints]:
    """Return the children, each hypothesis once, with the best of every association, and those to keep, heaviest first.

    labels: (num_rows, 2) of the rows. is_covered: True if nothing that `max_track_gap` would keep has been left out.
    """
    caps = truncation.search
    covering = truncation.max_track_gap > 0.0 and not is_covered
    associations = Associations(np.empty(0, np.int64), 0)
    if covering:
        associations = associations_of_options(labels, options)
        children = add_uncovered(options, associations, parents, children, truncation.max_track_gap)
    # Two parents that differ only in tracks that are now absent have the same child: it is one hypothesis.
    order = heaviest_first(children, merge_equal(children, options.columns))
    needed = filled_ints(children.filled[0], 0)
    if covering:
        half = caps.max_hypotheses // 2
        num_safe = caps.max_hypotheses - half
        mark_heaviest(children, order, associations, num_safe, half, truncation.max_track_gap, needed)
    return children, keep_heaviest(children, order, needed, caps)


@kernel
def _sources(naming: Naming, num_tracks: int, num_prior: int, columns: Ints) -> Ints:
    """Return the prior track, among `num_prior`, and the measurement of each track, as in `StepReport`.

    columns: of the options.
    """
    sources = np.empty((num_tracks, 2), np.int64)
    for i in range(num_tracks):
        row = naming.rows[i]
        sources[i, 0] = row if row < num_prior else -1  # birth sites follow the tracks
        sources[i, 1] = columns[naming.options[i]]  # MISSED is -1
    return sources


@kernel
def _conclude(
    num_prior: int,
    found: Associated,
    children: Children,
    truncation: Truncation,
    cut: bool,
    is_covered: bool,
    log_next: float,
) -> tuple[Glmb, StepReport]:
    """Truncate and assemble.

    num_prior: number of tracks of the prior. log_next: see `log_weight_bound`. is_covered: see `kept_children`.
    """
    log_totals = log_row_totals(found.options)
    log_bound = log_total_bound(log_totals, found.parents)
    log_bound = log_weight_bound(found.options, found.parents, children, log_totals, log_next, log_bound)
    labels = found.rows.labels
    children, kept = kept_children(labels, found.options, found.parents, children, truncation, is_covered)
    members = counted_ints(len(labels))
    posterior, log_total, naming = assemble(children, kept, found.parents, members, found.rows, found.options)
    require_gaussians(posterior.tracks.components.means, posterior.tracks.components.covs)
    log_kept = log_total - log_bound if log_bound - log_total > ROUNDING else 0.0
    full = len(kept) >= truncation.search.max_hypotheses
    sources = _sources(naming, len(posterior.tracks.labels), num_prior, found.options.columns)
    return posterior, StepReport(log_total, log_kept, found.log_clutter, found.num_raised, cut, full, sources)


@kernel
def step_ranked(
    prior: Glmb, scan: ScanInput, motion: Motion, sensor: Sensor, truncation: Truncation
) -> tuple[Glmb, StepReport]:
    """Predict and update with one scan, with exactly ranked hypotheses.

    scan: its `dt` is 0 at the time of the prior, without births then.
    """
    found = _associate(prior, scan, motion, sensor, truncation)
    children, cut = rank_children(found.options, found.parents, truncation.search)
    # An exhausted search has left nothing out.
    is_covered = children.filled[0] < truncation.search.max_hypotheses and not cut
    log_next = log_heaviest_left(children, truncation.search, cut)
    return _conclude(len(prior.tracks.labels), found, children, truncation, cut, is_covered, log_next)


@kernel
def step_gibbs(
    prior: Glmb,
    scan: ScanInput,
    motion: Motion,
    sensor: Sensor,
    truncation: Truncation,
    num_samples: int,
    rng: np.random.Generator,
) -> tuple[Glmb, StepReport]:
    """Predict and update with one scan, with hypotheses found by Gibbs sampling."""
    found = _associate(prior, scan, motion, sensor, truncation)
    children = sample_children(found.options, found.parents, num_samples, rng)
    return _conclude(len(prior.tracks.labels), found, children, truncation, False, False, math.inf)
