"""The labelled multi-Bernoulli filter: one Bernoulli track a label, with exact association marginals by clusters."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from vedette.densities import GLMB, LMB
from vedette.errors import NumericalError
from vedette.filters.base import SingleSensorFilter
from vedette.filters.info import FilterInfo
from vedette.filters.inputs import check_belief, model_errors
from vedette.kernels.steps.lmb import step_lmb


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
        self, belief: GLMB | LMB, scan: Any, pose: Any, dt: float, step: int, *, rng: np.random.Generator
    ) -> tuple[LMB, FilterInfo]:
        """Predict over `dt` seconds and update with a scan; arguments, results and errors as `DeltaGlmbFilter.step`.

        Nothing is drawn from `rng`; it is taken so that filters are interchangeable.
        """
        measurements, num_duplicates = self._check_scan(scan, rng)
        prior = check_belief(belief, LMB, self.targets.state_dim)
        arguments = self._arguments(measurements, pose, dt, step, prior)
        with model_errors():
            posterior, report = step_lmb(prior.to_kernel(), *arguments, self.limits.reduction())
        if not np.isfinite(report.sums.log_total):
            raise NumericalError(f"step {step}: no association has positive weight; do the models forbid this scan?")
        info = FilterInfo(
            log_likelihood=report.sums.log_total + report.log_clutter - self.sensor.clutter.rate,
            num_hypotheses=1,
            num_tracks=len(posterior.existence_logit),
            discarded_weight_bound=max(0.0, -math.expm1(report.sums.log_kept)),
            dropped_existence=float(report.dropped_existence),
            num_clutter_raised=int(report.num_raised),
            num_duplicates=num_duplicates,
            num_inexact_clusters=int(report.sums.num_ranked),
            search_cut=False,
            cap_met=len(posterior.existence_logit) >= self.limits.max_labels,
        )
        return LMB.from_kernel(posterior), info
