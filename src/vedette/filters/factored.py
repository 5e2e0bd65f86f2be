"""The factored GLMB filter: labels that interact are tracked jointly, all others independently."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np

from vedette.densities import LMB, FactoredGLMB, LabelledDensity, UndetectedTargets
from vedette.densities.checks import offsets_of
from vedette.densities.label_sets import take_factors
from vedette.errors import NumericalError
from vedette.filters.base import LabelledFilter, LabelledFilterBase, SensorStep, blind_sensor
from vedette.filters.inputs import born_at, check_new, no_births_for_kernel
from vedette.filters.limits import Limits
from vedette.filters.multi_sensor import SequentialUpdate
from vedette.filters.protocols import FilterInfo
from vedette.filters.region_births import arrivals_of, region_births, with_cells, with_deaths, with_learnt_rate
from vedette.filters.undetected import (
    SplitBirths,
    after_scan,
    before_scan,
    no_arrivals,
    no_births,
    no_undetected,
    split_births,
    undetected_component_cap,
    with_dropped,
    with_step,
)
from vedette.kernels.base.types import Bools, FactoredGlmb, Ints, Lmb
from vedette.kernels.steps.factor_updates import Factoring
from vedette.kernels.steps.factored import FactoredReport, step_factored
from vedette.kernels.steps.field_of_view import in_view
from vedette.kernels.steps.undetected import Arrivals
from vedette.models import SensorModel
from vedette.models.arguments import step_number
from vedette.models.fields import Count, L1Error

# At a measurement, associations are cut while the sum of pairwise products is at most the split error, or this.
_MOST_CUT = 0.01

# If undetected targets are an intensity, hypotheses beyond the list of a group hold more targets than those in it: they
# are condensed and split up to this L1 error. Labels shared with other sensors would lose their identity by it.
_MAX_MERGING = 0.3

# Number of factors of the largest size that may be updated jointly.
_FACTORS_TOGETHER = 4


class _Before(NamedTuple):
    """Input of an update: the density of the labels, and the undetected targets with the error of their births."""

    density: FactoredGlmb
    undetected: UndetectedTargets | None  # None if births are labelled
    arrivals: Arrivals  # since the previous scan
    error: float = 0.0  # L1 error of the Poisson approximation of births at sites


class _FactoredFilterBase(LabelledFilterBase[FactoredGLMB]):
    """Base of the factored filters of one and of several sensors."""

    __slots__ = ()
    kind: ClassVar[type[FactoredGLMB]] = FactoredGLMB
    default_detection_at: ClassVar[str] = "mean"
    limits: Limits
    max_split_error: float
    max_factor_labels: int
    births: Literal["poisson", "labelled"]

    @property
    def starts_tracks(self) -> bool:
        """True if the filter makes births from measurements itself: births in a region, with a Poisson intensity."""
        return self.births == "poisson" and region_births(self.targets.birth) is not None

    def initial(self) -> FactoredGLMB:
        """Return the belief before the first scan: no target."""
        empty = FactoredGLMB.empty(self.targets.birth)
        return empty if self.births == "labelled" else empty.with_fields(undetected=self._none())

    def _none(self) -> UndetectedTargets:
        return UndetectedTargets.none(self.targets.birth)

    def limits_of(self, sensor: SensorModel) -> Limits:
        return self.limits if self.births == "poisson" else LabelledFilterBase.limits_of(self, sensor)

    def _births(self, dt: float, step: Any, prior: LabelledDensity | None, births: LMB | None) -> Lmb:
        if self.births == "labelled" or births is not None:
            return LabelledFilterBase._births(self, dt, step, prior, births)
        number, birth = step_number(step), self.targets.birth
        if prior is not None and birth.is_active(number):
            check_new(prior, number, step)
        born = self._born(dt, number).labels
        return born_at(born, number).to_kernel() if born.tracks.num_tracks else no_births_for_kernel(birth.state_dim)

    def _born(self, dt: float, step: int) -> SplitBirths:
        """Return the births at the sites within the `dt` seconds before a step."""
        birth = self.targets.birth
        return split_births(birth, dt) if birth.is_active(step) else no_births(birth)

    def _before_scan(self, prior: FactoredGLMB, dt: float, step: Any, births: LMB | None) -> _Before:
        density, arrivals, error = prior.to_kernel(), no_arrivals(self.targets.birth), 0.0
        if self.births == "labelled":
            return _Before(density, None, arrivals)
        undetected = self._none() if prior.undetected is None else prior.undetected
        if dt > 0.0:
            # Births given by the caller replace those of the model, both in the region and at sites.
            targets, appear = self.targets, births is None
            born = self._born(dt, step) if appear else no_births(targets.birth)
            most, error = undetected_component_cap(self.limits, targets.birth), born.error
            arrivals = arrivals_of(undetected, targets, born.undetected, dt, most, appear=appear)
            undetected = with_cells(undetected, targets.birth, dt, appear=appear)
            undetected = with_deaths(undetected, prior, targets.survival, dt)
        if step is not None:
            undetected = with_step(undetected, step, self.targets.birth.num_sites)
        return _Before(density, undetected, arrivals, error)

    def _run_kernel(self, prior: _Before, step: SensorStep) -> tuple[_Before, FactoredReport]:
        scan, reduction, birth = step.inputs[0], step.limits.reduction(), self.targets.birth
        max_merging = 0.0 if self.births == "labelled" else _MAX_MERGING
        factoring = _factoring(self.max_split_error, self.max_factor_labels, step.num_scans, max_merging)
        before, undetected = no_undetected(birth), prior.undetected
        if undetected is not None:
            before = before_scan(undetected, birth, step.sensor, scan.measurements.values, scan.pose)
        density, missed, left, report = step_factored(
            prior.density, before, prior.arrivals, *step.inputs, reduction, factoring
        )
        if undetected is not None:
            undetected = after_scan(undetected, missed, left, len(scan.measurements.values))
        return _Before(density, undetected, prior.arrivals, prior.error), report

    def _check(self, posterior: Any, report: FactoredReport, place: str) -> float:
        if report.log_total > -math.inf:
            return report.log_total
        if report.cut:
            raise NumericalError(f"{place}no hypothesis was found within Limits.max_search_nodes; raise it")
        raise NumericalError(f"{place}no hypothesis has positive weight; do the models forbid this scan?")

    def _conclude(
        self, posterior: _Before, reports: Sequence[FactoredReport], *, log_likelihood: float, repeats: Sequence[Ints]
    ) -> tuple[FactoredGLMB, FilterInfo]:
        undetected = posterior.undetected
        whole = FactoredGLMB.from_kernel(posterior.density, undetected)
        found, dropped, is_full = self.limits.without_excess(whole)
        # If undetected targets are an intensity, dropped labels return to it: labels dropped by the caps still count as
        # dropped, those dropped by the kernel do not.
        if undetected is not None:
            undetected = with_learnt_rate(with_dropped(undetected, whole, found), whole, found, self.targets.birth)
        else:
            dropped += sum(float(report.dropped_existence) for report in reports)
        factoring = posterior.error + sum(float(report.split_error + 4.0 * report.taken_twice) for report in reports)
        belief = found if found.undetected is undetected else found.with_fields(undetected=undetected)
        return belief, FilterInfo(
            log_likelihood=log_likelihood,
            num_hypotheses=found.num_hyps,
            num_tracks=found.tracks.num_tracks,
            truncation_error_bound=max(0.0, -math.expm1(sum(report.log_kept for report in reports))),
            dropped_existence=dropped,
            num_clutter_floored=sum(int(report.num_raised) for report in reports),
            num_duplicates=sum(map(len, repeats)),
            search_truncated=any(bool(report.cut) for report in reports),
            limit_reached=is_full or any(bool(report.full) for report in reports),
            independence_error_bound=min(2.0, factoring),
            reduction_error=min(2.0, sum(float(report.reduction_error) for report in reports)),
        )


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class FactoredGlmbFilter(_FactoredFilterBase, LabelledFilter[FactoredGLMB]):
    """delta-GLMB filter of one sensor whose density is a product of independent factors.

    At a scan, factors that may take the same measurements are multiplied out and updated jointly, exactly as a
    delta-GLMB. All others are updated independently. Then each factor splits into the smallest factors that are
    independent within `max_split_error`. A list of `limits.max_hypotheses` therefore serves a few interacting targets,
    not all of them: the accuracy for a distant target does not depend on the length of the list, and the cost grows
    with the number of targets, not with the number of their combinations. With a `max_split_error` of 2 every label is
    its own factor, as in an LMB filter (with Poisson births, a PMB filter). With 0, and `max_factor_labels` at least
    the number of targets, no dependent factors are split, as in a delta-GLMB filter. The filter draws no random
    numbers. Its predictions are truncated as those of a delta-GLMB filter, factor by factor, but drop no label.

    Attributes:
        targets: motion, survival and birth models.
        sensor: model of the sensor.
        limits: caps and thresholds. Those on hypotheses hold for each factor.
        max_split_error: of a factored_glmb: L1 error, of densities that each integrate to 1, up to which labels that
            interacted are treated as independent again, and versions of a label as one. 2: always, as an LMB. 0: only
            if they are. At each measurement the weakest associations of factors are cut while the sum over pairs of
            their products is at most this, and at most .01. See `scans_together`.
        max_factor_labels: of a factored_glmb: largest number of labels of a factor, and a quarter of the largest number
            updated jointly at a scan. If more labels interact, factors are linked from the strongest association on,
            and links that would join more are left out. `FilterInfo.independence_error_bound` bounds the error.
        scans_together: number of scans of one time that update one belief, of this sensor and others, as with
            `ParallelUpdate`. The error of a weak link that is cut counts once for each: for S scans the cutting
            threshold is S^2 times smaller.
        births: of a factored_glmb: poisson: targets that were never detected are a Poisson intensity, and a label
            begins with a first detection, except at sites with an existence of .15 or more. labelled: a label begins at
            each birth site at each scan. Filters whose beliefs are fused by label have labelled births, whatever this
            value is.

    Raises:
        InputError: a part of another kind, or a field out of range.
    """

    max_split_error: L1Error = 0.01
    max_factor_labels: Count = 20
    scans_together: Count = 1
    births: Literal["poisson", "labelled"] = "poisson"

    def _blind(self) -> "FactoredGlmbFilter":
        return replace(self, sensor=blind_sensor(), limits=self.limits.keeping_labels())

    def _run_kernel(self, prior: _Before, step: SensorStep) -> tuple[_Before, FactoredReport]:
        if step.num_scans != self.scans_together:
            step = step._replace(num_scans=self.scans_together)
        return _FactoredFilterBase._run_kernel(self, prior, step)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SequentialFactoredFilter(_FactoredFilterBase, SequentialUpdate[FactoredGLMB]):
    """Factored GLMB filter of several sensors that updates with their scans sequentially.

    Like `SequentialLmbFilter`, with the density of `FactoredGlmbFilter`: the identity of interacting labels stays open
    from one sensor to the next. With one sensor it is the `FactoredGlmbFilter`.

    Attributes and errors: as `MultiSensorGlmbFilter`, and `max_split_error` and `max_factor_labels` as in
    `FactoredGlmbFilter`.
    """

    max_split_error: L1Error = 0.01
    max_factor_labels: Count = 20
    births: Literal["poisson", "labelled"] = "poisson"

    def _updated_in_view(
        self, prior: _Before, settled: Bools, step: SensorStep
    ) -> tuple[_Before, FactoredReport, Bools]:
        """Return `_run_kernel` of the factors that the scan may affect. The other factors come first, unchanged."""
        scan, _, sensor, truncation = step.inputs
        density = FactoredGLMB.from_kernel(prior.density)
        marks = in_view(prior.density.tracks, scan, sensor, truncation)
        seen = np.diff(offsets_of(marks.astype(np.int64))[density.track_offsets]) > 0
        near, far = (take_factors(density, np.flatnonzero(places)) for places in (seen, ~seen))
        posterior, report = self._run_kernel(prior._replace(density=near.to_kernel()), step)
        both = [far, FactoredGLMB.from_kernel(posterior.density)]
        joined = FactoredGLMB.product(both, density.state_dim).to_kernel()
        return posterior._replace(density=joined), report, settled


def _factoring(max_split_error: float, max_factor_labels: int, num_scans: int, max_merging: float) -> Factoring:
    """Return the fields of a filter in kernel form."""
    error, most = float(max_split_error), int(max_factor_labels)
    max_cut = min(error, _MOST_CUT) / num_scans**2
    return Factoring(error, max_cut, most, _FACTORS_TOGETHER * most, max_merging)


def with_labelled_births(local: Any) -> Any:
    """Return the filter with a label at each birth site, for beliefs that are fused by label, other filters unchanged.

    Otherwise the first detections of one target by two sensors would be two labels.
    """
    return replace(local, births="labelled") if isinstance(local, _FactoredFilterBase) else local  # type: ignore[type-var]
