"""The delta-GLMB ("Vo-Vo") filter: joint prediction and update, exactly ranked or Gibbs sampled."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from vedette.densities import GLMB
from vedette.errors import NumericalError
from vedette.filters.assignment import Gibbs, OfChoices, Ranked, check_assignment
from vedette.filters.base import LabelledFilter, StepArguments, UpdateArguments
from vedette.filters.blind import blind_sensor
from vedette.filters.info import FilterInfo
from vedette.filters.posteriors import glmb_posterior
from vedette.kernels.base.types import Glmb
from vedette.kernels.steps.glmb import StepReport, step_gibbs, step_ranked, update_ranked
from vedette.models.arguments import flag


@dataclass(frozen=True, slots=True, eq=False)
class DeltaGlmbFilter(LabelledFilter[GLMB]):
    """delta-GLMB filter of one sensor (Vo, Vo, Hoang 2017; paper, Algorithm 1, local prediction and update).

    Predictions and updates apart are ranked, whatever `assignment`; a prediction is cut by `limits` as after a scan.

    Attributes:
        targets: how targets move, live on and appear.
        sensor: what the sensor sees of them.
        limits: caps and thresholds.
        assignment: how joint choices are found: `Ranked`, the heaviest in exact order, or drawn, `Gibbs`.
        marginalised: collapse the posterior to one hypothesis a label set after each step (M-delta-GLMB filter,
            Fantacci and Vo 2015); track mixtures are then reduced to `limits.max_components`.

    Raises:
        InputError: a part of another kind, or a field out of range.
    """

    assignment: OfChoices = field(default_factory=Ranked)
    marginalised: bool = False
    kind: ClassVar[type[GLMB]] = GLMB

    def __post_init__(self) -> None:
        LabelledFilter.__post_init__(self)  # slots replace the class that super() looks for
        check_assignment(self.assignment, OfChoices)
        flag("marginalised", self.marginalised)

    def _blind(self) -> DeltaGlmbFilter:
        return replace(self, sensor=blind_sensor(), assignment=Ranked())

    def _stepped(
        self, prior: Glmb, arguments: StepArguments, rng: np.random.Generator | None
    ) -> tuple[Glmb, StepReport]:
        if isinstance(self.assignment, Gibbs):
            assert rng is not None  # predictions are ranked
            return step_gibbs(prior, *arguments, int(self.assignment.num_samples), rng)
        return step_ranked(prior, *arguments)

    def _updated(self, prior: Glmb, arguments: UpdateArguments) -> tuple[Glmb, StepReport]:
        return update_ranked(prior, *arguments)

    def _concluded(
        self, posterior: Glmb, report: StepReport, num_duplicates: int, place: str
    ) -> tuple[GLMB, FilterInfo]:
        if len(posterior.hyp_log_weights) == 0:
            raise NumericalError(f"{place}no hypothesis has positive weight; do the models forbid this scan?")
        return glmb_posterior(
            posterior,
            [report],
            self.limits,
            log_likelihood=report.log_total + report.log_clutter - self.sensor.clutter.rate,
            num_duplicates=num_duplicates,
            marginalised=self.marginalised,
            cap_met=len(posterior.hyp_log_weights) >= self.limits.max_hypotheses,
        )
