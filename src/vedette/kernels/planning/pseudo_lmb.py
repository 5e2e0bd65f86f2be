"""Pseudo-updates of an LMB: the filter's own step for every action and sample of a decision.

A case is one action of one sensor with one sample: case `action * num_samples + sample`. The kernels are those of
`vedette.kernels.steps.lmb`, in arrays that are kept from case to case. The differences: no label is born, dies or is
dropped, and the samples of an action share the first prediction.
"""

import math
from typing import NamedTuple

import numpy as np

from vedette.errors import NumericalError
from vedette.kernels.association.assignment import Options
from vedette.kernels.association.clusters import MarginalWork, grown_marginal_work, make_marginal_work
from vedette.kernels.association.gating import Near, all_measurements
from vedette.kernels.association.marginals import Association, fill_marginals
from vedette.kernels.association.options import make_options, view_options, weigh_options
from vedette.kernels.association.predicted import Rows, leave_unseen, make_rows, predict_rows
from vedette.kernels.base.compile import borrowing, kernel
from vedette.kernels.base.types import Floats, Ints, Lmb, Measurements, Mixture, ScanInput, Tracks
from vedette.kernels.gaussian.components import copy_gaussian, make_components, merge_all
from vedette.kernels.gaussian.marks import no_marks
from vedette.kernels.gaussian.relinearisation import PairWork, make_pair_work
from vedette.kernels.gaussian.row_noise import bare_measurements, first_measurements
from vedette.kernels.planning.ideal import Decision, ideal_scan, most_targets
from vedette.kernels.steps.lmb import fill_existence, weigh_by_existence, write_mixture


class LmbResults(NamedTuple):
    """Updated densities."""

    logits: Floats  # (num_cases, num_labels) logits of existence
    means: Floats  # (num_cases, num_labels, state_dim), one Gaussian per label
    covs: Floats  # (num_cases, num_labels, state_dim, state_dim)


class LmbWork(NamedTuple):
    """Working arrays of a case, with one row per label of the prior."""

    pair: PairWork  # and scratch arrays
    measurements: Measurements  # room for the ideal ones, which bring nothing
    log_clutter: Floats  # (most_measurements,)
    first_rows: Rows  # of the prior, for all samples of an action
    rows: Rows  # of a later belief
    near: Near  # every measurement with every row: ideal scans are small
    options: Options
    marginals: Floats  # (num_options,)
    belief: Lmb  # after the latest step, one Gaussian per label
    wide: Mixture  # of one row over its options
    chosen: Ints  # (num,) the components of `wide`
    weights: Floats  # (num,) their linear weights


@kernel
def _make_work(prior: Lmb, meas_dim: int, most_measurements: int) -> LmbWork:
    num, dim = prior.tracks.components.means.shape
    options = make_options(num, num, most_measurements, dim, meas_dim)
    room = make_components(num, dim, no_marks())
    for c in range(num):
        room.log_weights[c] = prior.tracks.components.log_weights[c]
    tracks = Tracks(prior.tracks.labels, prior.tracks.offsets, room)
    return LmbWork(
        make_pair_work(dim, meas_dim),
        bare_measurements(np.empty((most_measurements, meas_dim))),
        np.empty(most_measurements),
        make_rows(num, num, room, meas_dim),
        make_rows(num, num, room, meas_dim),
        all_measurements(),
        options,
        np.empty(len(options.columns)),
        Lmb(tracks, np.empty(num)),
        make_components(most_measurements + 1, dim, no_marks()),
        np.empty(most_measurements + 1, np.int64),
        np.empty(most_measurements + 1),
    )


@borrowing
def _update_cases(
    prior: Lmb,
    decision: Decision,
    association: Association | None,
    first: int,
    last: int,
    results: LmbResults,
    work: LmbWork,
    clusters: MarginalWork,
) -> int:
    """Update cases `first:last`. Returns `last`, or the case before which `clusters` must be grown."""
    sensor, horizon, caps, belief = decision.sensor, decision.horizon, decision.truncation, work.belief
    num_samples, prepared, updated = len(decision.futures.offsets) - 1, -1, belief.tracks.components
    for case in range(first, last):
        action, sample = case // num_samples, case % num_samples
        for step in range(horizon.poses.shape[1]):
            num = ideal_scan(decision, action, sample, step, work.pair.scratch, work.measurements.values)
            ideal = first_measurements(work.measurements, num)
            scan = ScanInput(decision.birth, ideal, horizon.poses[action, step], horizon.dt)
            # The first prediction depends on neither sample nor measurements: it is computed once per action.
            rows, current = (work.first_rows, prior) if step == 0 else (work.rows, belief)
            if step > 0 or action != prepared:
                predict_rows(current.tracks, scan, decision.motion, sensor, rows, work.pair.scratch)
                if not horizon.scans[action, step]:
                    leave_unseen(rows)
                weigh_by_existence(current.existence_logit, rows)
            prepared = action
            options = view_options(work.options, len(rows.log_absent), num)
            weigh_options(rows, work.near, scan, sensor, caps, work.log_clutter, work.pair, options)
            sums, has_room = fill_marginals(options, caps.search, association, clusters, work.marginals)
            if not has_room:
                return case
            if sums.log_total == -math.inf:
                raise NumericalError(
                    "pseudo-update: no association has positive weight; do the models forbid the ideal scan?"
                )
            fill_existence(options, work.marginals, belief.existence_logit)
            for row in range(len(belief.existence_logit)):
                width = write_mixture(row, rows, options, work.marginals, work.wide)
                merge_all(work.wide, width, work.chosen, work.weights, 0.0, updated, row)
        for i in range(len(belief.existence_logit)):
            results.logits[case, i] = belief.existence_logit[i]
            copy_gaussian(updated.means, updated.covs, i, results.means[case], results.covs[case], i)
    return last


@kernel
def pseudo_update_lmb(
    prior: Lmb, decision: Decision, association: Association | None, first: int, last: int, results: LmbResults
) -> None:
    """Write the results of cases `first:last` of one sensor into `results`.

    prior: one Gaussian per track. association: used instead of the sums over clusters.
    """
    most_measurements = most_targets(decision.futures)
    work = _make_work(prior, len(decision.sensor.periods), most_measurements)
    clusters = make_marginal_work(len(prior.tracks.labels), most_measurements)
    while first < last:
        first = _update_cases(prior, decision, association, first, last, results, work, clusters)
        if first < last:
            clusters = grown_marginal_work(clusters)
