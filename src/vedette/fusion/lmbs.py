"""Fusion of LMBs label by label: generalised covariance intersection, and the arithmetic average."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from vedette.densities import GLMB, LMB, FactoredGLMB, LabelledDensity, TrackTable
from vedette.densities.batches import DensityBatch, lmb_batch
from vedette.densities.checks import offsets_of
from vedette.densities.containers import unchecked
from vedette.densities.conversions import reduced_lmb
from vedette.densities.products import PowerProducts, SensorPower, precompute_products
from vedette.fusion.base import (
    FusionInfo,
    LogLinearPool,
    active_sensors,
    check_beliefs,
    check_kinds,
    check_weights,
    label_fusion_info,
)
from vedette.fusion.powers import (
    FusionLimits,
    MixturePower,
    check_power,
    numerical_errors_of_tracks,
    power_rule,
)
from vedette.fusion.views import AlignedLmbs, FieldsOfView, align_lmbs, require_views, sum_over_sensors, view_weights
from vedette.internal.probabilities import expit, log_expit, logit
from vedette.kernels.base.types import Bools, Floats, Ints, Lmb
from vedette.kernels.gaussian.pooling import pooled_tracks, reduced_tracks
from vedette.kernels.gaussian.reduction import MixtureCaps
from vedette.kernels.labelled.gci import fused_tracks
from vedette.models.fields import Chance, check_fields


@dataclass(frozen=True, slots=True)
class Clmb:
    """Consensus LMB fusion (paper eq. 12, Fantacci et al. 2015): GCI label by label.

    The logit of a fused existence is the weighted mean of the sensors' logits plus the log of the integral of prod_i
    p_i^(w_i), which is at most 0. One blind sensor therefore lowers the existence of a target (0.98 and 0.1 give about
    0.69).

    The fused labels are those that any sensor of positive weight has. If a sensor lacks a label (or has it with
    existence 0), a floor replaces its existence: the least of `missing_existence` and the existences that the sensor
    has. The sensor is then left out of the label's density, and the weights of the other sensors are scaled to sum to
    one. `FusionInfo` counts this. A label in every hypothesis of a sensor's GLMB is certain there, and so in the
    fusion. (Truncation may have removed the other hypotheses. A bound on its certainty, like the floor on its absence,
    makes joint decisions worse, not better.)

    Plain weights assume that the sensors have the same field of view: a target that one sensor surely observes is lost
    if another sensor does not observe its position. With `field_of_view_weighting`, the weights at a label are w_sl
    proportional to w_s P / (1 - .999 P), where P = E[P_D^s(l)], that is, to the information that a scan has about the
    existence of a target that is present. A sensor that cannot observe the position of a target (or did not scan) then
    affects neither its existence nor its density. A sensor that observes the position and lacks the label contributes
    its floor. If no sensor that scanned observes a label, sensors are weighted by how well they would observe it if
    they scanned. If no sensor would, those that have the label keep their plain weights. In both modes a target must
    have one label at all sensors (see `match_labels`).

    Attributes:
        weights: fusion weights, one per sensor, in the order of the beliefs, non-negative, sum 1. A sensor of weight 0
            takes no part.
        mixture_power: how the power of a mixture is computed. See `CmDeltaGlmb`.
        missing_existence: floor for the existence probability of a label that a sensor lacks, in (0, 1).
        limits: caps on the cost.
        field_of_view_weighting: whether sensors are weighted by how well they observe each label. `fuse` then needs
            `views`.

    Raises `InputError` for invalid weights, floor or limits.
    """

    weights: Sequence[float] | Floats
    mixture_power: MixturePower = "auto"
    missing_existence: Chance = 1e-4
    limits: FusionLimits = field(default_factory=FusionLimits)
    field_of_view_weighting: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "weights", check_weights(self.weights))
        check_power(self.mixture_power, self.limits, len(self.weights))
        check_fields(self)

    def fuse(self, beliefs: Sequence[LabelledDensity], views: FieldsOfView | None = None) -> tuple[LMB, FusionInfo]:
        """Return the fused LMB in increasing label order, and the report. Beliefs that are not LMBs are converted.

        views: fields of view of the sensors, not used with plain weights. Raises `InputError` for a wrong number or
        kind of beliefs, state dimensions that differ, an invalid density or missing views, and `NumericalError` if a
        product of track densities cannot be integrated.
        """
        check_beliefs(beliefs, (LMB, GLMB, FactoredGLMB), len(self.weights))
        seen = require_views(self.field_of_view_weighting, views, len(self.weights))
        rule = power_rule(self.mixture_power, self.limits, beliefs[0].state_dim, len(self.weights))
        active, weights = active_sensors(self.weights)
        aligned = align_lmbs([_reduced(beliefs[i], rule.caps) for i in active], self.missing_existence)
        powers = _Powers.plain(aligned, weights) if seen is None else _Powers.by_view(aligned, weights, seen, active)
        of_tracks = np.array(np.broadcast_to(powers.of_tracks, powers.chosen.shape))
        with numerical_errors_of_tracks():
            tracks, log_overlaps = fused_tracks(aligned.labels, powers.chosen, of_tracks, aligned.tracks, rule)
        log_present = powers.mean(log_expit(aligned.logits)) + log_overlaps
        log_absent = powers.mean(log_expit(-aligned.logits))
        logits, lacking = powers.mean(aligned.logits) + log_overlaps, powers.participating & ~aligned.held
        log_normaliser = float(np.logaddexp(log_present, log_absent).sum())
        existence = expit(aligned.logits), expit(logits)
        info = label_fusion_info(lacking, active, len(beliefs), *existence, log_normaliser)
        return unchecked(LMB, TrackTable.from_kernel(tracks), logits), info

    def log_linear_pool(self, num_sensors: int) -> LogLinearPool | None:
        """Return the pool with these weights, or None with `field_of_view_weighting`."""
        return None if self.field_of_view_weighting else LogLinearPool(0.0, tuple(self.weights), self.missing_existence)

    def precompute(self, cases: Sequence[DensityBatch], prediction: LabelledDensity) -> PowerProducts | None:
        """Return the fusions of all combinations of cases.

        None with `field_of_view_weighting`, a GLMB prediction or inexact powers.

        cases: one batch per sensor. A GLMB is converted first, as in `fuse`. prediction: with one Gaussian per track.
        Raises `InputError` for a wrong number of cases.
        """
        check_kinds([own.kind for own in cases], (LMB, GLMB), len(self.weights))
        # A GLMB's labels become mixtures, which auto replaces by one Gaussian; powers of single Gaussians are exact.
        exact = self.mixture_power in ("auto", "moment_matched") or all(own.is_lmb for own in cases)
        if self.field_of_view_weighting or not exact or not prediction.is_lmb:
            return None
        active, _ = active_sensors(self.weights)
        shares = [self._share(cases[i], self.weights[i]) for i in active]
        return precompute_products(shares, DensityBatch.of(prediction), active)

    def _share(self, own: DensityBatch, weight: float) -> SensorPower:
        lmbs = own if own.is_lmb else lmb_batch(own)
        held, logits = lmbs.possible, lmbs.existence_logits
        least = logits.min(axis=1, where=held[:, 1::2], initial=logit(self.missing_existence))
        return SensorPower(lmbs, weight, held, np.stack([log_expit(-least), log_expit(least)], axis=1))


class _Powers(NamedTuple):
    """Powers to which the sensors' densities are raised, label by label."""

    of_labels: Floats  # (num_labels, num_sensors) rows that sum to one, or (num_sensors,) for all labels
    of_tracks: Floats  # the same, for the tracks in `chosen`
    chosen: Ints  # (num_labels, num_sensors) tracks, -1 if left out
    participating: Bools  # (num_labels, num_sensors)

    @classmethod
    def plain(cls, aligned: AlignedLmbs, weights: Floats) -> "_Powers":
        """Return the same weights for every label."""
        return cls(weights, weights, aligned.chosen, np.ones(aligned.chosen.shape, np.bool_))

    @classmethod
    def by_view(cls, aligned: AlignedLmbs, weights: Floats, views: FieldsOfView, active: Sequence[int]) -> "_Powers":
        """Return weights by how well each sensor observes each label."""
        shares = view_weights(aligned, weights, views, active)
        chosen = np.where(shares > 0.0, aligned.chosen, -1)
        # If all sensors that observe the position lack the label, the other sensors give its density.
        bare = (chosen < 0).all(axis=1, keepdims=True)
        of_tracks = np.where(bare, weights, shares)
        return cls(shares, of_tracks, np.where(bare, aligned.chosen, chosen), shares > 0.0)

    def mean(self, values: Floats) -> Floats:
        """Weighted mean over sensors, shape (num_labels,). Values of sensors left out may be infinite."""
        if self.of_labels.ndim == 1:
            return np.asarray(values @ self.of_labels)
        return sum_over_sensors(self.of_labels * np.where(self.participating, values, 0.0))


def _reduced(belief: LabelledDensity, caps: MixtureCaps) -> Lmb:
    """Return the LMB of a belief with reduced mixtures."""
    lmb = reduced_lmb(belief, caps)
    return Lmb(reduced_tracks(lmb.tracks, caps), lmb.existence_logit) if belief.is_lmb else lmb


@dataclass(frozen=True, slots=True)
class ArithmeticAverage:
    """Arithmetic average of LMBs: r = sum_s w_s r_s, p = sum_s w_s r_s p_s / r.

    It minimises the weighted sum of the divergences from the sensors' densities to the fused one. The mean number of
    targets is the mean over the sensors, so a sensor that does not observe a target (r = 0 if it lacks the label)
    reduces the existence by its weight. The fused density is never more certain or narrower than the most certain
    sensor, even if the sensors agree.

    With `field_of_view_weighting`, the weights at a label depend on how well each sensor observes it, as in `Clmb`: a
    sensor that cannot observe the label is left out of it. A target must have one label at all sensors (see
    `match_labels`).

    Attributes:
        weights: one per sensor, in the order of the beliefs, non-negative, sum 1. A sensor of weight 0 takes no part.
        field_of_view_weighting: whether sensors are weighted by how well they observe each label. `fuse` then needs
            `views`.
        limits: caps on the fused mixtures (`log_min_component_weight`, `merge_distance`, None for 2,
            `max_components`). The others are not used.

    Raises `InputError` for invalid weights or limits.
    """

    weights: Sequence[float] | Floats
    field_of_view_weighting: bool = False
    limits: FusionLimits = field(default_factory=FusionLimits)

    def __post_init__(self) -> None:
        object.__setattr__(self, "weights", check_weights(self.weights))
        check_power("moment_matched", self.limits, len(self.weights))
        check_fields(self)

    def fuse(self, beliefs: Sequence[LabelledDensity], views: FieldsOfView | None = None) -> tuple[LMB, FusionInfo]:
        """Return the fused LMB in increasing label order, and the report. Beliefs that are not LMBs are converted.

        views: fields of view of the sensors, not used with plain weights. Labels that only sensors without weight there
        have are left out. Raises `InputError` for a wrong number or kind of beliefs, state dimensions that differ, an
        invalid density or missing views.
        """
        check_beliefs(beliefs, (LMB, GLMB, FactoredGLMB), len(self.weights))
        seen = require_views(self.field_of_view_weighting, views, len(self.weights))
        caps = power_rule("component_wise", self.limits, beliefs[0].state_dim).caps
        active, weights = active_sensors(self.weights)
        aligned = align_lmbs([reduced_lmb(beliefs[i], caps) for i in active], 0.0)
        shares = np.tile(weights, (len(aligned.labels), 1))
        if seen is not None:
            shares = view_weights(aligned, weights, seen, active)
        existence = expit(aligned.logits)
        present = shares * existence
        exists, absent = sum_over_sensors(present), sum_over_sensors(shares * expit(-aligned.logits))
        kept = exists > 0.0
        with np.errstate(divide="ignore"):
            logits = np.log(exists) - np.log(absent)
        fused = unchecked(LMB, _pooled(aligned, kept, present, caps), logits[kept])
        return fused, label_fusion_info((shares > 0.0) & ~aligned.held, active, len(beliefs), existence, exists, 0.0)


def _pooled(aligned: AlignedLmbs, kept: Bools, present: Floats, caps: MixtureCaps) -> TrackTable:
    """Return the reduced mixture of the tracks of each kept label, weighted by `present` (num_labels, num_sensors)."""
    pooled = (present > 0.0) & kept[:, None]
    label, sensor = np.nonzero(pooled)
    offsets = offsets_of(np.count_nonzero(pooled, axis=1)[kept])
    places, weights = aligned.chosen[label, sensor], present[label, sensor]
    return TrackTable.from_kernel(pooled_tracks(aligned.tracks, aligned.labels[kept], offsets, places, weights, caps))
