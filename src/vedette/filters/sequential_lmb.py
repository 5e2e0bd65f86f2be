"""The sequential LMB filter: one prediction, then an update by each sensor's scan in turn."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from vedette.densities import LMB
from vedette.errors import NumericalError
from vedette.filters.info import FilterInfo
from vedette.filters.inputs import model_errors
from vedette.filters.multi_sensor import Looks, MultiSensorFilter
from vedette.filters.posteriors import lmb_posterior
from vedette.kernels.steps.lmb import LmbReport
from vedette.kernels.steps.multi_sensor_combinations import predict_combinations, standing_combinations
from vedette.kernels.steps.multi_sensor_lmb import update_lmb
from vedette.models import kernel_motion


@dataclass(frozen=True, slots=True, eq=False)
class SequentialLmbFilter(MultiSensorFilter[LMB]):
    """LMB filter of several sensors that takes their scans in turn ("iterated corrector").

    After each scan the posterior is projected to an LMB again, so that the order of the sensors matters a little. In
    return the cost grows in proportion to the number of sensors, whatever they see, where that of
    `MultiSensorLmbFilter` grows exponentially. Of one sensor it is the `LmbFilter`. Labels are dropped, by
    `Limits.min_existence`, `max_labels` and `max_position_std`, after the last scan alone: one sensor's missed
    detection does not lose a target that the next one sees. What is cut is counted as by `MultiSensorLmbFilter`.

    Attributes and errors: as `MultiSensorGlmbFilter`.
    """

    kind: ClassVar[type[LMB]] = LMB

    def _updated(self, prior: LMB, born: LMB, looks: Looks, dt: float, place: str) -> tuple[LMB, FilterInfo]:
        motion, posterior = kernel_motion(self.targets.motion, self.targets.survival), prior.to_kernel()
        keeping, reports, search_cut = self.limits.keeping_labels(), list[LmbReport](), False
        given = zip(looks.names, looks.sensors, looks.inputs_in_turn(born, dt), strict=True)
        for s, (name, sensor, scan) in enumerate(given):
            limits = self.limits if s == len(looks.names) - 1 else keeping
            truncation, reduction = limits.truncation(sensor.meas_dim), limits.reduction()
            with model_errors():
                before = (
                    predict_combinations(posterior, scan, 1, motion) if s == 0 else standing_combinations(posterior)
                )
                posterior, report, cut = update_lmb(before, scan, sensor.to_kernel(), truncation, reduction)
            if not math.isfinite(report.sums.log_total):
                raise NumericalError(
                    f"{place}, {name}: no association has positive weight; do the models forbid these scans?"
                )
            reports.append(report)
            search_cut = search_cut or bool(cut)
        log_total = sum(report.sums.log_total for report in reports)
        return lmb_posterior(
            posterior,
            reports,
            self.limits,
            log_likelihood=looks.log_likelihood(log_total, [report.log_clutter for report in reports]),
            num_duplicates=looks.num_duplicates,
            search_cut=search_cut,
        )
