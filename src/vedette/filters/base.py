"""Shared parts of the single-sensor filters: models, checks and kernel inputs."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache, lru_cache
from typing import Any, ClassVar, Generic, NamedTuple, TypeAlias, TypeVar

import numpy as np

from vedette.densities import LMB, LabelledDensity
from vedette.filters.inputs import (
    births_for,
    check_belief,
    check_scan,
    is_zero_duration,
    no_births_for_kernel,
    raise_model_error,
)
from vedette.filters.limits import Limits, limits_for_births
from vedette.filters.protocols import FilterInfo
from vedette.internal.representation import SummaryRepr
from vedette.kernels.association.truncation import Truncation
from vedette.kernels.base.types import Ints, Lmb, Measurements, Motion, ScanInput, Sensor
from vedette.models import (
    SensorModel,
    TargetModel,
    constant_detection,
    constant_noise,
    measurement_space_clutter,
    motion_of_filter,
    position,
    sensor_of_filter,
)
from vedette.models.arguments import generator, pose_vector, positive, step_number
from vedette.models.fields import check_fields
from vedette.models.modes import check_room_for_modes
from vedette.models.scan_rows import to_measurements
from vedette.models.sensor import with_default_detection_at

BeliefT = TypeVar("BeliefT", bound=LabelledDensity)


StepInputs: TypeAlias = tuple[ScanInput, Motion, Sensor, Truncation]


class SensorStep(NamedTuple):
    """Inputs of one update with the scan of one sensor.

    inputs: in kernel form. For a scan at the time of the belief its `dt` is 0. limits: caps and thresholds.
    sensor: the sensor of the scan.
    num_scans: number of scans at this time that update the belief. rng: None if nothing is drawn.
    """

    inputs: StepInputs
    limits: Limits
    sensor: SensorModel
    num_scans: int = 1
    rng: np.random.Generator | None = None


@cache
def blind_sensor() -> SensorModel:
    """Return a sensor without detections and clutter: a step with it is a prediction, from any pose."""
    return SensorModel(
        position(),
        constant_noise([1.0, 1.0]),
        constant_detection(0.0),
        measurement_space_clutter(0.0, [0.0, 0.0], [1.0, 1.0]),
    )


NO_SCAN = to_measurements(np.empty((0, 2)))
NO_POSE = np.zeros(3)


class WithBirths(SummaryRepr):
    """A filter whose labels may begin at birth sites."""

    __slots__ = ()
    default_detection_at: ClassVar[str] = "centre"  # of sensors whose `detection_at` is None
    targets: TargetModel
    limits: Limits

    def limits_of(self, sensor: SensorModel) -> Limits:
        """Return the limits of an update with a scan of a sensor. See `step_limits`."""
        return limits_for_births(self.limits, self.targets.birth, sensor.clutter.rate)

    def _births(self, dt: float, step: Any, prior: LabelledDensity | None, births: LMB | None) -> Lmb:
        """Return the labels born within the `dt` seconds before a step, detected or not. See `births_for`."""
        return births_for(self.targets.birth, dt, step, prior, births)


@lru_cache(maxsize=1000)
def step_limits(local: WithBirths, sensor: SensorModel) -> Limits:
    """Return the limits of an update of a filter with a scan of a sensor, cached."""
    return local.limits_of(sensor)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SingleSensorFilter(WithBirths):
    """Base of the filters of one sensor.

    Attributes:
        targets: motion, survival and birth models.
        sensor: model of the sensor.
        limits: caps and thresholds.

    Raises:
        InputError: a part of another kind, or a measurement of a component that states do not have.
    """

    targets: TargetModel
    sensor: SensorModel
    limits: Limits = field(default_factory=Limits)

    def __post_init__(self) -> None:
        check_fields(self)
        self.sensor.measurement.check_motion("sensor.measurement", self.targets.motion.components)
        check_room_for_modes(self.targets.motion, self.limits.max_components)
        object.__setattr__(self, "sensor", with_default_detection_at(self.sensor, self.default_detection_at))

    def _inputs_after(
        self,
        dt: Any,
        scan: Measurements,
        pose: Any,
        step: Any,
        prior: LabelledDensity | None = None,
        births: LMB | None = None,
    ) -> StepInputs:
        """Return the scan, models and truncation in kernel form and order, for a `dt` of 0 those of an update.

        prior: density whose labels the births must not repeat, or None if it has none. births: replace those of the
        targets' model.
        """
        if is_zero_duration(dt):
            step_number(step)
            return self._update_inputs(scan, pose)
        (motion, sensor, truncation), period = _models(self.targets, self.sensor, self.limits), positive("dt", dt)
        born = self._births(period, step, prior, births)
        return ScanInput(born, scan, pose_vector("pose", pose), period), motion, sensor, truncation

    def _update_inputs(self, scan: Measurements, pose: Any) -> StepInputs:
        """Return the inputs of `_inputs_after` for a scan at the time of the prior."""
        motion, sensor, truncation = _models(self.targets, self.sensor, self.limits)
        given = ScanInput(no_births_for_kernel(self.targets.state_dim), scan, pose_vector("pose", pose), 0.0)
        return given, motion, sensor, truncation


@lru_cache(maxsize=1000)
def _models(targets: TargetModel, sensor: SensorModel, limits: Limits) -> tuple[Motion, Sensor, Truncation]:
    """Return the models in kernel form, cached."""
    motion = motion_of_filter(targets.motion, targets.survival)
    return motion, sensor_of_filter(sensor, targets.motion), limits.truncation(sensor.meas_dim)


class LabelledFilterBase(WithBirths, ABC, Generic[BeliefT]):
    """Base of the filters of one kind of labelled belief, for any number of sensors."""

    __slots__ = ()
    kind: ClassVar[type[Any]]  # of the belief: a `GLMB`, an `LMB` or a `FactoredGLMB`

    def initial(self) -> BeliefT:
        """Return the belief before the first scan: no target."""
        empty: BeliefT = self.kind.empty(self.targets.birth)
        return empty

    def _before_scan(self, prior: BeliefT, dt: float, step: Any, births: LMB | None) -> Any:
        """Return the prior as `_run_kernel` expects it. dt: seconds since it. step: of the scan, None for an update."""
        return prior.to_kernel()

    @abstractmethod
    def _check(self, posterior: Any, report: Any, place: str) -> float:
        """Return the log total weight. Raises `NumericalError`, with `place` first, if nothing has positive weight."""

    @abstractmethod
    def _conclude(
        self, posterior: Any, reports: Sequence[Any], *, log_likelihood: float, repeats: Sequence[Ints]
    ) -> tuple[BeliefT, FilterInfo]:
        """Return the posterior and the report, after one update per report. repeats: per scan, the rows left out."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class LabelledFilter(SingleSensorFilter, LabelledFilterBase[BeliefT]):
    """Base of the labelled filters of one sensor: step, prediction and update.

    Attributes and errors: as `SingleSensorFilter`.
    """

    def step(
        self,
        belief: LabelledDensity,
        scan: Any,
        pose: Any,
        dt: float,
        step: int,
        *,
        rng: np.random.Generator,
        births: LMB | None = None,
    ) -> tuple[BeliefT, FilterInfo]:
        """Predict over `dt` seconds and update with a scan.

        Args:
            belief: posterior of the previous step.
            scan: (num, meas_dim) measurements in any order, with angles in radians, in (-pi, pi], or
                `vedette.models.ScanRows`, which bring their noise.
            pose: (3 or more,) [px, py, heading_rad, ...] of the sensor.
            dt: seconds since the previous step. 0 is the same as `update`: no motion, deaths or births.
            step: number of this step, from 1 on. Births at the sites of the targets' model are labelled with it.
            rng: used only by Gibbs sampling. All filters accept it, so that they are interchangeable.
            births: birth density since the previous step, in place of those sites. Its labels must be later than the
                belief's.

        Returns:
            The posterior (hypotheses of a GLMB by descending weight) and a report.

        Raises:
            InputError: a scan, pose, belief or births of the wrong shape or kind, an angle beyond a full turn, a step
                below 1.
            ModelError: a model function raised or returned a value that is invalid for its kind.
            NumericalError: no hypothesis has positive weight.
        """
        generator(rng)
        measurements, repeats = check_scan(scan, self.sensor, self.targets.num_classes)
        prior = check_belief(belief, self.kind, self.targets)
        inputs = self._inputs_after(dt, measurements, pose, step, prior, births)
        before = self._before_scan(prior, inputs[0].dt, step, births)
        return self._taken(before, inputs, rng, [repeats], f"step {step}: ")

    def predict(
        self, belief: LabelledDensity, dt: float, step: int, *, births: LMB | None = None
    ) -> tuple[BeliefT, FilterInfo]:
        """Return the belief `dt` seconds later, births included. Arguments and errors as for `step`.

        Truncation here uses the weights before the scan, unlike in `step`.
        """
        prior, blind = check_belief(belief, self.kind, self.targets), self._blind()
        inputs = blind._inputs_after(dt, NO_SCAN, NO_POSE, step, prior, births)
        return blind._taken(blind._before_scan(prior, inputs[0].dt, step, births), inputs, None, [], f"step {step}: ")

    def update(
        self, belief: LabelledDensity, scan: Any, pose: Any, *, rng: np.random.Generator
    ) -> tuple[BeliefT, FilterInfo]:
        """Return the posterior after a scan at the time of the belief, with no motion, deaths or births. See `step`."""
        generator(rng)
        measurements, repeats = check_scan(scan, self.sensor, self.targets.num_classes)
        prior = check_belief(belief, self.kind, self.targets)
        inputs = self._update_inputs(measurements, pose)
        return self._taken(self._before_scan(prior, 0.0, None, None), inputs, rng, [repeats], "")

    def _taken(
        self, prior: Any, inputs: StepInputs, rng: np.random.Generator | None, repeats: Sequence[Ints], place: str
    ) -> tuple[BeliefT, FilterInfo]:
        try:
            step = SensorStep(inputs, step_limits(self, self.sensor), self.sensor, rng=rng)
            posterior, report = self._run_kernel(prior, step)
        except Exception as error:
            raise_model_error(error)
            raise
        log_likelihood = self._check(posterior, report, place) + report.log_clutter - self.sensor.clutter.rate
        return self._conclude(posterior, [report], log_likelihood=log_likelihood, repeats=repeats)

    @abstractmethod
    def _run_kernel(self, prior: Any, step: SensorStep) -> tuple[Any, Any]:
        """Return the posterior and report in kernel form."""

    @abstractmethod
    def _blind(self) -> "LabelledFilter[BeliefT]":
        """Return the filter whose step is the prediction: its sensor detects nothing."""
