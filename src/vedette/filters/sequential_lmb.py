"""The sequential LMB filter: one prediction, then an update by each sensor's scan in turn."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from vedette.densities import LMB
from vedette.errors import NumericalError
from vedette.filters.assignment import OfMarginals, Ranked, check_assignment, kernel_association
from vedette.filters.info import FilterInfo
from vedette.filters.inputs import model_errors
from vedette.filters.multi_sensor import Looks, MultiSensorFilter
from vedette.filters.posteriors import lmb_posterior
from vedette.kernels.association.marginals import Association
from vedette.kernels.association.truncation import Truncation
from vedette.kernels.base.types import Bools, Lmb, Motion, ScanInput, Sensor
from vedette.kernels.steps.in_view import in_view, marked, put_back
from vedette.kernels.steps.lmb import LmbReport, Reduction, step_lmb, update_lmb_by
from vedette.kernels.steps.multi_sensor_combinations import predict_combinations, standing_combinations
from vedette.kernels.steps.multi_sensor_lmb import update_lmb
from vedette.models import kernel_motion


@dataclass(frozen=True, slots=True, eq=False)
class SequentialLmbFilter(MultiSensorFilter[LMB]):
    """LMB filter of several sensors that takes their scans in turn ("iterated corrector").

    After each scan the posterior is projected to an LMB again, so that the order of the sensors matters a little. In
    return the cost grows in proportion to the number of sensors, whatever they see, where that of
    `MultiSensorLmbFilter` grows exponentially; a scan costs what it may say anything of, not all labels. Of one sensor
    it is the `LmbFilter`. Labels are dropped, by `Limits.min_existence`, `max_labels` and `max_position_std`, after the
    last scan alone: one sensor's missed detection does not lose a target that the next one sees. What is cut is counted
    as by `MultiSensorLmbFilter`.

    Attributes and errors: as `MultiSensorGlmbFilter`, and `assignment` as of `LmbFilter`.
    """

    assignment: OfMarginals = field(default_factory=Ranked)
    kind: ClassVar[type[LMB]] = LMB

    def __post_init__(self) -> None:
        MultiSensorFilter.__post_init__(self)  # slots replace the class that super() looks for
        check_assignment(self.assignment, OfMarginals)

    def _updated(self, prior: LMB, born: LMB, looks: Looks, dt: float, place: str) -> tuple[LMB, FilterInfo]:
        motion, posterior = kernel_motion(self.targets.motion, self.targets.survival), prior.to_kernel()
        keeping, reports = self.limits.keeping_labels(), list[LmbReport]()
        given = zip(looks.names, looks.sensors, looks.inputs_in_turn(born, dt), strict=True)
        settled, association = np.zeros(0, np.bool_), kernel_association(self.assignment)
        for s, (name, sensor, scan) in enumerate(given):
            is_last = s == len(looks.names) - 1
            limits = self.limits if is_last else keeping
            own = (sensor.to_kernel(), limits.truncation(sensor.meas_dim), limits.reduction(), association)
            with model_errors():
                if s == 0:
                    posterior, report = _stepped(posterior, scan, motion, *own)
                elif is_last:  # of which every label is told whether it stays
                    posterior, report = _updated(posterior, scan, *own)
                else:
                    posterior, report, settled = _updated_in_view(posterior, settled, scan, *own)
            if not math.isfinite(report.sums.log_total):
                raise NumericalError(
                    f"{place}, {name}: no association has positive weight; do the models forbid these scans?"
                )
            reports.append(report)
        log_total = sum(report.sums.log_total for report in reports)
        return lmb_posterior(
            posterior,
            reports,
            self.limits,
            log_likelihood=looks.log_likelihood(log_total, [report.log_clutter for report in reports]),
            num_duplicates=looks.num_duplicates,
        )


def _stepped(
    prior: Lmb,
    scan: ScanInput,
    motion: Motion,
    sensor: Sensor,
    truncation: Truncation,
    reduction: Reduction,
    association: Association | None,
) -> tuple[Lmb, LmbReport]:
    if association is not None:
        return step_lmb(prior, scan, motion, sensor, truncation, reduction, association)
    return update_lmb(predict_combinations(prior, scan, 1, motion), scan, sensor, truncation, reduction)


def _updated(
    prior: Lmb,
    scan: ScanInput,
    sensor: Sensor,
    truncation: Truncation,
    reduction: Reduction,
    association: Association | None,
) -> tuple[Lmb, LmbReport]:
    if association is not None:
        return update_lmb_by(prior, scan, sensor, truncation, reduction, association)
    return update_lmb(standing_combinations(prior), scan, sensor, truncation, reduction)


def _updated_in_view(
    prior: Lmb,
    settled: Bools,
    scan: ScanInput,
    sensor: Sensor,
    truncation: Truncation,
    reduction: Reduction,
    association: Association | None,
) -> tuple[Lmb, LmbReport, Bools]:
    """As `_updated`, of the labels that the scan may say anything of; settled: as of `put_back`, empty of none."""
    num, marks = len(prior.existence_logit), in_view(prior.tracks, scan, sensor, truncation)
    updated, report = _updated(marked(prior, marks), scan, sensor, truncation, reduction, association)
    before = settled if len(settled) else np.zeros(num, np.bool_)
    posterior, settled = put_back(prior, marks, updated, reduction.mixture, before)
    return posterior, report, settled
