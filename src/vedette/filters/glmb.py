"""The delta-GLMB ("Vo-Vo") filter, of one sensor and of several sensors with sequential updates."""

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np

from vedette.densities import GLMB, LMB, existence_probabilities
from vedette.densities.tracks import UNSCANNED
from vedette.errors import ImplausibleWarning, InputError, NumericalError
from vedette.filters.assignment import Gibbs, JointAssociation, RankedAssignment
from vedette.filters.base import LabelledFilter, LabelledFilterBase, SensorStep, blind_sensor
from vedette.filters.limits import Limits
from vedette.filters.multi_sensor import SequentialUpdate
from vedette.filters.protocols import FilterInfo
from vedette.internal.cut_births import MAX_CUT_SHARE, cut_share
from vedette.internal.probabilities import expit
from vedette.kernels.base.types import Glmb, Ints
from vedette.kernels.labelled.conversions import marginalise
from vedette.kernels.steps.glmb import StepReport, step_gibbs, step_ranked


class _GlmbFilterBase(LabelledFilterBase[GLMB]):
    """Base of the delta-GLMB filters of one and of several sensors."""

    __slots__ = ()
    kind: ClassVar[type[GLMB]] = GLMB
    limits: Limits
    marginalised: bool

    def _before_scan(self, prior: GLMB, dt: float, step: Any, births: LMB | None) -> Any:
        if dt > 0.0 and self.targets.birth.period is not None and prior.num_hyps >= self.limits.max_hypotheses:
            born = expit(self._births(dt, step, None, births).existence_logit)
            existence, most = existence_probabilities(prior)[1], self.limits.max_hypotheses
            # Labels of about the probability of a birth are unconfirmed; a scan rejects or confirms the others.
            least, largest = 0.5 * born.min(initial=1.0), 2.0 * born.max(initial=0.0)
            labels = np.concatenate([born, existence[(existence >= least) & (existence <= largest)]])
            if cut_share(len(labels), float(labels.sum()) / max(len(labels), 1), most) > MAX_CUT_SHARE:
                text = f"max_hypotheses: {most} hypotheses cut more than {100.0 * MAX_CUT_SHARE:g} % of the expected "
                text += "births, as each site makes a label at each step until a scan confirms or rejects them; use "
                text += "FactoredGlmbFilter or LmbFilter, longer steps without scans, or births at fewer steps"
                warnings.warn(text, ImplausibleWarning, stacklevel=3)
        return prior.to_kernel()

    def _run_kernel(self, prior: Glmb, step: SensorStep) -> tuple[Glmb, StepReport]:
        return step_ranked(prior, *step.inputs)

    def _check(self, posterior: Glmb, report: StepReport, place: str) -> float:
        if len(posterior.hyp_log_weights) == 0:
            raise NumericalError(f"{place}no hypothesis has positive weight; do the models forbid this scan?")
        return report.log_total

    def _conclude(
        self, posterior: Glmb, reports: Sequence[StepReport], *, log_likelihood: float, repeats: Sequence[Ints]
    ) -> tuple[GLMB, FilterInfo]:
        if self.marginalised:
            belief = GLMB.from_kernel(marginalise(posterior, self.limits.track_caps()))
        else:
            belief = GLMB.from_kernel(posterior, _sources(reports, repeats))
        kept, spread = self.limits.without_spread(belief)
        _, log_kept, _, num_raised, cut, full, _ = zip(*reports, strict=True)
        return kept, FilterInfo(
            log_likelihood=log_likelihood,
            num_hypotheses=len(kept.hyp_log_weights),
            num_tracks=len(kept.tracks.labels),
            truncation_error_bound=max(0.0, -math.expm1(sum(log_kept))),
            dropped_existence=spread,
            num_clutter_floored=sum(num_raised),
            num_duplicates=sum(map(len, repeats)),
            search_truncated=any(cut),
            limit_reached=any(full),
        )


def _sources(reports: Sequence[StepReport], repeats: Sequence[Ints]) -> Ints | None:
    """Return the sources of tracks as in `TrackTable`, or None after several sequential updates."""
    if len(reports) > 1:
        return None
    sources = reports[0].sources
    if len(repeats) == 0:  # a prediction
        return np.column_stack([sources[:, 0], np.full(len(sources), UNSCANNED)])
    if len(repeats[0]):  # from rows of the deduplicated scan to those of the given scan
        rows = np.setdiff1d(np.arange(sources[:, 1].max(initial=-1) + 1 + len(repeats[0])), repeats[0])
        return np.column_stack([sources[:, 0], np.append(rows, -1)[sources[:, 1]]])
    return sources


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class DeltaGlmbFilter(_GlmbFilterBase, LabelledFilter[GLMB]):
    """delta-GLMB filter of one sensor (Vo, Vo, Hoang 2017, paper, Algorithm 1, local prediction and update).

    Separate predictions and updates are ranked, whatever `assignment`. `limits` truncates a prediction as it does a
    posterior.

    Attributes:
        targets: motion, survival and birth models.
        sensor: model of the sensor.
        limits: caps and thresholds.
        assignment: how joint associations are found: `RankedAssignment`, the heaviest in exact order, or drawn,
            `Gibbs`.
        marginalised: reduce the posterior to one hypothesis per label set after each step (M-delta-GLMB filter,
            Fantacci and Vo 2015). Track mixtures are then reduced to `limits.max_components`.

    Raises:
        InputError: a part of another kind, or a field out of range.
    """

    assignment: JointAssociation = field(default_factory=RankedAssignment)
    marginalised: bool = False

    def __post_init__(self) -> None:
        LabelledFilter.__post_init__(self)  # super() fails here, as slots=True replaces the class
        if not isinstance(self.assignment, JointAssociation):
            raise InputError(f"assignment: expected RankedAssignment or Gibbs; got {type(self.assignment).__name__}")

    def _blind(self) -> "DeltaGlmbFilter":
        return replace(self, sensor=blind_sensor(), assignment=RankedAssignment())

    def _run_kernel(self, prior: Glmb, step: SensorStep) -> tuple[Glmb, StepReport]:
        scan, motion, sensor, truncation = step.inputs
        if isinstance(self.assignment, Gibbs) and scan.dt > 0.0 and step.rng is not None:
            return step_gibbs(prior, scan, motion, sensor, truncation, int(self.assignment.num_samples), step.rng)
        return step_ranked(prior, *step.inputs)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class MultiSensorGlmbFilter(_GlmbFilterBase, SequentialUpdate[GLMB]):
    """delta-GLMB filter of several sensors: one prediction, then sequential updates with each sensor's scan.

    Without caps the posterior is the multi-sensor delta-GLMB (Vo, Vo and Beard 2019), whatever the order of the
    sensors, if models are linear and neither noise nor detection depends on the state. Otherwise the model of a later
    sensor is linearised, and its noise and detection are evaluated, at the result of the earlier ones.

    With caps, hypotheses are truncated after every sensor by their weights at that point. A hypothesis that the first
    sensors make unlikely is lost even if a later sensor would have raised its weight, so the order of the sensors
    matters a little. `truncation_error_bound` counts the weight that is discarded at each sensor.

    Attributes:
        targets: motion, survival and birth models.
        sensors: model of each sensor. They may measure different quantities.
        limits: caps and thresholds.
        marginalised: reduce the posterior to one hypothesis per label set after each step, as in `DeltaGlmbFilter`.

    Raises:
        InputError: a part of another kind, or no sensor.
    """

    marginalised: bool = False
