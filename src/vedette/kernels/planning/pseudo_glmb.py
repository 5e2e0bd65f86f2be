"""Pseudo-updates of a GLMB: the filter's own step for every action and sample of a decision (paper, Algorithm 2).

A case is one action of one sensor with one sample: case `action * num_samples + sample`. The kernels are those of
`vedette.kernels.steps.glmb`, in arrays that are kept from case to case. The differences: no target is born or dies, so
that every joint association is a separate hypothesis. The samples of an action share the first prediction, and every
case keeps all label sets of the prior, so that all cases and the prediction have the same support.
"""

import math
from typing import NamedTuple

from vedette.errors import NumericalError
from vedette.kernels.association.assignment import Options
from vedette.kernels.association.children import Parents
from vedette.kernels.association.options import view_options, weigh_options
from vedette.kernels.association.predicted import Rows, leave_unseen, predict_rows, view_rows
from vedette.kernels.association.ranked import add_missing_groups, run_search
from vedette.kernels.association.search import SearchCaps
from vedette.kernels.association.search_start import start_search
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Glmb, Ints, ScanInput
from vedette.kernels.gaussian.mixtures import match_components
from vedette.kernels.gaussian.pooling import add_to_pool
from vedette.kernels.gaussian.row_noise import first_measurements
from vedette.kernels.planning.case_work import CaseBelief, GlmbWork, grown_work, has_rows, make_work, view_belief
from vedette.kernels.planning.ideal import Decision, ideal_scan, most_targets
from vedette.kernels.steps.assembly import name_tracks, update_tracks


class GlmbResults(NamedTuple):
    """Updated densities. `set_offsets[g]:set_offsets[g + 1]` are the members of label set `g`."""

    set_offsets: Ints  # (num_sets + 1,) first member of each set
    log_weights: Floats  # (num_cases, num_sets)
    means: Floats  # (num_cases, num_members, state_dim), one Gaussian each; not written for log weight -inf
    covs: Floats  # (num_cases, num_members, state_dim, state_dim)


@inlined
def _find_children(options: Options, belief: CaseBelief, caps: SearchCaps, work: GlmbWork) -> bool:
    """Write the heaviest children, and the best of each label set. Returns False if the capacity is too small."""
    return (
        start_search(options, belief.hyps, work.search, work.children)
        and run_search(options, belief.hyps, caps, work.search, work.children)
        and add_missing_groups(options, belief.hyps, belief.groups, work.seen, work.search.work, work.children)
    )


@inlined
def _posterior(options: Options, belief: CaseBelief, rows: Rows, work: GlmbWork, out: CaseBelief) -> CaseBelief:
    """Return the posterior of all children, in the arrays of `out`."""
    children = work.children
    num_hyps = children.filled[0]
    kept = work.all_children[:num_hyps]
    num_tracks, num_entries, _ = name_tracks(children, kept, belief.hyps, options, work.naming, out.hyps)
    update_tracks(work.naming, num_tracks, rows, options, out.tracks)
    for h in range(num_hyps):
        out.groups[h] = belief.groups[children.parents[h]]
    return view_belief(out, num_tracks, num_hyps, num_entries)


@borrowing
def _update_cases(
    prior: CaseBelief, decision: Decision, first: int, last: int, results: GlmbResults, work: GlmbWork
) -> int:
    """Update cases `first:last`. Returns `last`, or the case before which `work` must be grown."""
    sensor, horizon, caps = decision.sensor, decision.horizon, decision.truncation
    num_samples, prepared = len(decision.futures.offsets) - 1, -1
    for case in range(first, last):
        action, sample = case // num_samples, case % num_samples
        belief = prior
        for step in range(horizon.poses.shape[1]):
            num_tracks = len(belief.tracks.labels)
            work.needed[0] = num_tracks
            if not has_rows(work, num_tracks):
                return case
            num = ideal_scan(decision, action, sample, step, work.pair.scratch, work.measurements.values)
            ideal = first_measurements(work.measurements, num)
            scan = ScanInput(decision.birth, ideal, horizon.poses[action, step], horizon.dt)
            # The first prediction depends on neither sample nor measurements: it is computed once per action.
            rows = work.first_rows if step == 0 else view_rows(work.rows, num_tracks)
            if step > 0 or action != prepared:
                predict_rows(belief.tracks, scan, decision.motion, sensor, rows, work.pair.scratch)
                if not horizon.scans[action, step]:
                    leave_unseen(rows)
            prepared = action
            options = view_options(work.options, num_tracks, num)
            weigh_options(rows, work.near, scan, sensor, caps, work.log_clutter, work.pair, options)
            if not _find_children(options, belief, caps.search, work):
                return case
            if work.children.filled[0] == 0:
                raise NumericalError(
                    "pseudo-update: no hypothesis has positive weight; do the models forbid the ideal scan?"
                )
            # One belief is read, the other written.
            belief = _posterior(options, belief, rows, work, work.even if step % 2 == 0 else work.odd)
        _write_marginal(belief, results, case, work)
    return last


@inlined
def _write_marginal(belief: CaseBelief, results: GlmbResults, case: int, work: GlmbWork) -> None:
    """Write the belief marginalised over association histories: a log weight per label set, one Gaussian per member.

    Paper eq. 10: w(L) = sum of the weights of L's hypotheses. Each member is the mixture of its tracks, with these
    weights.
    """
    set_offsets, log_weights, hyps, groups = results.set_offsets, results.log_weights[case], belief.hyps, belief.groups
    means, covs = results.means[case], results.covs[case]
    heads, following, relative = work.heads, work.following, work.relative  # the hypotheses of each set are chained
    slot_of, pool, weights = work.naming.track_of, work.naming.options, work.pool_weights
    for at in range(len(log_weights)):
        log_weights[at], heads[at] = -math.inf, -1
    # In reverse, so that each chain is in the order of its hypotheses.
    for h in range(len(groups) - 1, -1, -1):
        following[h] = heads[groups[h]]
        heads[groups[h]] = h
        log_weights[groups[h]] = max(log_weights[groups[h]], hyps.log_weights[h])
    own = belief.tracks.components
    for track in range(len(belief.tracks.labels)):
        slot_of[track] = -1
    for at in range(len(log_weights)):
        if heads[at] < 0:
            continue
        total, h = 0.0, heads[at]
        while h >= 0:
            relative[h] = math.exp(hyps.log_weights[h] - log_weights[at])
            total += relative[h]
            h = following[h]
        log_weights[at] += math.log(total)
        for m in range(set_offsets[at], set_offsets[at + 1]):
            end, h = 0, heads[at]
            while h >= 0:
                track = hyps.rows[hyps.offsets[h] + m - set_offsets[at]]
                end = add_to_pool(track, relative[h], slot_of, pool, weights, end)
                h = following[h]
            match_components(pool, weights, end, own.means, own.covs, means[m], covs[m])
            for p in range(end):
                slot_of[pool[p]] = -1


@kernel
def pseudo_update_glmb(
    prior: Glmb, groups: Ints, decision: Decision, first: int, last: int, results: GlmbResults
) -> None:
    """Write the results of cases `first:last` of one sensor into `results`.

    prior: one Gaussian per track. groups: label set of each of its hypotheses.
    """
    belief = CaseBelief(prior.tracks, Parents(prior.hyp_offsets, prior.hyp_tracks, prior.hyp_log_weights), groups)
    num_tracks, dim = prior.tracks.components.means.shape
    num_sets, most = len(results.set_offsets) - 1, most_targets(decision.futures)
    work = make_work(num_tracks, num_sets, dim, len(decision.sensor.periods), most)
    while first < last:
        first = _update_cases(belief, decision, first, last, results, work)
        if first < last:
            work = grown_work(work)
