"""The protocol of platforms, and the one place where their answers are checked."""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable

import numpy as np

from vedette.kernels.base.types import Floats
from vedette.models.arguments import as_array, float_array, reject
from vedette.platforms.actions import Actions


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
class TakesManyActions(Protocol):
    """A platform that gives the courses of many actions at once, equal to those of `Platform.course`."""

    def courses(self, pose: Floats, actions: Floats, times: Floats) -> Floats:
        """(num_actions, num_times, 3 or more) for actions (num_actions, num_columns)."""
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
    return Actions(columns, values)


def course_of(field: str, platform: Platform, pose: Floats, action: Floats, times: Floats) -> Floats:
    """(num_times, pose_dim) poses after an action; `InputError`, with the name of the platform, for what are none."""
    course = platform.course(pose.copy(), action.copy(), times.copy())
    return _checked(f"{field}.course", course, (len(times),), pose)


def courses_of(field: str, platform: Platform, pose: Floats, actions: Floats, times: Floats) -> Floats:
    """(num_actions, num_times, pose_dim) poses after each action; `InputError` as `course_of`."""
    if isinstance(platform, TakesManyActions):
        courses = platform.courses(pose.copy(), actions.copy(), times.copy())
        return _checked(f"{field}.courses", courses, (len(actions), len(times)), pose)
    return np.stack([course_of(field, platform, pose, action, times) for action in actions])


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
