"""Central tracker: one filter processes the scans of all sensors. It is the reference for every fusion of beliefs."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol, runtime_checkable

import numpy as np

from vedette.densities import LMB
from vedette.filters import FilterInfo
from vedette.kernels.base.types import Floats
from vedette.models import BirthModel, SensorModel, TargetModel
from vedette.models.arguments import reject
from vedette.tracking.base import StageTimer, State, TrackerInfo, check_step, scan_bytes
from vedette.tracking.births import (
    birth_candidates,
    births_from_scans,
    check_measured_births,
    combine_births,
    tracker_births,
)
from vedette.tracking.lost_labels import undetected_intensity


@runtime_checkable
class CentralFilter(Protocol):
    """A multi-sensor filter: `MultiSensorGlmbFilter`, `MultiSensorLmbFilter` or a custom one."""

    @property
    def targets(self) -> TargetModel:
        """Target model."""

    @property
    def sensors(self) -> tuple[SensorModel, ...]:
        """Model of each sensor."""

    def initial(self) -> Any:
        """Return the belief before the first scans."""

    def step(
        self, belief: Any, scans: Any, poses: Any, dt: float, step: int, *, rng: np.random.Generator
    ) -> tuple[Any, FilterInfo]:
        """Predict over `dt` seconds and update with one scan per sensor, None for a sensor that did not scan.

        For births from measurements, a further argument `births` is the LMB of all birth candidates.
        """


@dataclass(frozen=True, slots=True, eq=False)
class MultiSensorFilterTracker:
    """Base of trackers with one multi-sensor filter.

    Attributes:
        filter: the multi-sensor filter.

    Raises:
        InputError: `filter` is not a multi-sensor filter, or births from measurements that do not determine a position.
    """

    filter: CentralFilter

    def __post_init__(self) -> None:
        if not isinstance(self.filter, CentralFilter):
            raise reject("filter", "one of several sensors, with targets, sensors, initial() and step()", self.filter)
        check_measured_births(self.targets.birth, self.sensors, each=False)

    @property
    def targets(self) -> TargetModel:
        """Target model."""
        return self.filter.targets

    @property
    def sensors(self) -> tuple[SensorModel, ...]:
        """Model of each sensor."""
        return tuple(self.filter.sensors)

    @property
    def birth(self) -> BirthModel:
        """Births that the tracker adds to those of the filter."""
        return tracker_births(self.targets.birth, self.filter)

    def _filter(
        self,
        belief: Any,
        measured: LMB | None,
        scans: Sequence[Any],
        poses: Floats,
        dt: float,
        step: int,
        rng: np.random.Generator,
    ) -> tuple[Any, FilterInfo]:
        """Return the belief after a step and the report. measured: birth candidates, as in `birth_candidates`."""
        candidates = birth_candidates(self.birth, step, dt, measured)
        births = {} if candidates is None else {"births": candidates}
        return self.filter.step(belief, scans, poses, dt, step, rng=rng, **births)


@dataclass(frozen=True, slots=True, eq=False)
class Central(MultiSensorFilterTracker):
    """Central tracker: a single belief serves as the belief of every sensor and as the fused one.

    Attributes and errors: as in `MultiSensorFilterTracker`.
    """

    def with_truth(self, truth: Any) -> "Central":
        """Return the tracker with a run's true targets passed to its filter, if the filter takes them, else itself."""
        return replace(self, filter=self.filter.with_truth(truth)) if hasattr(self.filter, "with_truth") else self

    def initial(self) -> State:
        """Return the state without targets."""
        return self._state(self.filter.initial(), 0, None)

    def step(
        self, state: State, scans: Sequence[Any], poses: Any, time: float, *, rngs: Sequence[np.random.Generator]
    ) -> tuple[State, TrackerInfo]:
        """Update the belief with all scans. See `Tracker.step`. Uses only `rngs[0]`."""
        pose_array, dt = check_step(state, scans, poses, time, rngs, self, len(self.sensors))
        timer, step = StageTimer(), state.step + 1
        with timer.timing("filter"):
            belief, info = self._filter(state.fused, state.memory, scans, pose_array, dt, step, rngs[0])
            motion = self.targets.motion
            measured = births_from_scans(self.birth, belief, self.sensors, scans, pose_array, step + 1, motion=motion)
            if dt == 0.0:
                measured = combine_births(self.birth, state.memory, measured)
        sent = tuple(scan_bytes(scan, pose) for scan, pose in zip(scans, pose_array, strict=True))
        return self._state(belief, step, float(time), measured), TrackerInfo((info,), None, timer.seconds, sent)

    def _state(self, belief: Any, step: int, time: float | None, measured: LMB | None = None) -> State:
        undetected = undetected_intensity(belief, self.targets.birth)
        return State((belief,) * len(self.sensors), belief, step, time, measured, undetected)
