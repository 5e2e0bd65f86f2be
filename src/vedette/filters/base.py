"""What every filter is, and what the filters of one sensor share: models, checks, what they hand to their kernels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

import numpy as np

from vedette.densities import LMB, Labelled
from vedette.errors import InputError
from vedette.filters.info import FilterInfo
from vedette.filters.inputs import births_for, check_scan
from vedette.filters.limits import Limits
from vedette.kernels.association.truncation import Truncation
from vedette.kernels.base.types import Floats, Motion, ScanInput, Sensor
from vedette.models import SensorModel, TargetModel, kernel_motion
from vedette.models.arguments import generator, pose_vector, positive

StepArguments = tuple[ScanInput, Motion, Sensor, Truncation]


@runtime_checkable
class Filter(Protocol):
    """How one sensor's belief meets time and a scan; one of your own is as good as those that are here.

    What it believes may be anything that the fusion and the estimator after it take. A filter labels its targets if
    that is a `GLMB`, an `LMB` or a `FactoredGLMB`; decisions need one that does.
    """

    @property
    def targets(self) -> TargetModel:
        """The targets, the same object for all sensors."""
        ...

    @property
    def sensor(self) -> SensorModel:
        """What the sensor sees."""
        ...

    def initial(self) -> Any:
        """The belief before the first scan."""
        ...

    def step(
        self, belief: Any, scan: Any, pose: Any, dt: float, step: int, *, rng: np.random.Generator
    ) -> tuple[Any, FilterInfo]:
        """Predict over `dt` seconds and update with a scan; see `DeltaGlmbFilter.step`."""
        ...


@runtime_checkable
class TwoStepFilter(Filter, Protocol):
    """A filter whose prediction and update can also be had apart: for several scans at one time, or none.

    Needed of a filter of your own where a sensor may miss a scan, where sensors share their prediction, and where
    targets are born of measurements: `births` then stand in for the sites of the targets' model.
    """

    def step(
        self,
        belief: Any,
        scan: Any,
        pose: Any,
        dt: float,
        step: int,
        *,
        rng: np.random.Generator,
        births: LMB | None = None,
    ) -> tuple[Any, FilterInfo]:
        """Predict over `dt` seconds and update with a scan; see `DeltaGlmbFilter.step`."""
        ...

    def predict(self, belief: Any, dt: float, step: int, *, births: LMB | None = None) -> tuple[Any, FilterInfo]:
        """The belief `dt` seconds later, with those who may have been born by then; see `DeltaGlmbFilter.predict`."""
        ...

    def update(self, belief: Any, scan: Any, pose: Any, *, rng: np.random.Generator) -> tuple[Any, FilterInfo]:
        """The belief after a scan of its own time; see `DeltaGlmbFilter.update`."""
        ...


def labels_targets(tracker: Filter) -> bool:
    """Whether the filter's belief is a `GLMB`, an `LMB` or a `FactoredGLMB`."""
    return isinstance(tracker.initial(), Labelled)


def shared_targets(filters: Sequence[Filter]) -> TargetModel:
    """The one model of the targets that all these filters hold; `InputError` if they do not."""
    targets = filters[0].targets
    for i, other in enumerate(filters):
        if other.targets != targets:
            raise InputError(f"filters[{i}].targets: expected the target model of filters[0]; got another")
    return targets


@dataclass(frozen=True, slots=True, eq=False)
class SingleSensorFilter:
    """The parts of a filter of one sensor.

    Attributes:
        targets: how targets move, live on and appear.
        sensor: what the sensor sees of them.
        limits: caps and thresholds.

    Raises:
        InputError: a part of another kind.
    """

    targets: TargetModel
    sensor: SensorModel
    limits: Limits = field(default_factory=Limits)

    def __post_init__(self) -> None:
        for name, kind in (("targets", TargetModel), ("sensor", SensorModel), ("limits", Limits)):
            value = getattr(self, name)
            if not isinstance(value, kind):
                raise InputError(f"{name}: expected a {kind.__name__}; got {type(value).__name__}")

    def _arguments(
        self, scan: Floats, pose: Any, dt: Any, step: Any, prior: Labelled | None = None, births: LMB | None = None
    ) -> StepArguments:
        """Scan, models and truncation as the kernels take them, in their order.

        prior: whose labels those of the births must not repeat; None where there are none. births: instead of those of
        the targets' model.
        """
        targets = self.targets
        period = positive("dt", dt)
        birth = births_for(targets.birth, period, step, prior, births).to_kernel()
        motion = kernel_motion(targets.motion, targets.survival)
        return (ScanInput(birth, scan, pose_vector("pose", pose), period), motion, *self._own())

    def _own(self) -> tuple[Sensor, Truncation]:
        return self.sensor.to_kernel(), self.limits.truncation(self.sensor.meas_dim)

    def _update_arguments(self, scan: Floats, pose: Any) -> tuple[ScanInput, Sensor, Truncation]:
        """As `_arguments`, of a scan of the prior's own time."""
        nobody = LMB.empty(self.targets.state_dim).to_kernel()
        return (ScanInput(nobody, scan, pose_vector("pose", pose), 0.0), *self._own())

    def _check_scan(self, scan: Any, rng: Any) -> tuple[Floats, int]:
        generator(rng)
        return check_scan(scan, self.sensor)
