"""Arithmetic average of LMB densities, label by label."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from vedette.densities import GLMB, LMB, FactoredGLMB, Labelled, TrackTable
from vedette.densities.checks import offsets_of
from vedette.densities.containers import unchecked
from vedette.densities.conversions import reduced_lmb
from vedette.fusion.base import (
    FusionInfo,
    FusionLimits,
    by_sensor,
    check_beliefs,
    check_power,
    check_weights,
    count_lost,
    power_rule,
)
from vedette.fusion.lmbs import AlignedLmbs, align_lmbs, require_views, sum_over_sensors, weights_by_view
from vedette.fusion.views import Views
from vedette.kernels.base.types import Bools, Floats, Lmb
from vedette.kernels.gaussian.mixtures import MixtureCaps
from vedette.kernels.gaussian.pooling import pooled_tracks
from vedette.models.arguments import flag
from vedette.probabilities import expit


@dataclass(frozen=True, slots=True)
class ArithmeticAverage:
    """Arithmetic average of LMBs: r = sum_s w_s r_s, p = sum_s w_s r_s p_s / r.

    The minimiser of the weighted sum of the divergences from the sensors' densities to the fused one. The mean number
    of targets is the sensors' mean, so that a sensor which does not see a target (r = 0 where it lacks the label) takes
    its share of the existence away; nothing that sensors agree on becomes surer or narrower than at one of them.

    By views, the weights at a label are by how well each sensor sees it, as in `Clmb`: a sensor that cannot see the
    label is left out of it. A target must have one label at all sensors (see `match_labels`).

    Attributes:
        weights: one a sensor, in the order of the beliefs; non-negative, sum 1. A sensor of weight 0 takes no part.
        by_views: whether sensors count by how well they see each label; `fuse` then needs `views`.
        limits: caps on the fused mixtures (`log_min_component_weight`, `merge_distance`, None for 2,
            `max_components`); the others are not used.

    Raises `InputError` for weights or limits that cannot be used.
    """

    weights: Sequence[float] | Floats
    by_views: bool = False
    limits: FusionLimits = field(default_factory=FusionLimits)

    def __post_init__(self) -> None:
        object.__setattr__(self, "weights", check_weights(self.weights))
        check_power("moment_matched", self.limits, len(self.weights))
        flag("by_views", self.by_views)

    def fuse(self, beliefs: Sequence[Labelled], views: Views | None = None) -> tuple[LMB, FusionInfo]:
        """Fused LMB of the sensors' LMBs (others are first converted), in increasing label order, and what was done.

        views: what the sensors could see; not used with plain weights. Labels that no sensor with a say has are left
        out. Raises `InputError` for another number or kind of beliefs, for state dimensions that differ, a density that
        is not valid or views that are missing.
        """
        check_beliefs(beliefs, (LMB, GLMB, FactoredGLMB), len(self.weights))
        seen = require_views(self.by_views, views, len(self.weights))
        caps = power_rule("component_wise", self.limits, beliefs[0].state_dim).caps
        active = [i for i, weight in enumerate(self.weights) if weight > 0.0]
        weights = np.array([self.weights[i] for i in active])
        aligned = align_lmbs([_as_lmb(beliefs[i], caps) for i in active], 0.0)
        shares = np.tile(weights, (len(aligned.labels), 1))
        if seen is not None:
            shares = weights_by_view(aligned, weights, seen, active)
        present = shares * expit(aligned.logits)
        exists, absent = sum_over_sensors(present), sum_over_sensors(shares * expit(-aligned.logits))
        kept = exists > 0.0
        with np.errstate(divide="ignore"):
            logits = np.log(exists) - np.log(absent)
        lacking = (shares > 0.0) & ~aligned.held
        missing = by_sensor(np.count_nonzero(lacking, axis=0), active, len(beliefs))
        fused = unchecked(LMB, _pooled(aligned, kept, present, caps), logits[kept])
        return fused, FusionInfo(
            missing_sets=missing,
            missing_labels=missing,
            num_sets=len(lacking),
            num_lost_labels=count_lost(expit(aligned.logits), exists),
            empty_intersection=len(lacking) > 0 and not bool((~lacking).all(axis=1).any()),
            log_normaliser=0.0,
            discarded_weight=0.0,
        )


def _as_lmb(belief: Labelled, caps: MixtureCaps) -> Lmb:
    return belief.to_kernel() if isinstance(belief, LMB) else reduced_lmb(belief, caps)


def _pooled(aligned: AlignedLmbs, kept: Bools, present: Floats, caps: MixtureCaps) -> TrackTable:
    """The mixture of each kept label's tracks under their weights (num_labels, num_sensors), reduced by the caps."""
    pooled = (present > 0.0) & kept[:, None]
    label, sensor = np.nonzero(pooled)
    offsets = offsets_of(np.count_nonzero(pooled, axis=1)[kept])
    places, weights = aligned.chosen[label, sensor], present[label, sensor]
    return TrackTable.from_kernel(pooled_tracks(aligned.tracks, aligned.labels[kept], offsets, places, weights, caps))
