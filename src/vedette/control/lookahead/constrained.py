"""Constraints on several decisions: what they judge a later one by, and the sequences of one sensor that they allow."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from vedette.control.allowed import beliefs_ahead
from vedette.control.constraints import Constraint, Mask, Situation, courses_allowed, mask_of, pairs_allowed
from vedette.control.lookahead.courses import CourseTree, Sequence, Stages, place_of
from vedette.control.settings import MobileSensor, PlanningSettings
from vedette.densities import Labelled
from vedette.kernels.base.types import Bools, Floats

# Places that are looked at, for the dead ends of one sensor. What lies beyond is taken to be open: a decision must not
# wait for the proof that there is no way out.
_MOST_PLACES = 10_000


@dataclass(frozen=True, slots=True, eq=False)
class ConstrainedTree(CourseTree):
    """Sequences of allowed courses; dead ends are left out.

    Where no course is allowed, those that violate constraints least are kept. Of these those are kept after which there
    is the least number of further decisions with no course allowed: a beginning after which nothing is allowed is left
    out, unless that is so after all of them.

    Attributes:
        name, platform, pose, stages: as of `CourseTree`.
        ahead: the constraints.
        sensor: whose courses they are.
        now: (num_courses,) which courses are allowed at the first decision, at least one.
        far_sighted: whether dead ends are left out.
    """

    ahead: Ahead = field(kw_only=True)
    sensor: int = field(kw_only=True)
    now: Bools = field(kw_only=True)
    far_sighted: bool = field(kw_only=True, default=True)
    _places: dict[Sequence, bytes] = field(default_factory=dict)
    _allowed: dict[tuple[bytes, int], Sequence] = field(default_factory=dict)
    _open: dict[tuple[bytes, int], tuple[Sequence, bool]] = field(default_factory=dict)
    _blocked: dict[tuple[bytes, int], int] = field(default_factory=dict)

    @classmethod
    def of(cls, tree: CourseTree, ahead: Ahead, sensor: int, now: Bools) -> ConstrainedTree:
        """The tree without constraints, with some."""
        given = tree.name, tree.platform, tree.pose, tree.stages, tree._found, tree._at_poses
        return cls(*given, ahead=ahead, sensor=sensor, now=now)

    def allowed(self, taken: Sequence) -> Sequence:
        """Those that meet the constraints and lead to no dead end; at least one."""
        key = self.place(taken), len(taken)
        if key not in self._allowed:
            found, _ = self._open_after(taken)
            if self.far_sighted and len(found) > 1 and len(taken) + 1 < self.stages.depth:
                blocked = [self._least_blocked((*taken, course)) for course in found]
                found = tuple(course for course, num in zip(found, blocked, strict=True) if num == min(blocked))
            self._allowed[key] = found
        return self._allowed[key]

    def short_sighted(self) -> ConstrainedTree:
        """The same with its dead ends."""
        return replace(self, far_sighted=False, _allowed={})

    def blocked(self, sequence: Sequence) -> list[int]:
        """The decisions of a sequence but the first, counted from 1, at which no course is allowed."""
        return [k + 1 for k in range(1, len(sequence)) if not self._open_after(sequence[:k])[1]]

    def place(self, taken: Sequence) -> bytes:
        """What is equal where it decides at one place: there it may do the same."""
        if taken not in self._places:
            self._places[taken] = place_of(self.pose_after(taken))
        return self._places[taken]

    def _moment(self, taken: Sequence) -> tuple[bytes, int]:
        """What is equal where constraints allow the same."""
        return self.place(taken), self.ahead.moment(len(taken) + 1)

    def _open_after(self, taken: Sequence) -> tuple[Sequence, bool]:
        """The courses that meet the constraints, or violate them least; and whether they meet them."""
        if not taken:
            return tuple(np.flatnonzero(self.now).tolist()), True
        key = self._moment(taken)
        if key not in self._open:
            allowed, met = self.ahead.courses(self.sensor, len(taken) + 1, Place.after(self, taken))
            self._open[key] = tuple(np.flatnonzero(allowed).tolist()), met
        return self._open[key]

    def _least_blocked(self, taken: Sequence) -> int:
        """The least number of decisions from here on at which no course is allowed."""
        if len(taken) == self.stages.depth:
            return 0
        key = self.place(taken), len(taken)
        if key not in self._blocked:
            if len(self._blocked) >= _MOST_PLACES:
                return 0
            self._blocked[key] = 0  # counted among the places from now on
            found, met = self._open_after(taken)
            ways = [(*taken, course) for course in found]
            if len(taken) + 1 < self.stages.depth:
                # One way out is enough: first those to places that are known.
                ways.sort(key=lambda way: self._moment(way) not in self._open)
            least = self.stages.depth
            for way in ways:
                least = min(least, self._least_blocked(way))
                if least == 0:
                    break
            self._blocked[key] = least + (not met)
        return self._blocked[key]


class Place(NamedTuple):
    """Where a sensor decides, and what it may do there."""

    pose: Floats  # (pose_dim,)
    courses: Floats  # (num_courses, num_times, pose_dim)

    @classmethod
    def after(cls, tree: CourseTree, taken: Sequence) -> Place:
        """The courses taken so far."""
        return cls(tree.pose_after(taken), tree.options(taken).courses)


@dataclass(frozen=True, slots=True, eq=False)
class Ahead:
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
    _timeless: bool = field(init=False)
    _beliefs: dict[int, tuple[Labelled, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        reaches = [getattr(constraint, "reach", math.inf) for constraint in self.constraints]
        object.__setattr__(self, "on_pairs", max(reaches) > 0.0)
        timeless = all(getattr(constraint, "timeless", False) for constraint in self.constraints)
        object.__setattr__(self, "_timeless", timeless)

    def mask(self, places: Mapping[int, Place]) -> Mask:
        """Of the first decision, of all sensors; opened where it has to be. Raises `InputError` as `mask_of`."""
        return mask_of(self.constraints, self._situation(1, places))

    def courses(self, sensor: int, stage: int, place: Place) -> tuple[Bools, bool]:
        """(num_courses,) which courses of one sensor are allowed at a decision, and whether they meet the constraints.

        Where none does, those that violate them least. stage: 1 for the decision now. Other sensors have no courses in
        what constraints are shown. Raises `InputError` as `mask_of`.
        """
        allowed, blocked = courses_allowed(self.constraints, self._situation(stage, {sensor: place}))
        return allowed[sensor], sensor not in blocked

    def pairs(self, stage: int, places: Mapping[int, Place]) -> dict[tuple[int, int], Bools]:
        """The tables of pairs of sensors i < j of which something is forbidden; raises `InputError` as `mask_of`."""
        return pairs_allowed(self.constraints, self._situation(stage, places))

    def moment(self, stage: int) -> int:
        """What is equal for decisions at which the same courses are allowed as far as constraints tell."""
        return -len(self.stages.times(stage)) if self._timeless else stage

    def _situation(self, stage: int, places: Mapping[int, Place]) -> Situation:
        done, num = (stage - 1) * self.stages.stride, len(self.stages.times(stage))
        if stage not in self._beliefs:
            ahead = beliefs_ahead(self.constraints, self.sensors, self.fused, self.settings, done + 1, done + num)
            self._beliefs[stage] = ahead
        poses = self.poses.copy()
        courses = [np.empty((0, num, self.poses.shape[1]))] * len(poses)
        for s, place in places.items():
            poses[s], courses[s] = place.pose, place.courses
        times = self.stages.period * np.arange(done + 1.0, done + num + 1.0)
        return Situation(tuple(courses), times, self._beliefs[stage], poses)
