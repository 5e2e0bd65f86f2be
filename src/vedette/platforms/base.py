"""The protocol of platforms, their actions as rows of named numbers, and the options of a sensor at a decision.

Here is the one place where a platform's answers are checked.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np

from vedette.errors import InputError
from vedette.internal.representation import SummaryRepr
from vedette.internal.text import pluralise
from vedette.kernels.base.types import Bools, Floats, Ints
from vedette.models.arguments import as_array, float_array, provides, reject, sequence

# Poses nearer than this, relative to their size, are one: rounding of degrees to radians and back stays below.
_SAME_POSE = 1e-9

SWITCH = "on"  # the column of actions that says whether the sensor scans: 1, or 0 where it is off


def switch_words(column: str, value: float) -> str:
    """`on` or `off`, of the column `on`, or `off at decision 2`, of `on_2` of a sequence; empty for other columns."""
    name, _, decision = column.partition("_")
    if name != SWITCH or (column != name and not decision.isdigit()):
        return ""
    return ("on" if value else "off") + (f" at decision {decision}" if decision else "")


class Options(NamedTuple):
    """What one sensor may do at a decision.

    actions: all of them, in the order of tables. courses: (num_courses, num_times, pose_dim) the different courses that
    they lead to, each in the place of its first action. which: (num_actions,) which course each action takes. pose:
    (pose_dim,) where it is now. prices: (num_courses,) in units of the reward; actions of one course have one price.
    scans: (num_courses, num_times) whether the actions of each course let the sensor scan.
    """

    actions: Actions
    courses: Floats
    which: Ints
    pose: Floats
    prices: Floats
    scans: Bools

    def first_action(self, course: int) -> int:
        """The first action that takes a course."""
        return int(np.flatnonzero(self.which == course)[0])


class Abilities(NamedTuple):
    """What a platform has more than a `Platform` must."""

    takes_many_actions: bool
    has_prices: bool
    has_scans: bool

    @classmethod
    def of(cls, platform: Platform) -> Abilities:
        """Find it out."""
        return cls(*[provides(platform, more) for more in (SupportsManyActions, HasPrices, HasScans)])


def options_at(
    field: str, platform: Platform, pose: Floats, times: Floats, abilities: Abilities | None = None
) -> Options:
    """The options of a platform at a pose, distinguished by price, poses and scans at `times`, in seconds from now.

    abilities: of the platform, where they are known. Raises `InputError`, with the name of the platform, for actions,
    courses, prices or scans that are none.
    """
    can, actions = abilities or Abilities.of(platform), actions_at(field, platform, pose)
    num = len(actions.values)
    courses = courses_of(field, platform, pose, actions.values, times, can)
    prices = prices_of(field, platform, actions.values) if can.has_prices else np.zeros(num)
    scans = np.ones((num, len(times)), np.bool_)
    if can.has_scans:
        scans = scans_of(field, platform, pose, actions.values, times)
    same = _same(courses) & (prices[:, np.newaxis] == prices) & (scans[:, np.newaxis] == scans).all(axis=2)
    own, which = np.unique(same.argmax(axis=1), return_inverse=True)  # itself, if none before it
    return Options(actions, courses[own], which, pose, prices[own], scans[own])


def _same(courses: Floats) -> Bools:
    """(num, num) which courses are equal up to rounding, headings up to whole turns; the second is compared to."""
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
    """What one sensor may do, one action a row.

    Attributes:
        columns: what the numbers of an action are: `heading_deg`, an absolute heading counter-clockwise from +x, or
            whatever the platform calls them; units other than SI's in the name.
        values: (num_actions, num_columns), in the order of tables.

    Raises:
        InputError: no action, or numbers that are not finite or not as many as columns.
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
    def of(cls, **numbers: float) -> Actions:
        """A single action, as in `Actions.of(heading_deg=30.0)`."""
        return cls(tuple(numbers), np.array([list(numbers.values())]))

    def __len__(self) -> int:
        return len(self.values)

    def _summary(self) -> str:
        return f"of {pluralise(len(self), 'choice')}: {', '.join(self.columns)}"

    def text(self, index: int) -> str:
        """One action in words: `heading_deg 30, speed 5`; a switch is `on` or `off`, in sequences at which decision."""
        numbers = zip(self.columns, self.values[index].tolist(), strict=True)
        return ", ".join(switch_words(name, value) or f"{name} {round(value, 6):g}" for name, value in numbers)


@runtime_checkable
class Platform(Protocol):
    """What carries a sensor: what it may do, and where that takes it.

    A pose is [px, py, heading_rad, ...]. All sensors of a run have poses of one length, the longest of any; components
    that are not a platform's own are 0. A platform gets them too, and need not give them back.
    """

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of an action's numbers, such as `("heading_deg",)`; see `Actions`."""
        ...

    def actions(self, pose: Floats) -> Floats:
        """(num_actions, num_columns) what it may do at `pose`, at least one thing, in the order of tables."""
        ...

    def course(self, pose: Floats, action: Floats, times: Floats) -> Floats:
        """(num_times, 3 or more) its poses `times` seconds after it began `action` at `pose`.

        action: one row of `actions`. Components of the pose beyond those returned stay as they are.
        """
        ...


@runtime_checkable
class SupportsManyActions(Protocol):
    """A platform that gives the courses of many actions at once, equal to those of `Platform.course`."""

    def courses(self, pose: Floats, actions: Floats, times: Floats) -> Floats:
        """(num_actions, num_times, 3 or more) for actions (num_actions, num_columns)."""
        ...


@runtime_checkable
class HasPrices(Protocol):
    """A platform whose actions have prices, which planners subtract from rewards; those of others cost nothing."""

    def prices(self, actions: Floats) -> Floats:
        """(num_actions,) in units of the reward, of actions (num_actions, num_columns)."""
        ...


@runtime_checkable
class HasScans(Protocol):
    """A platform some of whose actions keep its sensor from scanning; under those of others it always scans."""

    def scans(self, pose: Floats, actions: Floats, times: Floats) -> Bools:
        """(num_actions, num_times) whether the sensor scans `times` seconds after it began each action at `pose`."""
        ...


def check_platform(field: str, platform: Any) -> None:
    """`InputError` for what lacks a member of `Platform`."""
    if isinstance(platform, type) or not isinstance(platform, Platform):
        raise reject(field, "a platform, with columns, actions(pose) and course(pose, action, times)", platform)


def actions_at(field: str, platform: Platform, pose: Floats) -> Actions:
    """What a platform may do at a pose; `InputError`, with the name of the platform, for what are no actions."""
    columns = tuple(platform.columns)
    values = float_array(f"{field}.actions", platform.actions(pose.copy()), (None, len(columns)))
    if len(values) == 0:
        raise reject(f"{field}.actions", "at least one action", "none")
    actions = object.__new__(Actions)  # of what was just checked, under the platform's name
    object.__setattr__(actions, "columns", columns)
    object.__setattr__(actions, "values", values)
    return actions


def course_of(field: str, platform: Platform, pose: Floats, action: Floats, times: Floats) -> Floats:
    """(num_times, pose_dim) poses after an action; `InputError`, with the name of the platform, for what are none."""
    course = platform.course(pose.copy(), action.copy(), times.copy())
    return _checked(f"{field}.course", course, (len(times),), pose)


def courses_of(
    field: str, platform: Any, pose: Floats, actions: Floats, times: Floats, abilities: Abilities | None = None
) -> Floats:
    """(num_actions, num_times, pose_dim) poses after each action; `InputError` as `course_of`."""
    if (abilities or Abilities.of(platform)).takes_many_actions:
        courses = platform.courses(pose.copy(), actions.copy(), times.copy())
        return _checked(f"{field}.courses", courses, (len(actions), len(times)), pose)
    return np.stack([course_of(field, platform, pose, action, times) for action in actions])


def prices_of(field: str, platform: Platform, actions: Floats) -> Floats:
    """(num_actions,) what actions cost, in units of the reward; `InputError` for what are no prices."""
    if not provides(platform, HasPrices):
        return np.zeros(len(actions))
    return float_array(f"{field}.prices", platform.prices(actions.copy()), (len(actions),))


def scans_of(field: str, platform: Platform, pose: Floats, actions: Floats, times: Floats) -> Bools:
    """(num_actions, num_times) whether each action lets its sensor scan; `InputError` for what is no such table."""
    shape = len(actions), len(times)
    if not provides(platform, HasScans):
        return np.ones(shape, np.bool_)
    scans = as_array(f"{field}.scans", platform.scans(pose.copy(), actions.copy(), times.copy()), "b", "booleans")
    if scans.shape != shape:
        raise reject(f"{field}.scans", f"booleans of shape {shape}", f"shape {scans.shape}")
    return scans


def _checked(field: str, given: Any, shape: tuple[int, ...], pose: Floats) -> Floats:
    """Poses of this shape, with the components of `pose` where they are not given."""
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
