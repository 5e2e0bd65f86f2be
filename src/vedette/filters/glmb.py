"""The delta-GLMB ("Vo-Vo") filter: joint prediction and update, exactly ranked or Gibbs sampled."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from vedette.densities import GLMB, LMB
from vedette.errors import NumericalError
from vedette.filters.base import SingleSensorFilter
from vedette.filters.blind import NO_POSE, NO_SCAN, blind_sensor
from vedette.filters.info import FilterInfo
from vedette.filters.inputs import check_belief, model_errors
from vedette.filters.posteriors import glmb_posterior
from vedette.kernels.base.types import Glmb
from vedette.kernels.steps.glmb import StepReport, step_gibbs, step_ranked, update_ranked
from vedette.models.arguments import dimension, flag, one_of


@dataclass(frozen=True, slots=True, eq=False)
class DeltaGlmbFilter(SingleSensorFilter):
    """delta-GLMB filter of one sensor (Vo, Vo, Hoang 2017; paper, Algorithm 1, local prediction and update).

    Attributes:
        targets: how targets move, live on and appear.
        sensor: what the sensor sees of them.
        limits: caps and thresholds.
        assignment: "ranked" finds the heaviest hypotheses in exact order, "gibbs" samples them.
        num_gibbs_samples: sweeps in all, shared out over the prior hypotheses.
        marginalised: collapse the posterior to one hypothesis a label set after each step (M-delta-GLMB filter,
            Fantacci and Vo 2015); track mixtures are then reduced to `limits.max_components`.

    Raises:
        InputError: a part of another kind, or a field out of range.
    """

    assignment: Literal["ranked", "gibbs"] = "ranked"
    num_gibbs_samples: int = 1000
    marginalised: bool = False

    def __post_init__(self) -> None:
        SingleSensorFilter.__post_init__(self)  # slots replace the class that super() looks for
        one_of("assignment", self.assignment, ("ranked", "gibbs"))
        flag("marginalised", self.marginalised)
        dimension("num_gibbs_samples", self.num_gibbs_samples)

    def initial(self) -> GLMB:
        """The belief before the first scan: no target."""
        return GLMB.empty(self.targets.state_dim)

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
    ) -> tuple[GLMB, FilterInfo]:
        """Predict over `dt` seconds and update with a scan.

        Args:
            belief: posterior of the previous step.
            scan: (num, meas_dim) measurements in any order; angles in radians, in (-pi, pi].
            pose: (3 or more,) [px, py, heading_rad, ...] of the sensor.
            dt: seconds since the previous step.
            step: number of this step, from 1 on; births at the sites of the targets' model are labelled with it.
            rng: drawn from only if `assignment` is "gibbs".
            births: who may have been born since the previous step, instead of at those sites; labels later than the
                belief's.

        Returns:
            The posterior, hypotheses by descending weight, and a report.

        Raises:
            InputError: a scan, pose, belief or births of the wrong shape or kind, an angle beyond a full turn, a step
                below 1.
            ModelError: a model function raised or gave a value that is none of its kind.
            NumericalError: no hypothesis has positive weight.
        """
        measurements, num_duplicates = self._check_scan(scan, rng)
        prior = check_belief(belief, GLMB, self.targets.state_dim)
        arguments = (prior.to_kernel(), *self._arguments(measurements, pose, dt, step, prior, births))
        with model_errors():
            if self.assignment == "gibbs":
                posterior, report = step_gibbs(*arguments, int(self.num_gibbs_samples), rng)
            else:
                posterior, report = step_ranked(*arguments)
        return self._concluded(posterior, report, num_duplicates, f"step {step}: ")

    def predict(
        self, belief: GLMB | LMB, dt: float, step: int, *, births: LMB | None = None
    ) -> tuple[GLMB, FilterInfo]:
        """The belief `dt` seconds later: every hypothesis by who of it survived and who was born.

        Ranked and cut by `limits` as after a scan, whatever `assignment`: who survives is cut here as it weighs before
        the scan is seen, which `step` is not. Arguments and errors as of `step`.
        """
        prior, blind = check_belief(belief, GLMB, self.targets.state_dim), replace(self, sensor=blind_sensor())
        arguments = blind._arguments(NO_SCAN, NO_POSE, dt, step, prior, births)
        with model_errors():
            posterior, report = step_ranked(prior.to_kernel(), *arguments)
        return blind._concluded(posterior, report, 0, f"step {step}: ")

    def update(self, belief: GLMB | LMB, scan: Any, pose: Any, *, rng: np.random.Generator) -> tuple[GLMB, FilterInfo]:
        """The belief after a scan of its own time; nobody moves, dies or is born. Ranked, whatever `assignment`.

        Arguments and errors as of `step`.
        """
        measurements, num_duplicates = self._check_scan(scan, rng)
        prior = check_belief(belief, GLMB, self.targets.state_dim)
        with model_errors():
            posterior, report = update_ranked(prior.to_kernel(), *self._update_arguments(measurements, pose))
        return self._concluded(posterior, report, num_duplicates, "")

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
