"""The central LMB filter: all combinations of the measurements of all sensors are weighted jointly."""

from dataclasses import dataclass

from vedette.densities import LMB
from vedette.filters.base import step_limits
from vedette.filters.inputs import model_errors
from vedette.filters.lmb import LmbFilterBase
from vedette.filters.multi_sensor import MultiSensorFilter, SensorScans
from vedette.filters.protocols import FilterInfo
from vedette.kernels.base.types import Lmb
from vedette.kernels.steps.multi_sensor_combinations import (
    extend_combinations,
    predict_combinations,
    standing_combinations,
)
from vedette.kernels.steps.multi_sensor_lmb import lmb_of_combinations
from vedette.models import sensor_of_filter


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class MultiSensorLmbFilter(LmbFilterBase, MultiSensorFilter[LMB]):
    """LMB filter of several sensors: the existences and densities of the exact posterior given all scans of a time.

    Every track is weighted under each combination of a miss or a gated measurement at every sensor, and the
    combinations of all tracks are summed jointly, without using a measurement twice. The posterior is projected to an
    LMB once, not after each sensor. The order of the sensors does not matter if models are linear and neither noise nor
    detection depends on the state. Otherwise the model of a later sensor is linearised, and its noise and detection are
    evaluated, at the result of the earlier ones.

    `limits` truncates, and the report counts: combinations of a track that are surely less probable than
    `min_existence`, or beyond the `max_hypotheses` heaviest at a sensor (`search_truncated`, counted by their weight
    there, before later sensors), and, in a cluster of tracks that compete for many measurements, sets of taken
    measurements beyond the `max_hypotheses` heaviest, or lighter than `min_relative_weight` times the heaviest
    (`num_inexact_clusters`). All of it is in `truncation_error_bound`. The number of combinations grows exponentially
    with the number of sensors that observe a track, up to `max_hypotheses`.

    Attributes and errors: as `MultiSensorGlmbFilter`.
    """

    def _updated(self, prior: Lmb, born: Lmb, taken: SensorScans, dt: float, place: str) -> tuple[LMB, FilterInfo]:
        limits, num_columns, reports = step_limits(self, self.sensors[0]), 0, []
        reduction = limits.reduction()
        with model_errors():
            inputs = taken.inputs(born, dt)
            if dt == 0.0:
                combinations = standing_combinations(prior, len(inputs))
            else:
                combinations = predict_combinations(prior, inputs[0], len(inputs), self._motion())
            for s, (sensor, scan) in enumerate(zip(taken.sensors, inputs, strict=True)):
                truncation = limits.truncation(sensor.meas_dim)
                seen = sensor_of_filter(sensor, self.targets.motion)
                combinations, report = extend_combinations(combinations, s, num_columns, scan, seen, truncation)
                num_columns += len(scan.measurements.values)
                reports.append(report)
            posterior, joint = lmb_of_combinations(combinations, num_columns, truncation, reduction)
        sums = joint.sums._replace(log_kept=joint.sums.log_kept + sum(report.log_kept for report in reports))
        whole = joint._replace(
            sums=sums,
            num_raised=sum(report.num_raised for report in reports),
            cut=any(report.log_kept < 0.0 for report in reports),
        )
        log_total = self._check(posterior, whole, f"{place}: ")
        log_likelihood = taken.log_likelihood(log_total, [report.log_clutter for report in reports])
        return self._conclude(posterior, [whole], log_likelihood=log_likelihood, repeats=taken.repeats)
