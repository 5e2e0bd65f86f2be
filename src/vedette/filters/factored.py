"""The factored GLMB filter: labels that contend are tracked together, all others apart."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from vedette.densities import FactoredGLMB
from vedette.densities.checks import offsets_of
from vedette.densities.label_sets import take_factors
from vedette.errors import InputError, NumericalError
from vedette.filters.base import LabelledFilter, OfKind, SensorStep, blind_sensor
from vedette.filters.limits import Limits
from vedette.filters.multi_sensor import InTurn, MultiSensorFilter
from vedette.filters.protocols import FilterInfo
from vedette.kernels.base.types import Bools, FactoredGlmb, Ints
from vedette.kernels.steps.factor_updates import Factoring
from vedette.kernels.steps.factored import FactoredReport, step_factored
from vedette.kernels.steps.in_view import in_view
from vedette.models.arguments import dimension, non_negative
from vedette.models.fields import Count, L1Error

# At a measurement, claims are cut while the sum over pairs of their products is at most the error of a split, or this.
# Finer cuts make groups that no list is long enough for.
_MOST_CUT = 0.02

# Of the largest factors, how many may take a scan together.
_FACTORS_TOGETHER = 4


class _OfFactors(OfKind[FactoredGLMB]):
    """What both have in common."""

    __slots__ = ()
    kind: ClassVar[type[FactoredGLMB]] = FactoredGLMB
    limits: Limits
    max_split_error: float
    max_factor_labels: int

    def _stepped(self, prior: FactoredGlmb, step: SensorStep) -> tuple[FactoredGlmb, FactoredReport]:
        factoring = _factoring(self.max_split_error, self.max_factor_labels, step.num_scans)
        return step_factored(prior, *step.inputs, step.limits.reduction(), factoring)

    def _check(self, posterior: FactoredGlmb, report: FactoredReport, place: str) -> float:
        if report.log_total > -math.inf:
            return report.log_total
        if report.cut:
            raise NumericalError(f"{place}no hypothesis was found within Limits.max_search_nodes; raise it")
        raise NumericalError(f"{place}no hypothesis has positive weight; do the models forbid this scan?")

    def _concluded(
        self,
        posterior: FactoredGlmb,
        reports: Sequence[FactoredReport],
        *,
        log_likelihood: float,
        repeats: Sequence[Ints],
    ) -> tuple[FactoredGLMB, FilterInfo]:
        found, dropped, is_full = self.limits.without_excess(FactoredGLMB.from_kernel(posterior))
        return found, FilterInfo(
            log_likelihood=log_likelihood,
            num_hypotheses=found.num_hyps,
            num_tracks=found.tracks.num_tracks,
            discarded_weight_bound=max(0.0, -math.expm1(sum(report.log_kept for report in reports))),
            dropped_existence=sum(float(report.dropped_existence) for report in reports) + dropped,
            num_clutter_raised=sum(int(report.num_raised) for report in reports),
            num_duplicates=sum(map(len, repeats)),
            num_inexact_clusters=0,
            search_cut=any(bool(report.cut) for report in reports),
            cap_met=is_full or any(bool(report.full) for report in reports),
            factoring_error=min(2.0, sum(float(report.split_error + 4.0 * report.taken_twice) for report in reports)),
            reduction_error=min(2.0, sum(float(report.reduction_error) for report in reports)),
        )


@dataclass(frozen=True, slots=True, eq=False)
class FactoredGlmbFilter(_OfFactors, LabelledFilter[FactoredGLMB]):
    """delta-GLMB filter of one sensor whose density is a product of independent factors.

    At a scan, factors that lay claim to the same measurements are multiplied out and updated together, exactly as a
    delta-GLMB; all others apart. Then each splits into the smallest factors that are independent within
    `max_split_error`. So a list of `limits.max_hypotheses` is shared by a few targets that contend, not by all: what is
    known of a far target does not depend on how long the list is, and the cost grows with the number of targets, not
    with that of their combinations. With a `max_split_error` of 2 every label is a factor of its own, as in an LMB
    filter; with 0, and `max_factor_labels` as large as the number of targets, none is split that depends on another, as
    in a delta-GLMB filter. It draws nothing; its predictions are cut as a delta-GLMB filter's, factor by factor, but
    drop no label.

    Attributes:
        targets: how targets move, live on and appear.
        sensor: what the sensor sees of them.
        limits: caps and thresholds; those on hypotheses hold for each factor.
        max_split_error: of a factored_glmb: L1 error, of densities that each integrate to 1, up to which labels that
            contended are taken as independent again, and versions of a label as one; 2: always, as an LMB; 0: where
            they are. Two factors are taken together where both take a measurement with a probability above twice this,
            or above .02, if they were independent; see `scans_together`.
        max_factor_labels: of a factored_glmb: most labels of a factor, and a quarter of those that take a scan
            together; where more contend, links are made from the strongest on and left out where they would join more.
            What all this leaves out is in `FilterInfo.factoring_error`.
        scans_together: scans of one time that go into one belief, of this sensor and others, as by `ParallelUpdate`.
            What a weak link that is cut leaves out counts with each of them: so for S scans links are cut S^2 times
            later.

    Raises:
        InputError: a part of another kind, or a field out of range.
    """

    max_split_error: L1Error = 0.01
    max_factor_labels: Count = 20
    scans_together: int = 1

    def __post_init__(self) -> None:
        LabelledFilter.__post_init__(self)  # slots replace the class that super() looks for
        _check_factoring(self.max_split_error, self.max_factor_labels)
        dimension("scans_together", self.scans_together)

    def _blind(self) -> FactoredGlmbFilter:
        return replace(self, sensor=blind_sensor(), limits=self.limits.keeping_labels())

    def _stepped(self, prior: FactoredGlmb, step: SensorStep) -> tuple[FactoredGlmb, FactoredReport]:
        return _OfFactors._stepped(self, prior, step._replace(num_scans=self.scans_together))


@dataclass(frozen=True, slots=True, eq=False)
class SequentialFactoredFilter(_OfFactors, InTurn[FactoredGLMB]):
    """Factored GLMB filter of several sensors that takes their scans in turn.

    As `SequentialLmbFilter`, with the density of `FactoredGlmbFilter`: which of contending labels is which stays open
    from one sensor to the next. Of one sensor it is the `FactoredGlmbFilter`.

    Attributes and errors: as `MultiSensorGlmbFilter`, and `max_split_error` and `max_factor_labels` as of
    `FactoredGlmbFilter`.
    """

    max_split_error: float = 0.01
    max_factor_labels: int = 20

    def __post_init__(self) -> None:
        MultiSensorFilter.__post_init__(self)  # slots replace the class that super() looks for
        _check_factoring(self.max_split_error, self.max_factor_labels)

    def _updated_in_view(
        self, prior: FactoredGlmb, settled: Bools, step: SensorStep
    ) -> tuple[FactoredGlmb, FactoredReport, Bools]:
        """As `_stepped`, of the factors that the scan may say anything of; the others come first, as they were."""
        scan, _, sensor, truncation = step.inputs
        density, marks = FactoredGLMB.from_kernel(prior), in_view(prior.tracks, scan, sensor, truncation)
        seen = np.diff(offsets_of(marks.astype(np.int64))[prior.track_offsets]) > 0
        near, far = (take_factors(density, np.flatnonzero(places)) for places in (seen, ~seen))
        posterior, report = self._stepped(near.to_kernel(), step)
        both = [far, FactoredGLMB.from_kernel(posterior)]
        return FactoredGLMB.product(both, density.state_dim).to_kernel(), report, settled


def _check_factoring(max_split_error: Any, max_factor_labels: Any) -> None:
    """`InputError` for a field out of its range."""
    if non_negative("max_split_error", max_split_error) > 2.0:
        raise InputError(f"max_split_error: expected at most 2; got {max_split_error!r}")
    dimension("max_factor_labels", max_factor_labels)


def _factoring(max_split_error: float, max_factor_labels: int, num_scans: int) -> Factoring:
    """The fields of a filter as kernels take them."""
    error, most = float(max_split_error), int(max_factor_labels)
    max_cut = min(error, _MOST_CUT) / num_scans**2
    return Factoring(error, max_cut, most, _FACTORS_TOGETHER * most)
