"""The protocol of constraints, and the data that they are evaluated on."""

import math
from itertools import accumulate
from typing import NamedTuple, Protocol, TypeVar, runtime_checkable

import numpy as np

from vedette.densities import LabelledDensity
from vedette.kernels.base.types import Bools, Floats
from vedette.models.arguments import provides

_Values = TypeVar("_Values", Bools, Floats)


class ConstraintContext(NamedTuple):
    """The data that constraints are evaluated on. Positions are the first two components of a pose and of a state, m.

    courses: (num_courses, num_times, pose_dim) poses of each course, one array per sensor.
    times: (num_times,) s from now.
    beliefs: the fused belief predicted to each of `times`, one Gaussian per track, or () if no constraint needs it.
    poses: (num_sensors, pose_dim) present poses, from which the way to the first of `times` starts. None: this way is
        not tested.
    scans: (num_courses, num_times) whether each course lets its sensor scan, one array per sensor. (): not known.
    unseen: seconds since a scan had each label in view (`State.unseen`). None: not known.
    """

    courses: tuple[Floats, ...]
    times: Floats
    beliefs: tuple[LabelledDensity, ...] = ()
    poses: Floats | None = None
    scans: tuple[Bools, ...] = ()
    unseen: dict[tuple[int, int], float] | None = None

    def ways(self, sensor: int) -> Floats:
        """Return (num_courses, num_points, 2) the corners of one sensor's ways.

        They begin at its present position, if it is known.
        """
        if self.poses is None:
            return self.courses[sensor][:, :, :2]
        return with_start(self.courses[sensor][:, :, :2], self.poses[sensor, :2])

    def is_fixed(self, sensor: int) -> bool:
        """Return True if no course moves the sensor, False if `poses` is not known."""
        return self.poses is not None and bool((self.courses[sensor][:, :, :2] == self.poses[sensor, :2]).all())

    def of_movable(self, values: Floats) -> tuple[Floats, ...]:
        """Return the values as `split`, but 0 for sensors that cannot move.

        A fixed radar may stand on land that is forbidden to boats.
        """
        return tuple(np.zeros_like(own) if self.is_fixed(s) else own for s, own in enumerate(self.split(values)))

    def split(self, values: _Values) -> tuple[_Values, ...]:
        """Return values of all sensors' courses (sum of num_courses,), in sensor order, as one array per sensor."""
        ends = list(accumulate(len(own) for own in self.courses))
        return tuple(np.split(values, ends[:-1]))


@runtime_checkable
class Constraint(Protocol):
    """A constraint on the courses of each sensor, and on pairs of courses of two sensors.

    It may have optional members: those of `RangeLimitedConstraint`, `TimeInvariantConstraint`, `QuantifiedConstraint`,
    `ZoneConstraint` and `ActivationConstraint`. Decisions over several periods evaluate it for one or two sensors at a
    time. The other sensors then have no courses.
    """

    @property
    def name(self) -> str:
        """Name of the constraint in messages."""

    @property
    def needs_beliefs(self) -> bool:
        """Whether it uses `ConstraintContext.beliefs`."""

    def courses(self, situation: ConstraintContext) -> tuple[Bools, ...]:
        """Return (num_courses,) the allowed courses of each sensor, one array per sensor."""

    def pairs(self, situation: ConstraintContext, first: int, second: int) -> Bools | None:
        """Return (num_courses of first, of second) the compatible courses of two sensors. None: all."""


@runtime_checkable
class RangeLimitedConstraint(Protocol):
    """A constraint on pairs of sensors that is evaluated only for pairs that may come close to each other."""

    @property
    def interaction_range(self) -> float:
        """Distance in m within which courses may be incompatible. 0: never. Without this member there is no limit."""


@runtime_checkable
class TimeInvariantConstraint(Protocol):
    """A constraint that decisions over several periods may evaluate once per place."""

    @property
    def time_invariant(self) -> bool:
        """Whether answers depend only on poses and courses, not on times or beliefs, False without this member."""


@runtime_checkable
class QuantifiedConstraint(Protocol):
    """A constraint that gives the amount by which courses violate it. Without it a forbidden course counts 1.

    If a sensor has no course that all constraints allow, it may take those with the smallest sum of violations.
    """

    def violations(self, situation: ConstraintContext) -> tuple[Floats, ...]:
        """Return (num_courses,) the violation of each course, one array per sensor, above 0 if it is not allowed."""


@runtime_checkable
class ZoneConstraint(Protocol):
    """A constraint that forbids an area at all times. Plans find paths around it beyond their horizon."""

    @property
    def zone(self) -> tuple[Floats, ...]:
        """Polygons (num_corners, 2), m, whose interior by the even-odd rule is forbidden, edges included."""


@runtime_checkable
class ActivationConstraint(Protocol):
    """A constraint on the number of sensors that may scan after a decision."""

    @property
    def most_active(self) -> int:
        """Number of sensors, at least 1."""


def interaction_range_of(constraint: Constraint) -> float:
    """Return the distance in m within which a constraint may forbid pairs. See `RangeLimitedConstraint`."""
    return constraint.interaction_range if provides(constraint, RangeLimitedConstraint) else math.inf


class PerSensorConstraint:
    """A constraint on each sensor alone: a violation above 0 is forbidden, and all pairs of courses are compatible."""

    __slots__ = ()
    interaction_range = 0.0

    def violations(self, situation: ConstraintContext) -> tuple[Floats, ...]:
        """Return (num_courses,) the violation of each course, one array per sensor."""
        raise NotImplementedError

    def courses(self, situation: ConstraintContext) -> tuple[Bools, ...]:
        """Return the courses without violation."""
        return tuple(np.asarray(own == 0.0) for own in self.violations(situation))

    def pairs(self, situation: ConstraintContext, first: int, second: int) -> Bools | None:
        """Return None: all pairs of courses are compatible."""
        return None


def with_start(ways: Floats, start: Floats) -> Floats:
    """Return ways (num_courses, num_times + 1, 2) that begin at `start` (2,), from ways (num_courses, num_times, 2)."""
    extended = np.empty((len(ways), ways.shape[1] + 1, 2))
    extended[:, 0], extended[:, 1:] = start, ways
    return extended


def least_on_legs(x: Floats, y: Floats) -> Floats:
    """Return the least squared length (..., num_points - 1) of vectors that move linearly from each point to the next.

    x, y: (..., num_points). The least length is at the foot of the perpendicular from the origin, or at an end.
    """
    from_x, from_y = x[..., :-1], y[..., :-1]
    leg_x, leg_y = x[..., 1:] - from_x, y[..., 1:] - from_y
    length = leg_x * leg_x + leg_y * leg_y
    share = -(from_x * leg_x + from_y * leg_y) / np.maximum(length, np.finfo(float).tiny)
    share = np.minimum(np.maximum(share, 0.0), 1.0)
    return np.asarray((from_x + share * leg_x) ** 2 + (from_y + share * leg_y) ** 2)
