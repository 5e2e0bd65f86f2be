"""Every sensor filters its own scans, and the beliefs are fused (paper, Algorithm 1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vedette.errors import InputError
from vedette.filters import Filter, shared_targets
from vedette.fusion import Fusion
from vedette.models import SensorModel, TargetModel
from vedette.models.arguments import reject
from vedette.tracking.base import State, TrackerInfo, check_step
from vedette.tracking.stages import Stages


@dataclass(frozen=True, slots=True, eq=False)
class Distributed:
    """A filter at each sensor, and a fusion of what they believe.

    Attributes:
        filters: one a sensor; all hold the same targets.
        fusion: of their beliefs, after every scan; None for a single sensor.
        feedback: whether the fused belief replaces the sensors' own (paper-notes 9).

    Raises:
        InputError: no filter or something else, filters of different targets, several sensors without a fusion.
    """

    filters: tuple[Filter, ...]
    fusion: Fusion | None = None
    feedback: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "filters", tuple(self.filters))
        if not self.filters:
            raise InputError("filters: expected at least one; got none")
        for s, local in enumerate(self.filters):
            if not isinstance(local, Filter):
                raise reject(f"filters[{s}]", "a Filter, with targets, sensor, initial() and step()", local)
        shared_targets(self.filters)
        if self.fusion is None and len(self.filters) > 1:
            raise InputError(f"fusion: expected one for {len(self.filters)} sensors; got none")

    @property
    def targets(self) -> TargetModel:
        """The targets as all sensors know them."""
        return shared_targets(self.filters)

    @property
    def sensors(self) -> tuple[SensorModel, ...]:
        """What each sensor sees."""
        return tuple(local.sensor for local in self.filters)

    def initial(self) -> State:
        """No target anywhere; the fused belief is then the first sensor's."""
        local = tuple(local.initial() for local in self.filters)
        return State(local, local[0])

    def step(
        self, state: State, scans: Sequence[Any], poses: Any, time: float, *, rngs: Sequence[np.random.Generator]
    ) -> tuple[State, TrackerInfo]:
        """Filter each sensor's scan, then fuse; see `Tracker.step`."""
        at, dt = check_step(state, scans, poses, time, rngs, len(self.filters))
        step, stages, local, infos = state.step + 1, Stages(), [], []
        for s, own in enumerate(self.filters):
            with stages.timing("filter", s):
                belief, info = own.step(state.local[s], scans[s], at[s], dt, step, rng=rngs[s])
            local.append(belief)
            infos.append(info)
        fused, report = local[0], None
        if self.fusion is not None:
            with stages.timing("fusion"):
                fused, report = self.fusion.fuse(local)
        if self.feedback:
            local = [fused] * len(local)
        return State(tuple(local), fused, step, float(time)), TrackerInfo(tuple(infos), report, stages.seconds)
