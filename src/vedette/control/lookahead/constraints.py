"""Context of constraints at later decisions: poses after earlier courses, and the belief predicted to that time."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from vedette.control.constraints.active import Active, active_of
from vedette.control.constraints.mask import Mask
from vedette.control.constraints.masks import courses_allowed, feasible_action_mask, pairs_allowed
from vedette.control.constraints.protocol import (
    Constraint,
    ConstraintContext,
    TimeInvariantConstraint,
    interaction_range_of,
)
from vedette.control.inputs import predicted_beliefs
from vedette.control.settings import MobileSensor, PlanningSettings
from vedette.densities import LabelledDensity
from vedette.kernels.base.types import Bools, Floats
from vedette.tracking import State


class Stages(NamedTuple):
    """Decisions `stride` pseudo-updates apart. After the last, the horizon of a single decision."""

    depth: int
    stride: int  # pseudo-updates from a decision to the next
    steps: int  # pseudo-updates of the horizon of a decision
    period: float  # s between pseudo-updates

    def num_steps(self, stage: int) -> int:
        """Return the number of pseudo-updates to the end of the horizon of a decision, counted from 1."""
        return (stage - 1) * self.stride + self.steps

    def times(self, stage: int) -> Floats:
        """Return the times in s from a decision to the pseudo-updates by which its courses are distinguished."""
        num = self.steps if stage == self.depth else max(self.stride, self.steps)
        return self.period * np.arange(1.0, num + 1)


class Place(NamedTuple):
    """The pose at which a sensor decides, and its courses from there."""

    pose: Floats  # (pose_dim,)
    courses: Floats  # (num_courses, num_times, pose_dim)
    scans: Bools  # (num_courses, num_times) whether the sensor scans


@dataclass(slots=True, eq=False)
class MultiStepConstraints:
    """Constraints on several decisions.

    Each course is tested from its beginning to the end of its horizon, or to the next decision if that is later.
    """

    constraints: tuple[Constraint, ...]  # at least one
    sensors: tuple[MobileSensor, ...]  # as in the planner
    settings: PlanningSettings  # as in the planner
    state: State  # the present state
    poses: Floats  # (num_sensors, pose_dim) present poses of the sensors
    stages: Stages  # the decisions
    on_pairs: bool = field(init=False)  # whether any constraint concerns pairs of sensors
    _time_invariant: bool = field(init=False)
    _beliefs: dict[int, tuple[LabelledDensity, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.on_pairs = max(map(interaction_range_of, self.constraints)) > 0.0
        self._time_invariant = all(
            isinstance(constraint, TimeInvariantConstraint) and constraint.time_invariant
            for constraint in self.constraints
        )

    def mask(self, places: Mapping[int, Place]) -> Mask:
        """Return the mask of the first decision, relaxed if necessary.

        Raises `InputError` as `feasible_action_mask`.
        """
        return feasible_action_mask(self.constraints, self._situation(1, places))

    def courses(self, sensor: int, stage: int, place: Place) -> tuple[Bools, bool]:
        """Return (num_courses,) the courses that one sensor may take at a decision, and whether they are feasible.

        If no course is feasible, those with the least violation. stage: 1 for the present decision. Constraints see no
        courses of other sensors. Raises `InputError` as `feasible_action_mask`.
        """
        allowed, blocked = courses_allowed(self.constraints, self._situation(stage, {sensor: place}))
        return allowed[sensor], sensor not in blocked

    def pairs(self, stage: int, places: Mapping[int, Place]) -> dict[tuple[int, int], Bools]:
        """Return tables of the pairs of sensors i < j with forbidden courses.

        Raises `InputError` as `feasible_action_mask`.
        """
        return pairs_allowed(self.constraints, self._situation(stage, places))

    def active(self, places: Mapping[int, Place]) -> Active | None:
        """Return the limit on active sensors, from all sensors' courses at a decision. None: all may scan."""
        active_places = [places[s] for s in range(len(places))]
        return active_of(self.constraints, [own.courses for own in active_places], [own.scans for own in active_places])

    def moment(self, stage: int) -> int:
        """Return a key that is equal for decisions at which constraints allow the same courses."""
        return -len(self.stages.times(stage)) if self._time_invariant else stage

    def _situation(self, stage: int, places: Mapping[int, Place]) -> ConstraintContext:
        done, num = (stage - 1) * self.stages.stride, len(self.stages.times(stage))
        if stage not in self._beliefs:
            ahead = predicted_beliefs(self.constraints, self.sensors, self.state, self.settings, done + 1, done + num)
            self._beliefs[stage] = ahead
        poses = self.poses.copy()
        courses = [np.empty((0, num, self.poses.shape[1]))] * len(poses)
        scans = [np.empty((0, num), np.bool_)] * len(poses)
        for s, place in places.items():
            poses[s], courses[s], scans[s] = place
        times = self.stages.period * np.arange(done + 1.0, done + num + 1.0)
        unseen = self.state.unseen if stage == 1 else {}  # later, it depends on the earlier courses
        return ConstraintContext(tuple(courses), times, self._beliefs[stage], poses, tuple(scans), unseen)
