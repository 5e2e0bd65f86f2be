"""Joint prediction and update of a delta-GLMB density (Vo, Vo, Hoang 2017, eq. 29-35)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.arrays import filled_ints, hashed
from vedette.kernels.assignment import ABSENT, MISSED, Options
from vedette.kernels.association import (
    Rows,
    clutter_levels,
    expect_rows,
    fill_births,
    fill_survivors,
    list_options,
    make_rows,
)
from vedette.kernels.compile import kernel
from vedette.kernels.coverage import add_uncovered, mark_heaviest, themes_of_options
from vedette.kernels.gaussian import Scratch, make_scratch, update_mean
from vedette.kernels.gibbs import sample_children
from vedette.kernels.linalg import log_sum
from vedette.kernels.mixtures import copy_component, descending_order
from vedette.kernels.ranked import Children, Parents, num_groups, rank_children
from vedette.kernels.types import Floats, Glmb, Ints, Lmb, Motion, Sensor, Tracks


class Truncation(NamedTuple):
    """What is kept. max_hyps: number of hypotheses. max_log_gap: log weight below the best. gate: squared Mahalanobis
    distance. log_clutter_floor: least log clutter intensity. max_nodes: bound on the ranking search. max_track_gap: log
    weight below the best to which a hypothesis is kept as the only one of a track; 0: none is.
    """

    max_hyps: int
    max_log_gap: float
    gate: float
    log_clutter_floor: float
    max_nodes: int
    max_track_gap: float


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
def _same_tracks(first: int, second: int, children: Children, columns: Ints) -> bool:
    """Whether two children are the same hypothesis: the same updated tracks, whoever else died."""
    i, j = children.offsets[first], children.offsets[second]
    end_i, end_j = children.offsets[first + 1], children.offsets[second + 1]
    while True:
        while i < end_i and columns[children.options[i]] == ABSENT:
            i += 1
        while j < end_j and columns[children.options[j]] == ABSENT:
            j += 1
        if i == end_i or j == end_j:
            return i == end_i and j == end_j
        if children.options[i] != children.options[j]:
            return False
        i += 1
        j += 1


@kernel
def _merge_equal(children: Children, columns: Ints) -> Ints:
    """Add the weight of each repeated hypothesis to its first occurrence; return the first occurrences."""
    num = len(children.parents)
    size = 4
    while size < 2 * num:
        size *= 2
    table = filled_ints(size, -1)
    firsts = np.empty(num, np.int64)
    num_firsts = 0
    for child in range(num):
        key = 0
        for i in range(children.offsets[child], children.offsets[child + 1]):
            if columns[children.options[i]] != ABSENT:
                key = hashed(key, children.options[i])
        slot = key & (size - 1)
        while table[slot] >= 0 and not _same_tracks(table[slot], child, children, columns):
            slot = (slot + 1) & (size - 1)
        if table[slot] < 0:
            table[slot] = child
            firsts[num_firsts] = child
            num_firsts += 1
        else:
            first = table[slot]
            a, b = children.log_weights[first], children.log_weights[child]
            children.log_weights[first] = max(a, b) + math.log1p(math.exp(min(a, b) - max(a, b)))
    return firsts[:num_firsts]


@kernel
def _heaviest_first(children: Children, firsts: Ints) -> Ints:
    """The children `firsts` by descending weight, ties by order of discovery."""
    log_weights = np.empty(len(firsts))
    for i in range(len(firsts)):
        log_weights[i] = children.log_weights[firsts[i]]
    order = descending_order(log_weights)
    for i in range(len(order)):
        order[i] = firsts[order[i]]
    return order


@kernel
def _keep_heaviest(children: Children, order: Ints, needed: Ints, truncation: Truncation, groups: Ints) -> Ints:
    """The children to keep of those in `order`, heaviest first: those needed; of the others, by number and gap; and the
    heaviest of each group.
    """
    others = truncation.max_hyps
    for child in order:
        others -= needed[child]
    kept = np.empty(len(order), np.int64)
    num_kept = 0
    seen = filled_ints(num_groups(groups), 0)
    for child in order:
        wanted = needed[child] == 1
        gap = children.log_weights[order[0]] - children.log_weights[child]
        if not wanted and others > 0 and gap <= truncation.max_log_gap:
            wanted = True
            others -= 1
        if len(groups):
            group = groups[children.parents[child]]
            wanted = wanted or seen[group] == 0
            seen[group] = 1
        if wanted:
            kept[num_kept] = child
            num_kept += 1
    return kept[:num_kept]


@kernel
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


@kernel
def _updated_tracks(used_options: Ints, used_rows: Ints, rows: Rows, options: Options) -> Tracks:
    num = len(used_options)
    most = 0
    for i in range(num):
        most += rows.offsets[used_rows[i] + 1] - rows.offsets[used_rows[i]]
    labels, offsets = np.empty((num, 2), np.int64), np.zeros(num + 1, np.int64)
    log_weights = np.empty(most)
    means = np.empty((most, rows.means.shape[1]))
    covs = np.empty((most, rows.means.shape[1], rows.means.shape[1]))
    filled = 0
    for i in range(num):
        labels[i, 0], labels[i, 1] = rows.labels[used_rows[i], 0], rows.labels[used_rows[i], 1]
        end = write_updated(used_rows[i], used_options[i], rows, options, filled, log_weights, means, covs)
        for c in range(filled, end):
            log_weights[c] -= options.log_weights[used_options[i]]
        filled = end
        offsets[i + 1] = filled
    return Tracks(labels, offsets, log_weights[:filled], means[:filled], covs[:filled])


@kernel
def _assemble(children: Children, kept: Ints, parents: Parents, rows: Rows, options: Options) -> tuple[Glmb, float]:
    """The posterior of the kept children, normalised, and the log of their unnormalised sum.

    Tracks are numbered by first use, so that a track's density is held once.
    """
    track_of = filled_ints(options.offsets[-1], -1)
    used_options, used_rows = np.empty(len(children.options), np.int64), np.empty(len(children.options), np.int64)
    num_used, filled = 0, 0
    hyp_offsets, hyp_tracks = np.zeros(len(kept) + 1, np.int64), np.empty(len(children.options), np.int64)
    log_weights = np.empty(len(kept))
    for h in range(len(kept)):
        child = kept[h]
        log_weights[h] = children.log_weights[child]
        first_row = parents.offsets[children.parents[child]]
        for i in range(children.offsets[child + 1] - children.offsets[child]):
            option = children.options[children.offsets[child] + i]
            if options.columns[option] == ABSENT:
                continue
            if track_of[option] < 0:
                track_of[option] = num_used
                used_options[num_used], used_rows[num_used] = option, parents.rows[first_row + i]
                num_used += 1
            hyp_tracks[filled] = track_of[option]
            filled += 1
        hyp_offsets[h + 1] = filled
    log_total = log_sum(log_weights)
    for h in range(len(kept)):
        log_weights[h] -= log_total
    tracks = _updated_tracks(used_options[:num_used], used_rows[:num_used], rows, options)
    return Glmb(tracks, hyp_offsets, hyp_tracks[:filled].copy(), log_weights), log_total


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
        options, parents, len(scan), truncation.max_hyps, truncation.max_log_gap, truncation.max_nodes
    )
    # A search that ran dry has left nothing out.
    is_covered = len(children.parents) < truncation.max_hyps and not cut
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
    order = _heaviest_first(children, _merge_equal(children, options.columns))
    needed = filled_ints(len(children.parents), 0)
    if covering:
        half = truncation.max_hyps // 2
        mark_heaviest(
            children, order, themes, num_themes, truncation.max_hyps - half, half, truncation.max_track_gap, needed
        )
    kept = _keep_heaviest(children, order, needed, truncation, parents.groups)
    posterior, log_total = _assemble(children, kept, parents, rows, options)
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
