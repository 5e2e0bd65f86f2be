"""The labelled multi-Bernoulli filter: one Bernoulli track a label, with exact association marginals by clusters."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from vedette.densities import GLMB, LMB
from vedette.errors import NumericalError
from vedette.filters.base import SingleSensorFilter
from vedette.filters.blind import NO_POSE, NO_SCAN, blind_sensor
from vedette.filters.info import FilterInfo
from vedette.filters.inputs import check_belief, model_errors
from vedette.filters.limits import Limits
from vedette.filters.posteriors import lmb_posterior
from vedette.kernels.base.types import Lmb
from vedette.kernels.steps.lmb import LmbReport, step_lmb
from vedette.kernels.steps.multi_sensor_combinations import standing_combinations
from vedette.kernels.steps.multi_sensor_lmb import update_lmb


@dataclass(frozen=True, slots=True, eq=False)
class LmbFilter(SingleSensorFilter):
    """LMB filter of one sensor (Reuter, Vo, Vo, Dietmayer 2014), cheaper than the delta-GLMB filter.

    Attributes:
        targets: how targets move, live on and appear.
        sensor: what the sensor sees of them.
        limits: caps and thresholds.

    Raises:
        InputError: a part of another kind.
    """

    def initial(self) -> LMB:
        """The belief before the first scan: no target."""
        return LMB.empty(self.targets.state_dim)

    def step(
        self,
        belief: GLMB | LMB,
        scan: Any,
        pose: Any,
        dt: float,
        step: int,
        *,
        rng: np.random.Generator,
        births: LMB | None = None,
    ) -> tuple[LMB, FilterInfo]:
        """Predict over `dt` seconds and update with a scan; arguments, results and errors as `DeltaGlmbFilter.step`.

        Nothing is drawn from `rng`; it is taken so that filters are interchangeable.
        """
        measurements, num_duplicates = self._check_scan(scan, rng)
        prior = check_belief(belief, LMB, self.targets.state_dim)
        arguments = self._arguments(measurements, pose, dt, step, prior, births)
        with model_errors():
            posterior, report = step_lmb(prior.to_kernel(), *arguments, self.limits.reduction())
        return self._concluded(posterior, report, num_duplicates, f"step {step}: ")

    def predict(self, belief: GLMB | LMB, dt: float, step: int, *, births: LMB | None = None) -> tuple[LMB, FilterInfo]:
        """The belief `dt` seconds later, births included; nothing is dropped. As `DeltaGlmbFilter.predict`."""
        prior = check_belief(belief, LMB, self.targets.state_dim)
        blind = LmbFilter(self.targets, blind_sensor(), Limits.none())
        arguments = blind._arguments(NO_SCAN, NO_POSE, dt, step, prior, births)
        with model_errors():
            posterior, report = step_lmb(prior.to_kernel(), *arguments, blind.limits.reduction())
        return blind._concluded(posterior, report, 0, f"step {step}: ")

    def update(self, belief: GLMB | LMB, scan: Any, pose: Any, *, rng: np.random.Generator) -> tuple[LMB, FilterInfo]:
        """The belief after a scan of its own time; as `DeltaGlmbFilter.update`."""
        measurements, num_duplicates = self._check_scan(scan, rng)
        prior = check_belief(belief, LMB, self.targets.state_dim)
        arguments = self._update_arguments(measurements, pose)
        with model_errors():
            before = standing_combinations(prior.to_kernel())
            posterior, report, cut = update_lmb(before, *arguments, self.limits.reduction())
        return self._concluded(posterior, report, num_duplicates, "", search_cut=bool(cut))

    def _concluded(
        self, posterior: Lmb, report: LmbReport, num_duplicates: int, place: str, *, search_cut: bool = False
    ) -> tuple[LMB, FilterInfo]:
        if not math.isfinite(report.sums.log_total):
            raise NumericalError(f"{place}no association has positive weight; do the models forbid this scan?")
        return lmb_posterior(
            posterior,
            [report],
            self.limits,
            log_likelihood=report.sums.log_total + report.log_clutter - self.sensor.clutter.rate,
            num_duplicates=num_duplicates,
            search_cut=search_cut,
        )
