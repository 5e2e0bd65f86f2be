"""Limit on the number of sensors that may scan after a decision."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from vedette.control.constraints.protocol import (
    ActivationConstraint,
    Constraint,
    ConstraintContext,
    PerSensorConstraint,
)
from vedette.kernels.base.types import BUDGET, Bools, Floats, Ints
from vedette.models.arguments import provides
from vedette.models.fields import Checked, Count, part


@part("max_active", "constraint")
@dataclass(frozen=True, slots=True)
class MaxActive(PerSensorConstraint, Checked):
    """A limit on the number of sensors that scan after a decision. The others take an action that switches them off.

    Each course of a sensor that can be switched is listed a second time without scans. The constraint therefore forbids
    no course and no pair of courses by itself: the planner chooses which sensors scan.

    Attributes:
        sensors: largest number of sensors that scan.
    """

    sensors: Count
    name: ClassVar[str] = "max_active"
    needs_beliefs: ClassVar[bool] = False
    time_invariant = True

    @property
    def most_active(self) -> int:
        """Largest number of sensors that scan."""
        return self.sensors

    def violations(self, situation: ConstraintContext) -> tuple[Floats, ...]:
        """Return 0 for all courses."""
        return tuple(np.zeros(len(own)) for own in situation.courses)


class Active(NamedTuple):
    """The courses that scan, and the number of sensors that may scan."""

    on: tuple[Bools, ...]  # (num_courses,) whether each course scans, one array per sensor
    # (num_courses,) index of the course with the same poses that does not scan, or the course itself if it does not
    # scan, or if its sensor cannot be switched off
    off: tuple[Ints, ...]
    limit: int  # number of sensors that may scan

    def excess(self, actions: Ints) -> Ints:
        """Return (num,) the number of sensors that scan beyond the limit in joint actions (num, num_sensors)."""
        num_scanning = np.zeros(len(actions), np.int64)
        for s, own in enumerate(self.on):
            num_scanning += own[actions[:, s]]
        return np.maximum(num_scanning - self.limit, 0)

    def is_full(self, at: Sequence[int], sensor: int) -> bool:
        """Return True if no further sensor may scan, given the other sensors' courses. Below 0: undecided, and off."""
        return sum(bool(self.on[s][own]) for s, own in enumerate(at) if s != sensor and own >= 0) >= self.limit

    def within_limit(self, at: Sequence[int], gains: Sequence[float] | None = None) -> tuple[int, ...]:
        """Return a joint action in which sensors beyond `limit` are off, on courses of the same poses.

        gains: value of each sensor's scans. The sensors with the largest keep scanning, of equal ones the first. None:
        sensors keep scanning in order from a sensor that depends on the joint action, so that random draws favour no
        sensor.
        """
        scanning = [s for s, course in enumerate(at) if self.on[s][course]]
        if len(scanning) <= self.limit:
            return tuple(at)
        fixed = {s for s in scanning if self.off[s][at[s]] == at[s]}
        if gains is None:
            first = sum(at) % len(at)
            order = sorted(scanning, key=lambda s: (s not in fixed, (s - first) % len(at)))
        else:
            order = sorted(scanning, key=lambda s: (s not in fixed, -gains[s], s))
        still_scanning = set(order[: self.limit])
        return tuple(course if s in still_scanning else int(self.off[s][course]) for s, course in enumerate(at))


def active_of(constraints: Sequence[Constraint], courses: Sequence[Floats], scans: Sequence[Bools]) -> Active | None:
    """Return the limit on active sensors given by constraints, or None if there is no limit or scans are not known.

    courses: (num_courses, num_times, pose_dim) for each sensor. scans: (num_courses, num_times) whether they scan.
    """
    numbers = [constraint.most_active for constraint in constraints if provides(constraint, ActivationConstraint)]
    if not numbers or not scans:
        return None
    on = tuple(np.asarray(sensor_scans.any(axis=1)) for sensor_scans in scans)
    return Active(on, tuple(map(_twins, courses, on)), min(numbers))


def _twins(courses: Floats, on: Bools) -> Ints:
    """Return (num_courses,) indices as in `Active.off`."""
    twins, silent = np.arange(len(courses)), np.flatnonzero(~on)
    poses = np.delete(courses, BUDGET, axis=2) if courses.shape[2] > BUDGET else courses
    of_pose = {poses[course].tobytes(): course for course in silent[::-1].tolist()}
    for course in np.flatnonzero(on).tolist():
        twins[course] = of_pose.get(poses[course].tobytes(), course)
    return twins
