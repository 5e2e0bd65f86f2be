"""What constraints judge by at a later decision: where courses after earlier ones lead, and what is believed then."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from vedette.control.constraints import (
    Active,
    Constraint,
    ConstraintContext,
    Mask,
    TimeInvariantConstraint,
    active_of,
    courses_allowed,
    feasible_action_mask,
    interaction_range_of,
    pairs_allowed,
)
from vedette.control.inputs import beliefs_ahead
from vedette.control.settings import MobileSensor, PlanningSettings
from vedette.densities import Labelled
from vedette.kernels.base.types import Bools, Floats


class Stages(NamedTuple):
    """Decisions `stride` pseudo-updates apart; after the last, the horizon of a single decision."""

    depth: int
    stride: int  # pseudo-updates from a decision to the next
    steps: int  # pseudo-updates of the horizon of a decision
    period: float  # s between pseudo-updates

    def num_steps(self, stage: int) -> int:
        """Pseudo-updates to the end of the horizon of a decision, counted from 1."""
        return (stage - 1) * self.stride + self.steps

    def times(self, stage: int) -> Floats:
        """s from a decision to the pseudo-updates that its courses are told apart by."""
        num = self.steps if stage == self.depth else max(self.stride, self.steps)
        return self.period * np.arange(1.0, num + 1)


class Place(NamedTuple):
    """Where a sensor decides, and what it may do there."""

    pose: Floats  # (pose_dim,)
    courses: Floats  # (num_courses, num_times, pose_dim)
    scans: Bools  # (num_courses, num_times) whether the sensor scans


@dataclass(slots=True, eq=False)
class MultiStepConstraints:
    """Constraints on several decisions: each is tested from where its courses begin to the end of its horizon, or to
    the next decision where that is later.

    Attributes:
        constraints: at least one.
        sensors, settings: as of the planner.
        fused: the fused belief now.
        poses: (num_sensors, pose_dim) where the sensors are now.
        stages: the decisions.
        on_pairs: whether any constraint has to do with pairs of sensors.
    """

    constraints: tuple[Constraint, ...]
    sensors: tuple[MobileSensor, ...]
    settings: PlanningSettings
    fused: Labelled
    poses: Floats
    stages: Stages
    on_pairs: bool = field(init=False)
    _time_invariant: bool = field(init=False)
    _beliefs: dict[int, tuple[Labelled, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.on_pairs = max(map(interaction_range_of, self.constraints)) > 0.0
        self._time_invariant = all(
            isinstance(own, TimeInvariantConstraint) and own.time_invariant for own in self.constraints
        )

    def mask(self, places: Mapping[int, Place]) -> Mask:
        """Mask of the first decision, relaxed if necessary. Raises `InputError` as `feasible_action_mask`."""
        return feasible_action_mask(self.constraints, self._situation(1, places))

    def courses(self, sensor: int, stage: int, place: Place) -> tuple[Bools, bool]:
        """(num_courses,) which courses of one sensor are allowed at a decision, and whether they meet the constraints.

        Where none does, those that violate them least. stage: 1 for the decision now. Other sensors have no courses in
        what constraints are shown. Raises `InputError` as `feasible_action_mask`.
        """
        allowed, blocked = courses_allowed(self.constraints, self._situation(stage, {sensor: place}))
        return allowed[sensor], sensor not in blocked

    def pairs(self, stage: int, places: Mapping[int, Place]) -> dict[tuple[int, int], Bools]:
        """Tables of pairs of sensors i < j with forbidden courses; raises `InputError` as `feasible_action_mask`."""
        return pairs_allowed(self.constraints, self._situation(stage, places))

    def active(self, places: Mapping[int, Place]) -> Active | None:
        """How many sensors may scan, of all sensors' courses at a decision; None: all."""
        found = [places[s] for s in range(len(places))]
        return active_of(self.constraints, [own.courses for own in found], [own.scans for own in found])

    def moment(self, stage: int) -> int:
        """What is equal for decisions at which the same courses are allowed as far as constraints tell."""
        return -len(self.stages.times(stage)) if self._time_invariant else stage

    def _situation(self, stage: int, places: Mapping[int, Place]) -> ConstraintContext:
        done, num = (stage - 1) * self.stages.stride, len(self.stages.times(stage))
        if stage not in self._beliefs:
            ahead = beliefs_ahead(self.constraints, self.sensors, self.fused, self.settings, done + 1, done + num)
            self._beliefs[stage] = ahead
        poses = self.poses.copy()
        courses = [np.empty((0, num, self.poses.shape[1]))] * len(poses)
        scans = [np.empty((0, num), np.bool_)] * len(poses)
        for s, place in places.items():
            poses[s], courses[s], scans[s] = place
        times = self.stages.period * np.arange(done + 1.0, done + num + 1.0)
        return ConstraintContext(tuple(courses), times, self._beliefs[stage], poses, tuple(scans))
