"""Densities of two kinds brought to one: GLMB filters under a fusion that makes LMBs (`vedette.fusion.Clmb`).

The same conversions as that fusion and `vedette.divergence` make, for all cases of a sensor at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from vedette.control.inputs import Belief
from vedette.control.priors import LabelSet, offsets_of
from vedette.control.pseudo import PseudoPosteriors
from vedette.control.threads import run_chunks
from vedette.densities import GLMB, LMB
from vedette.densities.checks import unchecked
from vedette.densities.conversions import lmb_on_label_sets
from vedette.fusion import Clmb, Fusion
from vedette.kernels.planning.pseudo_glmb import GlmbResults
from vedette.kernels.planning.pseudo_lmb import LmbResults, glmb_cases_to_lmb

_ALL_BUT_CERTAIN = 700.0  # logit; its exponential is still a number


def of_one_kind(
    posteriors: Sequence[PseudoPosteriors], prediction: Belief, fusion: Fusion[Any, Any] | None, num_threads: int
) -> tuple[Sequence[PseudoPosteriors], Belief]:
    """Posteriors and prediction of the same kind where that says exactly the same; else as they are.

    GLMB posteriors that CLMB fuses by their moments become the LMBs that it would make of them. An LMB prediction that
    a single sensor's GLMB is compared with is taken on that GLMB's label sets.
    """
    if not isinstance(prediction, LMB) or any(own.is_lmb or np.isneginf(own.log_weights).any() for own in posteriors):
        return posteriors, prediction
    if type(fusion) is Clmb and fusion.mixture_power == "moment_matched":
        return [_as_lmb(own, num_threads) for own in posteriors], prediction
    if fusion is None and len(posteriors) == 1:
        return posteriors, _on_label_sets(prediction, posteriors[0].sets)
    return posteriors, prediction


def _as_lmb(own: PseudoPosteriors, num_threads: int) -> PseudoPosteriors:
    """Each case of a GLMB as an LMB of one Gaussian a label."""
    members = np.array([label for labels in own.sets for label in labels], np.int64).reshape(-1, 2)
    labels = sorted({label for members in own.sets for label in members})
    set_offsets = offsets_of([len(labels) for labels in own.sets])
    cases = GlmbResults(set_offsets, own.log_weights, own.means, own.covs)
    num_cases, dim = len(own.log_weights), own.means.shape[2]
    results = LmbResults(
        np.empty((num_cases, len(labels))),
        np.empty((num_cases, len(labels), dim)),
        np.empty((num_cases, len(labels), dim, dim)),
    )
    run_chunks(
        lambda first, last: glmb_cases_to_lmb(members, set_offsets, cases, first, last, results), num_cases, num_threads
    )
    return PseudoPosteriors(tuple((label,) for label in labels), results.logits, results.means, results.covs, True)


def _on_label_sets(lmb: LMB, sets: Sequence[LabelSet]) -> GLMB:
    """The LMB's hypotheses on those of the label sets that it has; their weights do not sum to one.

    A certain or impossible label is taken as all but that: the divergence on common label sets does not depend on the
    scale of the weights, and so it is defined also where the GLMB lacks that label in every set.
    """
    logits = np.clip(lmb.existence_logit, -_ALL_BUT_CERTAIN, _ALL_BUT_CERTAIN)
    return lmb_on_label_sets(unchecked(LMB, lmb.tracks, logits), sets)
