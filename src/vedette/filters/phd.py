"""The probability hypothesis density filter: how many targets are to be expected, and where."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from vedette.densities import Poisson
from vedette.filters.base import SingleSensorFilter
from vedette.filters.inputs import check_belief, check_scan, model_errors
from vedette.filters.protocols import FilterInfo
from vedette.kernels.steps.phd import step_phd
from vedette.models.arguments import generator


@dataclass(frozen=True, slots=True, eq=False)
class PhdFilter(SingleSensorFilter):
    """Gaussian-mixture PHD filter of one sensor (Vo and Ma 2006).

    Believes in a Poisson density; its intensity after a scan is that of the exact posterior of such a prior. Births
    enter with their intensity, the existence of each site times its density, which is exact as well.

    Attributes and errors: as `LmbFilter`.
    """

    def initial(self) -> Poisson:
        """The belief before the first scan: no target."""
        return Poisson.empty(self.targets.state_dim)

    def step(
        self, belief: Poisson, scan: Any, pose: Any, dt: float, step: int, *, rng: np.random.Generator
    ) -> tuple[Poisson, FilterInfo]:
        """Predict over `dt` seconds and update with a scan; arguments, results and errors as `DeltaGlmbFilter.step`.

        Nothing is drawn from `rng`; it is taken so that filters are interchangeable.
        """
        generator(rng)
        measurements, num_duplicates = check_scan(scan, self.sensor)
        prior = check_belief(belief, Poisson, self.targets.state_dim)
        inputs = self._inputs(measurements, pose, dt, step)
        with model_errors():
            posterior, report = step_phd(prior.to_kernel(), *inputs, self.limits.intensity_caps())
        info = FilterInfo(
            log_likelihood=report.log_total + report.log_clutter - self.sensor.clutter.rate,
            num_hypotheses=1,
            num_tracks=len(posterior.log_weights),
            discarded_weight_bound=0.0,
            dropped_existence=0.0,
            num_clutter_raised=int(report.num_raised),
            num_duplicates=num_duplicates,
            num_inexact_clusters=0,
            search_cut=False,
            cap_met=len(posterior.log_weights) >= self.limits.max_intensity_components,
        )
        return Poisson.from_kernel(posterior), info
