"""Generalized covariance intersection of marginalised delta-GLMB densities."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np

from vedette.densities import GLMB, FactoredGLMB, Labelled, TrackTable
from vedette.densities.cases import LabelledCases
from vedette.densities.checks import offsets_of, take_runs
from vedette.densities.containers import unchecked
from vedette.densities.conversions import marginalised_factors
from vedette.densities.label_sets import possible
from vedette.densities.products import PowerProducts, Share
from vedette.densities.tracks import take_tracks
from vedette.errors import NumericalError
from vedette.fusion.alignment import Aligned, align, side_by_side, tidied
from vedette.fusion.base import (
    FusionInfo,
    by_sensor,
    check_beliefs,
    check_kinds,
    check_weights,
    count_lost,
    taking_part,
)
from vedette.fusion.laid_out import lay_out_glmbs
from vedette.fusion.powers import FusionLimits, MixturePower, PowerRule, check_power, fused_tracks, power_rule
from vedette.fusion.views import Views
from vedette.kernels.base.types import Floats
from vedette.kernels.labelled.conversions import marginalise
from vedette.kernels.labelled.groups import group_log_sums
from vedette.models.arguments import real, reject
from vedette.probabilities import expit

_Glmb = TypeVar("_Glmb", GLMB, FactoredGLMB)


@dataclass(frozen=True, slots=True)
class CmDeltaGlmb:
    """Consensus marginalised delta-GLMB fusion (paper eq. 11; Fantacci et al. 2015): GCI by label set and label.

    The fused label sets are those that any sensor of positive weight has, not only those that all have, because a set
    is missing where a cap cut it off as well as where the evidence speaks against it. Where a sensor lacks a set, its
    weight there is a floor, the least of `missing_log_weight` and the weights of the sets that it has, and each
    label's density is the sensor's marginal density of the label over the sets that it has. Where it does not know
    the label at all, it is left out of the label's density and the other sensors' weights there are scaled to sum to
    one. A hypothesis of weight zero counts as missing. All this is counted in the `FusionInfo`.

    Assumes that the sensors see the same part of the world and that a target has one label at all of them: what one
    sensor surely sees is lost where another has no set with it, or does not see there.

    Attributes:
        weights: fusion weights, one a sensor, in the order of the beliefs; non-negative, sum 1. A sensor of weight 0
            takes no part.
        mixture_power: how a power of a mixture is taken. "moment_matched": of the Gaussian of each mixture's mean and
            covariance, as in the M-delta-GLMB; exact for single Gaussians. "component_wise": as the mixture of all
            products of component powers; valid for well separated components, an upper bound of the integral
            otherwise. "quadrature": the same with each Gaussian's mass and moments corrected by cubature. "auto":
            component-wise, with so few components that the number of sensors allows it within
            `limits.max_combinations`; one is as moment matching.
            docs/decisions/0003-power-of-mixtures.md has their errors.
        missing_log_weight: log of the floor for the weight of a label set that a sensor lacks.
        limits: caps on the cost.

    Raises `InputError` for weights, a floor or limits that cannot be used.
    """

    weights: Sequence[float] | Floats
    mixture_power: MixturePower = "auto"
    missing_log_weight: float = math.log(1e-6)
    limits: FusionLimits = field(default_factory=FusionLimits)

    def __post_init__(self) -> None:
        object.__setattr__(self, "weights", check_weights(self.weights))
        check_power(self.mixture_power, self.limits, len(self.weights))
        if real("missing_log_weight", self.missing_log_weight) >= 0.0:
            raise reject("missing_log_weight", "the log of a probability above 0 and below 1", self.missing_log_weight)

    def fuse(self, beliefs: Sequence[_Glmb], views: Views | None = None) -> tuple[_Glmb, FusionInfo]:
        """Fused marginalised GLMB of the sensors' GLMBs (delta or marginalised), heaviest set first, and what was done.

        Label sets of equal weight come in the order of their first occurrence. Of products of GLMBs, where a GLMB is
        one of a single factor, the product of the fusions of what belongs together: the smallest groups of labels of
        which no sensor's factor spans two. A sensor without a label of a group is there certain that it is absent.
        The caps are for each group, those of `max_hypotheses` also for each sensor's products of factors in it.
        views: not used. Raises `InputError` for another number or kind of beliefs, for state dimensions that differ or
        a density that is not valid, and `NumericalError` where a product of track densities cannot be integrated.
        """
        check_beliefs(beliefs, (GLMB, FactoredGLMB), len(self.weights))
        rule = power_rule(self.mixture_power, self.limits, beliefs[0].state_dim, len(self.weights))
        active, weights = taking_part(self.weights)
        fused: Any
        if not any(belief.is_product for belief in beliefs):
            marginal = [GLMB.from_kernel(marginalise(beliefs[i].as_hypotheses(), rule.caps)) for i in active]
            sensors = [FactoredGLMB.of(possible(own)) for own in marginal]
            whole, info = self._fused(sensors, np.zeros(1), weights, rule)
            fused = whole.factor(0)
        else:
            factored = [marginalised_factors(FactoredGLMB.of(beliefs[i]), rule.caps) for i in active]
            sensors, log_kept = side_by_side(factored, self.limits.max_hypotheses)
            whole, info = self._fused(sensors, log_kept, weights, rule)
            fused = tidied(whole)
        missing_sets = by_sensor(np.array(info.missing_sets), active, len(beliefs))
        missing_labels = by_sensor(np.array(info.missing_labels), active, len(beliefs))
        return fused, replace(info, missing_sets=missing_sets, missing_labels=missing_labels)

    def _fused(
        self, sensors: Sequence[FactoredGLMB], log_kept: Floats, weights: Floats, rule: PowerRule
    ) -> tuple[FactoredGLMB, FusionInfo]:
        """The fusion of marginalised GLMBs, factor g with factor g, and the report of these sensors alone.

        log_kept: (num_groups,) log of the weight that was left of the sensors' factors.
        """
        aligned = align(sensors, self.missing_log_weight, rule)
        tracks, log_overlaps = fused_tracks(aligned.labels, aligned.chosen, weights, aligned.tracks, rule)
        log_weights = aligned.log_weights @ weights
        log_weights = log_weights + np.bincount(aligned.set_of_member, log_overlaps, len(log_weights))
        fused, discarded = _heaviest(aligned, tracks, log_weights, self.limits.max_hypotheses)
        log_normalisers = group_log_sums(log_weights, aligned.groups, aligned.num_groups)
        of_sensors = np.where(aligned.held, aligned.log_weights, -math.inf)
        existence = aligned.existence(np.column_stack([of_sensors, log_weights - log_normalisers[aligned.groups]]))
        in_common = np.bincount(aligned.groups[aligned.held.all(axis=1)], minlength=aligned.num_groups)
        with np.errstate(divide="ignore"):
            left = float((np.log1p(-discarded) + log_kept).sum())
        return fused, FusionInfo(
            missing_sets=tuple(np.count_nonzero(~aligned.held, axis=0).tolist()),
            missing_labels=tuple(aligned.num_missing_labels.tolist()),
            num_sets=len(aligned.held),
            num_lost_labels=count_lost(existence[:, :-1], existence[:, -1]),
            empty_intersection=not bool(in_common.all()),
            log_normaliser=float(log_normalisers.sum()),
            discarded_weight=-math.expm1(left) + 0.0,  # no -0
        )

    def lay_out(self, cases: Sequence[LabelledCases], prediction: Labelled) -> PowerProducts | None:
        """The fusions of any of the sensors' cases; None for an LMB prediction, or where the powers are not exact.

        cases: one a sensor. prediction: marginalised, of one Gaussian a track. Floors and stand-ins are as in
        `fuse`, but that under `auto` the stand-ins are single Gaussians.
        Raises `InputError` for another number or kind of cases, and where they share no label set with the
        prediction.
        """
        check_kinds([own.kind for own in cases], (GLMB,), len(self.weights))
        active, _ = taking_part(self.weights)
        if prediction.is_lmb:
            return None
        shares = [self._share(cases[i], self.weights[i]) for i in active]
        sets = {labels for share in shares for labels in share.cases.sets}
        whole = all(set(share.cases.sets) == sets and share.held.all() for share in shares)
        # Stand-ins for missing sets are the only mixtures, and powers of single Gaussians are exact.
        exact = self.mixture_power in ("auto", "moment_matched") or (whole and self.mixture_power != "quadrature")
        if not exact or len(sets) > self.limits.max_hypotheses:
            return None
        return lay_out_glmbs(shares, LabelledCases.of(prediction), active)

    def _share(self, own: LabelledCases, weight: float) -> Share:
        held = own.possible
        least = own.log_weights.min(axis=1, where=held, initial=self.missing_log_weight)
        return Share(own, weight, held, least[:, None])


def _heaviest(
    aligned: Aligned, tracks: TrackTable, log_weights: Floats, max_hypotheses: int
) -> tuple[FactoredGLMB, Floats]:
    """Normalised GLMBs of the `max_hypotheses` heaviest label sets of each group, and the weights of the others."""
    groups, num = aligned.groups, aligned.num_groups
    order = np.lexsort((-log_weights, groups))
    starts = offsets_of(np.bincount(groups, minlength=num))
    rank = np.arange(len(order)) - starts[groups[order]]
    kept, cut = order[rank < max_hypotheses], order[rank >= max_hypotheses]
    peaks = log_weights[order[starts[:-1]]]
    if (peaks == -math.inf).any():
        raise NumericalError("fusion: expected a label set of positive weight; the sensors' densities share no place")
    # From the heaviest on: logs of -1e12 keep their differences.
    relative = log_weights[kept] - peaks[groups[kept]]
    log_kept = group_log_sums(relative, groups[kept], num)
    hyp_offsets, members = take_runs(aligned.set_offsets, kept)
    factor_offsets = offsets_of(np.bincount(groups[kept], minlength=num))
    fused = unchecked(
        FactoredGLMB,
        take_tracks(tracks, members),
        hyp_offsets[factor_offsets],
        hyp_offsets,
        np.arange(len(members)),
        relative - log_kept[groups[kept]],
        factor_offsets,
        None,
    )
    log_cut = group_log_sums(log_weights[cut] - peaks[groups[cut]], groups[cut], num)
    return fused, np.asarray(expit(log_cut - log_kept))
