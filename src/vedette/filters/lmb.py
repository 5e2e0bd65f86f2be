"""The labelled multi-Bernoulli filter: one Bernoulli track a label, with exact association marginals by clusters."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from vedette.densities import LMB
from vedette.errors import NumericalError
from vedette.filters.assignment import OfMarginals, Ranked, check_assignment, kernel_association
from vedette.filters.base import Filter, LabelledFilter, StepArguments, UpdateArguments
from vedette.filters.blind import blind_sensor
from vedette.filters.info import FilterInfo
from vedette.filters.limits import Limits
from vedette.filters.posteriors import lmb_posterior
from vedette.kernels.association.marginals import Association
from vedette.kernels.base.types import Lmb
from vedette.kernels.steps.lmb import LmbReport, step_lmb, update_lmb_by
from vedette.kernels.steps.multi_sensor_combinations import standing_combinations
from vedette.kernels.steps.multi_sensor_lmb import update_lmb


@dataclass(frozen=True, slots=True, eq=False)
class LmbFilter(LabelledFilter[LMB]):
    """LMB filter of one sensor (Reuter, Vo, Vo, Dietmayer 2014), cheaper than the delta-GLMB filter.

    It draws nothing, and its predictions drop nothing.

    Attributes:
        targets: how targets move, live on and appear.
        sensor: what the sensor sees of them.
        limits: caps and thresholds.
        assignment: how the probabilities of associations are had: the exact sum, belief propagation, your own.

    Raises:
        InputError: a part of another kind.
    """

    assignment: OfMarginals = field(default_factory=Ranked)
    kind: ClassVar[type[LMB]] = LMB

    def __post_init__(self) -> None:
        LabelledFilter.__post_init__(self)  # slots replace the class that super() looks for
        check_assignment(self.assignment, OfMarginals)

    def _blind(self) -> LmbFilter:
        return LmbFilter(self.targets, blind_sensor(), Limits.none())

    def _stepped(self, prior: Lmb, arguments: StepArguments, rng: np.random.Generator | None) -> tuple[Lmb, LmbReport]:
        return step_lmb(prior, *arguments, self.limits.reduction(), kernel_association(self.assignment))

    def _updated(self, prior: Lmb, arguments: UpdateArguments) -> tuple[Lmb, LmbReport]:
        association, reduction = kernel_association(self.assignment), self.limits.reduction()
        if association is not None:
            return update_lmb_by(prior, *arguments, reduction, association)
        return update_lmb(standing_combinations(prior), *arguments, reduction)

    def _concluded(self, posterior: Lmb, report: LmbReport, num_duplicates: int, place: str) -> tuple[LMB, FilterInfo]:
        if not math.isfinite(report.sums.log_total):
            raise NumericalError(f"{place}no association has positive weight; do the models forbid this scan?")
        return lmb_posterior(
            posterior,
            [report],
            self.limits,
            log_likelihood=report.sums.log_total + report.log_clutter - self.sensor.clutter.rate,
            num_duplicates=num_duplicates,
        )


def association_of(tracker: Filter) -> Association | None:
    """Who gives the association marginals of a filter, as kernels take it; None: the sums over clusters, or nobody."""
    return kernel_association(tracker.assignment) if isinstance(tracker, LmbFilter) else None
