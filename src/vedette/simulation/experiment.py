"""A simulated world with the trackers in it: everything a run needs but a planner and a seed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from vedette.control import MobileSensor
from vedette.densities import Estimate
from vedette.errors import InputError
from vedette.filters import Belief
from vedette.fusion import Fusion
from vedette.kernels.base.types import Bools, Floats
from vedette.simulation.truth import TargetSource


@dataclass(frozen=True, slots=True, eq=False)
class Experiment:
    """The parts of a run.

    Attributes:
        name: of the scenario, for records.
        times: (num_scans,) s of the scans.
        targets: where the true targets come from.
        sensors: the sensors with their local filters.
        poses: (num_sensors, 3) poses at the first scan.
        moving: (num_sensors,) whether a sensor is under way from the start; the others lie still until the first
            decision.
        fusion: of the local beliefs; None for a single sensor.
        feedback: whether the fused belief replaces the local ones (paper-notes 9).
        estimate: reads the targets off the fused belief, given the number of the scan (from 1).
        decision_steps: scans (counted from 1) after which the planner is asked.

    Raises:
        InputError: parts that do not fit together.
    """

    name: str
    times: Floats
    targets: TargetSource
    sensors: tuple[MobileSensor, ...]
    poses: Floats
    moving: Bools
    fusion: Fusion[Any, Any] | None
    feedback: bool
    estimate: Callable[[Belief, int], Estimate]
    decision_steps: tuple[int, ...]

    def __post_init__(self) -> None:
        num = len(self.sensors)
        if num == 0 or (self.fusion is None and num > 1):
            raise InputError(f"fusion: expected one for {num} sensors; got none")
        if self.poses.shape != (num, 3) or not np.isfinite(self.poses).all():
            raise InputError(f"poses: expected finite numbers of shape ({num}, 3); got {self.poses.tolist()}")
        if self.moving.shape != (num,):
            raise InputError(f"moving: expected {num} flags; got shape {self.moving.shape}")
        bad = [step for step in self.decision_steps if not 1 <= step <= len(self.times)]
        if bad:
            raise InputError(f"decision_steps: expected scans from 1 to {len(self.times)}; got {bad[0]}")
