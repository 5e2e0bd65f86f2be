"""Generalised covariance intersection of marginalised delta-GLMB densities."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from vedette.densities import GLMB, FactoredGLMB, LabelledDensity
from vedette.densities.batches import DensityBatch
from vedette.densities.conversions import marginalised_factors
from vedette.densities.products import PowerProducts, SensorPower
from vedette.fusion.alignment import align_factors, sort_factors
from vedette.fusion.base import FusionInfo, active_sensors, check_beliefs, check_kinds, check_weights, per_sensor_counts
from vedette.fusion.powers import FusionLimits, MixturePower, check_power, numerical_errors_of_tracks, power_rule
from vedette.fusion.precomputed import precompute_glmbs
from vedette.fusion.views import FieldsOfView
from vedette.kernels.base.types import Floats, Glmb, Ints
from vedette.kernels.labelled.set_alignment import Sets
from vedette.kernels.labelled.set_fusion import SetReport, SetRule, fuse_glmbs, fuse_sets
from vedette.kernels.labelled.stacking import stack_glmbs
from vedette.models.arguments import real, reject

_Glmb = TypeVar("_Glmb", GLMB, FactoredGLMB)


@dataclass(frozen=True, slots=True)
class CmDeltaGlmb:
    """Consensus marginalised delta-GLMB fusion (paper eq. 11, Fantacci et al. 2015): GCI by label set and label.

    The fused label sets are those that any sensor of positive weight has, not only those common to all sensors, because
    a set may be missing through a cap as well as through evidence against it. If a sensor lacks a set, a floor replaces
    its weight: the least of `missing_log_weight` and the weights of the sets that the sensor has. The density of each
    label is then the sensor's marginal density of that label over the sets that it has. If the sensor lacks the label
    altogether, that sensor is left out of the label's density and the weights of the other sensors are scaled there to
    sum to one. A hypothesis of weight zero counts as missing. `FusionInfo` counts all these cases.

    The rule assumes that the sensors have the same field of view and that a target has the same label at all of them. A
    target that one sensor surely observes is lost if another sensor has no set with it, or does not observe its
    position.

    Attributes:
        weights: fusion weights, one per sensor, in the order of the beliefs, non-negative, sum 1. A sensor of weight 0
            takes no part.
        mixture_power: how the power of a mixture is computed. "moment_matched": as the power of the Gaussian with the
            mean and covariance of each mixture, as in the M-delta-GLMB, exact for single Gaussians. "component_wise":
            as the mixture of all products of component powers, valid for well separated components, an upper bound of
            the integral otherwise. "quadrature": the same with each Gaussian's mass and moments corrected by cubature.
            "auto": component-wise, with the number of components reduced until the number of combinations over all
            sensors is within `limits.max_combinations`. A single component is the same as moment matching.
            docs/decisions/0003-power-of-mixtures.md has their errors.
        missing_log_weight: log of the floor for the weight of a label set that a sensor lacks.
        limits: caps on the cost.

    Raises `InputError` for invalid weights, floor or limits.
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

    def fuse(self, beliefs: Sequence[_Glmb], views: FieldsOfView | None = None) -> tuple[_Glmb, FusionInfo]:
        """Return the fused marginalised GLMB, heaviest label set first, and the report.

        The sensors' GLMBs may be delta or marginalised. Label sets of equal weight are in the order of their first
        occurrence. For products of GLMBs (a GLMB has a single factor), the result is the product of the fusions of each
        group of labels. Groups are the smallest that no sensor's factor crosses. A sensor without a label of a group is
        certain that the group is empty. The caps apply to each group. `max_hypotheses` also applies to each sensor's
        products of factors in it. views: not used. Raises `InputError` for a wrong number or kind of beliefs, state
        dimensions that differ or an invalid density, and `NumericalError` if a product of track densities cannot be
        integrated.
        """
        check_beliefs(beliefs, (GLMB, FactoredGLMB), len(self.weights))
        active, weights = active_sensors(self.weights)
        power = power_rule(self.mixture_power, self.limits, beliefs[0].state_dim, len(self.weights))
        rule = SetRule(weights, self.missing_log_weight, power, self.limits.max_hypotheses)
        own, log_kept = [beliefs[i] for i in active], 0.0
        fused: Any
        if not any(belief.is_product for belief in beliefs):
            hyps, sensor_of = _stacked(own)
            with numerical_errors_of_tracks():
                glmb, report = fuse_glmbs(hyps, sensor_of, rule)
            fused = GLMB.from_kernel(glmb)
        else:
            factored = [marginalised_factors(FactoredGLMB.of(belief), power.caps) for belief in own]
            sensors, log_shares = align_factors(factored, self.limits.max_hypotheses)
            hyps, sensor_of = _stacked(sensors)
            sets = Sets(hyps, sensor_of, np.concatenate([sensor.factor_of for sensor in sensors]))
            with numerical_errors_of_tracks():
                product, report = fuse_sets(sets, len(log_shares), rule)
            fused, log_kept = sort_factors(FactoredGLMB.from_kernel(product)), float(log_shares.sum())
        return fused, self._info(report, active, log_kept)

    def _info(self, report: SetReport, active: Sequence[int], log_kept: float) -> FusionInfo:
        """Return the report. log_kept: log of the retained weight of the sensors' factors."""
        num = len(self.weights)
        return FusionInfo(
            missing_sets=per_sensor_counts(report.missing_sets, active, num),
            missing_labels=per_sensor_counts(report.missing_labels, active, num),
            num_sets=report.num_sets,
            num_lost_labels=report.num_lost_labels,
            empty_intersection=bool(report.empty_intersection),
            log_normaliser=report.log_normaliser,
            discarded_weight=-math.expm1(report.log_kept + log_kept) + 0.0,  # no -0
        )

    def precompute(self, cases: Sequence[DensityBatch], prediction: LabelledDensity) -> PowerProducts | None:
        """Return the fusions of all combinations of cases, or None for an LMB prediction or inexact powers.

        cases: one batch per sensor. prediction: marginalised, with one Gaussian per track. Floors and substitutes are
        as in `fuse`, except that under `auto` the substitutes are single Gaussians. Raises `InputError` for a wrong
        number or kind of cases, and if they share no label set with the prediction.
        """
        check_kinds([own.kind for own in cases], (GLMB,), len(self.weights))
        active, _ = active_sensors(self.weights)
        if prediction.is_lmb:
            return None
        shares = [self._share(cases[i], self.weights[i]) for i in active]
        sets = {labels for share in shares for labels in share.cases.sets}
        whole = all(set(share.cases.sets) == sets and share.held.all() for share in shares)
        # Only the substitutes for missing sets are mixtures; powers of single Gaussians are exact.
        exact = self.mixture_power in ("auto", "moment_matched") or (whole and self.mixture_power != "quadrature")
        if not exact or len(sets) > self.limits.max_hypotheses:
            return None
        return precompute_glmbs(shares, DensityBatch.of(prediction), active)

    def _share(self, own: DensityBatch, weight: float) -> SensorPower:
        held = own.possible
        least = own.log_weights.min(axis=1, where=held, initial=self.missing_log_weight)
        return SensorPower(own, weight, held, least[:, None])


def _stacked(beliefs: Sequence[LabelledDensity]) -> tuple[Glmb, Ints]:
    """Return the hypotheses of all beliefs, and the sensor of each, shape (num_hyps,)."""
    hyps = [belief.as_hypotheses() for belief in beliefs]
    sensor_of = np.repeat(np.arange(len(hyps)), [len(own.hyp_log_weights) for own in hyps])
    return stack_glmbs(hyps), sensor_of
