"""The cardinalised PHD filter: the distribution of the number of targets, and where one of them is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from vedette.densities import IidCluster
from vedette.errors import NumericalError
from vedette.filters.base import SingleSensorFilter
from vedette.filters.inputs import check_belief, check_scan, model_errors
from vedette.filters.protocols import FilterInfo
from vedette.kernels.steps.cphd import step_cphd
from vedette.models.arguments import generator


@dataclass(frozen=True, slots=True, eq=False)
class CphdFilter(SingleSensorFilter):
    """Gaussian-mixture CPHD filter of one sensor (Vo, Vo and Cantoni 2007).

    Believes in an iid cluster; its cardinality distribution and intensity after a scan are those of the exact posterior
    of such a prior. The cardinality distribution of the births is that of the multi-Bernoulli birth (not a Poisson one
    of the same mean), so that the predicted cardinality distribution is exact too.

    Attributes and errors: as `LmbFilter`.
    """

    def initial(self) -> IidCluster:
        """The belief before the first scan: no target."""
        return IidCluster.empty(self.targets.state_dim)

    def step(
        self, belief: IidCluster, scan: Any, pose: Any, dt: float, step: int, *, rng: np.random.Generator
    ) -> tuple[IidCluster, FilterInfo]:
        """Predict over `dt` seconds and update with a scan; arguments, results and errors as `DeltaGlmbFilter.step`.

        Nothing is drawn from `rng`; it is taken so that filters are interchangeable.
        """
        generator(rng)
        measurements, num_duplicates = check_scan(scan, self.sensor)
        prior = check_belief(belief, IidCluster, self.targets.state_dim)
        log_cardinality, mixture = prior.to_kernel()
        inputs = self._inputs(measurements, pose, dt, step)
        with model_errors():
            cardinality, posterior, report = step_cphd(log_cardinality, mixture, *inputs, self.limits.intensity_caps())
        if report.log_total == -math.inf:
            raise NumericalError(
                f"step {step}: no number of targets can have given this scan; do the models forbid it?"
            )
        info = FilterInfo(
            log_likelihood=report.log_total + report.log_clutter - self.sensor.clutter.rate,
            num_hypotheses=1,
            num_tracks=len(posterior.log_weights),
            discarded_weight_bound=-math.expm1(report.log_kept),
            dropped_existence=0.0,
            num_clutter_raised=int(report.num_raised),
            num_duplicates=num_duplicates,
            num_inexact_clusters=0,
            search_cut=False,
            cap_met=len(posterior.log_weights) >= self.limits.max_intensity_components,
        )
        return IidCluster.from_kernel(cardinality, posterior), info
