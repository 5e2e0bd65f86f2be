"""Cameras that turn and zoom, fixed or mounted, with pose [px, py, heading_rad, pointing_rad, half_width_rad]."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vedette.errors import InputError
from vedette.kernels.base.types import BUDGET, HALF_WIDTH, HEADING, POINTING, Bools, Floats
from vedette.models.arguments import float_array, positive, reject
from vedette.models.fields import Positive
from vedette.models.measurement import wrap_angles
from vedette.platforms.base import Platform, check_platform, prices_of, scans_of

_ARRIVED = 1e-9  # rad, pointing error at which a turn is complete


def is_camera(pose: Floats) -> bool:
    """Return True if a pose has the pointing of a camera."""
    return len(pose) > HALF_WIDTH and bool(pose[HALF_WIDTH] > 0.0)


def line_of_sight(pose: Floats) -> float:
    """Return the direction in rad that a sensor looks in: the pointing of a camera, the heading of any other sensor."""
    return float(pose[POINTING] if is_camera(pose) else pose[HEADING])


def angle_beyond_view(poses: Floats, places: Floats) -> Floats:
    """Return the angle, rad, from the field of view of cameras to places, 0 for other sensors. Shapes as `view_gap`."""
    offsets = places - poses[..., :2]
    if poses.shape[-1] <= HALF_WIDTH:
        return np.zeros(offsets.shape[:-1])
    off = np.abs(wrap_angles(np.arctan2(offsets[..., 1], offsets[..., 0]) - poses[..., POINTING]))
    half_widths = np.where(poses[..., HALF_WIDTH] > 0.0, poses[..., HALF_WIDTH], math.pi)
    return np.asarray(np.maximum(off - half_widths, 0.0))


def view_gap(poses: Floats, places: Floats, radius: float) -> Floats:
    """Return the distance in m by which a place is out of a sensor's view. 0: in view.

    It is the distance beyond `radius`, m, plus, for a camera, the arc from the place to its field of view. poses: (...,
    pose_dim). places: (..., 2) m. Both are broadcast.
    """
    distances = np.hypot(*np.moveaxis(places - poses[..., :2], -1, 0))
    return np.asarray(np.maximum(distances - radius, 0.0) + distances * angle_beyond_view(poses, places))


@dataclass(frozen=True, slots=True)
class Pointing:
    """A fixed camera that can be pointed and may zoom. Its pointing does not depend on its heading.

    `vedette.models.camera` looks along the pointing, with the half width to either side.

    Attributes:
        pointings_deg: possible pointings, counter-clockwise from east [deg].
        relative: whether these are changes of its pointing, added to it. Actions are absolute in either case.
        half_widths_deg: half widths that it may zoom to instantly. none: it does not zoom [deg].
        turn_rate_deg: turn rate, the shorter way, counter-clockwise if both are as long. none: it turns instantly
            [deg/s].
        blind_while_turning: whether it makes no scan until its turn is complete.

    Raises:
        InputError: no pointing, or one that is not finite; half widths outside (0, 180]; a rate that is not above 0.
    """

    pointings_deg: Sequence[float]
    relative: bool = False
    half_widths_deg: Sequence[float] = ()
    turn_rate_deg: Positive | None = None
    blind_while_turning: bool = False

    def __post_init__(self) -> None:
        for name in ("pointings_deg", "half_widths_deg"):
            object.__setattr__(self, name, tuple(float_array(name, getattr(self, name), (None,)).tolist()))
        if not self.pointings_deg:
            raise reject("pointings_deg", "at least one angle in degrees", "none")
        if not all(0.0 < width <= 180.0 for width in self.half_widths_deg):
            raise reject("half_widths_deg", "angles in (0, 180] degrees", self.half_widths_deg)
        if self.turn_rate_deg is not None:
            positive("turn_rate_deg", self.turn_rate_deg)

    @property
    def columns(self) -> tuple[str, ...]:
        """`pointing_deg`, and `half_width_deg` if it zooms."""
        return ("pointing_deg", "half_width_deg") if self.half_widths_deg else ("pointing_deg",)

    def actions(self, pose: Floats) -> Floats:
        """Return (num_actions, num_columns) absolute pointings, each at every width. 180 and -180 remain distinct."""
        _check(pose)
        degrees = np.array(self.pointings_deg)
        if self.relative:
            degrees = np.degrees(wrap_angles(pose[POINTING] + np.radians(degrees)))
        if not self.half_widths_deg:
            return degrees[:, np.newaxis]
        num = len(self.half_widths_deg)
        return np.column_stack([np.repeat(degrees, num), np.tile(self.half_widths_deg, len(degrees))])

    def course(self, pose: Floats, action: Floats, times: Floats) -> Floats:
        """Return poses with constant position and heading."""
        _check(pose)
        poses = np.tile(pose, (len(times), 1))
        turn = float(wrap_angles(np.radians(action[0]) - pose[POINTING]))
        if self.turn_rate_deg is None:
            poses[:, POINTING] = wrap_angles(np.radians(action[0]))
        else:
            most = np.radians(self.turn_rate_deg) * times
            poses[:, POINTING] = wrap_angles(pose[POINTING] + math.copysign(1.0, turn) * np.minimum(abs(turn), most))
        if self.half_widths_deg:
            poses[:, HALF_WIDTH] = math.radians(action[1])
        return poses

    def scans(self, pose: Floats, actions: Floats, times: Floats) -> Bools:
        """Return (num_actions, num_times) False while it turns and is blind, True if it turns instantly."""
        if not self.blind_while_turning or self.turn_rate_deg is None:
            return np.ones((len(actions), len(times)), np.bool_)
        turns = np.abs(wrap_angles(np.radians(actions[:, :1]) - pose[POINTING]))
        return np.asarray(turns <= np.radians(self.turn_rate_deg) * times + _ARRIVED)


def _check(pose: Floats) -> None:
    if len(pose) < BUDGET:
        raise InputError(f"pose: expected {BUDGET} components, with pointing_rad and half_width_rad; got {len(pose)}")
    if not 0.0 < pose[HALF_WIDTH] <= math.pi:
        raise InputError(f"pose: expected half_width_rad in (0, pi]; got {pose[HALF_WIDTH]:g} (is it in degrees?)")


@dataclass(frozen=True, slots=True)
class MountedPlatform:
    """A pointing sensor mounted on a moving platform. The actions are all combinations of both, columns side by side.

    Attributes:
        platform: controls position and heading, and receives a pose of these three.
        pointing: controls all other components of the pose.

    Raises:
        InputError: one of them is not a platform, or both have a column of the same name.
    """

    platform: Platform
    pointing: Platform

    def __post_init__(self) -> None:
        for name in ("platform", "pointing"):
            check_platform(name, getattr(self, name))
        if len(set(self.columns)) < len(self.columns):
            raise reject("pointing", f"columns other than {', '.join(self.platform.columns)}", self.pointing.columns)

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of the platform, then those of the pointing."""
        return (*self.platform.columns, *self.pointing.columns)

    def actions(self, pose: Floats) -> Floats:
        """Return (num_actions, num_columns), the pointing's actions fastest."""
        moves = np.asarray(self.platform.actions(pose[:3].copy()), np.float64)
        turns = np.asarray(self.pointing.actions(pose), np.float64)
        return np.hstack([np.repeat(moves, len(turns), axis=0), np.tile(turns, (len(moves), 1))])

    def course(self, pose: Floats, action: Floats, times: Floats) -> Floats:
        """Return poses composed of the components of both."""
        num_columns = len(self.platform.columns)
        poses = np.array(self.pointing.course(pose.copy(), action[num_columns:], times), np.float64)
        poses[:, :3] = np.asarray(self.platform.course(pose[:3].copy(), action[:num_columns], times))[:, :3]
        return poses

    def prices(self, actions: Floats) -> Floats:
        """Return prices (num_actions,), the sums of both."""
        num_columns = len(self.platform.columns)
        prices = prices_of("platform", self.platform, actions[:, :num_columns])
        return prices + prices_of("pointing", self.pointing, actions[:, num_columns:])

    def scans(self, pose: Floats, actions: Floats, times: Floats) -> Bools:
        """Return (num_actions, num_times) whether both let the sensor scan."""
        num_columns = len(self.platform.columns)
        scans = scans_of("platform", self.platform, pose[:3], actions[:, :num_columns], times)
        return scans & scans_of("pointing", self.pointing, pose, actions[:, num_columns:], times)
