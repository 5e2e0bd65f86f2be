"""Parallel update: fusion of posteriors that were updated from one common prediction, each by its sensor's own scan."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, TypeVar

import numpy as np

from vedette.densities import LMB, FactoredGLMB, LabelledDensity, TrackTable, as_lmb
from vedette.densities.checks import offsets_of
from vedette.densities.containers import unchecked
from vedette.densities.conversions import marginalised_factors, with_single_gaussians
from vedette.densities.label_sets import WHOLE, in_label_order, join_factors
from vedette.densities.tracks import places_of
from vedette.errors import InputError, NumericalError
from vedette.fusion.base import (
    FusionInfo,
    LogLinearPool,
    PrevalidatedBeliefs,
    check_beliefs,
    label_fusion_info,
    refuse_modes,
)
from vedette.fusion.classes import class_gains, updated_classes
from vedette.fusion.parallel_sets import (
    check_evidence,
    check_single,
    fused_groups,
    grouped_sets,
    known_places,
    lost_labels,
    posteriors_of,
    updated_logs,
)
from vedette.fusion.powers import ONE, FusionLimits, check_limits
from vedette.fusion.views import FieldsOfView
from vedette.internal.probabilities import expit, log_expit
from vedette.kernels.base.types import CLASSES, Floats, Ints, Mixture, Tracks
from vedette.kernels.gaussian.components import taken_components
from vedette.kernels.gaussian.marks import marks_of
from vedette.kernels.gaussian.pooling import merged_mixtures
from vedette.kernels.labelled.parallel import update_in_parallel
from vedette.kernels.labelled.stacking import stack_tracks
from vedette.models.arguments import chance, non_negative, sequence

_Density = TypeVar("_Density", LMB, FactoredGLMB)


@dataclass(frozen=True, slots=True)
class ParallelUpdate:
    """Fusion of posteriors that were updated from one prediction, each by its sensor's own scan alone.

    With independent scans Bayes' rule gives pi+ prod_s (pi_s / pi+), where each factor is the likelihood ratio of
    sensor s's scan. The common prediction counts once, whatever the number of sensors. Label by label, for single
    Gaussians with P+ = C C':

        A_s = C' (P_s^-1 - P+^-1) C, negative eigenvalues set to 0;  z_s = C^-1 (m_s - m+);  eta_s = (I + A_s) z_s
        A = I + sum_s A_s;  eta = sum_s eta_s;  m = m+ + C A^-1 eta;  P = C A^-1 C'
        logit = l+ + sum_s (l_s - l+) - ln|A| / 2 + eta'A^-1 eta / 2 + sum_s (ln|I + A_s| / 2 - eta_s'z_s / 2)

    The mixtures of an LMB are first replaced by Gaussians of their moments. A sensor that cannot observe a target has
    its prediction as posterior, so it leaves the result unchanged to the last bit.

    For products of GLMBs the same holds for each label set I of a group of labels: w(I) is in proportion to w+(I)
    prod_s (w_s(I) / w+(I)) times the integrals of the position densities of its labels, where w_s(I) is the weight in a
    factor of sensor s and w+(I) the prediction's weight of I among the labels in that factor. If each sensor finds that
    one of two labels has no target, the rule takes this as the same label at all sensors. LMBs would reduce both labels
    at every sensor, and may lose both. A track that is a mixture contributes a sum of such terms. The product is then
    the mixture over all choices of one component per sensor, of which the Gaussian of the moments is kept. (If an
    exponent is not 1, the mixture of each posterior is first replaced by the Gaussian of its moments.)

    The rule is exact for LMBs of single Gaussians and for label sets in which positions do not depend on each other.
    Otherwise it is as accurate as the moments.

    Attributes:
        weights: exponents v_s of (pi_s / pi+), non-negative, one per sensor, or None for 1 each, which is Bayes' rule.
            Other values are for consensus, where they converge to 1.
        missing_existence: upper bound, in (0, 1), on the existence of a predicted label that a sensor's posterior lacks
            because its filter dropped it. If the prediction was higher, the difference counts. The sensor then adds no
            information about the position. Counted in `FusionInfo`. It should be the filters' `min_existence`, or
            `min_existence` should be 0, so that nothing is dropped.
        limits: caps on the cost: `max_combinations` of components of one label, the likeliest after each sensor
            (combinations lighter than 1e-6 of the likeliest are always dropped), and `max_hypotheses` label sets of a
            group, predicted and fused. The others are not used.

    Raises `InputError` for invalid weights, floor or limits.
    """

    weights: Sequence[float] | Floats | None = None
    missing_existence: float = 1e-4
    limits: FusionLimits = field(default_factory=FusionLimits)
    requires_common_prior: ClassVar[bool] = True  # a tracker must update all beliefs from one

    def __post_init__(self) -> None:
        if self.weights is not None:
            given = sequence("weights", self.weights, "non-negative finite numbers, one a sensor")
            weights = tuple(non_negative(f"weights[{s}]", weight) for s, weight in enumerate(given))
            if not weights:
                raise InputError("weights: expected non-negative finite numbers, one a sensor; got none")
            object.__setattr__(self, "weights", weights)
        chance("missing_existence", self.missing_existence)
        check_limits(self.limits)

    def log_linear_pool(self, num_sensors: int) -> LogLinearPool:
        """Return pi+^(1 - sum of v) prod_s pi_s^(v_s)."""
        powers = (1.0,) * num_sensors if self.weights is None else tuple(self.weights)
        return LogLinearPool(1.0 - math.fsum(powers), powers, self.missing_existence)

    def fuse(self, beliefs: Sequence[_Density], views: FieldsOfView | None = None) -> tuple[_Density, FusionInfo]:
        """Return the fused density of the labels of the prediction, in increasing order, and the report.

        LMBs give an LMB. If a belief or the prediction is a `FactoredGLMB`, the result is a `FactoredGLMB` with one
        Gaussian per label. Its factors are the smallest groups of labels that no factor of the prediction or of a
        posterior crosses.

        beliefs: posteriors, whose labels the prediction must have. views: with the common `prediction`. A product of
        GLMBs must have one single Gaussian per label, the same in all hypotheses.

        Raises `InputError` for a missing or unsuitable prediction, a wrong number or kind of beliefs, state dimensions
        that differ, an invalid density or a label that the prediction lacks, and `NumericalError` if a label is certain
        at one sensor and impossible at another, or a product cannot be integrated.
        """
        prediction = _prediction_of(views, check=not isinstance(beliefs, PrevalidatedBeliefs))
        given: Sequence[LabelledDensity] = beliefs
        if not isinstance(beliefs, PrevalidatedBeliefs):
            given = sequence("beliefs", beliefs, "one density a sensor")
        num_sensors = len(given) if self.weights is None else len(self.weights)
        check_beliefs(given, (LMB, FactoredGLMB), num_sensors)
        refuse_modes("parallel fusion", given)
        if any(belief.state_dim != prediction.state_dim for belief in given):
            raise InputError(f"beliefs: expected states of dimension {prediction.state_dim}, as of views.prediction")
        weights = np.ones(num_sensors) if self.weights is None else np.array(self.weights)
        fused: Any
        if all(belief.is_lmb for belief in (prediction, *given)):
            single = [with_single_gaussians(as_lmb(belief)) for belief in (prediction, *given)]
            fused, info = self._fused_lmbs(single[0], single[1:], weights)
        else:
            factored = [FactoredGLMB.of(belief) for belief in given]
            fused, info = self._fused_factors(FactoredGLMB.of(prediction), factored, weights)
        return fused, info

    def _fused_lmbs(self, prediction: LMB, beliefs: Sequence[LMB], weights: Floats) -> tuple[LMB, FusionInfo]:
        """Fuse label by label. The prediction must have single Gaussians."""
        prior, given = prediction.tracks.to_kernel(), posteriors_of(prediction, beliefs, self.missing_existence)
        before = prior.components
        updated, log_overlaps = self._updated_tracks(before, given.chosen, weights, given.tracks)
        logits = updated_logs(prediction.existence_logit, given.logits, weights) + log_overlaps
        check_evidence(prediction.tracks.labels, logits)
        tracks = TrackTable.from_kernel(Tracks(prior.labels, prior.offsets, updated))
        present, absent = (
            updated_logs(log_expit(sign * prediction.existence_logit), log_expit(sign * given.logits), weights)
            for sign in (1.0, -1.0)
        )
        active = np.flatnonzero(weights > 0.0).tolist()
        lacking, existence = (given.chosen < 0)[:, active], expit(given.logits[:, active])
        log_normaliser = float(np.logaddexp(present + log_overlaps, absent).sum())
        info = label_fusion_info(lacking, active, len(weights), existence, expit(logits), log_normaliser)
        return unchecked(LMB, tracks, logits), info

    def _fused_factors(
        self, prediction: FactoredGLMB, beliefs: Sequence[FactoredGLMB], weights: Floats
    ) -> tuple[FactoredGLMB, FusionInfo]:
        """Fuse labels that are alone in their factors label by label, the others group by group."""
        check_single(prediction)
        marginal = [
            marginalised_factors(belief, WHOLE if power == 1.0 else ONE)
            for belief, power in zip(beliefs, weights.tolist(), strict=True)
        ]
        joined = join_factors([prediction, *marginal])
        known_places(prediction.tracks.labels, [belief.tracks.labels for belief in marginal])
        predicted, *updated = joined.lmbs_alone()
        alone, info = self._fused_lmbs(predicted, updated, weights)
        tables = [belief.tracks for belief in joined.densities]
        starts = offsets_of([table.num_tracks for table in tables[1:]])
        groups = [
            grouped_sets(joined, group, starts, weights, self.missing_existence, self.limits.max_hypotheses)
            for group in np.flatnonzero(~joined.alone).tolist()
        ]
        if not groups:
            return FactoredGLMB.of(alone), info
        own = places_of(np.concatenate([group.labels[group.place_labels] for group in groups]), tables[0].labels)
        chosen = np.concatenate([group.chosen for group in groups])
        tracks = stack_tracks([table.to_kernel() for table in tables[1:]])
        prior = taken_components(tables[0].to_kernel().components, own)
        components, log_overlaps = self._updated_tracks(prior, chosen, weights, tracks)
        joint, log_normaliser = fused_groups(groups, log_overlaps, components, self.limits.max_hypotheses)
        fused = in_label_order(FactoredGLMB.product([FactoredGLMB.of(alone), *joint], prediction.state_dim))
        missing = tuple((np.array(info.missing_labels) + sum(group.num_missing for group in groups)).tolist())
        return fused, replace(
            info,
            missing_sets=missing,
            missing_labels=missing,
            num_sets=info.num_sets + sum(len(group.labels) for group in groups),
            num_lost_labels=lost_labels(marginal, weights, fused),
            empty_intersection=False,
            log_normaliser=info.log_normaliser + log_normaliser,
            discarded_weight=-math.expm1(sum(group.log_kept for group in groups)) + 0.0,  # no -0
        )

    def _updated_tracks(self, prior: Mixture, chosen: Ints, weights: Floats, tracks: Tracks) -> tuple[Mixture, Floats]:
        """Return the updated components, and the logs of their integrals."""
        most = self.limits.max_combinations
        try:
            means, covs, log_overlaps = update_in_parallel(prior.means, prior.covs, chosen, weights, tracks, most)
        except FloatingPointError as fault:
            raise NumericalError(f"fusion of tracks: {fault}") from None
        fused = prior._replace(log_weights=np.zeros(len(means)), means=means, covs=covs)
        classes = prior.marks[:, CLASSES:]
        if classes.shape[1] == 0:
            return fused, log_overlaps
        own = merged_mixtures(tracks.components, tracks.offsets).marks[:, CLASSES:]
        gains = np.where((chosen >= 0)[..., np.newaxis], class_gains(own[chosen], classes[:, np.newaxis]), 0.0)
        classes, log_factors = updated_classes(classes, (weights[:, np.newaxis] * gains).sum(axis=1))
        return fused._replace(marks=marks_of(classes)), log_overlaps + log_factors


def _prediction_of(views: FieldsOfView | None, *, check: bool) -> LabelledDensity:
    prediction = views.prediction if isinstance(views, FieldsOfView) else None
    if prediction is None or not (prediction.is_lmb or prediction.is_product):
        raise InputError(
            "views.prediction: expected the LMB or FactoredGLMB that all beliefs were updated from, each by its "
            f"sensor's own scan alone, which a parallel update divides by; got {type(prediction).__name__}"
        )
    if not check:
        return prediction
    try:
        prediction.validate(error=InputError)
    except InputError as fault:
        raise InputError(f"views.prediction: {fault}") from None
    return prediction
