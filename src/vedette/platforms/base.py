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
    given = as_array(f"{field}.course", platform.course(pose.copy(), action.copy(), times.copy()), "fiu", "numbers")
    fits = given.ndim == 2 and len(given) == len(times) and 3 <= given.shape[1] <= len(pose)
    if not fits or not np.isfinite(given).all():
        expected = f"finite poses of shape ({len(times)}, 3 to {len(pose)}), one a time"
        raise reject(f"{field}.course", expected, f"shape {given.shape}" if not fits else given)
    poses = np.tile(pose, (len(times), 1))
    poses[:, : given.shape[1]] = given
    return poses
