"""The central delta-GLMB filter: one prediction, then an update by each sensor's scan in turn."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from vedette.densities import GLMB, LMB
from vedette.errors import NumericalError
from vedette.filters.info import FilterInfo
from vedette.filters.inputs import model_errors
from vedette.filters.multi_sensor import Looks, MultiSensorFilter
from vedette.filters.posteriors import glmb_posterior
from vedette.kernels.steps.glmb import step_ranked, update_ranked
from vedette.models import kernel_motion


@dataclass(frozen=True, slots=True, eq=False)
class MultiSensorGlmbFilter(MultiSensorFilter[GLMB]):
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
    kind: ClassVar[type[GLMB]] = GLMB

    def _updated(self, prior: GLMB, born: LMB, looks: Looks, dt: float, place: str) -> tuple[GLMB, FilterInfo]:
        limits, cap_met, reports = self.limits, False, []
        motion, posterior = kernel_motion(self.targets.motion, self.targets.survival), prior.to_kernel()
        given = zip(looks.names, looks.sensors, looks.inputs_in_turn(born, dt), strict=True)
        for s, (name, sensor, scan) in enumerate(given):
            own = sensor.to_kernel(), limits.truncation(sensor.meas_dim)
            with model_errors():
                posterior, report = (
                    step_ranked(posterior, scan, motion, *own) if s == 0 else update_ranked(posterior, scan, *own)
                )
            if len(posterior.hyp_log_weights) == 0:
                raise NumericalError(
                    f"{place}, {name}: no hypothesis has positive weight; do the models forbid this scan?"
                )
            reports.append(report)
            cap_met = cap_met or len(posterior.hyp_log_weights) >= limits.max_hypotheses
        log_total = sum(report.log_total for report in reports)
        return glmb_posterior(
            posterior,
            reports,
            limits,
            log_likelihood=looks.log_likelihood(log_total, [report.log_clutter for report in reports]),
            num_duplicates=looks.num_duplicates,
            marginalised=self.marginalised,
            cap_met=cap_met,
        )
