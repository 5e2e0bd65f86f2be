"""Conversions between labelled densities."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from vedette.densities.checks import unchecked
from vedette.densities.glmb import GLMB
from vedette.densities.lmb import LMB
from vedette.errors import InputError
from vedette.kernels.gaussian.mixtures import MixtureCaps
from vedette.kernels.labelled import conversions as kernels
from vedette.probabilities import log_expit

DEFAULT_LOG_MIN_WEIGHT = math.log(1e-5)
DEFAULT_MERGE_DISTANCE = 2.0


def _checked_caps(max_components: int, log_min_weight: float, merge_distance: float) -> MixtureCaps:
    if max_components < 1:
        raise InputError(f"max_components: expected at least 1; got {max_components}")
    if not log_min_weight <= 0.0:
        raise InputError(f"log_min_weight: expected the log of a weight of at most 1; got {log_min_weight}")
    if not merge_distance >= 0.0:
        raise InputError(f"merge_distance: expected at least 0; got {merge_distance}")
    return MixtureCaps(float(log_min_weight), float(merge_distance), int(max_components))


def marginalise(
    glmb: GLMB,
    *,
    max_components: int = 1,
    log_min_weight: float = DEFAULT_LOG_MIN_WEIGHT,
    merge_distance: float = DEFAULT_MERGE_DISTANCE,
) -> GLMB:
    """Marginalised delta-GLMB of a delta-GLMB: one hypothesis a label set (paper eq. 10; Fantacci and Vo 2015).

    Keeps the probability of every label set, and so the cardinality distribution and the existence probabilities. Each
    track of a label set becomes the mixture of its label's tracks in the set's hypotheses. With `max_components` 1 (the
    default) that is one Gaussian of the mixture's mean and covariance. Otherwise components lighter than
    `log_min_weight` (log, relative to the track) are dropped, those within the Mahalanobis distance `merge_distance`
    are merged, and the heaviest `max_components` stay; a `merge_distance` of 0 merges nothing.

    Hypotheses come out by descending weight, equal weights in the order of their first occurrence.
    Raises `InputError` for a limit outside its range.
    """
    caps = _checked_caps(max_components, log_min_weight, merge_distance)
    return GLMB.from_kernel(kernels.marginalise(glmb.to_kernel(), caps))


def glmb_to_lmb(
    glmb: GLMB,
    *,
    max_components: int = 1,
    log_min_weight: float = DEFAULT_LOG_MIN_WEIGHT,
    merge_distance: float = DEFAULT_MERGE_DISTANCE,
) -> LMB:
    """LMB with the existence probability and track density of every label of a GLMB (Reuter et al. 2014, eq. 43-45).

    Keeps the existence probabilities and so the mean cardinality, not its whole distribution. Mixtures are reduced as
    by `marginalise`. Raises `InputError` for a limit outside its range.
    """
    caps = _checked_caps(max_components, log_min_weight, merge_distance)
    return LMB.from_kernel(kernels.glmb_to_lmb(glmb.to_kernel(), caps))


def lmb_to_glmb(lmb: LMB, *, max_hypotheses: int) -> tuple[GLMB, float]:
    """GLMB of the `max_hypotheses` most probable label subsets of an LMB, and the weight of those left out.

    The GLMB shares the LMB's track table, and its weights are normalised over the subsets kept, which come by
    descending weight. Subsets of probability zero are not listed. Raises `InputError` for a `max_hypotheses` below 1.
    """
    if max_hypotheses < 1:
        raise InputError(f"max_hypotheses: expected at least 1; got {max_hypotheses}")
    glmb, discarded_weight = kernels.lmb_to_glmb(lmb.to_kernel(), int(max_hypotheses))
    return GLMB.from_kernel(glmb), float(discarded_weight)


__all__ = ["DEFAULT_LOG_MIN_WEIGHT", "DEFAULT_MERGE_DISTANCE", "glmb_to_lmb", "lmb_to_glmb", "marginalise"]


def lmb_on_label_sets(lmb: LMB, sets: Sequence[Sequence[tuple[int, ...]]]) -> GLMB:
    """The LMB's hypotheses on those of the label sets that it has, in their order; their weights do not sum to one."""
    place = {tuple(label): i for i, label in enumerate(lmb.tracks.labels.tolist())}
    hyps = [[place[label] for label in labels] for labels in sets if all(label in place for label in labels)]
    exists = np.zeros((len(hyps), len(place)), np.bool_)
    for h, hyp in enumerate(hyps):
        exists[h, hyp] = True
    log_weights = np.where(exists, log_expit(lmb.existence_logit), log_expit(-lmb.existence_logit)).sum(axis=1)
    offsets = np.cumsum([0, *(len(hyp) for hyp in hyps)])
    members = np.array([track for hyp in hyps for track in hyp], np.int64)
    return unchecked(GLMB, lmb.tracks, offsets, members, log_weights)
