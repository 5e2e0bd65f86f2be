"""The cardinality-balanced multi-Bernoulli filter: independent targets without names."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from vedette.densities import MultiBernoulli
from vedette.filters.base import SingleSensorFilter
from vedette.filters.inputs import check_belief, check_scan, model_errors
from vedette.filters.protocols import FilterInfo
from vedette.kernels.steps.cbmember import step_cb_member
from vedette.models.arguments import generator


@dataclass(frozen=True, slots=True, eq=False)
class CbMemberFilter(SingleSensorFilter):
    """Gaussian-mixture cardinality-balanced multi-target multi-Bernoulli filter (Vo, Vo and Cantoni 2009).

    Believes in a multi-Bernoulli density, to which the births are added as they are; prediction is exact. The update
    approximates the posterior by a Bernoulli for each one missed and for each measurement. It takes detection to be
    probable and clutter not too dense; then the expected number of targets is not biased, as Mahler's plain
    multi-Bernoulli update is.

    Attributes and errors: as `LmbFilter`.
    """

    def initial(self) -> MultiBernoulli:
        """The belief before the first scan: no target."""
        return MultiBernoulli.empty(self.targets.state_dim)

    def step(
        self, belief: MultiBernoulli, scan: Any, pose: Any, dt: float, step: int, *, rng: np.random.Generator
    ) -> tuple[MultiBernoulli, FilterInfo]:
        """Predict over `dt` seconds and update with a scan; arguments, results and errors as `DeltaGlmbFilter.step`.

        Nothing is drawn from `rng`; it is taken so that filters are interchangeable.
        """
        generator(rng)
        measurements, num_duplicates = check_scan(scan, self.sensor)
        prior = check_belief(belief, MultiBernoulli, self.targets.state_dim)
        inputs = self._inputs(measurements, pose, dt, step)
        limits = self.limits
        with model_errors():
            posterior, report = step_cb_member(
                prior.to_kernel(), *inputs, limits.reduction(), limits.max_existence_logit
            )
        info = FilterInfo(
            log_likelihood=math.nan,
            num_hypotheses=1,
            num_tracks=len(posterior.existence_logit),
            discarded_weight_bound=math.nan,
            dropped_existence=float(report.dropped_existence),
            num_clutter_raised=int(report.num_raised),
            num_duplicates=num_duplicates,
            num_inexact_clusters=0,
            search_cut=False,
            cap_met=len(posterior.existence_logit) >= limits.max_labels,
        )
        return MultiBernoulli.from_kernel(posterior), info
