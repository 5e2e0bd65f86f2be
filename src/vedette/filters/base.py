"""What filters of one step a scan share: their models, and what they hand to their kernels."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from vedette.densities import LMB
from vedette.filters.inputs import births_at, check_parts, check_scan, check_step
from vedette.filters.limits import Limits
from vedette.kernels.association.truncation import Truncation
from vedette.kernels.base.types import Floats, Lmb, Motion, Sensor
from vedette.models import BirthModel, MotionModel, SensorModel, SurvivalModel, kernel_motion
from vedette.models.arguments import generator, pose_vector, positive

StepArguments = tuple[Lmb, Floats, Floats, float, Motion, Sensor, Truncation]


@dataclass(frozen=True, slots=True, eq=False)
class ModelledFilter:
    """The models of a filter.

    Attributes:
        motion, survival, birth, sensor: the models.
        limits: caps and thresholds.

    Raises:
        InputError: models of different state dimensions.
    """

    motion: MotionModel
    survival: SurvivalModel
    birth: BirthModel
    sensor: SensorModel
    limits: Limits = field(default_factory=Limits)

    def __post_init__(self) -> None:
        check_parts(self.motion, self.survival, self.birth, self.sensor, self.limits)

    def _arguments(self, scan: Floats, pose: Any, dt: Any, step: Any, prior: LMB | None = None) -> StepArguments:
        """Births, scan, pose, time step, models and truncation as the kernels take them, in their order.

        prior: whose labels those of the births must not repeat; None where there are none.
        """
        return (
            births_at(self.birth, check_step(step, self.birth, prior)).to_kernel(),
            scan,
            pose_vector("pose", pose),
            positive("dt", dt),
            kernel_motion(self.motion, self.survival),
            self.sensor.to_kernel(),
            self.limits.truncation(self.sensor.meas_dim),
        )

    def _check_scan(self, scan: Any, rng: Any) -> tuple[Floats, int]:
        generator(rng)
        return check_scan(scan, self.sensor.measurement)
