"""The sequential LMB filter: one prediction, then an update by each sensor's scan in turn."""

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
from vedette.kernels.steps.lmb import LmbReport, step_lmb, update_lmb
from vedette.models import kernel_motion
from vedette.models.arguments import positive


@dataclass(frozen=True, slots=True, eq=False)
class SequentialLmbFilter(MultiSensorFilter):
    """LMB filter of several sensors that takes their scans in turn ("iterated corrector").

    After each scan the posterior is projected to an LMB again, so that the order of the sensors matters a little. In
    return the cost grows in proportion to the number of sensors, whatever they see, where that of
    `MultiSensorLmbFilter` grows exponentially. Of one sensor it is the `LmbFilter`. Labels are dropped, by
    `Limits.min_existence`, `max_labels` and `max_position_std`, after the last scan alone: one sensor's missed
    detection does not lose a target that the next one sees.

    Attributes and errors: as `MultiSensorGlmbFilter`.
    """

    def initial(self) -> LMB:
        """The belief before the first scans: no target."""
        return LMB.empty(self.targets.state_dim)

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
    ) -> tuple[LMB, FilterInfo]:
        """Predict over `dt` seconds and update; arguments, results and errors as `MultiSensorGlmbFilter.step`.

        Nothing is drawn from `rng`; it is taken so that filters are interchangeable.
        """
        looks, num_duplicates = self._looks(scans, poses, rng)
        targets, limits = self.targets, self.limits
        prior = check_belief(belief, LMB, targets.state_dim)
        born, nobody = births_for(targets.birth, step, prior, births), LMB.empty(targets.state_dim)
        motion, posterior, reduction = (
            kernel_motion(targets.motion, targets.survival),
            prior.to_kernel(),
            limits.reduction(),
        )
        reports: list[LmbReport] = []
        for look in looks:
            is_last = len(reports) == len(looks) - 1
            keep = reduction if is_last else reduction._replace(min_existence_logit=-math.inf, max_labels=2**62)
            own = (look.sensor.to_kernel(), limits.truncation(look.sensor.meas_dim), keep)
            with model_errors():
                if not reports:
                    given = ScanInput(born.to_kernel(), look.scan, look.pose, positive("dt", dt))
                    posterior, report = step_lmb(posterior, given, motion, *own)
                else:
                    given = ScanInput(nobody.to_kernel(), look.scan, look.pose, 0.0)
                    posterior, report = update_lmb(posterior, given, *own)
            if not math.isfinite(report.sums.log_total):
                raise NumericalError(
                    f"step {step}, {look.name}: no association has positive weight; do the models forbid this scan?"
                )
            reports.append(report)
        kept, spread = limits.without_spread(LMB.from_kernel(posterior))
        log_total, log_kept = (sum(getattr(r.sums, name) for r in reports) for name in ("log_total", "log_kept"))
        return kept, FilterInfo(
            log_likelihood=log_likelihood(log_total, [report.log_clutter for report in reports], looks),
            num_hypotheses=1,
            num_tracks=kept.tracks.num_tracks,
            discarded_weight_bound=max(0.0, -math.expm1(log_kept)),
            dropped_existence=sum(float(report.dropped_existence) for report in reports) + spread,
            num_clutter_raised=sum(int(report.num_raised) for report in reports),
            num_duplicates=num_duplicates,
            num_inexact_clusters=sum(int(report.sums.num_ranked) for report in reports),
            search_cut=False,
            cap_met=len(posterior.existence_logit) >= limits.max_labels,
        )
