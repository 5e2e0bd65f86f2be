"""Local filters of all sensors: step, prediction and update of each sensor's belief."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from vedette.densities import LMB, FactoredGLMB, LabelledDensity
from vedette.errors import InputError
from vedette.filters import (
    FactoredGlmbFilter,
    Filter,
    FilterInfo,
    LmbFilter,
    PredictUpdateFilter,
    common_target_model,
    with_labelled_births,
)
from vedette.filters.base import NO_POSE, NO_SCAN, SingleSensorFilter, blind_sensor
from vedette.fusion import PrevalidatedBeliefs
from vedette.models import BirthModel, SensorModel, TargetModel
from vedette.models.arguments import provides, reject, sequence
from vedette.tracking.births import check_measured_births, tracker_births

_MEASURED_BIRTHS = "targets are born of measurements"


@dataclass(frozen=True, slots=True, eq=False)
class LocalFilters:
    """Base of trackers with a filter at each sensor.

    Attributes:
        filters: one per sensor. All have the same target model. Several filters always use labelled births, because
            two sensors' first detections of one target would otherwise be two labels.
        targets: target model that all sensors share.
        sensors: model of each sensor.

    Raises:
        InputError: no filter, an object that is not a filter, or filters with different target models, or for births
            from measurements, filters or measurements that do not support them.
    """

    filters: tuple[Filter, ...]
    targets: TargetModel = field(init=False)
    sensors: tuple[SensorModel, ...] = field(init=False)
    _are_builtin: bool = field(init=False, repr=False)  # True if all filters are the library's

    def __post_init__(self) -> None:
        object.__setattr__(self, "filters", sequence("filters", self.filters, "a Filter of each sensor"))
        if not self.filters:
            raise InputError("filters: expected at least one; got none")
        for s, local in enumerate(self.filters):
            if not isinstance(local, Filter):
                raise reject(f"filters[{s}]", "a Filter, with targets, sensor, initial() and step()", local)
        if len(self.filters) > 1:
            object.__setattr__(self, "filters", tuple(map(with_labelled_births, self.filters)))
        object.__setattr__(self, "targets", common_target_model(self.filters))
        object.__setattr__(self, "sensors", tuple(local.sensor for local in self.filters))
        object.__setattr__(self, "_are_builtin", all(isinstance(local, SingleSensorFilter) for local in self.filters))
        birth = self.targets.birth
        check_measured_births(birth, self.sensors, each=True)
        for s in range(len(self.filters)):
            if birth.from_measurements is not None:
                self._predict_update_filter(s, _MEASURED_BIRTHS)

    @property
    def birth(self) -> BirthModel:
        """Births that the tracker adds to those of the filters."""
        return tracker_births(self.targets.birth, self.filters[0])

    def _step_filter(
        self,
        s: int,
        belief: Any,
        scan: Any,
        pose: Any,
        dt: float,
        step: int,
        births: LMB | None,
        rng: np.random.Generator,
    ) -> tuple[Any, FilterInfo]:
        """Return the belief of sensor `s` after a scan, or its prediction if it did not scan, and the report."""
        local = self.filters[s]
        if scan is None:
            return self._predict(s, belief, dt, step, births)
        if births is None:
            return local.step(belief, scan, pose, dt, step, rng=rng)
        return self._predict_update_filter(s, _MEASURED_BIRTHS).step(
            belief, scan, pose, dt, step, rng=rng, births=births
        )

    def _predict(self, s: int, belief: Any, dt: float, step: int, births: LMB | None) -> tuple[Any, FilterInfo]:
        """Return the prediction of sensor `s` over `dt` seconds, and the report."""
        return self._predict_update_filter(s, "it must predict without a scan").predict(belief, dt, step, births=births)

    def _update(
        self, s: int, prediction: Any, scan: Any, pose: Any, rng: np.random.Generator
    ) -> tuple[Any, FilterInfo]:
        """Return the prediction updated with the scan of sensor `s`, and the report.

        No label is dropped. If the sensor did not scan, the prediction is returned unchanged.
        """
        local = self.filters[s]
        if not isinstance(local, LmbFilter | FactoredGlmbFilter):
            raise reject(
                f"filters[{s}]", "an LmbFilter or FactoredGlmbFilter, as sensors share their prediction", local
            )
        unlimited = replace(local, limits=local.limits.keeping_labels())
        if isinstance(unlimited, FactoredGlmbFilter):
            # The errors of all sensors' splits add up, and mixtures are divided by the prediction without merging.
            limits = replace(unlimited.limits, merge_distance=0.0)
            num, error = len(self.filters), unlimited.max_split_error
            unlimited = replace(unlimited, limits=limits, max_split_error=error / num, scans_together=num)
        if scan is None:
            _, info = replace(unlimited, sensor=blind_sensor()).update(prediction, NO_SCAN.values, NO_POSE, rng=rng)
            return prediction, info
        return unlimited.update(prediction, scan, pose, rng=rng)

    def _drop_labels(self, belief: Any) -> Any:
        """Return the belief without the labels that the limits of the first filter drop."""
        local = self.filters[0]
        assert isinstance(local, SingleSensorFilter)
        return local.limits_of(local.sensor).kept(belief)

    def _as_filter_density(self, belief: Any) -> Any:
        """Return the density in the form of the filters: a product of GLMBs if they use these."""
        factored = isinstance(self.filters[0], FactoredGlmbFilter) and isinstance(belief, LabelledDensity)
        return FactoredGLMB.of(belief) if factored else belief

    def _for_fusion(self, beliefs: Sequence[Any]) -> Sequence[Any]:
        """Return the beliefs for fusion, marked as valid if all filters are the library's."""
        return PrevalidatedBeliefs(beliefs) if self._are_builtin else beliefs

    def _predict_update_filter(self, s: int, why: str) -> PredictUpdateFilter:
        local = self.filters[s]
        if provides(local, PredictUpdateFilter):
            provided: PredictUpdateFilter = local
            return provided
        expected = f"a PredictUpdateFilter, with predict() and update(), as {why}"
        raise reject(f"filters[{s}]", expected, type(local).__name__)
