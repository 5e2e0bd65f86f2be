"""The central delta-GLMB filter: one prediction, then an update by each sensor's scan in turn."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from vedette.densities import GLMB, LMB
from vedette.errors import NumericalError
from vedette.filters.info import FilterInfo
from vedette.filters.inputs import births_for, check_belief, model_errors
from vedette.filters.multi_sensor import MultiSensorFilter, log_likelihood
from vedette.kernels.base.types import ScanInput
from vedette.kernels.labelled.conversions import marginalise
from vedette.kernels.steps.glmb import StepReport, step_ranked, update_ranked
from vedette.models import kernel_motion
from vedette.models.arguments import positive


@dataclass(frozen=True, slots=True, eq=False)
class MultiSensorGlmbFilter(MultiSensorFilter):
    """delta-GLMB filter of several sensors: one prediction, then an update by each sensor's scan in turn.

    Without caps the posterior is the multi-sensor delta-GLMB (Vo, Vo and Beard 2019), whatever the order of the
    sensors, where models are linear and neither noise nor detection depends on the state; else a later sensor's model
    is linearised, and its noise and detection are taken, at what the earlier ones have left.

    With caps, hypotheses are cut after every sensor as they weigh then. One that the first sensors make unlikely is
    gone even where a later one would have raised it, so that the order of the sensors matters a little.
    `discarded_weight_bound` counts what is left out at each sensor by its weight there.

    Attributes:
        targets: how targets move, live on and appear.
        sensors: what each sensor sees of them; they may measure different things.
        limits: caps and thresholds.
        marginalised: collapse the posterior to one hypothesis a label set after each step, as `DeltaGlmbFilter`.

    Raises:
        InputError: a part of another kind, or no sensor.
    """

    marginalised: bool = False

    def initial(self) -> GLMB:
        """The belief before the first scans: no target."""
        return GLMB.empty(self.targets.state_dim)

    def step(
        self,
        belief: GLMB | LMB,
        scans: Any,
        poses: Any,
        dt: float,
        step: int,
        *,
        rng: np.random.Generator,
        births: LMB | None = None,
    ) -> tuple[GLMB, FilterInfo]:
        """Predict over `dt` seconds and update with the scans of all sensors.

        Args:
            belief: posterior of the previous step.
            scans: one a sensor, in their order: (num, meas_dim) measurements in any order; angles in radians, in
                (-pi, pi]; None of a sensor that did not scan.
            poses: one a sensor: [px, py, heading_rad, ...].
            dt: seconds since the previous step.
            step: number of this step, from 1 on; births are labelled with it.
            rng: nothing is drawn from it; it is taken so that filters are interchangeable.
            births: as of `DeltaGlmbFilter.step`.

        Returns:
            The posterior and a report on all scans together: log likelihoods, counts and bounds of all sensors.

        Raises:
            InputError: not one scan and one pose a sensor, or one of the wrong shape or kind; an angle beyond a full
                turn; a step below 1.
            ModelError: a model function raised or gave a value that is none of its kind.
            NumericalError: no hypothesis has positive weight.
        """
        looks, num_duplicates = self._looks(scans, poses, rng)
        targets, limits = self.targets, self.limits
        prior = check_belief(belief, GLMB, targets.state_dim)
        born, nobody = births_for(targets.birth, step, prior, births), LMB.empty(targets.state_dim)
        motion, posterior, cap_met = kernel_motion(targets.motion, targets.survival), prior.to_kernel(), False
        reports: list[StepReport] = []
        for look in looks:
            own = (look.sensor.to_kernel(), limits.truncation(look.sensor.meas_dim))
            with model_errors():
                if not reports:
                    given = ScanInput(born.to_kernel(), look.scan, look.pose, positive("dt", dt))
                    posterior, report = step_ranked(posterior, given, motion, *own)
                else:
                    given = ScanInput(nobody.to_kernel(), look.scan, look.pose, 0.0)
                    posterior, report = update_ranked(posterior, given, *own)
            if len(posterior.hyp_log_weights) == 0:
                raise NumericalError(
                    f"step {step}, {look.name}: no hypothesis has positive weight; do the models forbid this scan?"
                )
            reports.append(report)
            cap_met = cap_met or len(posterior.hyp_log_weights) >= limits.max_hypotheses
        if self.marginalised:
            posterior = marginalise(posterior, limits.track_caps())
        kept, spread = limits.without_spread(GLMB.from_kernel(posterior))
        log_kept = sum(min(0.0, report.log_total - report.log_bound) for report in reports)
        log_total = sum(report.log_total for report in reports)
        return kept, FilterInfo(
            log_likelihood=log_likelihood(log_total, [report.log_clutter for report in reports], looks),
            num_hypotheses=kept.num_hyps,
            num_tracks=kept.tracks.num_tracks,
            discarded_weight_bound=-math.expm1(log_kept),
            dropped_existence=spread,
            num_clutter_raised=sum(int(report.num_raised) for report in reports),
            num_duplicates=num_duplicates,
            num_inexact_clusters=0,
            search_cut=any(report.cut for report in reports),
            cap_met=cap_met,
        )
