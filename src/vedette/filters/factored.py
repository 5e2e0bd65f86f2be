"""The factored GLMB filter: labels that contend are tracked together, all others apart."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from vedette.densities import FactoredGLMB
from vedette.errors import InputError, NumericalError
from vedette.filters.base import LabelledFilter, StepArguments, UpdateArguments
from vedette.filters.blind import blind_sensor
from vedette.filters.info import FilterInfo
from vedette.filters.posteriors import factored_posterior
from vedette.kernels.base.types import FactoredGlmb
from vedette.kernels.steps.factored import FactoredReport, Factoring, step_factored, update_factored
from vedette.kernels.steps.lmb import Reduction
from vedette.models.arguments import dimension, non_negative
from vedette.models.fields import Count, L1Error

# Two claims to a measurement make a link where both hold with a probability above this times the error of a split, or
# above this at all. Weaker links make groups that no list is long enough for.
_LINK_PER_ERROR, _WEAKEST_LINK = 2.0, 0.02

# Of the largest factors, how many may take a scan together.
_FACTORS_TOGETHER = 4


@dataclass(frozen=True, slots=True, eq=False)
class FactoredGlmbFilter(LabelledFilter[FactoredGLMB]):
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
    kind: ClassVar[type[FactoredGLMB]] = FactoredGLMB

    def __post_init__(self) -> None:
        LabelledFilter.__post_init__(self)  # slots replace the class that super() looks for
        check_factoring(self.max_split_error, self.max_factor_labels)
        dimension("scans_together", self.scans_together)

    def _blind(self) -> FactoredGlmbFilter:
        return replace(self, sensor=blind_sensor(), limits=self.limits.keeping_labels())

    def _stepped(
        self, prior: FactoredGlmb, arguments: StepArguments, rng: np.random.Generator | None
    ) -> tuple[FactoredGlmb, FactoredReport]:
        return step_factored(prior, *arguments, *self._reduction())

    def _updated(self, prior: FactoredGlmb, arguments: UpdateArguments) -> tuple[FactoredGlmb, FactoredReport]:
        return update_factored(prior, *arguments, *self._reduction())

    def _reduction(self) -> tuple[Reduction, Factoring]:
        return self.limits.reduction(), factoring_of(self.max_split_error, self.max_factor_labels, self.scans_together)

    def _concluded(
        self, posterior: FactoredGlmb, report: FactoredReport, num_duplicates: int, place: str
    ) -> tuple[FactoredGLMB, FilterInfo]:
        check_found(report, place)
        log_likelihood = report.log_total + report.log_clutter - self.sensor.clutter.rate
        return factored_posterior(
            posterior, [report], self.limits, log_likelihood=log_likelihood, num_duplicates=num_duplicates
        )


def check_found(report: FactoredReport, place: str) -> None:
    """Raise `NumericalError` where no joint choice was found. place: of the error."""
    if report.log_total > -math.inf:
        return
    if report.cut:
        raise NumericalError(f"{place}no hypothesis was found within Limits.max_search_nodes; raise it")
    raise NumericalError(f"{place}no hypothesis has positive weight; do the models forbid this scan?")


def check_factoring(max_split_error: Any, max_factor_labels: Any) -> None:
    """`InputError` for a field out of its range."""
    if non_negative("max_split_error", max_split_error) > 2.0:
        raise InputError(f"max_split_error: expected at most 2; got {max_split_error!r}")
    dimension("max_factor_labels", max_factor_labels)


def factoring_of(max_split_error: float, max_factor_labels: int, scans_together: int) -> Factoring:
    """The fields of a filter as kernels take them."""
    error, most = float(max_split_error), int(max_factor_labels)
    link = min(_LINK_PER_ERROR * error, _WEAKEST_LINK) / scans_together**2
    return Factoring(error, link, most, _FACTORS_TOGETHER * most)
