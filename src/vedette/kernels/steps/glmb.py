"""Joint prediction and update of a delta-GLMB density (Vo, Vo, Hoang 2017, eq. 29-35)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vedette.kernels.association.assignment import Options
from vedette.kernels.association.coverage import add_uncovered, mark_heaviest, themes_of_options
from vedette.kernels.association.gibbs import sample_children
from vedette.kernels.association.options import (
    Rows,
    clutter_levels,
    expect_rows,
    fill_births,
    fill_survivors,
    list_options,
    make_rows,
)
from vedette.kernels.association.ranked import Children, Parents, rank_children
from vedette.kernels.association.truncation import Truncation, heaviest_first, keep_heaviest, merge_equal
from vedette.kernels.base.arrays import filled_ints
from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Floats, Glmb, Ints, Lmb, Motion, Sensor, Tracks
from vedette.kernels.gaussian.kalman import Scratch, make_scratch
from vedette.kernels.gaussian.linalg import log_sum
from vedette.kernels.gaussian.mixtures import require_gaussians
from vedette.kernels.steps.assembly import assemble


class StepReport(NamedTuple):
    """log_total: log of the sum of the kept weights, relative to all measurements being clutter, whose log intensities
    sum to log_clutter. log_bound: log of an upper bound on the sum of all weights.
    num_raised: measurements whose clutter intensity was raised to the floor. cut: ranking stopped at `max_nodes`.
    """

    log_total: float
    log_bound: float
    log_clutter: float
    num_raised: int
    cut: bool


@kernel
def _parents_with_births(prior: Glmb, num_births: int, groups: Ints) -> Parents:
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
    return Parents(offsets, rows, prior.hyp_log_weights, groups)


@kernel
def _log_total_bound(options: Options, parents: Parents) -> float:
    """Log total weight of all joint choices if rows could share measurements: an upper bound on the true total."""
    row_totals = np.empty(len(options.offsets) - 1)
    for row in range(len(row_totals)):
        row_totals[row] = log_sum(options.log_weights[options.offsets[row] : options.offsets[row + 1]])
    bounds = np.empty(len(parents.log_weights))
    for parent in range(len(bounds)):
        bounds[parent] = parents.log_weights[parent]
        for i in range(parents.offsets[parent], parents.offsets[parent + 1]):
            bounds[parent] += row_totals[parents.rows[i]]
    return log_sum(bounds)


@kernel
def prepare_rows(
    tracks: Tracks, birth: Lmb, pose: Floats, dt: float, motion: Motion, sensor: Sensor, scratch: Scratch
) -> Rows:
    """Predicted survivors and birth sites with what each expects of a scan taken from `pose`."""
    num_tracks, num_births = len(tracks.labels), len(birth.tracks.labels)
    num_components = len(tracks.log_weights) + len(birth.tracks.log_weights)
    rows = make_rows(num_tracks + num_births, num_components, tracks.means.shape[1], len(sensor.angular))
    fill_survivors(tracks, motion, dt, rows, scratch)
    fill_births(birth, num_tracks, rows)
    expect_rows(sensor, pose, rows, scratch)
    return rows


@kernel
def finish_step(
    prior: Glmb,
    num_births: int,
    rows: Rows,
    scan: Floats,
    pose: Floats,
    sensor: Sensor,
    truncation: Truncation,
    groups: Ints,
) -> tuple[Glmb, Ints, StepReport]:
    """Rank, truncate and assemble once the rows are prepared. Returns posterior, parent of each hypothesis, report."""
    levels = np.empty(len(scan))
    log_clutter, num_raised = clutter_levels(sensor, scan, pose, truncation.log_clutter_floor, levels)
    options = list_options(rows, scan, levels, sensor, truncation.gate)
    parents = _parents_with_births(prior, num_births, groups)
    children, cut = rank_children(
        options, parents, len(scan), truncation.max_hypotheses, truncation.max_log_gap, truncation.max_nodes
    )
    # A search that ran dry has left nothing out.
    is_covered = len(children.parents) < truncation.max_hypotheses and not cut
    return _conclude(children, parents, rows, options, len(scan), truncation, log_clutter, num_raised, cut, is_covered)


@kernel
def _conclude(
    children: Children,
    parents: Parents,
    rows: Rows,
    options: Options,
    num_columns: int,
    truncation: Truncation,
    log_clutter: float,
    num_raised: int,
    cut: bool,
    is_covered: bool,
) -> tuple[Glmb, Ints, StepReport]:
    """Truncate and assemble. is_covered: nothing that `max_track_gap` would keep has been left out."""
    covering = truncation.max_track_gap > 0.0 and not is_covered
    themes, num_themes = np.empty(0, np.int64), 0
    if covering:
        themes, num_themes = themes_of_options(rows.labels, options, num_columns)
        children = add_uncovered(options, themes, num_themes, parents, children, num_columns, truncation.max_track_gap)
    order = heaviest_first(children, merge_equal(children, options.columns))
    needed = filled_ints(len(children.parents), 0)
    if covering:
        half = truncation.max_hypotheses // 2
        mark_heaviest(
            children,
            order,
            themes,
            num_themes,
            truncation.max_hypotheses - half,
            half,
            truncation.max_track_gap,
            needed,
        )
    kept = keep_heaviest(children, order, needed, truncation, parents.groups)
    posterior, log_total = assemble(children, kept, parents, rows, options)
    require_gaussians(posterior.tracks.means, posterior.tracks.covs)
    report = StepReport(log_total, _log_total_bound(options, parents), log_clutter, num_raised, cut)
    origins = np.empty(len(kept), np.int64)
    for h in range(len(kept)):
        origins[h] = children.parents[kept[h]]
    return posterior, origins, report


@kernel
def step_ranked(
    prior: Glmb,
    birth: Lmb,
    scan: Floats,
    pose: Floats,
    dt: float,
    motion: Motion,
    sensor: Sensor,
    truncation: Truncation,
    groups: Ints,
) -> tuple[Glmb, Ints, StepReport]:
    """One scan with the exactly ranked hypotheses. groups: label-set number of each prior hypothesis, or empty."""
    scratch = make_scratch(prior.tracks.means.shape[1], len(sensor.angular))
    rows = prepare_rows(prior.tracks, birth, pose, dt, motion, sensor, scratch)
    return finish_step(prior, len(birth.tracks.labels), rows, scan, pose, sensor, truncation, groups)


@kernel
def step_gibbs(
    prior: Glmb,
    birth: Lmb,
    scan: Floats,
    pose: Floats,
    dt: float,
    motion: Motion,
    sensor: Sensor,
    truncation: Truncation,
    num_samples: int,
    rng: np.random.Generator,
) -> tuple[Glmb, Ints, StepReport]:
    """One scan with hypotheses found by Gibbs sampling."""
    scratch = make_scratch(prior.tracks.means.shape[1], len(sensor.angular))
    rows = prepare_rows(prior.tracks, birth, pose, dt, motion, sensor, scratch)
    levels = np.empty(len(scan))
    log_clutter, num_raised = clutter_levels(sensor, scan, pose, truncation.log_clutter_floor, levels)
    options = list_options(rows, scan, levels, sensor, truncation.gate)
    parents = _parents_with_births(prior, len(birth.tracks.labels), np.empty(0, np.int64))
    children = sample_children(options, parents, len(scan), num_samples, rng)
    return _conclude(children, parents, rows, options, len(scan), truncation, log_clutter, num_raised, False, False)
