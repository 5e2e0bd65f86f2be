"""Generalized covariance intersection of products of GLMBs, factor by factor."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.special import expit

from vedette.densities import GLMB, LMB, FactoredGLMB
from vedette.densities.checks import offsets_of, unchecked
from vedette.densities.conversions import factored_to_glmb, marginalised_factors
from vedette.densities.joining import JoinedFactors, join_factors
from vedette.densities.label_sets import in_label_order, laid_out, take_hypotheses
from vedette.errors import NumericalError
from vedette.fusion.base import FusionInfo, FusionLimits, PowerRule, count_lost
from vedette.fusion.tracks import fused_tracks
from vedette.kernels.base.types import Floats, Glmb
from vedette.kernels.labelled.stacking import stack_tracks

FuseGlmbs = Callable[[Sequence[Glmb]], tuple[GLMB, FusionInfo]]


def fuse_factors(
    beliefs: Sequence[FactoredGLMB],
    weights: Floats,
    missing_log_weight: float,
    rule: PowerRule,
    limits: FusionLimits,
    fuse_glmbs: FuseGlmbs,
) -> tuple[FactoredGLMB, FusionInfo]:
    """The fusion of the beliefs of sensors of positive weight, a factor for each group of labels that they join.

    fuse_glmbs: fuses marginalised GLMBs, one a sensor, without hypotheses of weight zero. It is called for each group
    in which some sensor has more than a label that is absent or there; the others are fused by the same rule all at
    once. A sensor without a factor in a group is certain that its targets do not exist. Raises `NumericalError` where a
    product of track densities cannot be integrated.
    """
    joined = join_factors([marginalised_factors(belief, rule.caps) for belief in beliefs])
    if limits.max_hypotheses < 2:
        joined = joined._replace(alone=np.zeros_like(joined.alone))  # the cap may leave one of two hypotheses
    fused, info = _fuse_alone(joined, weights, missing_log_weight, rule)
    parts, infos = [fused], [info]
    for group in np.flatnonzero(~joined.alone).tolist():
        products = [_product(part, limits.max_hypotheses) for part in joined.parts(group)]
        own, info = fuse_glmbs([glmb.to_kernel() for glmb, _ in products])
        parts.append(laid_out(own))
        log_kept = sum(math.log1p(-lost) for lost in (info.discarded_weight, *(lost for _, lost in products)))
        infos.append(replace(info, discarded_weight=-math.expm1(log_kept)))
    return in_label_order(FactoredGLMB.product(parts, beliefs[0].state_dim)), _summed(infos)


def _product(part: FactoredGLMB, max_hypotheses: int) -> tuple[GLMB, float]:
    """The heaviest products of positive weight, and the weight of the others."""
    if part.num_factors != 1:
        return factored_to_glmb(part, max_hypotheses=max_hypotheses)
    factor = part.factor(0)
    return take_hypotheses(factor, np.flatnonzero(factor.hyp_log_weights > -math.inf)), 0.0


def _fuse_alone(
    joined: JoinedFactors, weights: Floats, missing_log_weight: float, rule: PowerRule
) -> tuple[FactoredGLMB, FusionInfo]:
    """The groups of one label: with two label sets, that it is absent and that it is there."""
    table = stack_tracks([density.tracks.to_kernel() for density in joined.densities])
    firsts = offsets_of([density.tracks.num_tracks for density in joined.densities])
    places = joined.places()
    log_weights = np.tile([[0.0], [-math.inf]], (len(places), 1, len(weights)))
    chosen = np.full(places.shape, -1, np.int64)
    for s, density in enumerate(joined.densities):
        own = np.flatnonzero(places[:, s] >= 0)
        factors = places[own, s]
        log_weights[own, :, s] = density.hyp_log_weights[density.factor_offsets[factors][:, None] + np.arange(2)]
        chosen[own, s] = firsts[s] + density.track_offsets[factors]
    held = np.isfinite(log_weights)
    chosen[~held[:, 1]] = -1
    floors = np.minimum(np.where(held, log_weights, math.inf).min(axis=1), missing_log_weight)
    present = held.any(axis=2)
    means = np.where(held, log_weights, floors[:, None]) @ weights
    means[~present] = -math.inf
    there = np.flatnonzero(present[:, 1])
    labels = table.labels[chosen[there].max(axis=1, initial=-1)]
    tracks, overlaps = fused_tracks(labels, chosen[there], weights, table, rule)
    means[there, 1] += overlaps
    log_normalisers = np.logaddexp(means[:, 0], means[:, 1])
    if (log_normalisers == -math.inf).any():
        raise NumericalError("fusion: expected a label set of positive weight; the sensors' densities share no place")
    logits = means[there, 1] - means[there, 0]
    fused = FactoredGLMB.from_lmb(unchecked(LMB, tracks, logits))
    missing = np.count_nonzero(present[:, :, None] & ~held, axis=(0, 1))
    unknown = np.count_nonzero(~held[there, 1], axis=0)
    existence = np.exp(np.where(held, log_weights, -math.inf)[there, 1])
    return fused, FusionInfo(
        missing_sets=tuple(missing.tolist()),
        missing_labels=tuple(unknown.tolist()),
        num_sets=int(present.sum()),
        num_lost_labels=count_lost(existence, expit(logits)),
        empty_intersection=not bool(held.all(axis=2).any(axis=1).all()),
        log_normaliser=float(log_normalisers.sum()),
        discarded_weight=0.0,
    )


def _summed(infos: Sequence[FusionInfo]) -> FusionInfo:
    """The report of a product from those of its factors."""
    return FusionInfo(
        missing_sets=tuple(map(sum, zip(*(info.missing_sets for info in infos), strict=True))),
        missing_labels=tuple(map(sum, zip(*(info.missing_labels for info in infos), strict=True))),
        num_sets=sum(info.num_sets for info in infos),
        num_lost_labels=sum(info.num_lost_labels for info in infos),
        empty_intersection=any(info.empty_intersection for info in infos),
        log_normaliser=math.fsum(info.log_normaliser for info in infos),
        discarded_weight=-math.expm1(sum(math.log1p(-info.discarded_weight) for info in infos)) + 0.0,
    )


__all__ = ["fuse_factors"]
