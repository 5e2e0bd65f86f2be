"""Pseudo-updates of a GLMB: the filter's own step for every action and sample of a decision (paper, Algorithm 2).

A case is one action of one sensor with one sample; case `action * num_samples + sample`. The targets of the prior are
neither born nor do they die, so that every joint choice is a hypothesis of its own. Every case keeps all label sets of
the prior, so that all cases and the prediction are compared on one support.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from vedette.errors import NumericalError
from vedette.kernels.association.assignment import Options
from vedette.kernels.association.children import Parents
from vedette.kernels.association.options import (
    Rows,
    clutter_levels,
    expect_rows,
    fill_options,
    fill_survivors,
    view_options,
    view_rows,
)
from vedette.kernels.association.ranked import add_missing_groups, run_search, size_search, start_search
from vedette.kernels.association.truncation import Truncation
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Glmb, Ints
from vedette.kernels.gaussian.mixtures import match_components
from vedette.kernels.gaussian.pooling import add_to_pool
from vedette.kernels.planning.ideal import Decision, ideal_scan, most_targets
from vedette.kernels.planning.planning_work import GlmbWork, grown_work, has_rows, make_work, view_belief
from vedette.kernels.steps.assembly import name_tracks, update_tracks


class GlmbResults(NamedTuple):
    """Updated densities. Members `set_offsets[g]:set_offsets[g + 1]` are the labels of label set `g`.

    log_weights: (num_cases, num_sets). means, covs: (num_cases, num_members, ...) one Gaussian each; those of a set of
    log weight -inf are left as they are.
    """

    set_offsets: Ints
    log_weights: Floats
    means: Floats
    covs: Floats


@inlined
def _predict(belief: Glmb, half: int, pose: Floats, decision: Decision, work: GlmbWork) -> Rows:
    """Rows of the belief for a scan taken from `pose`, in one half of `work.rows`; there must be room."""
    num = len(belief.tracks.labels)
    rows = view_rows(work.rows, half * (len(work.rows.log_absent) // 2), num)
    fill_survivors(belief.tracks, decision.motion, decision.horizon.dt, rows, work.scratch)
    expect_rows(decision.sensor, pose, rows, work.scratch)
    return rows


@inlined
def _rank(options: Options, parents: Parents, num_columns: int, caps: Truncation, work: GlmbWork) -> bool:
    """Write the children of the parents; false where there is no room for them."""
    work.used[0] = work.used[1] = 0
    if not size_search(options, parents, num_columns, work.search):
        return False
    start_search(options, parents, work.search)
    if not run_search(
        options, parents, caps.max_hypotheses, caps.max_log_gap, caps.max_nodes, work.search, work.children, work.used
    ):
        return False
    return add_missing_groups(options, parents, work.search.work, work.seen, work.children, work.used)


@inlined
def _update(options: Options, parents: Parents, rows: Rows, half: int, work: GlmbWork) -> Glmb:
    """The posterior of all children, in one half of `work.beliefs`, its hypotheses' groups in `work.groups`."""
    num_hyps, children = work.used[0], work.children
    out = view_belief(work.beliefs, half, len(work.track_of), num_hyps, work.used[1])
    num_tracks, num_entries, _ = name_tracks(
        children, work.numbers[:num_hyps], parents, options, work.track_of, work.used_options, work.used_rows,
        out.hyp_offsets, out.hyp_tracks, out.hyp_log_weights,
    )  # fmt: skip
    update_tracks(work.used_options[:num_tracks], work.used_rows[:num_tracks], rows, options, out.tracks)
    start = half * (len(work.groups) // 2)
    for h in range(num_hyps):
        work.groups[start + h] = parents.groups[children.parents[h]]
    return view_belief(work.beliefs, half, num_tracks, num_hyps, num_entries)


@borrowing
def _update_cases(
    prior: Glmb, groups: Ints, decision: Decision, first: int, last: int, results: GlmbResults, work: GlmbWork
) -> int:
    """Cases `first:last`; returns `last`, or the case before which `work` must be grown."""
    sensor, horizon, caps = decision.sensor, decision.horizon, decision.truncation
    num_samples, prepared = len(decision.futures.offsets) - 1, -1
    for case in range(first, last):
        action, sample = case // num_samples, case % num_samples
        belief, belief_groups = prior, groups
        for step in range(horizon.poses.shape[1]):
            pose, num_tracks = horizon.poses[action, step], len(belief.tracks.labels)
            work.needed[0] = num_tracks
            if not has_rows(work.rows, num_tracks):
                return case
            # The first prediction is the same for every sample of an action.
            if step == 0 and action == prepared:
                rows = view_rows(work.rows, 0, num_tracks)
            else:
                rows = _predict(belief, min(step, 1), pose, decision, work)
            prepared = action
            num = ideal_scan(decision, action, sample, step, work.scratch, work.scan)
            clutter_levels(sensor, work.scan[:num], pose, caps.log_clutter_floor, work.levels)
            options = view_options(work.options, num_tracks)
            fill_options(rows, work.scan[:num], work.levels, sensor, caps.gate, options)
            parents = Parents(belief.hyp_offsets, belief.hyp_tracks, belief.hyp_log_weights, belief_groups)
            if not _rank(options, parents, num, caps, work):
                return case
            if work.used[0] == 0:
                raise NumericalError(
                    "pseudo-update: no hypothesis has positive weight; do the models forbid the ideal scan?"
                )
            belief = _update(options, parents, rows, step % 2, work)
            start = (step % 2) * (len(work.groups) // 2)
            belief_groups = work.groups[start : start + work.used[0]]
        _write_marginal(belief, belief_groups, results, case, work)
    return last


@inlined
def _write_marginal(belief: Glmb, groups: Ints, results: GlmbResults, case: int, work: GlmbWork) -> None:
    """The belief marginalised over association histories: a log weight a label set, one Gaussian a member."""
    set_offsets, log_weights = results.set_offsets, results.log_weights[case]
    means, covs = results.means[case], results.covs[case]
    heads, following, relative = work.heads, work.following, work.relative  # the hypotheses of each set are chained
    slot_of, pool, weights = work.track_of, work.used_options, work.pool_weights
    for at in range(len(log_weights)):
        log_weights[at], heads[at] = -math.inf, -1
    for h in range(len(groups) - 1, -1, -1):
        following[h] = heads[groups[h]]
        heads[groups[h]] = h
        log_weights[groups[h]] = max(log_weights[groups[h]], belief.hyp_log_weights[h])
    for track in range(len(belief.tracks.labels)):
        slot_of[track] = -1
    for at in range(len(log_weights)):
        if heads[at] < 0:
            continue
        total, h = 0.0, heads[at]
        while h >= 0:
            relative[h] = math.exp(belief.hyp_log_weights[h] - log_weights[at])
            total += relative[h]
            h = following[h]
        log_weights[at] += math.log(total)
        for m in range(set_offsets[at], set_offsets[at + 1]):
            end, h = 0, heads[at]
            while h >= 0:
                track = belief.hyp_tracks[belief.hyp_offsets[h] + m - set_offsets[at]]
                end = add_to_pool(track, relative[h], slot_of, pool, weights, end)
                h = following[h]
            match_components(pool, weights, end, belief.tracks.means, belief.tracks.covs, means[m], covs[m])
            for p in range(end):
                slot_of[pool[p]] = -1


@kernel
def pseudo_update_glmb(
    prior: Glmb, groups: Ints, decision: Decision, first: int, last: int, results: GlmbResults
) -> None:
    """Cases `first:last` of one sensor, into `results`.

    prior: of one Gaussian a track. groups: label set of each of its hypotheses.
    """
    num_sets, meas_dim = len(results.set_offsets) - 1, len(decision.sensor.angular)
    work = make_work(prior, num_sets, meas_dim, most_targets(decision.futures))
    while first < last:
        first = _update_cases(prior, groups, decision, first, last, results, work)
        if first < last:
            work = grown_work(work)
