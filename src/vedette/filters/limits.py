"""Caps and thresholds of the filters. Each is a named field of `Limits`."""

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, TypeVar

import numpy as np

from vedette.densities import GLMB, LMB, FactoredGLMB, LabelledDensity, as_lmb, existence_probabilities, track_moments
from vedette.densities.label_sets import without_labels
from vedette.internal.probabilities import chi_squared_quantile, logit
from vedette.kernels.association.search import SearchCaps
from vedette.kernels.association.truncation import Truncation
from vedette.kernels.base.types import Bools, Ints
from vedette.kernels.gaussian.reduction import MixtureCaps
from vedette.kernels.steps.lmb import Reduction
from vedette.models.birth import BirthModel
from vedette.models.fields import (
    Chance,
    Count,
    Limit,
    NonNegative,
    Portion,
    Probability,
    Real,
    Share,
    check_fields,
)

# Labels and hypotheses less probable than this share of the weakest birth have no effect on what later detections mean.
_SHARE_OF_BIRTH = 0.1
_RELATIVE_TO_BIRTHS = ("min_existence", "min_relative_weight", "min_track_weight")
_Labelled = TypeVar("_Labelled", GLMB, LMB, FactoredGLMB)


@dataclass(frozen=True, slots=True)
class Limits:
    """Caps and thresholds of the filters. `Limits.none()` switches them all off (for small exact problems).

    Attributes:
        max_hypotheses: largest number of hypotheses, for a factored density in each factor, and for an LMB, of joint
            choices summed in a cluster too large for the exact sum.
        min_relative_weight: hypotheses lighter than this times the heaviest are dropped (if a labelled birth is weaker
            than this, those below a tenth of the weakest birth), and in a CPHD filter the large numbers of targets less
            probable than this times the most probable.
        min_track_weight: for every label and each association with the scan (missed, or detected as a given
            measurement), the heaviest such hypothesis is kept, in up to half of `max_hypotheses`, while its weight is
            at least this times the heaviest of all. 1 switches this off. Without it, a target whose first measurements
            fit its birth badly is displaced by variations of the heaviest hypotheses, and lost for good.
        gate_probability: probability that a target's measurement falls inside its gate. 1 switches gating off.
        min_log_clutter: floor of the log clutter intensity. A measurement where the clutter model gives intensity 0
            (outside the region) would otherwise rule out every hypothesis that leaves it unexplained.
        max_search_nodes: bound on the ranking search, a safeguard for scenes of extreme ambiguity.
        min_component_weight: mixture components lighter than this share of their track, or of the intensity of a PHD
            or CPHD filter, are dropped.
        merge_distance: Mahalanobis distance within which components of a track are merged. 0 merges none.
        max_components: largest number of components per track. 1 keeps one moment-matched Gaussian.
        min_existence: labels of an LMB or alone in their factor, or Bernoullis, less probable than this are dropped. If
            undetected targets are an intensity, only if a detection at their place is more probably of an undetected
            target. If a labelled birth is weaker than this, only below a tenth of the weakest birth. Such labels have
            no effect on what later detections mean.
        max_labels: largest number of labels of an LMB or a factored density, or of Bernoullis of a multi-Bernoulli. The
            most probable ones are kept.
        max_position_std: labels whose position std exceeds this along both axes are dropped after the scan: targets
            without detections for a long time. Infinite, in a file none: never [m].
        max_intensity_components: largest number of components of the intensity of a PHD or CPHD filter, over all
            targets.
        max_existence: upper bound on the existence of Bernoullis of the CB-MeMBer filter, below 1, because the update
            weights them by r / (1 - r), and leaves a certain one unchanged, whatever the scan.

    Raises:
        InputError: a field out of range.
    """

    max_hypotheses: Count = 300
    min_relative_weight: Share = 1e-6
    min_track_weight: Probability = 1e-5
    gate_probability: Portion = 1.0 - 1e-7
    min_log_clutter: Real = -60.0
    max_search_nodes: Count = 1_000_000
    min_component_weight: Share = 1e-5
    merge_distance: NonNegative = 2.0
    max_components: Count = 10
    min_existence: Share = 1e-4
    max_labels: Count = 1000
    max_position_std: Limit = math.inf
    max_intensity_components: Count = 100
    max_existence: Chance = 0.999

    def __post_init__(self) -> None:
        check_fields(self, "Limits.")

    @classmethod
    def none(cls) -> "Limits":
        """Return limits that drop, gate and merge nothing."""
        return cls(
            max_hypotheses=2**62,
            min_relative_weight=0.0,
            min_track_weight=0.0,
            gate_probability=1.0,
            max_search_nodes=2**62,
            min_component_weight=0.0,
            merge_distance=0.0,
            max_components=2**62,
            min_existence=0.0,
            max_labels=2**62,
            max_intensity_components=2**62,
            max_existence=1.0 - 2.0**-53,
        )

    def truncation(self, meas_dim: int) -> Truncation:
        """Return the fields that bound hypotheses, in kernel form."""
        return _truncation(self, meas_dim)

    def track_caps(self) -> MixtureCaps:
        """Return the fields that bound the mixture of a track, in kernel form."""
        log_min_weight = math.log(self.min_component_weight) if self.min_component_weight > 0.0 else -math.inf
        return MixtureCaps(log_min_weight, float(self.merge_distance), int(self.max_components))

    def intensity_caps(self) -> MixtureCaps:
        """Return `track_caps` with the cap of a whole intensity in place of a track's.

        Components as improbable as the least existence are kept, since one target begins with each.
        """
        least = min(self.min_component_weight, self.min_existence or 1.0)
        log_least = math.log(least) if least > 0.0 else -math.inf
        return MixtureCaps(log_least, float(self.merge_distance), int(self.max_intensity_components))

    def reduction(self) -> Reduction:
        """Return the fields that bound tracks and labels, in kernel form."""
        return _reduction(self)

    def without_spread(self, belief: _Labelled) -> tuple[_Labelled, float]:
        """Return the belief without the labels that `max_position_std` drops, and their summed existence."""
        if math.isinf(self.max_position_std):
            return belief, 0.0
        return without_labels(belief, _spread_labels(belief, self.max_position_std))

    def keeping_labels(self) -> "Limits":
        """Return the same limits, but with no label dropped."""
        return _keeping_labels(self)

    def without_excess(self, belief: FactoredGLMB) -> tuple[FactoredGLMB, float, bool]:
        """Return the belief without the labels that `max_labels` and `without_spread` drop, and what was dropped.

        That is the summed existence of the dropped labels, and True if the number of labels reached `max_labels`. Of
        more than `max_labels` labels, the least probable ones are dropped.
        """
        if belief.tracks.num_tracks < self.max_labels:  # labels may have several
            return *self.without_spread(belief), False
        labels, existence = existence_probabilities(belief)
        excess = labels[np.argsort(-existence, kind="stable")[self.max_labels :]]
        fewer, dropped = without_labels(belief, excess)
        kept, spread = self.without_spread(fewer)
        return kept, dropped + spread, len(labels) >= self.max_labels

    def kept(self, belief: _Labelled) -> _Labelled:
        """Return the belief without the labels that `min_existence`, `max_labels` and `max_position_std` drop."""
        labels, existence = existence_probabilities(belief)
        likeliest = np.argsort(-existence, kind="stable")
        gone = np.union1d(likeliest[self.max_labels :], np.flatnonzero(existence < self.min_existence))
        return self.without_spread(without_labels(belief, labels[gone])[0])[0]

    @property
    def max_existence_logit(self) -> float:
        """Log-odds of `max_existence`."""
        return logit(self.max_existence)


@lru_cache(maxsize=1000)
def _truncation(limits: Limits, meas_dim: int) -> Truncation:
    log_gap = -math.log(limits.min_relative_weight) if limits.min_relative_weight > 0.0 else math.inf
    return Truncation(
        SearchCaps(int(limits.max_hypotheses), log_gap, int(limits.max_search_nodes)),
        chi_squared_quantile(meas_dim, limits.gate_probability),
        float(limits.min_log_clutter),
        -math.log(limits.min_track_weight) if limits.min_track_weight > 0.0 else math.inf,
    )


@lru_cache(maxsize=1000)
def _reduction(limits: Limits) -> Reduction:
    return Reduction(limits.track_caps(), logit(limits.min_existence), int(limits.max_labels))


@lru_cache(maxsize=1000)
def limits_for_births(limits: Limits, birth: BirthModel, clutter_rate: float) -> Limits:
    """Return the limits of a filter with labelled births: thresholds above a birth become a tenth of the weakest.

    clutter_rate: mean number of false measurements of a scan.
    """
    least = birth.least_existence(clutter_rate)
    names = [name for name in _RELATIVE_TO_BIRTHS if least < getattr(limits, name) < 1.0]
    lowered: dict[str, Any] = dict.fromkeys(names, _SHARE_OF_BIRTH * least)
    return replace(limits, **lowered) if lowered else limits


@lru_cache(maxsize=1000)
def _keeping_labels(limits: Limits) -> Limits:
    return replace(limits, min_existence=0.0, max_labels=2**62, max_position_std=math.inf)


def _spread_labels(belief: LabelledDensity, max_position_std: float) -> Ints:
    """Return the labels (num, 2) whose position has more than this standard deviation along both axes."""
    lmb = as_lmb(belief)
    variances = np.diagonal(track_moments(lmb.tracks)[1], axis1=1, axis2=2)[:, :2]
    wide: Bools = variances.min(axis=1, initial=np.inf) > max_position_std**2
    return np.ascontiguousarray(lmb.tracks.labels[wide])
