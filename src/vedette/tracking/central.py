"""One filter takes the scans of all sensors: what any fusion of their beliefs is measured against."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol, runtime_checkable

import numpy as np

from vedette.densities import LMB
from vedette.filters import FilterInfo
from vedette.kernels.base.types import Floats
from vedette.models import BirthModel, SensorModel, TargetModel
from vedette.models.arguments import reject
from vedette.tracking.base import Stages, State, TrackerInfo, bytes_of_scan, check_step
from vedette.tracking.births import (
    births_due,
    births_from_scans,
    births_of_tracker,
    births_waiting,
    check_measured_births,
)
from vedette.tracking.losing import undetected_of


@runtime_checkable
class CentralFilter(Protocol):
    """A filter of several sensors: `MultiSensorGlmbFilter`, `MultiSensorLmbFilter`, or one of your own."""

    @property
    def targets(self) -> TargetModel:
        """The targets."""
        ...

    @property
    def sensors(self) -> tuple[SensorModel, ...]:
        """What each sensor sees."""
        ...

    def initial(self) -> Any:
        """The belief before the first scans."""
        ...

    def step(
        self, belief: Any, scans: Any, poses: Any, dt: float, step: int, *, rng: np.random.Generator
    ) -> tuple[Any, FilterInfo]:
        """Predict over `dt` seconds and update with one scan a sensor, None of one that did not scan.

        Where targets are born of measurements, a further argument `births` is an LMB of all who may have been born.
        """
        ...


@dataclass(frozen=True, slots=True, eq=False)
class OfAllScans:
    """What the trackers share that have one filter for the scans of all sensors.

    Attributes:
        filter: of all sensors' scans.

    Raises:
        InputError: something else than such a filter; births from measurements that do not say where they were taken.
    """

    filter: CentralFilter

    def __post_init__(self) -> None:
        if not isinstance(self.filter, CentralFilter):
            raise reject("filter", "one of several sensors, with targets, sensors, initial() and step()", self.filter)
        check_measured_births(self.targets.birth, self.sensors)

    @property
    def targets(self) -> TargetModel:
        """The targets."""
        return self.filter.targets

    @property
    def sensors(self) -> tuple[SensorModel, ...]:
        """What each sensor sees."""
        return tuple(self.filter.sensors)

    @property
    def birth(self) -> BirthModel:
        """The births that the tracker adds to those of the filter."""
        return births_of_tracker(self.targets.birth, self.filter)

    def _filtered(
        self,
        belief: Any,
        measured: LMB | None,
        scans: Sequence[Any],
        poses: Floats,
        dt: float,
        step: int,
        rng: np.random.Generator,
    ) -> tuple[Any, FilterInfo]:
        """The belief after a step. measured: who may be born of measurements, as of `births_due`."""
        due = births_due(self.birth, step, dt, measured)
        births = {} if due is None else {"births": due}
        return self.filter.step(belief, scans, poses, dt, step, rng=rng, **births)


@dataclass(frozen=True, slots=True, eq=False)
class Central(OfAllScans):
    """A single belief, which is every sensor's and the fused one at once.

    Attributes and errors: as `OfAllScans`.
    """

    def with_truth(self, truth: Any) -> Central:
        """The same, where the filter is one that is told the targets of a run."""
        return replace(self, filter=self.filter.with_truth(truth)) if hasattr(self.filter, "with_truth") else self

    def initial(self) -> State:
        """No target."""
        return self._state(self.filter.initial(), 0, None)

    def step(
        self, state: State, scans: Sequence[Any], poses: Any, time: float, *, rngs: Sequence[np.random.Generator]
    ) -> tuple[State, TrackerInfo]:
        """Update the one belief with all scans; see `Tracker.step`. Only the first of `rngs` is drawn from."""
        at, dt = check_step(state, scans, poses, time, rngs, len(self.sensors))
        stages, step = Stages(), state.step + 1
        with stages.timing("filter"):
            belief, info = self._filtered(state.fused, state.memory, scans, at, dt, step, rngs[0])
            measured = births_from_scans(self.birth, belief, self.sensors, scans, at, step + 1)
            if dt == 0.0:
                measured = births_waiting(self.birth, state.memory, measured)
        sent = tuple(bytes_of_scan(scan, pose) for scan, pose in zip(scans, at, strict=True))
        return self._state(belief, step, float(time), measured), TrackerInfo((info,), None, stages.seconds, sent)

    def _state(self, belief: Any, step: int, time: float | None, measured: LMB | None = None) -> State:
        undetected = undetected_of(belief, self.targets.birth)
        return State((belief,) * len(self.sensors), belief, step, time, measured, undetected)
