"""What the filters of one sensor share: models, checks, what they hand to their kernels."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache, lru_cache
from typing import Any, ClassVar, Generic, NamedTuple, TypeAlias, TypeVar

import numpy as np

from vedette.densities import LMB, LabelledDensity
from vedette.errors import InputError
from vedette.filters.inputs import (
    births_for,
    check_belief,
    check_scan,
    is_zero_duration,
    no_births_for_kernel,
    raise_model_error,
)
from vedette.filters.limits import Limits
from vedette.filters.protocols import FilterInfo
from vedette.internal.representation import SummaryRepr
from vedette.kernels.association.truncation import Truncation
from vedette.kernels.base.types import Floats, Ints, Lmb, Motion, ScanInput, Sensor
from vedette.models import (
    SensorModel,
    TargetModel,
    constant_detection,
    constant_noise,
    kernel_motion,
    measurement_space_clutter,
    position,
)
from vedette.models.arguments import generator, pose_vector, positive, step_number

BeliefT = TypeVar("BeliefT", bound=LabelledDensity)


StepInputs: TypeAlias = tuple[ScanInput, Motion | None, Sensor, Truncation]


class SensorStep(NamedTuple):
    """One sensor's scan, as it meets a belief.

    inputs: as kernels take them; the motion is None of a scan of the belief's own time. limits: caps and thresholds.
    sensor: that took the scan.
    num_scans: of that time, which go into one belief. rng: None where nothing is drawn.
    """

    inputs: StepInputs
    limits: Limits
    sensor: SensorModel
    num_scans: int = 1
    rng: np.random.Generator | None = None


@cache
def blind_sensor() -> SensorModel:
    """One that never detects and has no clutter: with it a step is a prediction; any position will do for it."""
    return SensorModel(
        position(),
        constant_noise([1.0, 1.0]),
        constant_detection(0.0),
        measurement_space_clutter(0.0, [0.0, 0.0], [1.0, 1.0]),
    )


NO_SCAN = np.empty((0, 2))
NO_POSE = np.zeros(3)


class WithBirths(SummaryRepr):
    """A filter whose labels may begin at birth sites."""

    __slots__ = ()
    targets: TargetModel

    def _births(self, dt: float, step: Any, prior: LabelledDensity | None, births: LMB | None) -> Lmb:
        """The labels that begin within the `dt` seconds before a step, whatever is detected; see `births_for`."""
        return births_for(self.targets.birth, dt, step, prior, births)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SingleSensorFilter(WithBirths):
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

    def _inputs_after(
        self,
        dt: Any,
        scan: Floats,
        pose: Any,
        step: Any,
        prior: LabelledDensity | None = None,
        births: LMB | None = None,
    ) -> StepInputs:
        """Scan, models and truncation as the kernels take them, in their order; of no time those of an update.

        prior: whose labels those of the births must not repeat; None where there are none. births: instead of those of
        the targets' model.
        """
        if is_zero_duration(dt):
            step_number(step)
            return self._update_inputs(scan, pose)
        (motion, sensor, truncation), period = _models(self.targets, self.sensor, self.limits), positive("dt", dt)
        born = self._births(period, step, prior, births)
        return ScanInput(born, scan, pose_vector("pose", pose), period), motion, sensor, truncation

    def _update_inputs(self, scan: Floats, pose: Any) -> StepInputs:
        """As `_inputs_after`, of a scan of the prior's own time."""
        _, sensor, truncation = _models(self.targets, self.sensor, self.limits)
        given = ScanInput(no_births_for_kernel(self.targets.state_dim), scan, pose_vector("pose", pose), 0.0)
        return given, None, sensor, truncation


@lru_cache(maxsize=1000)
def _models(targets: TargetModel, sensor: SensorModel, limits: Limits) -> tuple[Motion, Sensor, Truncation]:
    """As kernels take them; laid out once."""
    motion = kernel_motion(targets.motion, targets.survival)
    return motion, sensor.to_kernel(), limits.truncation(sensor.meas_dim)


class LabelledFilterBase(WithBirths, ABC, Generic[BeliefT]):
    """What filters of one kind of labelled belief have in common, whatever the number of their sensors."""

    __slots__ = ()
    kind: ClassVar[type[Any]]  # of the belief: a `GLMB`, an `LMB` or a `FactoredGLMB`

    def initial(self) -> BeliefT:
        """The belief before the first scan: no target."""
        empty: BeliefT = self.kind.empty(self.targets.state_dim)
        return empty

    def _before_scan(self, prior: BeliefT, dt: float, step: Any, births: LMB | None) -> Any:
        """What `_stepped` takes of the prior. dt: seconds since; step: of the scan; None: of an update apart."""
        return prior.to_kernel()

    @abstractmethod
    def _check(self, posterior: Any, report: Any, place: str) -> float:
        """The log total weight; `NumericalError`, after `place`, where nothing has positive weight."""

    @abstractmethod
    def _concluded(
        self, posterior: Any, reports: Sequence[Any], *, log_likelihood: float, repeats: Sequence[Ints]
    ) -> tuple[BeliefT, FilterInfo]:
        """As they are given back, after updates with one report each. repeats: of each scan, the rows left out."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class LabelledFilter(SingleSensorFilter, LabelledFilterBase[BeliefT]):
    """A filter of one sensor that labels its targets: what its step, its prediction and its update have in common.

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
            scan: (num, meas_dim) measurements in any order; angles in radians, in (-pi, pi].
            pose: (3 or more,) [px, py, heading_rad, ...] of the sensor.
            dt: seconds since the previous step; 0: as `update`, nobody moves, dies or is born.
            step: number of this step, from 1 on; births at the sites of the targets' model are labelled with it.
            rng: drawn from only by Gibbs sampling; taken by all so that filters are interchangeable.
            births: who may have been born since the previous step, instead of at those sites; labels later than the
                belief's.

        Returns:
            The posterior, of a GLMB the hypotheses by descending weight, and a report.

        Raises:
            InputError: a scan, pose, belief or births of the wrong shape or kind, an angle beyond a full turn, a step
                below 1.
            ModelError: a model function raised or gave a value that is none of its kind.
            NumericalError: no hypothesis has positive weight.
        """
        generator(rng)
        measurements, repeats = check_scan(scan, self.sensor)
        prior = check_belief(belief, self.kind, self.targets.state_dim)
        inputs = self._inputs_after(dt, measurements, pose, step, prior, births)
        before = self._before_scan(prior, inputs[0].dt, step, births)
        return self._taken(before, inputs, rng, [repeats], f"step {step}: ")

    def predict(
        self, belief: LabelledDensity, dt: float, step: int, *, births: LMB | None = None
    ) -> tuple[BeliefT, FilterInfo]:
        """The belief `dt` seconds later, births included: a step without sight. Arguments and errors as of `step`.

        What is cut here is cut as it weighs before the scan is seen, which in `step` is not so.
        """
        prior, blind = check_belief(belief, self.kind, self.targets.state_dim), self._blind()
        inputs = blind._inputs_after(dt, NO_SCAN, NO_POSE, step, prior, births)
        return blind._taken(blind._before_scan(prior, inputs[0].dt, step, births), inputs, None, [], f"step {step}: ")

    def update(
        self, belief: LabelledDensity, scan: Any, pose: Any, *, rng: np.random.Generator
    ) -> tuple[BeliefT, FilterInfo]:
        """The belief after a scan of its own time; nobody moves, dies or is born. Arguments and errors as of `step`."""
        generator(rng)
        measurements, repeats = check_scan(scan, self.sensor)
        prior = check_belief(belief, self.kind, self.targets.state_dim)
        inputs = self._update_inputs(measurements, pose)
        return self._taken(self._before_scan(prior, 0.0, None, None), inputs, rng, [repeats], "")

    def _taken(
        self,
        prior: Any,
        inputs: StepInputs,
        rng: np.random.Generator | None,
        repeats: Sequence[Ints],
        place: str,
    ) -> tuple[BeliefT, FilterInfo]:
        try:
            posterior, report = self._stepped(prior, SensorStep(inputs, self.limits, self.sensor, rng=rng))
        except Exception as error:
            raise_model_error(error)
            raise
        log_likelihood = self._check(posterior, report, place) + report.log_clutter - self.sensor.clutter.rate
        return self._concluded(posterior, [report], log_likelihood=log_likelihood, repeats=repeats)

    @abstractmethod
    def _stepped(self, prior: Any, step: SensorStep) -> tuple[Any, Any]:
        """Posterior and report of kernels."""

    @abstractmethod
    def _blind(self) -> LabelledFilter[BeliefT]:
        """The filter whose step is the prediction; its sensor sees nothing."""
