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
from vedette.kernels.base.types import Floats
from vedette.simulation.truth import TargetSource


@dataclass(frozen=True, slots=True, eq=False)
class Experiment:
    """The parts of a run.

    Attributes:
        name: of the scenario, for records.
        times: (num_scans,) s of the scans.
        targets: where the true targets come from.
        sensors: the sensors with their local filters.
        poses: (num_sensors, 3 or more) poses at the first scan, all as long as the longest; components that are not a
            sensor's own are 0.
        first_actions: for each sensor, the row of the action that it is under from the start; None: it lies still until
            the first decision.
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
    first_actions: tuple[Floats | None, ...]
    fusion: Fusion[Any, Any] | None
    feedback: bool
    estimate: Callable[[Belief, int], Estimate]
    decision_steps: tuple[int, ...]

    def __post_init__(self) -> None:
        num = len(self.sensors)
        if num == 0 or (self.fusion is None and num > 1):
            raise InputError(f"fusion: expected one for {num} sensors; got none")
        shape = self.poses.shape
        if len(shape) != 2 or len(self.poses) != num or shape[1] < 3 or not np.isfinite(self.poses).all():
            raise InputError(f"poses: expected finite numbers of shape ({num}, 3 or more); got {self.poses.tolist()}")
        if len(self.first_actions) != num:
            raise InputError(f"first_actions: expected {num}, one a sensor; got {len(self.first_actions)}")
        bad = [step for step in self.decision_steps if not 1 <= step <= len(self.times)]
        if bad:
            raise InputError(f"decision_steps: expected scans from 1 to {len(self.times)}; got {bad[0]}")
