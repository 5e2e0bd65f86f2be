"""The protocol of constraints, and what they judge by."""

from __future__ import annotations

import math
from itertools import accumulate
from typing import NamedTuple, Protocol, TypeVar, runtime_checkable

import numpy as np

from vedette.densities import Labelled
from vedette.kernels.base.types import Bools, Floats
from vedette.models.arguments import provides

_Values = TypeVar("_Values", Bools, Floats)


class ConstraintContext(NamedTuple):
    """What constraints judge by. Positions are the first two components of a pose and of a state, m.

    courses: (num_courses, num_times, pose_dim) where each course takes its sensor, one array a sensor.
    times: (num_times,) s from now.
    beliefs: the fused belief predicted to each of `times`, one Gaussian a track; () where no constraint needs it.
    poses: (num_sensors, pose_dim) where the sensors are now, from which the way to the first of `times` begins; None:
        nothing is asked of that way.
    scans: (num_courses, num_times) whether each course lets its sensor scan, one array a sensor; (): not known.
    """

    courses: tuple[Floats, ...]
    times: Floats
    beliefs: tuple[Labelled, ...] = ()
    poses: Floats | None = None
    scans: tuple[Bools, ...] = ()

    def ways(self, sensor: int) -> Floats:
        """(num_courses, num_points, 2) corners of the ways of one sensor: where it is now, if known, and later."""
        if self.poses is None:
            return self.courses[sensor][:, :, :2]
        return with_start(self.courses[sensor][:, :, :2], self.poses[sensor, :2])

    def is_fixed(self, sensor: int) -> bool:
        """Whether no course of a sensor takes it anywhere; not where `poses` is not known."""
        return self.poses is not None and bool((self.courses[sensor][:, :, :2] == self.poses[sensor, :2]).all())

    def of_movable(self, values: Floats) -> tuple[Floats, ...]:
        """As `split`, but 0 for sensors that go nowhere: a radar may stand on land that is forbidden to boats."""
        return tuple(np.zeros_like(own) if self.is_fixed(s) else own for s, own in enumerate(self.split(values)))

    def split(self, values: _Values) -> tuple[_Values, ...]:
        """Values of all sensors' courses (sum of num_courses,), one sensor's after another's, as an array a sensor."""
        ends = list(accumulate(len(own) for own in self.courses))
        return tuple(np.split(values, ends[:-1]))


@runtime_checkable
class Constraint(Protocol):
    """Says which courses a sensor may take, and which courses of two sensors go together.

    It may have more members: those of `RangeLimitedConstraint`, `TimeInvariantConstraint`, `QuantifiedConstraint`,
    `ZoneConstraint` and `ActivationConstraint`. Decisions over several
    periods show it one sensor, or two, at a time: the others have no courses then.
    """

    @property
    def name(self) -> str:
        """What it is called in messages."""
        ...

    @property
    def needs_beliefs(self) -> bool:
        """Whether it looks at `ConstraintContext.beliefs`."""
        ...

    def courses(self, situation: ConstraintContext) -> tuple[Bools, ...]:
        """(num_courses,) which courses each sensor may take, one array a sensor."""
        ...

    def pairs(self, situation: ConstraintContext, first: int, second: int) -> Bools | None:
        """(num_courses of first, of second) which courses of two sensors go together; None: all."""
        ...


@runtime_checkable
class RangeLimitedConstraint(Protocol):
    """A constraint that is asked about pairs of sensors only where they may come near each other."""

    @property
    def interaction_range(self) -> float:
        """m; so near some two of their courses might come. 0: it is asked about none; without it, about all."""
        ...


@runtime_checkable
class TimeInvariantConstraint(Protocol):
    """A constraint that decisions over several periods may ask once about each place."""

    @property
    def time_invariant(self) -> bool:
        """Whether answers hang on poses and courses alone, neither on times nor on beliefs; without it: no."""
        ...


@runtime_checkable
class QuantifiedConstraint(Protocol):
    """A constraint that says how much courses violate it; otherwise one that is not allowed counts 1.

    Where a sensor has no course that all constraints allow, it may take those of the least sum.
    """

    def violations(self, situation: ConstraintContext) -> tuple[Floats, ...]:
        """(num_courses,) how much each course violates it, one array a sensor; above 0 where it is not allowed."""
        ...


@runtime_checkable
class ZoneConstraint(Protocol):
    """A constraint that forbids an area at all times, round which plans look for ways beyond their horizon."""

    @property
    def zone(self) -> tuple[Floats, ...]:
        """Polygons (num_corners, 2), m: forbidden is what is inside of them by the even-odd rule, and their edges."""
        ...


@runtime_checkable
class ActivationConstraint(Protocol):
    """A constraint on how many sensors may scan after a decision."""

    @property
    def most_active(self) -> int:
        """Number of sensors, at least 1."""
        ...


def interaction_range_of(constraint: Constraint) -> float:
    """m; what lies within it is asked of pairs of sensors, see `RangeLimitedConstraint`."""
    return constraint.interaction_range if provides(constraint, RangeLimitedConstraint) else math.inf


class PerSensorConstraint:
    """A constraint on each sensor: any courses go together. What violates it by more than 0 is forbidden."""

    __slots__ = ()
    reach = 0.0

    def violations(self, situation: ConstraintContext) -> tuple[Floats, ...]:
        """(num_courses,) how much each course violates it, one array a sensor."""
        raise NotImplementedError

    def courses(self, situation: ConstraintContext) -> tuple[Bools, ...]:
        """Those that do not violate it."""
        return tuple(np.asarray(own == 0.0) for own in self.violations(situation))

    def pairs(self, situation: ConstraintContext, first: int, second: int) -> Bools | None:
        """All."""
        return None


def with_start(ways: Floats, start: Floats) -> Floats:
    """(num_courses, num_times + 1, 2) ways (num_courses, num_times, 2) that begin at `start` (2,)."""
    found = np.empty((len(ways), ways.shape[1] + 1, 2))
    found[:, 0], found[:, 1:] = start, ways
    return found


def least_on_legs(x: Floats, y: Floats) -> Floats:
    """(..., num_points - 1) least squared length of vectors that go straight and evenly from one to the next.

    x, y: (..., num_points). It is least at the foot of the origin on their line, or at an end.
    """
    from_x, from_y = x[..., :-1], y[..., :-1]
    leg_x, leg_y = x[..., 1:] - from_x, y[..., 1:] - from_y
    length = leg_x * leg_x + leg_y * leg_y
    share = -(from_x * leg_x + from_y * leg_y) / np.maximum(length, np.finfo(float).tiny)
    share = np.minimum(np.maximum(share, 0.0), 1.0)
    return np.asarray((from_x + share * leg_x) ** 2 + (from_y + share * leg_y) ** 2)
