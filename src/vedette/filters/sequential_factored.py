"""The sequential factored filter: one prediction, then an update by each sensor's scan in turn."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from vedette.densities import LMB, FactoredGLMB
from vedette.densities.checks import offsets_of
from vedette.densities.label_sets import take_factors
from vedette.filters.factored import check_factoring, check_found, factoring_of
from vedette.filters.info import FilterInfo
from vedette.filters.inputs import model_errors
from vedette.filters.multi_sensor import Looks, MultiSensorFilter
from vedette.filters.posteriors import factored_posterior
from vedette.kernels.association.truncation import Truncation
from vedette.kernels.base.types import FactoredGlmb, ScanInput, Sensor
from vedette.kernels.steps.factor_updates import Factoring
from vedette.kernels.steps.factored import FactoredReport, step_factored, update_factored
from vedette.kernels.steps.in_view import in_view
from vedette.kernels.steps.lmb import Reduction
from vedette.models import kernel_motion


@dataclass(frozen=True, slots=True, eq=False)
class SequentialFactoredFilter(MultiSensorFilter[FactoredGLMB]):
    """Factored GLMB filter of several sensors that takes their scans in turn.

    As `SequentialLmbFilter`, with the density of `FactoredGlmbFilter`: which of contending labels is which stays open
    from one sensor to the next. Of one sensor it is the `FactoredGlmbFilter`.

    Attributes and errors: as `MultiSensorGlmbFilter`, and `max_split_error` and `max_factor_labels` as of
    `FactoredGlmbFilter`.
    """

    max_split_error: float = 0.01
    max_factor_labels: int = 20
    kind: ClassVar[type[FactoredGLMB]] = FactoredGLMB

    def __post_init__(self) -> None:
        MultiSensorFilter.__post_init__(self)  # slots replace the class that super() looks for
        check_factoring(self.max_split_error, self.max_factor_labels)

    def _updated(
        self, prior: FactoredGLMB, born: LMB, looks: Looks, dt: float, place: str
    ) -> tuple[FactoredGLMB, FilterInfo]:
        motion, posterior = kernel_motion(self.targets.motion, self.targets.survival), prior.to_kernel()
        keeping, reports = self.limits.keeping_labels(), list[FactoredReport]()
        factoring = factoring_of(self.max_split_error, self.max_factor_labels, len(looks.names))
        given = zip(looks.names, looks.sensors, looks.inputs_in_turn(born, dt), strict=True)
        for s, (name, sensor, scan) in enumerate(given):
            limits = self.limits if s == len(looks.names) - 1 else keeping
            kernel_sensor, truncation = sensor.to_kernel(), limits.truncation(sensor.meas_dim)
            own = (kernel_sensor, truncation, limits.reduction(), factoring)
            with model_errors():
                if s == 0:
                    posterior, report = step_factored(posterior, scan, motion, *own)
                elif limits is self.limits:  # by which every label is told whether it stays
                    posterior, report = update_factored(posterior, scan, *own)
                else:
                    posterior, report = _updated_in_view(posterior, scan, *own)
            check_found(report, f"{place}, {name}: ")
            reports.append(report)
        log_total = sum(report.log_total for report in reports)
        return factored_posterior(
            posterior,
            reports,
            self.limits,
            log_likelihood=looks.log_likelihood(log_total, [report.log_clutter for report in reports]),
            num_duplicates=looks.num_duplicates,
        )


def _updated_in_view(
    prior: FactoredGlmb,
    scan: ScanInput,
    sensor: Sensor,
    truncation: Truncation,
    reduction: Reduction,
    factoring: Factoring,
) -> tuple[FactoredGlmb, FactoredReport]:
    """As `update_factored`, of the factors that the scan may say anything of; the others come first, as they were."""
    density, marks = FactoredGLMB.from_kernel(prior), in_view(prior.tracks, scan, sensor, truncation)
    seen = np.diff(offsets_of(marks.astype(np.int64))[prior.track_offsets]) > 0
    near, far = (take_factors(density, np.flatnonzero(places)) for places in (seen, ~seen))
    posterior, report = update_factored(near.to_kernel(), scan, sensor, truncation, reduction, factoring)
    both = [far, FactoredGLMB.from_kernel(posterior)]
    return FactoredGLMB.product(both, density.state_dim).to_kernel(), report
