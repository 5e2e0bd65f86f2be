"""Shared parts of the central filters: one belief, updated with the scans of several sensors at one time."""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from vedette.densities import LMB, LabelledDensity
from vedette.errors import InputError
from vedette.filters.base import (
    NO_POSE,
    NO_SCAN,
    BeliefT,
    LabelledFilterBase,
    SensorStep,
    blind_sensor,
    step_limits,
)
from vedette.filters.inputs import check_belief, check_scan, is_zero_duration, model_errors, no_births_for_kernel
from vedette.filters.limits import Limits
from vedette.filters.protocols import FilterInfo
from vedette.kernels.base.types import Bools, Floats, Ints, Lmb, Measurements, Motion, ScanInput
from vedette.models import SensorModel, TargetModel, motion_of_filter, sensor_of_filter
from vedette.models.arguments import generator, one_a_sensor, pose_vector, positive, reject, step_number
from vedette.models.fields import check_fields
from vedette.models.modes import check_room_for_modes
from vedette.models.sensor import with_default_detection_at


class SensorScans(NamedTuple):
    """The scans of one time, of the sensors that scanned."""

    names: list[str]
    sensors: list[SensorModel]
    scans: list[Measurements]
    poses: list[Floats]
    repeats: list[Ints]  # rows of each scan that repeat another; empty if no sensor scanned

    def inputs(self, born: Lmb, dt: float) -> list[ScanInput]:
        """Return the scans in kernel form, each with the births and the period."""
        return [ScanInput(born, *own, dt) for own in zip(self.scans, self.poses, strict=True)]

    def sequential_inputs(self, born: Lmb, dt: float) -> list[ScanInput]:
        """Return `inputs` with births and a period for the first scan only."""
        none = no_births_for_kernel(born.tracks.components.means.shape[1])
        first, *others = self.inputs(born, dt)
        return [first, *(own._replace(birth=none, dt=0.0) for own in others)]

    def log_likelihood(self, log_total: float, log_clutters: Sequence[float]) -> float:
        """Convert a joint log weight relative to clutter to the log density of the scans."""
        return log_total + sum(
            log_clutter - sensor.clutter.rate for log_clutter, sensor in zip(log_clutters, self.sensors, strict=True)
        )


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class MultiSensorFilter(LabelledFilterBase[BeliefT]):
    """Base of the filters of several sensors.

    Attributes:
        targets: motion, survival and birth models.
        sensors: model of each sensor. They may measure different quantities.
        limits: caps and thresholds.

    Raises:
        InputError: a part of another kind, or no sensor.
    """

    targets: TargetModel
    sensors: tuple[SensorModel, ...]
    limits: Limits = field(default_factory=Limits)

    def __post_init__(self) -> None:
        check_fields(self)
        if not isinstance(self.sensors, Sequence) or len(self.sensors) == 0:
            raise reject("sensors", "a sequence of at least one SensorModel", self.sensors)
        for s, sensor in enumerate(self.sensors):
            if not isinstance(sensor, SensorModel):
                raise InputError(f"sensors[{s}]: expected a SensorModel; got {type(sensor).__name__}")
            sensor.measurement.check_motion(f"sensors[{s}].measurement", self.targets.motion.components)
        check_room_for_modes(self.targets.motion, self.limits.max_components)
        at = self.default_detection_at
        object.__setattr__(self, "sensors", tuple(with_default_detection_at(sensor, at) for sensor in self.sensors))

    def step(
        self,
        belief: LabelledDensity,
        scans: Any,
        poses: Any,
        dt: float,
        step: int,
        *,
        rng: np.random.Generator,
        births: LMB | None = None,
    ) -> tuple[BeliefT, FilterInfo]:
        """Predict over `dt` seconds and update with the scans of all sensors.

        Args:
            belief: posterior of the previous step.
            scans: one per sensor, in their order: (num, meas_dim) measurements in any order, with angles in radians, in
                (-pi, pi]. None for a sensor that did not scan.
            poses: one per sensor: [px, py, heading_rad, ...].
            dt: seconds since the previous step. 0: no motion, deaths or births.
            step: number of this step, from 1 on. Births are labelled with it.
            rng: not used, but accepted so that filters are interchangeable.
            births: as in `DeltaGlmbFilter.step`.

        Returns:
            The posterior and one report on all scans: log likelihoods, counts and bounds of all sensors.

        Raises:
            InputError: not one scan and one pose per sensor, or one of the wrong shape or kind; an angle beyond a full
                turn; a step below 1.
            ModelError: a model function raised or returned a value that is invalid for its kind.
            NumericalError: no association has positive weight.
        """
        taken = self._checked_scans(scans, poses, rng)
        prior = check_belief(belief, self.kind, self.targets)
        if is_zero_duration(dt):
            step_number(step)
            before = self._before_scan(prior, 0.0, step, births)
            return self._updated(before, no_births_for_kernel(self.targets.state_dim), taken, 0.0, f"step {step}")
        period = positive("dt", dt)
        born = self._births(period, step, prior, births)
        return self._updated(self._before_scan(prior, period, step, births), born, taken, period, f"step {step}")

    def _motion(self) -> Motion:
        """Return the motion in kernel form."""
        return motion_of_filter(self.targets.motion, self.targets.survival)

    @abstractmethod
    def _updated(self, prior: Any, born: Lmb, taken: SensorScans, dt: float, place: str) -> tuple[BeliefT, FilterInfo]:
        """Update the predicted prior (see `_before_scan`), births added, with all scans. place: prefix of messages."""

    def _checked_scans(self, scans: Any, poses: Any, rng: Any) -> SensorScans:
        """Return the checked scans and poses of the sensors that scanned.

        If no sensor scanned, return an empty scan of a blind sensor, with which an update is the prediction.
        """
        generator(rng)
        one_a_sensor(len(self.sensors), scans=scans, poses=poses)
        taken = SensorScans([], [], [], [], [])
        for s, sensor in enumerate(self.sensors):
            if scans[s] is None:
                continue
            try:
                scan, repeats = check_scan(scans[s], sensor, self.targets.num_classes)
            except InputError as error:
                raise InputError(f"scans[{s}]: {error}") from None
            taken.names.append(f"sensor {s}")
            taken.sensors.append(sensor)
            taken.scans.append(scan)
            taken.poses.append(pose_vector(f"poses[{s}]", poses[s]))
            taken.repeats.append(repeats)
        return taken if taken.names else SensorScans(["no sensor"], [blind_sensor()], [NO_SCAN], [NO_POSE], [])


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SequentialUpdate(MultiSensorFilter[BeliefT]):
    """Base of filters with one prediction, then an update with each sensor's scan in order.

    Attributes and errors: as `MultiSensorFilter`.
    """

    def _updated(self, prior: Any, born: Lmb, taken: SensorScans, dt: float, place: str) -> tuple[BeliefT, FilterInfo]:
        motion, posterior = self._motion(), prior
        keeping, settled = self.limits.keeping_labels(), np.zeros(0, np.bool_)
        reports, log_total, last = list[Any](), 0.0, len(taken.names) - 1
        given = zip(taken.names, taken.sensors, taken.sequential_inputs(born, dt), strict=True)
        for s, (name, sensor, scan) in enumerate(given):
            limits = step_limits(self, sensor) if s == last else keeping
            own = sensor_of_filter(sensor, self.targets.motion), limits.truncation(sensor.meas_dim)
            step = SensorStep((scan, motion, *own), limits, sensor, len(taken.names))
            with model_errors():
                if s in (0, last):  # the last update decides for every label whether it is kept
                    posterior, report = self._run_kernel(posterior, step)
                else:
                    posterior, report, settled = self._updated_in_view(posterior, settled, step)
            log_total += self._check(posterior, report, f"{place}, {name}: ")
            reports.append(report)
        log_likelihood = taken.log_likelihood(log_total, [report.log_clutter for report in reports])
        return self._conclude(posterior, reports, log_likelihood=log_likelihood, repeats=taken.repeats)

    @abstractmethod
    def _run_kernel(self, prior: Any, step: SensorStep) -> tuple[Any, Any]:
        """Return the posterior and report in kernel form."""

    def _updated_in_view(self, prior: Any, settled: Bools, step: SensorStep) -> tuple[Any, Any, Bools]:
        """Return `_run_kernel`. Subclasses may skip unaffected parts. settled: result of the previous call."""
        return (*self._run_kernel(prior, step), settled)
