"""The labelled multi-Bernoulli filter, of one sensor and of several sensors with sequential updates."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from vedette.densities import LMB
from vedette.errors import NumericalError
from vedette.filters.assignment import LmbAssociation, RankedAssignment
from vedette.filters.base import LabelledFilter, LabelledFilterBase, SensorStep, blind_sensor
from vedette.filters.limits import Limits
from vedette.filters.multi_sensor import SequentialUpdate
from vedette.filters.protocols import Filter, FilterInfo
from vedette.kernels.association.marginals import Association
from vedette.kernels.base.types import Bools, Ints, Lmb
from vedette.kernels.steps.field_of_view import in_view, marked, merge_updated
from vedette.kernels.steps.lmb import LmbReport, step_lmb
from vedette.kernels.steps.multi_sensor_combinations import predict_combinations, standing_combinations
from vedette.kernels.steps.multi_sensor_lmb import update_lmb


class LmbFilterBase(LabelledFilterBase[LMB]):
    """Base of the filters of an LMB."""

    __slots__ = ()
    kind: ClassVar[type[LMB]] = LMB
    limits: Limits

    def _check(self, posterior: Lmb, report: LmbReport, place: str) -> float:
        if not math.isfinite(report.sums.log_total):
            raise NumericalError(f"{place}no association has positive weight; do the models forbid this scan?")
        return report.sums.log_total

    def _conclude(
        self, posterior: Lmb, reports: Sequence[LmbReport], *, log_likelihood: float, repeats: Sequence[Ints]
    ) -> tuple[LMB, FilterInfo]:
        kept, spread = self.limits.without_spread(LMB.from_kernel(posterior))
        sums, _, num_raised, dropped, cut = zip(*reports, strict=True)
        _, num_ranked, log_kept = zip(*sums, strict=True)
        return kept, FilterInfo(
            log_likelihood=log_likelihood,
            num_hypotheses=1,
            num_tracks=len(kept.tracks.labels),
            truncation_error_bound=max(-math.expm1(sum(log_kept)), 0.0),  # keeps NaN
            dropped_existence=sum(dropped) + spread,
            num_clutter_floored=sum(num_raised),
            num_duplicates=sum(map(len, repeats)),
            num_inexact_clusters=sum(num_ranked),
            search_truncated=any(cut),
            limit_reached=len(posterior.existence_logit) >= self.limits.max_labels,
        )


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class LmbFilter(LmbFilterBase, LabelledFilter[LMB]):
    """LMB filter of one sensor (Reuter, Vo, Vo, Dietmayer 2014), cheaper than the delta-GLMB filter.

    It draws no random numbers, and its predictions drop nothing.

    Attributes:
        targets: motion, survival and birth models.
        sensor: model of the sensor.
        limits: caps and thresholds.
        assignment: how association probabilities are computed: the exact sum, belief propagation, or a custom method.

    Raises:
        InputError: a part of another kind.
    """

    assignment: LmbAssociation = field(default_factory=RankedAssignment)

    def _blind(self) -> "LmbFilter":
        return LmbFilter(self.targets, blind_sensor(), Limits.none())

    def _run_kernel(self, prior: Lmb, step: SensorStep) -> tuple[Lmb, LmbReport]:
        association = self.assignment.to_kernel()
        if association is None and step.inputs[0].dt == 0.0:
            return _by_combinations(prior, step)
        return step_lmb(prior, *step.inputs, step.limits.reduction(), association)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SequentialLmbFilter(LmbFilterBase, SequentialUpdate[LMB]):
    """LMB filter of several sensors with sequential updates ("iterated corrector").

    After each scan the posterior is projected to an LMB again, so the order of the sensors matters a little. In return
    the cost grows in proportion to the number of sensors, whatever their fields of view, while that of
    `MultiSensorLmbFilter` grows exponentially. The cost of a scan depends on the labels that it may affect, not on all
    labels. With one sensor it is the `LmbFilter`. Labels are dropped, by `Limits.min_existence`, `max_labels` and
    `max_position_std`, only after the last scan, so that a missed detection of one sensor does not lose a target that
    the next one detects. Truncation is counted as by `MultiSensorLmbFilter`.

    Attributes and errors: as `MultiSensorGlmbFilter`, and `assignment` as in `LmbFilter`.
    """

    assignment: LmbAssociation = field(default_factory=RankedAssignment)

    def _run_kernel(self, prior: Lmb, step: SensorStep) -> tuple[Lmb, LmbReport]:
        association = self.assignment.to_kernel()
        if association is None:
            return _by_combinations(prior, step)
        return step_lmb(prior, *step.inputs, step.limits.reduction(), association)

    def _updated_in_view(self, prior: Lmb, settled: Bools, step: SensorStep) -> tuple[Lmb, LmbReport, Bools]:
        """Return `_run_kernel` of the labels that the scan may affect. settled: see `merge_updated`, empty if none."""
        scan, _, sensor, truncation = step.inputs
        marks = in_view(prior.tracks, scan, sensor, truncation)
        updated, report = self._run_kernel(marked(prior, marks), step)
        before = settled if len(settled) else np.zeros(len(marks), np.bool_)
        posterior, settled = merge_updated(prior, marks, updated, step.limits.track_caps(), before)
        return posterior, report, settled


def _by_combinations(prior: Lmb, step: SensorStep) -> tuple[Lmb, LmbReport]:
    """Update by the exact sums of the multi-sensor filter, which drop surely improbable terms (docs/decisions/0014)."""
    scan, motion, sensor, truncation = step.inputs
    before = standing_combinations(prior, 1) if scan.dt == 0.0 else predict_combinations(prior, scan, 1, motion)
    return update_lmb(before, scan, sensor, truncation, step.limits.reduction())


def association_of(tracker: Filter) -> Association | None:
    """Return the kernel form of a filter's association marginals, or None for sums over clusters and other filters."""
    return tracker.assignment.to_kernel() if isinstance(tracker, LmbFilter) else None
