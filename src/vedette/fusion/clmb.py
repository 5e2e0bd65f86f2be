"""Generalized covariance intersection of LMB densities."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy.special import expit, log_expit, logit

from vedette.densities import GLMB, LMB
from vedette.densities.cases import LabelledCases, lmb_cases
from vedette.densities.checks import unchecked
from vedette.densities.products import PowerProducts, Share, lay_out_products
from vedette.fusion.base import (
    FusionInfo,
    FusionLimits,
    MixturePower,
    PowerRule,
    by_sensor,
    check_beliefs,
    check_floor,
    check_kinds,
    check_power,
    check_weights,
    count_lost,
    power_rule,
)
from vedette.fusion.tracks import fused_tracks, reduced_tracks
from vedette.kernels.base.types import Floats, Ints, Lmb, Tracks
from vedette.kernels.labelled.conversions import glmb_to_lmb
from vedette.kernels.labelled.stacking import stack_tracks


@dataclass(frozen=True, slots=True)
class Clmb:
    """Consensus LMB fusion (paper eq. 12; Fantacci et al. 2015): GCI label by label.

    The logit of a fused existence is the weighted mean of the sensors' logits and the log of the integral of prod_i
    p_i^(w_i), which is at most 0: one blind sensor pulls a target down (0.98 and 0.1 give about 0.69).

    The fused labels are those that any sensor of positive weight has. Where a sensor lacks a label (or has it with
    existence 0), its existence there is a floor, the least of `missing_existence` and the existences that it has, and
    it is left out of the label's density, where the other sensors' weights are scaled to sum to one; counted in the
    `FusionInfo`. A label in every hypothesis of a sensor's GLMB is certain there, and so in the fusion. (Truncation may
    have cut off the rest; to bound its certainty as its absence is bounded makes joint decisions worse, not better.)

    Assumes that the sensors see the same part of the world and that a target has one label at all of them: what one
    sensor surely sees is lost where another has none of its label, or does not see there.

    Attributes:
        weights: fusion weights, one a sensor, in the order of the beliefs; non-negative, sum 1. A sensor of weight 0
            takes no part.
        mixture_power: how a power of a mixture is taken; see `CmDeltaGlmb`.
        missing_existence: floor for the existence probability of a label that a sensor lacks, in (0, 1).
        limits: caps on the cost.

    Raises `InputError` for weights, a floor or limits that cannot be used.
    """

    weights: Sequence[float] | Floats
    mixture_power: MixturePower = "moment_matched"
    missing_existence: float = 1e-4
    limits: FusionLimits = field(default_factory=FusionLimits)

    def __post_init__(self) -> None:
        object.__setattr__(self, "weights", check_weights(self.weights))
        check_power(self.mixture_power, self.limits, len(self.weights))
        check_floor("missing_existence", math.log(self.missing_existence) if self.missing_existence > 0 else -math.inf)

    def fuse(self, beliefs: Sequence[LMB | GLMB]) -> tuple[LMB, FusionInfo]:
        """Fused LMB of the sensors' LMBs (a GLMB is first converted), in increasing label order, and what was done.

        Raises `InputError` for another number or kind of beliefs, for state dimensions that differ or a density that
        is not valid, and `NumericalError` where a product of track densities cannot be integrated.
        """
        check_beliefs(beliefs, (LMB, GLMB), len(self.weights))
        rule = power_rule(self.mixture_power, self.limits, beliefs[0].state_dim)
        active = [i for i, weight in enumerate(self.weights) if weight > 0.0]
        weights = np.array([self.weights[i] for i in active])
        aligned = _align([_as_lmb(beliefs[i], rule) for i in active], self.missing_existence)
        tracks, log_overlaps = fused_tracks(aligned.labels, aligned.chosen, weights, aligned.tracks, rule)
        log_present = log_expit(aligned.logits) @ weights + log_overlaps
        log_absent = log_expit(-aligned.logits) @ weights
        held = aligned.chosen >= 0
        missing = by_sensor(np.count_nonzero(~held, axis=0), active, len(beliefs))
        logits = aligned.logits @ weights + log_overlaps
        return unchecked(LMB, tracks, logits), FusionInfo(
            missing_sets=missing,
            missing_labels=missing,
            num_sets=len(held),
            num_lost_labels=count_lost(expit(aligned.logits), expit(logits)),
            empty_intersection=len(held) > 0 and not bool(held.all(axis=1).any()),
            log_normaliser=float(np.logaddexp(log_present, log_absent).sum()),
            discarded_weight=0.0,
        )

    def lay_out(self, cases: Sequence[LabelledCases], prediction: GLMB | LMB) -> PowerProducts | None:
        """The fusions of any of the sensors' cases; None for a GLMB prediction, or where the powers are not exact.

        cases: one a sensor; a GLMB is first converted, as by `fuse`. prediction: of one Gaussian a track. Raises
        `InputError` for another number of cases.
        """
        check_kinds([own.kind for own in cases], (LMB, GLMB), len(self.weights))
        active = [i for i, weight in enumerate(self.weights) if weight > 0.0]
        # A GLMB's labels become mixtures; powers of the single Gaussians of an LMB are exact.
        exact = self.mixture_power == "moment_matched" or all(own.kind is LMB for own in cases)
        if not exact or not isinstance(prediction, LMB):
            return None
        shares = [self._share(cases[i], self.weights[i]) for i in active]
        return lay_out_products(shares, LabelledCases.of(prediction), active)

    def _share(self, own: LabelledCases, weight: float) -> Share:
        lmbs = own if own.kind is LMB else lmb_cases(own)
        held, logits = lmbs.possible, lmbs.existence_logits
        least = logits.min(axis=1, where=held[:, 1::2], initial=float(logit(self.missing_existence)))
        return Share(lmbs, weight, held, np.stack([log_expit(-least), log_expit(least)], axis=1))


class _Aligned(NamedTuple):
    """All sensors on the union of their labels. labels: (num_labels, 2), increasing.

    chosen: (num_labels, S) place in `tracks`, -1 where the sensor lacks the label. logits: (num_labels, S).
    """

    labels: Ints
    chosen: Ints
    tracks: Tracks
    logits: Floats


def _align(sensors: Sequence[Lmb], missing_existence: float) -> _Aligned:
    floor = math.log(missing_existence) - math.log1p(-missing_existence)
    places = [_places(sensor) for sensor in sensors]
    labels = sorted(set().union(*places))
    chosen, logits = np.full((len(labels), len(sensors)), -1), np.empty((len(labels), len(sensors)))
    start = 0
    for s, sensor in enumerate(sensors):
        own = np.array([place for place, label in enumerate(labels) if label in places[s]], np.int64)
        tracks = np.array([places[s][labels[place]] for place in own.tolist()], np.int64)
        logits[:, s] = min(floor, float(sensor.existence_logit[tracks].min(initial=math.inf)))
        logits[own, s] = sensor.existence_logit[tracks]
        chosen[own, s] = start + tracks
        start += len(sensor.existence_logit)
    table = stack_tracks([sensor.tracks for sensor in sensors])
    return _Aligned(np.array(labels, np.int64).reshape(-1, 2), chosen, table, logits)


def _as_lmb(belief: LMB | GLMB, rule: PowerRule) -> Lmb:
    """An LMB with reduced mixtures."""
    if isinstance(belief, GLMB):
        return glmb_to_lmb(belief.to_kernel(), rule.caps)
    return Lmb(reduced_tracks(belief.tracks.to_kernel(), rule), belief.existence_logit)


def _places(lmb: Lmb) -> dict[tuple[int, int], int]:
    """Place of each label of positive existence."""
    labels = lmb.tracks.labels.tolist()
    return {(labels[i][0], labels[i][1]): i for i in np.flatnonzero(lmb.existence_logit > -math.inf).tolist()}
