"""Pseudo-updates of an LMB: the filter's own step for every action and sample of a decision.

A case is one action of one sensor with one sample; case `action * num_samples + sample`. The labels of the prior are
neither born nor dropped. All cases are worked on in the same arrays.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vedette.errors import NumericalError
from vedette.kernels.association.assignment import Options
from vedette.kernels.association.clusters import MarginalWork, grown_marginal_work, make_marginal_work
from vedette.kernels.association.marginals import MarginalCaps, fill_marginals
from vedette.kernels.association.options import (
    Rows,
    clutter_levels,
    expect_rows,
    fill_options,
    fill_survivors,
    make_options,
    make_rows,
    view_rows,
)
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Ints, Lmb, Tracks
from vedette.kernels.gaussian.kalman import Scratch, make_scratch
from vedette.kernels.gaussian.mixtures import copy_component
from vedette.kernels.planning.ideal import Decision, ideal_scan, most_targets
from vedette.kernels.steps.lmb import fill_existence, weigh_by_existence
from vedette.kernels.steps.matching import Mixture, make_mixture, match_rows


class LmbResults(NamedTuple):
    """Updated densities. logits: (num_cases, num_labels) of existence. means, covs: one Gaussian a label."""

    logits: Floats
    means: Floats
    covs: Floats


class LmbWork(NamedTuple):
    """Arrays in which a case is worked on. The first half of `rows` is of the prior, for all samples of an action.

    scan, levels: the measurements and their clutter levels. marginals: of the options. belief: after the latest step,
    one Gaussian for each label of the prior. numbers: 0, 1, 2, ..., one a row. mixture: of one row.
    """

    scratch: Scratch
    scan: Floats
    levels: Floats
    rows: Rows
    options: Options
    marginals: Floats
    clusters: MarginalWork
    belief: Lmb
    numbers: Ints
    mixture: Mixture


@kernel
def _make_work(prior: Lmb, meas_dim: int, most_measurements: int) -> LmbWork:
    num, dim = prior.tracks.means.shape
    options = make_options(num, num, most_measurements, meas_dim)
    numbers = np.empty(num, np.int64)
    for row in range(num):
        numbers[row] = row
    tracks = Tracks(
        prior.tracks.labels,
        prior.tracks.offsets,
        prior.tracks.log_weights,
        np.empty((num, dim)),
        np.empty((num, dim, dim)),
    )
    return LmbWork(
        make_scratch(dim, meas_dim),
        np.empty((most_measurements, meas_dim)),
        np.empty(most_measurements),
        make_rows(2 * num + 2, 2 * num + 2, dim, meas_dim),
        options,
        np.empty(len(options.columns)),
        make_marginal_work(num, most_measurements),
        Lmb(tracks, np.empty(num)),
        numbers,
        make_mixture(most_measurements + 1, dim),
    )


@kernel
def _grown_work(work: LmbWork) -> LmbWork:
    return LmbWork(
        work.scratch,
        work.scan,
        work.levels,
        work.rows,
        work.options,
        work.marginals,
        grown_marginal_work(work.clusters),
        work.belief,
        work.numbers,
        work.mixture,
    )


@inlined
def _predict(belief: Lmb, half: int, pose: Floats, decision: Decision, work: LmbWork) -> Rows:
    """Rows of the belief for a scan taken from `pose`, in one half of `work.rows`."""
    num = len(belief.existence_logit)
    rows = view_rows(work.rows, half * (num + 1), num)
    fill_survivors(belief.tracks, decision.motion, decision.horizon.dt, rows, work.scratch)
    weigh_by_existence(belief.existence_logit, rows)
    expect_rows(decision.sensor, pose, rows, work.scratch)
    return rows


@inlined
def _update(rows: Rows, pose: Floats, num_measurements: int, decision: Decision, work: LmbWork) -> bool:
    """Update `work.belief`; false where there is no room for it."""
    scan, options, caps = work.scan[:num_measurements], work.options, decision.truncation
    clutter_levels(decision.sensor, scan, pose, caps.log_clutter_floor, work.levels)
    fill_options(rows, scan, work.levels, decision.sensor, caps.gate, options)
    ranked = MarginalCaps(caps.max_hypotheses, caps.max_log_gap, caps.max_nodes)
    log_total, _, _, has_room = fill_marginals(options, num_measurements, ranked, work.clusters, work.marginals)
    if not has_room:
        return False
    if log_total == -math.inf:
        raise NumericalError("pseudo-update: no association has positive weight; do the models forbid the ideal scan?")
    belief = work.belief
    fill_existence(options, work.marginals, belief.existence_logit)
    match_rows(work.numbers, rows, options, work.marginals, work.mixture, belief.tracks.means, belief.tracks.covs)
    return True


@borrowing
def _update_cases(prior: Lmb, decision: Decision, first: int, last: int, results: LmbResults, work: LmbWork) -> int:
    """Cases `first:last`; returns `last`, or the case before which `work` must be grown."""
    horizon = decision.horizon
    num_samples, prepared = len(decision.futures.offsets) - 1, -1
    for case in range(first, last):
        action, sample = case // num_samples, case % num_samples
        for step in range(horizon.poses.shape[1]):
            pose = horizon.poses[action, step]
            if step > 0:
                rows = _predict(work.belief, 1, pose, decision, work)
            elif action != prepared:
                # The first prediction is the same for every sample of an action.
                rows = _predict(prior, 0, pose, decision, work)
                prepared = action
            else:
                rows = view_rows(work.rows, 0, len(prior.existence_logit))
            num = ideal_scan(decision, action, sample, step, work.scratch, work.scan)
            if not _update(rows, pose, num, decision, work):
                return case
        belief = work.belief
        for i in range(len(belief.existence_logit)):
            results.logits[case, i] = belief.existence_logit[i]
            copy_component(belief.tracks.means, belief.tracks.covs, i, results.means[case], results.covs[case], i)
    return last


@kernel
def pseudo_update_lmb(prior: Lmb, decision: Decision, first: int, last: int, results: LmbResults) -> None:
    """Cases `first:last` of one sensor, into `results`. prior: of one Gaussian a track."""
    work = _make_work(prior, len(decision.sensor.angular), most_targets(decision.futures))
    while first < last:
        first = _update_cases(prior, decision, first, last, results, work)
        if first < last:
            work = _grown_work(work)
