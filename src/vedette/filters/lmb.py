"""The labelled multi-Bernoulli filter: one Bernoulli track a label, with exact association marginals by clusters."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from vedette.densities import LMB
from vedette.errors import NumericalError
from vedette.filters.base import LabelledFilter, StepArguments, UpdateArguments
from vedette.filters.blind import blind_sensor
from vedette.filters.info import FilterInfo
from vedette.filters.limits import Limits
from vedette.filters.posteriors import lmb_posterior
from vedette.kernels.base.types import Lmb
from vedette.kernels.steps.lmb import LmbReport, step_lmb
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

    Raises:
        InputError: a part of another kind.
    """

    kind: ClassVar[type[LMB]] = LMB

    def _blind(self) -> LmbFilter:
        return LmbFilter(self.targets, blind_sensor(), Limits.none())

    def _stepped(self, prior: Lmb, arguments: StepArguments, rng: np.random.Generator | None) -> tuple[Lmb, LmbReport]:
        return step_lmb(prior, *arguments, self.limits.reduction())

    def _updated(self, prior: Lmb, arguments: UpdateArguments) -> tuple[Lmb, LmbReport]:
        return update_lmb(standing_combinations(prior), *arguments, self.limits.reduction())

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
