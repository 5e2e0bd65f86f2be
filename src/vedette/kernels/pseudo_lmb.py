"""Pseudo-updates of an LMB: the filter's own step for every action and sample of a decision."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vedette.errors import NumericalError
from vedette.kernels.compile import kernel
from vedette.kernels.conversions import glmb_to_lmb
from vedette.kernels.gaussian import make_scratch
from vedette.kernels.glmb import prepare_rows
from vedette.kernels.ideal import Decision, ideal_scan, most_targets
from vedette.kernels.lmb import Reduction, finish_lmb, weigh_by_existence
from vedette.kernels.mixtures import copy_component
from vedette.kernels.pseudo_glmb import GlmbResults
from vedette.kernels.types import Floats, Glmb, Ints, Lmb, Tracks


class LmbResults(NamedTuple):
    """Updated densities. logits: (num_cases, num_labels) of existence. means, covs: one Gaussian a label."""

    logits: Floats
    means: Floats
    covs: Floats


@kernel
def pseudo_update_lmb(
    prior: Lmb, no_birth: Lmb, decision: Decision, reduction: Reduction, first: int, last: int, results: LmbResults
) -> None:
    """Cases `first:last` of one sensor, into `results`. A case is `action * num_samples + sample`."""
    motion, sensor, horizon = decision.motion, decision.sensor, decision.horizon
    scratch = make_scratch(prior.tracks.means.shape[1], len(sensor.angular))
    num_samples = len(decision.futures.offsets) - 1
    scan = np.empty((most_targets(decision.futures), len(sensor.angular)))
    first_rows = prepare_rows(prior.tracks, no_birth, horizon.poses[0, 0], horizon.dt, motion, sensor, scratch)
    weigh_by_existence(prior.existence_logit, first_rows)
    prepared_action = 0
    for case in range(first, last):
        action, sample = case // num_samples, case % num_samples
        belief = prior
        for step in range(horizon.poses.shape[1]):
            pose = horizon.poses[action, step]
            num = ideal_scan(decision, action, sample, step, scratch, scan)
            rows = first_rows
            if step > 0 or action != prepared_action:
                rows = prepare_rows(belief.tracks, no_birth, pose, horizon.dt, motion, sensor, scratch)
                weigh_by_existence(belief.existence_logit, rows)
            if step == 0:
                first_rows, prepared_action = rows, action
            belief, report = finish_lmb(rows, scan[:num], pose, sensor, decision.truncation, reduction)
            if report.log_total == -math.inf:
                raise NumericalError(
                    "pseudo-update: no association has positive weight; do the models forbid the ideal scan?"
                )
        for i in range(len(belief.existence_logit)):
            results.logits[case, i] = belief.existence_logit[i]
            copy_component(belief.tracks.means, belief.tracks.covs, i, results.means[case], results.covs[case], i)


@kernel
def glmb_cases_to_lmb(
    labels: Ints, set_offsets: Ints, cases: GlmbResults, first: int, last: int, results: LmbResults
) -> None:
    """Cases `first:last` of one sensor's GLMB as LMBs by moments, into `results`, in increasing label order.

    labels: (num_members, 2) label of each member of each label set.
    """
    num = len(labels)
    offsets, no_weights, members = np.arange(num + 1), np.zeros(num), np.arange(num)
    for case in range(first, last):
        tracks = Tracks(labels, offsets, no_weights, cases.means[case], cases.covs[case])
        lmb = glmb_to_lmb(Glmb(tracks, set_offsets, members, cases.log_weights[case]), -math.inf, 0.0, 1)
        for i in range(len(lmb.existence_logit)):
            results.logits[case, i] = lmb.existence_logit[i]
            copy_component(lmb.tracks.means, lmb.tracks.covs, i, results.means[case], results.covs[case], i)
