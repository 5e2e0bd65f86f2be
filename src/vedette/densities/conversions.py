"""Conversions between labelled densities."""

import math
from collections.abc import Sequence
from typing import Any, TypeVar, cast

import numpy as np

from vedette.densities.checks import distinct_labels, offsets_of, take_runs
from vedette.densities.containers import unchecked
from vedette.densities.factored import FactoredGLMB, sets_of_factors
from vedette.densities.glmb import GLMB
from vedette.densities.label_sets import take_factors
from vedette.densities.labelled import LMB, LabelledDensity
from vedette.densities.tracks import DEFAULT_MERGE_DISTANCE, TrackTable, single_gaussians, take_tracks
from vedette.errors import InputError
from vedette.internal.probabilities import log_expit
from vedette.kernels.association.label_resolution import resolved_labels
from vedette.kernels.base.types import Lmb
from vedette.kernels.gaussian.pooling import reduced_tracks
from vedette.kernels.gaussian.reduction import MixtureCaps
from vedette.kernels.labelled import conversions as kernels

_Glmb = TypeVar("_Glmb", GLMB, FactoredGLMB)
_Labelled = TypeVar("_Labelled", bound=LabelledDensity)

DEFAULT_LOG_MIN_WEIGHT = math.log(1e-5)

# Targets further apart than this, in standard deviations of their difference, are distinct.
_APART = 4.0


def _checked_caps(max_components: int, log_min_weight: float, merge_distance: float) -> MixtureCaps:
    if max_components < 1:
        raise InputError(f"max_components: expected at least 1; got {max_components}")
    if not log_min_weight <= 0.0:
        raise InputError(f"log_min_weight: expected the log of a weight of at most 1; got {log_min_weight}")
    if not merge_distance >= 0.0:
        raise InputError(f"merge_distance: expected at least 0; got {merge_distance}")
    return MixtureCaps(float(log_min_weight), float(merge_distance), int(max_components))


def marginalise(
    glmb: _Glmb,
    *,
    max_components: int = 1,
    log_min_weight: float = DEFAULT_LOG_MIN_WEIGHT,
    merge_distance: float = DEFAULT_MERGE_DISTANCE,
) -> _Glmb:
    """Return the marginalised form of a delta-GLMB: one hypothesis per label set (paper eq. 10, Fantacci and Vo 2015).

    The probability of every label set is preserved, and so are the cardinality distribution and the existence
    probabilities. Each track of a label set becomes the mixture of its label's tracks in the set's hypotheses. With
    `max_components` 1 (the default) that is one Gaussian of the mixture's mean and covariance. Otherwise components
    lighter than `log_min_weight` (log, relative to the track) are dropped, those within the Mahalanobis distance
    `merge_distance` are merged, and the heaviest `max_components` are kept. A `merge_distance` of 0 merges nothing.

    Hypotheses are returned by descending weight, equal weights in the order of their first occurrence. A product of
    GLMBs is marginalised factor by factor, in their order. Factors of one label in the form of `FactoredGLMB.of`
    keep the order of their hypotheses. Raises `InputError` for a limit outside its range.
    """
    caps = _checked_caps(max_components, log_min_weight, merge_distance)
    if isinstance(glmb, FactoredGLMB):
        return marginalised_factors(glmb, caps)
    return GLMB.from_kernel(kernels.marginalise(glmb.to_kernel(), caps))


def marginalised_factors(density: FactoredGLMB, caps: MixtureCaps) -> FactoredGLMB:
    """Return the density with every factor marginalised, in order. Those in the form of an LMB keep it."""
    bernoulli = density.is_bernoulli
    if bernoulli.all() and len(density.tracks.log_weights) == density.num_factors:
        return density
    singles, several = np.flatnonzero(bernoulli), np.flatnonzero(~bernoulli)
    alone = take_factors(density, singles)
    alone = alone.with_fields(tracks=TrackTable.from_kernel(reduced_tracks(alone.tracks.to_kernel(), caps)))
    others = _marginalised_glmbs(take_factors(density, several), caps)
    order = np.argsort(np.concatenate([singles, several]))
    return take_factors(FactoredGLMB.product([alone, others], density.state_dim), order)


def _marginalised_glmbs(density: FactoredGLMB, caps: MixtureCaps) -> FactoredGLMB:
    """Return all factors marginalised at once, with each one's hypotheses by descending weight."""
    num, hypotheses, factor_of = density.num_factors, density.as_hypotheses(), density.factor_of
    set_of, first = sets_of_factors(hypotheses, factor_of)
    marginal, number = kernels.marginalise_sets(hypotheses, set_of, first, caps)
    factor = factor_of[first][number]
    order = np.argsort(factor, kind="stable")
    hyp_offsets, tracks = take_runs(marginal.hyp_offsets, order)
    factor_offsets = offsets_of(np.bincount(factor, minlength=num))
    return unchecked(
        FactoredGLMB,
        take_tracks(TrackTable.from_kernel(marginal.tracks), tracks),
        hyp_offsets[factor_offsets],
        hyp_offsets,
        np.arange(len(tracks)),
        marginal.hyp_log_weights[order],
        factor_offsets,
        None,
    )


def as_lmb(
    density: LabelledDensity,
    *,
    max_components: int = 1,
    log_min_weight: float = DEFAULT_LOG_MIN_WEIGHT,
    merge_distance: float = DEFAULT_MERGE_DISTANCE,
) -> LMB:
    """Return the LMB with the existence probability and density of every label (Reuter et al. 2014, eq. 43-45).

    The existence probabilities and so the mean cardinality are preserved, but not the whole cardinality distribution.
    Mixtures are reduced as by `marginalise`. An LMB is returned unchanged. Raises `InputError` for a limit outside its
    range.
    """
    if isinstance(density, LMB):
        return density
    caps = _checked_caps(max_components, log_min_weight, merge_distance)
    return LMB.from_kernel(reduced_lmb(density, caps))


def reduced_lmb(density: LabelledDensity, caps: MixtureCaps, *, resolved: bool = False) -> Lmb:
    """Return the LMB of a density, with reduced mixtures unless it is an LMB.

    resolved: use the labels of `resolve_labels`.
    """
    if isinstance(density, LMB):
        return density.to_kernel()
    factors, hypotheses = density.to_factors(), density.as_hypotheses()
    all_labels, place = distinct_labels(density.tracks.labels)
    place_of_entry = place[factors.hyp_tracks]
    if resolved:
        place_of_entry = resolved_labels(hypotheses, factors.factor_offsets, factors.track_offsets, place, _APART)
    used = np.bincount(place_of_entry, minlength=len(all_labels)) > 0  # the table may contain unused labels
    factor = np.empty(len(all_labels), np.int64)
    factor[place] = np.repeat(np.arange(len(factors.factor_offsets) - 1), np.diff(factors.track_offsets))
    firsts, ends = factors.factor_offsets[factor[used]], factors.factor_offsets[factor[used] + 1]
    label_of = (np.cumsum(used) - 1)[place_of_entry]
    return kernels.factors_to_lmb(hypotheses, all_labels[used], label_of, firsts, ends, caps)


def resolve_labels(
    density: LabelledDensity,
    *,
    max_components: int = 1,
    log_min_weight: float = DEFAULT_LOG_MIN_WEIGHT,
    merge_distance: float = DEFAULT_MERGE_DISTANCE,
) -> LMB:
    """Return the LMB of the same targets with a single label each, where GLMB hypotheses disagree on labels.

    Hypotheses may differ only in labels: two targets swapped, or one target born at one of two steps. The marginals of
    the labels (`as_lmb`) then put every label half at each position, or make no label probable. The density of the
    unlabelled set of targets is the same in both. Therefore, within each factor, the heaviest hypothesis keeps its
    labels, and each target of the other hypotheses takes the label of the target that it is most likely to be. Like
    `as_lmb`, this preserves the mean number of targets, but not the existence probabilities of the original labels. An
    LMB is returned unchanged. Mixtures are reduced as by `marginalise`.
    """
    if isinstance(density, LMB):
        return density
    caps = _checked_caps(max_components, log_min_weight, merge_distance)
    return LMB.from_kernel(reduced_lmb(density, caps, resolved=True))


def with_single_gaussians(density: _Labelled) -> _Labelled:
    """Return the density with each mixture replaced by the Gaussian of its moments. GLMBs are marginalised."""
    if density.is_lmb:
        return density.with_fields(tracks=single_gaussians(density.tracks))
    given: Any = density
    return cast(_Labelled, marginalise(given, max_components=1))


def with_resolved_labels(density: LabelledDensity, max_components: int) -> LabelledDensity:
    """Return the density. A product of GLMBs with ambiguous labels is replaced by its `resolve_labels`."""
    if not isinstance(density, FactoredGLMB) or density.is_bernoulli.all():
        return density
    return FactoredGLMB.of(resolve_labels(density, max_components=max_components))


def as_glmb(density: LabelledDensity, *, max_hypotheses: int) -> tuple[GLMB, float]:
    """Return the GLMB of the `max_hypotheses` heaviest hypotheses of all factors, and the weight of the others.

    A hypothesis of the product combines one hypothesis of each factor. For an LMB these are its most probable label
    subsets. A GLMB is one factor. The GLMB shares the track table. Its weights are normalised over the kept hypotheses,
    which are in order of descending weight. Products of weight zero are left out. Raises `InputError` for a
    `max_hypotheses` below 1.
    """
    glmb, discarded_weight = density.heaviest_sets(max_hypotheses)
    return GLMB.from_kernel(glmb), discarded_weight


def lmb_on_label_sets(lmb: LMB, sets: Sequence[Sequence[tuple[int, ...]]]) -> GLMB:
    """Return the LMB's hypotheses on those label sets that it has, in their order. Their weights do not sum to one."""
    place = {tuple(label): i for i, label in enumerate(lmb.tracks.labels.tolist())}
    hyps = [[place[label] for label in labels] for labels in sets if all(label in place for label in labels)]
    exists = np.zeros((len(hyps), len(place)), np.bool_)
    for h, hyp in enumerate(hyps):
        exists[h, hyp] = True
    log_weights = np.where(exists, log_expit(lmb.existence_logit), log_expit(-lmb.existence_logit)).sum(axis=1)
    offsets = np.cumsum([0, *(len(hyp) for hyp in hyps)])
    members = np.array([track for hyp in hyps for track in hyp], np.int64)
    return unchecked(GLMB, lmb.tracks, offsets, members, log_weights)
