"""Experiment: everything a run needs except a planner and a seed."""

from dataclasses import dataclass, field

import numpy as np

from vedette.densities import Estimator
from vedette.errors import InputError
from vedette.internal.representation import SummaryRepr
from vedette.kernels.base.types import Bools, Floats
from vedette.models.arguments import pose_vector, reject
from vedette.platforms import Fleet, Platform
from vedette.simulation.true_sensors import TrueSensor, sensors_at_step, true_sensors_of
from vedette.simulation.truth import TargetSource
from vedette.tracking import Tracker


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Experiment(SummaryRepr):
    """The parts of a run.

    Attributes:
        name: name of the scenario, for records.
        times: (num_scans,) times of the scans, s.
        targets: source of the true targets.
        tracker: the tracker.
        platforms: platform of each sensor.
        poses: (num_sensors, 3 or more) poses at the first scan, all as long as the longest. Components that a sensor
            does not have are 0.
        first_actions: per sensor, the row of its initial action. None: it does not move until the first decision.
        estimate: extracts the targets from the fused density, given the number of the scan (from 1).
        decision_steps: scans (counted from 1) that are followed by a decision.
        true_sensors: the sensors that scan. (): they equal the sensor models of the tracker.
        scans_at: (num_sensors, num_scans or more) whether each sensor scans. None: at every step.
        scan_loss_probability: probability of each sensor that a scan is lost. (): none.
        explain: whether decisions are stored with their explanations, see `vedette.control.Plan.explain`.

    Raises:
        InputError: parts that do not fit together.
    """

    name: str
    times: Floats
    targets: TargetSource
    tracker: Tracker
    platforms: tuple[Platform, ...]
    poses: Floats
    first_actions: tuple[Floats | None, ...]
    estimate: Estimator
    decision_steps: tuple[int, ...]
    true_sensors: tuple[TrueSensor, ...] = ()
    scans_at: Bools | None = None
    scan_loss_probability: tuple[float, ...] = ()
    explain: bool = True
    _scanning: tuple[TrueSensor, ...] = field(init=False, default=())

    def __post_init__(self) -> None:
        if not isinstance(self.tracker, Tracker):
            raise reject("tracker", "a Tracker, with targets, sensors, initial() and step()", self.tracker)
        num = self.num_sensors
        if len(self.platforms) != num:
            raise InputError(
                f"platforms: expected {num}, one for each sensor of the tracker; got {len(self.platforms)}"
            )
        shape = self.poses.shape
        if len(shape) != 2 or len(self.poses) != num or shape[1] < 3 or not np.isfinite(self.poses).all():
            raise InputError(f"poses: expected finite numbers of shape ({num}, 3 or more); got {self.poses.tolist()}")
        for s, pose in enumerate(self.poses):
            pose_vector(f"poses[{s}]", pose)
        if len(self.first_actions) != num:
            raise InputError(f"first_actions: expected {num}, one a sensor; got {len(self.first_actions)}")
        bad = [step for step in self.decision_steps if not 1 <= step <= len(self.times)]
        if bad:
            raise InputError(f"decision_steps: expected scans from 1 to {len(self.times)}; got {bad[0]}")
        object.__setattr__(self, "_scanning", true_sensors_of(self.true_sensors, self.tracker.sensors))
        losses = self.scan_loss_probability
        if losses and (len(losses) != num or not all(0.0 <= loss < 1.0 for loss in losses)):
            raise InputError(f"scan_loss_probability: expected {num} numbers below 1, one per sensor; got {losses}")
        if self.scans_at is not None:
            self._check_scans_at(np.asarray(self.scans_at))

    def _check_scans_at(self, table: Bools) -> None:
        expected = f"booleans of shape ({self.num_sensors}, {len(self.times)} or more)"
        if table.dtype != np.bool_ or table.ndim != 2:
            raise InputError(f"scans_at: expected {expected}; got {table.dtype} of shape {table.shape}")
        if len(table) != self.num_sensors or table.shape[1] < len(self.times):
            raise InputError(f"scans_at: expected {expected}; got shape {table.shape}")

    @property
    def num_sensors(self) -> int:
        """Number of sensors."""
        return len(self.tracker.sensors)

    def sensors_at(self, step: int, scans_at: Bools | None = None) -> tuple[TrueSensor | None, ...]:
        """Return the true sensors at a step (from 1), or None for one that does not scan then.

        scans_at: scans of the run, see `vedette.simulation.loop.scan_flags_of_run`. None: without lost scans.
        """
        times = self.scans_at if scans_at is None else scans_at
        return sensors_at_step(self._scanning, times, step)

    def fleet(self, *, moving: bool = True) -> Fleet:
        """Return the platforms at the first scan. Without an initial action, or if not `moving`, they do not move."""
        actions = self.first_actions if moving else (None,) * self.num_sensors
        return Fleet(self.platforms, self.poses, actions, float(self.times[0]))
