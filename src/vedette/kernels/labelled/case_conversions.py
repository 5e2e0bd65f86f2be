"""Conversion of many GLMBs to LMBs at once."""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Floats, Glmb, Ints, Tracks
from vedette.kernels.gaussian.components import copy_gaussian, make_components
from vedette.kernels.gaussian.marks import no_marks
from vedette.kernels.gaussian.reduction import MixtureCaps
from vedette.kernels.labelled.conversions import glmb_to_lmb
from vedette.kernels.labelled.power_integrals import SensorCases


class LmbCases(NamedTuple):
    """LMBs on the same labels."""

    logits: Floats  # (num_cases, num_labels)
    means: Floats  # (num_cases, num_labels, state_dim)
    covs: Floats  # (num_cases, num_labels, state_dim, state_dim)


@kernel
def _held_sets(set_offsets: Ints, cases: SensorCases, case: int) -> tuple[Ints, Ints, Floats]:
    """Return the offsets, members and log weights of the label sets that a case holds."""
    num = 0
    for at in range(len(set_offsets) - 1):
        num += cases.held[case, at]
    offsets, members = np.zeros(num + 1, np.int64), np.empty(set_offsets[-1], np.int64)
    log_weights, hyp, end = np.empty(num), 0, 0
    for at in range(len(set_offsets) - 1):
        if not cases.held[case, at]:
            continue
        for m in range(set_offsets[at], set_offsets[at + 1]):
            members[end] = m
            end += 1
        log_weights[hyp] = cases.log_weights[case, at]
        hyp += 1
        offsets[hyp] = end
    return offsets, members[:end].copy(), log_weights


@kernel
def glmb_cases_to_lmb(
    members: Ints, set_offsets: Ints, cases: SensorCases, labels: Ints, first: int, last: int, out: LmbCases
) -> None:
    """Convert cases `first:last` of marginalised GLMBs to LMBs by moments, each as `glmb_to_lmb` does.

    members: (num_members, 2) label of each member of each label set. labels: (num_labels, 2) all of them in increasing
    order. A label without any set in a case gets logit -inf there, and no Gaussian.
    """
    num = len(members)
    offsets, components = np.arange(num + 1), make_components(num, cases.means.shape[2], no_marks())
    tracks, caps = Tracks(members, offsets, components), MixtureCaps(-math.inf, 0.0, 1)
    components.log_weights[:] = 0.0
    for case in range(first, last):
        for m in range(num):
            copy_gaussian(cases.means[case], cases.covs[case], m, components.means, components.covs, m)
        hyp_offsets, hyp_members, log_weights = _held_sets(set_offsets, cases, case)
        lmb, found = glmb_to_lmb(Glmb(tracks, hyp_offsets, hyp_members, log_weights), caps), 0
        known = lmb.tracks.labels
        for i in range(len(labels)):
            out.logits[case, i] = -math.inf
            if found < len(known) and known[found, 0] == labels[i, 0] and known[found, 1] == labels[i, 1]:
                out.logits[case, i] = lmb.existence_logit[found]
                found_means, found_covs = lmb.tracks.components.means, lmb.tracks.components.covs
                copy_gaussian(found_means, found_covs, found, out.means[case], out.covs[case], i)
                found += 1
