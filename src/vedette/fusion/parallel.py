"""Parallel update: posteriors of one common prediction, each by its sensor's own scan, become one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from vedette.densities import LMB, TrackTable
from vedette.densities.checks import unchecked
from vedette.densities.label_sets import places_of
from vedette.errors import InputError, NumericalError
from vedette.fusion.base import (
    FusionInfo,
    FusionLimits,
    LinearRule,
    by_sensor,
    check_beliefs,
    check_floor,
    count_lost,
    power_rule,
)
from vedette.fusion.lmbs import sum_over_sensors
from vedette.fusion.tracks import reduced_tracks
from vedette.fusion.validity import ValidBeliefs
from vedette.fusion.views import Views
from vedette.kernels.base.types import Floats, Ints, Tracks
from vedette.kernels.labelled.parallel import update_in_parallel
from vedette.kernels.labelled.stacking import stack_tracks
from vedette.probabilities import expit, log_expit


@dataclass(frozen=True, slots=True)
class ParallelUpdate:
    """Fusion of posteriors that were updated from one prediction, each by its sensor's own scan alone.

    With independent scans Bayes' rule gives pi+ prod_s (pi_s / pi+), of which each factor is what sensor s's scan said:
    the common prediction counts once, whatever the number of sensors. Label by label, for single Gaussians (a mixture
    is first replaced by one of its moments) with P+ = C C':

        A_s = C' (P_s^-1 - P+^-1) C, negative eigenvalues set to 0;  z_s = C^-1 (m_s - m+);  eta_s = (I + A_s) z_s
        A = I + sum_s A_s;  eta = sum_s eta_s;  m = m+ + C A^-1 eta;  P = C A^-1 C'
        logit = l+ + sum_s (l_s - l+) - ln|A| / 2 + eta'A^-1 eta / 2 + sum_s (ln|I + A_s| / 2 - eta_s'z_s / 2)

    Exact where every posterior is a single Gaussian, as of linear sensors whose targets are far from each other and
    from clutter; otherwise as good as the moments are. A sensor that cannot see a target says nothing of it, since its
    posterior is its prediction: it changes nothing, to the last bit.

    Attributes:
        weights: exponents v_s of (pi_s / pi+), non-negative, one a sensor; None for 1 each, which is Bayes' rule. Other
            values serve consensus, where they go to 1.
        missing_existence: existence, in (0, 1), of a predicted label that a sensor's posterior lacks because its filter
            dropped it. That is at most this sure there, and if the prediction was surer, the difference counts; the
            sensor then says nothing of where the target is. Counted in the `FusionInfo`. It should be the filters'
            `min_existence`, or these 0, so that nothing is dropped.

    Raises `InputError` for weights or a floor that cannot be used.
    """

    weights: Sequence[float] | Floats | None = None
    missing_existence: float = 1e-4
    shares_prediction: ClassVar[bool] = True  # a tracker must update all beliefs from one

    def __post_init__(self) -> None:
        if self.weights is not None:
            weights = tuple(float(weight) for weight in self.weights)
            if not weights or not all(0.0 <= weight < math.inf for weight in weights):
                raise InputError(f"weights: expected non-negative finite numbers, one a sensor; got {weights}")
            object.__setattr__(self, "weights", weights)
        check_floor("missing_existence", math.log(self.missing_existence) if self.missing_existence > 0 else -math.inf)

    def linear_rule(self, num_sensors: int) -> LinearRule:
        """pi+^(1 - sum of v) prod_s pi_s^(v_s)."""
        powers = (1.0,) * num_sensors if self.weights is None else tuple(self.weights)
        return LinearRule(1.0 - math.fsum(powers), powers, self.missing_existence)

    def fuse(self, beliefs: Sequence[LMB], views: Views | None = None) -> tuple[LMB, FusionInfo]:
        """Fused LMB of the labels of the prediction, in increasing order, and what was done.

        beliefs: posteriors, LMBs whose labels the prediction has. views: with the common `prediction`, an LMB.

        Raises `InputError` for a prediction that is missing or no LMB, for another number or kind of beliefs, state
        dimensions that differ, a density that is not valid or a label that the prediction lacks, and `NumericalError`
        where a label is certain at one sensor and impossible at another, or a product cannot be integrated.
        """
        prediction = _prediction_of(views, check=not isinstance(beliefs, ValidBeliefs))
        num_sensors = len(beliefs) if self.weights is None else len(self.weights)
        check_beliefs(beliefs, (LMB,), num_sensors)
        if any(belief.state_dim != prediction.state_dim for belief in beliefs):
            raise InputError(f"beliefs: expected states of dimension {prediction.state_dim}, as of views.prediction")
        weights = np.ones(num_sensors) if self.weights is None else np.array(self.weights)
        prior, given = _single(prediction), _posteriors(prediction, beliefs, self.missing_existence)
        try:
            means, covs, log_overlaps = update_in_parallel(
                prior.means, prior.covs, given.chosen, weights, given.tracks.means, given.tracks.covs
            )
        except FloatingPointError as fault:
            raise NumericalError(f"fusion of tracks: {fault}") from None
        logits = _updated(prediction.existence_logit, given.logits, weights) + log_overlaps
        _check_evidence(prediction.tracks.labels, logits)
        tracks = TrackTable.from_kernel(Tracks(prior.labels, prior.offsets, prior.log_weights, means, covs))
        present, absent = (
            _updated(log_expit(sign * prediction.existence_logit), log_expit(sign * given.logits), weights)
            for sign in (1.0, -1.0)
        )
        active = np.flatnonzero(weights > 0.0).tolist()
        lacking = (given.chosen < 0)[:, active]
        missing = by_sensor(np.count_nonzero(lacking, axis=0), active, num_sensors)
        return unchecked(LMB, tracks, logits), FusionInfo(
            missing_sets=missing,
            missing_labels=missing,
            num_sets=len(logits),
            num_lost_labels=count_lost(expit(given.logits[:, active]), expit(logits)),
            empty_intersection=len(logits) > 0 and bool(lacking.any(axis=1).all()),
            log_normaliser=float(np.logaddexp(present + log_overlaps, absent).sum()),
            discarded_weight=0.0,
        )


class _Posteriors(NamedTuple):
    """The sensors' posteriors on the labels of the prediction."""

    chosen: Ints  # (num_labels, num_sensors) place in `tracks`, -1 where the sensor lacks the label
    tracks: Tracks  # single Gaussians of all sensors
    logits: Floats  # (num_labels, num_sensors)


def _prediction_of(views: Views | None, *, check: bool) -> LMB:
    prediction = None if views is None else views.prediction
    if not isinstance(prediction, LMB):
        raise InputError(
            "views.prediction: expected the LMB that all beliefs were updated from, each by its sensor's own scan "
            f"alone, which a parallel update divides by; got {type(prediction).__name__}"
        )
    if not check:
        return prediction
    try:
        prediction.validate(error=InputError)
    except InputError as fault:
        raise InputError(f"views.prediction: {fault}") from None
    return prediction


def _single(belief: LMB) -> Tracks:
    """The tracks, each of one Gaussian."""
    tracks = belief.tracks.to_kernel()
    return reduced_tracks(tracks, power_rule("moment_matched", FusionLimits(), belief.state_dim))


def _posteriors(prediction: LMB, beliefs: Sequence[LMB], missing_existence: float) -> _Posteriors:
    shape = prediction.tracks.num_tracks, len(beliefs)
    floor = math.log(missing_existence) - math.log1p(-missing_existence)
    logits = np.minimum(prediction.existence_logit, floor)[:, None].repeat(len(beliefs), axis=1)
    chosen, start = np.full(shape, -1), 0
    for s, belief in enumerate(beliefs):
        own = places_of(belief.tracks.labels, prediction.tracks.labels)
        if (own < 0).any():
            label = belief.tracks.labels[int(np.argmax(own < 0))].tolist()
            raise InputError(
                f"beliefs[{s}]: expected labels of views.prediction, from which it was updated; got {label}"
            )
        chosen[own, s] = start + np.arange(len(own))
        logits[own, s] = belief.existence_logit
        start += len(own)
    return _Posteriors(chosen, stack_tracks([_single(belief) for belief in beliefs]), logits)


def _updated(prior: Floats, posteriors: Floats, weights: Floats) -> Floats:
    """prior + sum_s v_s (posterior_s - prior), where what is infinite and stays so adds nothing."""
    base = prior[:, None]
    with np.errstate(invalid="ignore"):
        change = np.where((posteriors == base) | (weights == 0.0), 0.0, posteriors - base)
        return np.asarray(prior + sum_over_sensors(weights * change))


def _check_evidence(labels: Ints, logits: Floats) -> None:
    faulty = np.isnan(logits)
    if faulty.any():
        label = labels[int(np.flatnonzero(faulty)[0])].tolist()
        raise NumericalError(
            f"fusion: label {label} is certain to one sensor or the prediction and impossible to another"
        )
