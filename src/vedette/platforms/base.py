"""The protocol of platforms, their actions as rows of named numbers, and the options of a sensor at a decision.

This is the only place where results of platforms are validated.
"""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np

from vedette.errors import InputError
from vedette.internal.representation import SummaryRepr
from vedette.internal.text import pluralise
from vedette.kernels.base.types import Bools, Floats, Ints
from vedette.models.arguments import as_array, float_array, provides, reject, sequence

# Poses closer than this, relative to their size, are the same: rounding of degrees to radians and back stays below.
_SAME_POSE = 1e-9

SWITCH = "on"  # the column of actions for the switch of the sensor: 1: on, 0: off


def switch_words(column: str, value: float) -> str:
    """Return `on` or `off` for the column `on`, or `off at decision 2` for `on_2`, and empty for other columns."""
    name, _, decision = column.partition("_")
    if name != SWITCH or (column != name and not decision.isdigit()):
        return ""
    return ("on" if value else "off") + (f" at decision {decision}" if decision else "")


class Options(NamedTuple):
    """The options of one sensor at a decision.

    actions: all actions, in the order of tables.
    courses: (num_courses, num_times, pose_dim) the distinct courses that they lead to, in the order of their first
        actions.
    which: (num_actions,) the course of each action.
    pose: (pose_dim,) present pose.
    prices: (num_courses,) in units of the reward. All actions of a course have the same price.
    scans: (num_courses, num_times) whether the actions of each course let the sensor scan.
    """

    actions: "Actions"
    courses: Floats
    which: Ints
    pose: Floats
    prices: Floats
    scans: Bools

    def first_action(self, course: int) -> int:
        """Return the first action that leads to a course."""
        return int(np.flatnonzero(self.which == course)[0])

    def at(self, times: slice) -> "Options":
        """Return the options at some of the times of their courses."""
        return self._replace(courses=np.ascontiguousarray(self.courses[:, times]), scans=self.scans[:, times])


class Abilities(NamedTuple):
    """The optional members that a platform has beyond those of `Platform`."""

    takes_many_actions: bool
    has_prices: bool
    has_scans: bool

    @classmethod
    def of(cls, platform: "Platform") -> "Abilities":
        """Return the abilities of a platform."""
        return cls(*[provides(platform, more) for more in (SupportsManyActions, HasPrices, HasScans)])


def options_at(
    field: str, platform: "Platform", pose: Floats, times: Floats, abilities: Abilities | None = None
) -> Options:
    """Return the options of a platform at a pose, distinguished by price, poses and scans at `times`, in s from now.

    abilities: of the platform, if known. Raises `InputError`, with the name of the platform, for invalid actions,
    courses, prices or scans.
    """
    can, actions = abilities or Abilities.of(platform), actions_at(field, platform, pose)
    num = len(actions.values)
    courses = courses_of(field, platform, pose, actions.values, times, can)
    prices = prices_of(field, platform, actions.values) if can.has_prices else np.zeros(num)
    scans = np.ones((num, len(times)), np.bool_)
    if can.has_scans:
        scans = scans_of(field, platform, pose, actions.values, times)
    same = _same(courses) & (prices[:, np.newaxis] == prices) & (scans[:, np.newaxis] == scans).all(axis=2)
    own, which = np.unique(same.argmax(axis=1), return_inverse=True)  # the course itself, if none before it is equal
    return Options(actions, courses[own], which, pose, prices[own], scans[own])


def _same(courses: Floats) -> Bools:
    """Return (num, num) whether courses are equal up to rounding and headings up to full turns.

    Tolerances are relative to the second course.
    """
    num = len(courses)
    equal = np.ones((num, num), np.bool_)
    for component in range(courses.shape[2]):
        values = courses[:, :, component]
        off = np.abs(values[:, np.newaxis] - values)
        if component == 2:
            off = np.abs(np.remainder(off + math.pi, 2.0 * math.pi) - math.pi)
        equal &= (off <= _SAME_POSE * np.maximum(1.0, np.abs(values))[:, np.newaxis]).all(axis=2)
    return equal


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Actions(SummaryRepr):
    """The possible actions of one sensor, one per row.

    Attributes:
        columns: names of the numbers of an action: `heading_deg`, an absolute heading counter-clockwise from +x, or the
            names that the platform gives. Units other than SI units are part of the name.
        values: (num_actions, num_columns), in the order of tables.

    Raises:
        InputError: no action, or numbers that are not finite or not one per column.
    """

    columns: tuple[str, ...]
    values: Floats

    def __post_init__(self) -> None:
        object.__setattr__(self, "columns", sequence("actions.columns", self.columns, "names of columns"))
        values = float_array("actions.values", self.values, (None, len(self.columns)))
        if len(values) == 0:
            raise InputError("actions.values: expected at least one action; got none")
        object.__setattr__(self, "values", values)

    @classmethod
    def of(cls, **numbers: float) -> "Actions":
        """Return a single action, as in `Actions.of(heading_deg=30.0)`."""
        return cls(tuple(numbers), np.array([list(numbers.values())]))

    def __len__(self) -> int:
        return len(self.values)

    def _summary(self) -> str:
        return f"of {pluralise(len(self), 'choice')}: {', '.join(self.columns)}"

    def differences(self, values: Floats) -> Floats:
        """Return absolute differences from other values, (num_actions, num_columns), of angles modulo full turns."""
        off = np.abs(self.values - values)
        turns = [name.endswith("_deg") for name in self.columns]
        off[:, turns] = np.abs(np.remainder(off[:, turns] + 180.0, 360.0) - 180.0)
        return np.asarray(off)

    def text(self, index: int) -> str:
        """Return one action as text, such as `heading_deg 30, speed 5`.

        A switch is `on` or `off`, in sequences with the decision.
        """
        numbers = zip(self.columns, self.values[index].tolist(), strict=True)
        return ", ".join(switch_words(name, value) or f"{name} {round(value, 6):g}" for name, value in numbers)


@runtime_checkable
class Platform(Protocol):
    """Platform of a sensor: its possible actions, and the poses that follow.

    A pose is [px, py, heading_rad, ...]. All sensors of a run have poses of the same length, the largest of any.
    Components that a platform does not use are 0. A platform receives them too, and need not return them.
    """

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of an action's numbers, such as `("heading_deg",)`. See `Actions`."""

    def actions(self, pose: Floats) -> Floats:
        """Return (num_actions, num_columns) the possible actions at `pose`, at least one, in the order of tables."""

    def course(self, pose: Floats, action: Floats, times: Floats) -> Floats:
        """Return (num_times, 3 or more) the poses `times` seconds after it began `action` at `pose`.

        action: one row of `actions`. Components of the pose beyond those returned stay as they are.
        """


@runtime_checkable
class SupportsManyActions(Protocol):
    """A platform that computes the courses of many actions at once, equal to those of `Platform.course`."""

    def courses(self, pose: Floats, actions: Floats, times: Floats) -> Floats:
        """Return (num_actions, num_times, 3 or more) poses for actions (num_actions, num_columns)."""


@runtime_checkable
class HasPrices(Protocol):
    """A platform whose actions have prices, which planners subtract from rewards. Actions of others cost nothing."""

    def prices(self, actions: Floats) -> Floats:
        """Return prices (num_actions,) in units of the reward, of actions (num_actions, num_columns)."""


@runtime_checkable
class HasScans(Protocol):
    """A platform whose actions may keep its sensor from scanning. Sensors of other platforms always scan."""

    def scans(self, pose: Floats, actions: Floats, times: Floats) -> Bools:
        """Return (num_actions, num_times) whether the sensor scans at `times`, s after each action began at `pose`."""


def check_platform(field: str, platform: Any) -> None:
    """Raise `InputError` for an object that lacks a member of `Platform`."""
    if isinstance(platform, type) or not isinstance(platform, Platform):
        raise reject(field, "a platform, with columns, actions(pose) and course(pose, action, times)", platform)


def actions_at(field: str, platform: Platform, pose: Floats) -> Actions:
    """Return the actions of a platform at a pose. Raises `InputError`, with the platform's name, for invalid ones."""
    columns = tuple(platform.columns)
    values = float_array(f"{field}.actions", platform.actions(pose.copy()), (None, len(columns)))
    if len(values) == 0:
        raise reject(f"{field}.actions", "at least one action", "none")
    actions = object.__new__(Actions)  # the values are already validated, with the platform's name in errors
    object.__setattr__(actions, "columns", columns)
    object.__setattr__(actions, "values", values)
    return actions


def course_of(field: str, platform: Platform, pose: Floats, action: Floats, times: Floats) -> Floats:
    """Return (num_times, pose_dim) poses of an action. Raises `InputError`, naming the platform, for invalid ones."""
    course = platform.course(pose.copy(), action.copy(), times.copy())
    return _checked(f"{field}.course", course, (len(times),), pose)


def courses_of(
    field: str, platform: Any, pose: Floats, actions: Floats, times: Floats, abilities: Abilities | None = None
) -> Floats:
    """Return (num_actions, num_times, pose_dim) poses after each action. Raises `InputError` as `course_of`."""
    if not len(times):  # at the last scan, and no case for platforms to consider
        return np.empty((len(actions), 0, len(pose)))
    if (abilities or Abilities.of(platform)).takes_many_actions:
        courses = platform.courses(pose.copy(), actions.copy(), times.copy())
        return _checked(f"{field}.courses", courses, (len(actions), len(times)), pose)
    return np.stack([course_of(field, platform, pose, action, times) for action in actions])


def prices_of(field: str, platform: Platform, actions: Floats) -> Floats:
    """Return prices (num_actions,) of actions, in units of the reward. Raises `InputError` for invalid prices."""
    if not provides(platform, HasPrices):
        return np.zeros(len(actions))
    return float_array(f"{field}.prices", platform.prices(actions.copy()), (len(actions),))


def scans_of(field: str, platform: Platform, pose: Floats, actions: Floats, times: Floats) -> Bools:
    """Return (num_actions, num_times) whether each action lets the sensor scan. Raises `InputError` if invalid."""
    shape = len(actions), len(times)
    if not provides(platform, HasScans):
        return np.ones(shape, np.bool_)
    scans = as_array(f"{field}.scans", platform.scans(pose.copy(), actions.copy(), times.copy()), "b", "booleans")
    if scans.shape != shape:
        raise reject(f"{field}.scans", f"booleans of shape {shape}", f"shape {scans.shape}")
    return scans


def _checked(field: str, given: Any, shape: tuple[int, ...], pose: Floats) -> Floats:
    """Return poses of this shape, completed with the components of `pose` that are not given."""
    array = as_array(field, given, "fiu", "numbers")
    fits = array.shape[:-1] == shape and 3 <= array.shape[-1] <= len(pose)
    if not fits or not np.isfinite(array).all():
        sizes = ", ".join(map(str, shape))
        expected = f"finite poses of shape ({sizes}, 3 to {len(pose)}), one a time"
        raise reject(field, expected, f"shape {array.shape}" if not fits else array)
    poses = np.empty((*shape, len(pose)))
    poses[...] = pose
    poses[..., : array.shape[-1]] = array
    return poses
