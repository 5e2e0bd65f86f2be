"""Platforms whose actions are given as compass courses: clockwise from true north, with speeds in m/s."""

from dataclasses import dataclass, field

import numpy as np

from vedette.kernels.base.types import HEADING, Bools, Floats
from vedette.models.arguments import instance
from vedette.platforms.base import Platform, actions_at, check_platform, courses_of, scans_of
from vedette.platforms.camera import MountedPlatform, Pointing
from vedette.platforms.compass import Compass, PlaneCompass, course_deg
from vedette.platforms.courses import GridPlatform, HeadingPlatform, Waypoints

_COURSES = {"heading_deg": "course_deg", "pointing_deg": "azimuth_deg"}
_NAMES = {**_COURSES, "speed": "speed_mps"}
_AT_ONCE = 1e-3  # s after a decision, when the motion of a platform is evaluated
_DIGITS = 9  # decimals of degrees and metres, so that a course of 60 degrees is shown as 60


@dataclass(frozen=True, slots=True)
class ByCompass:
    """A platform whose directions are clockwise from true north instead of counter-clockwise from east.

    `heading_deg` becomes `course_deg`, from 0 to 360, with `speed_mps`. `pointing_deg` becomes `azimuth_deg`. A step is
    `course_deg`, `speed_mps` and `distance_m`. A waypoint has the course and the speed towards it. The fixed directions
    of `HeadingPlatform`, `GridPlatform` and `Pointing` are relative to true north at any position. Angles given by the
    pose or by a custom platform are angles in the plane, converted at the position of the platform.

    Attributes:
        platform: the platform whose directions are converted.
        compass: direction of true north, such as a `vedette.recorded.Origin`.

    Raises:
        InputError: no platform.
    """

    platform: Platform
    compass: Compass = field(default_factory=PlaneCompass)

    def __post_init__(self) -> None:
        check_platform("platform", self.platform)
        instance("compass", self.compass, Compass)

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of the platform under their compass names."""
        return tuple(name for part in self._parts for name in _columns(part))

    def actions(self, pose: Floats) -> Floats:
        """Return (num_actions, num_columns) the actions of the platform, in its order."""
        return self.converted(actions_at("platform", self.platform, pose).values, pose, fixed=True)

    def course(self, pose: Floats, action: Floats, times: Floats) -> Floats:
        """Return the course of the platform."""
        return np.asarray(self.courses(pose, action[np.newaxis], times)[0])

    def courses(self, pose: Floats, actions: Floats, times: Floats) -> Floats:
        """Return the courses of many actions at once."""
        return courses_of("platform", self.platform, pose, self._own(actions, pose), times)

    def scans(self, pose: Floats, actions: Floats, times: Floats) -> Bools:
        """Return whether the platform's actions let the sensor scan."""
        return scans_of("platform", self.platform, pose, self._own(actions, pose), times)

    def converted(self, rows: Floats, pose: Floats, *, fixed: bool) -> Floats:
        """Return converted rows (num_rows, num_columns) of the platform's own columns.

        fixed: whether directions that do not depend on the pose are already relative to true north.
        """
        found, place = [], 0
        for part in self._parts:
            own = rows[:, place : place + len(part.columns)]
            place += len(part.columns)
            compass = PlaneCompass() if fixed and _is_fixed(part) else self.compass
            found.append(_given(part, own, self._pose_of(part, pose), compass))
        return np.hstack(found)

    @property
    def _parts(self) -> tuple[Platform, ...]:
        platform = self.platform
        return (platform.platform, platform.pointing) if isinstance(platform, MountedPlatform) else (platform,)

    def _own(self, actions: Floats, pose: Floats) -> Floats:
        """Return (num_actions, num_columns of the platform) the platform's own rows of actions."""
        found, place = [], 0
        for part in self._parts:
            own = actions[:, place : place + len(_columns(part))]
            place += len(_columns(part))
            found.append(_own(part, own, self._pose_of(part, pose), self.compass))
        return np.hstack(found)

    def _pose_of(self, part: Platform, pose: Floats) -> Floats:
        """Return the pose that `MountedPlatform` passes on: the mounting platform gets position and heading only."""
        is_mounting = isinstance(self.platform, MountedPlatform) and part is self.platform.platform
        return pose[:3] if is_mounting else pose


def _is_fixed(part: Platform) -> bool:
    """Return True if its directions are the same at every pose."""
    return isinstance(part, GridPlatform) or (isinstance(part, HeadingPlatform | Pointing) and not part.relative)


def _columns(part: Platform) -> tuple[str, ...]:
    if isinstance(part, GridPlatform):
        return ("course_deg", "speed_mps", "distance_m")
    if isinstance(part, Waypoints):
        return (*part.columns, "course_deg", "speed_mps")
    names = tuple(_NAMES.get(name, name) for name in part.columns)
    if len(set(names)) < len(names):  # a custom platform that has a course besides its heading
        return tuple(part.columns)
    return (*names, "speed_mps") if "heading_deg" in part.columns and "speed_mps" not in names else names


def _given(part: Platform, rows: Floats, pose: Floats, compass: Compass) -> Floats:
    """Return rows of a platform converted to compass columns."""
    if isinstance(part, GridPlatform):
        lengths = np.hypot(rows[:, 0], rows[:, 1])
        courses = np.where(lengths > 0.0, _course(compass, np.arctan2(rows[:, 1], rows[:, 0]), pose), 0.0)
        return np.column_stack([courses, np.where(lengths > 0.0, part.speed, 0.0), np.round(lengths, _DIGITS)])
    if isinstance(part, Waypoints):
        return np.hstack([rows, _under_way(part, rows, pose, compass)])
    names, found = _columns(part), np.array(rows)
    for i, name in enumerate(part.columns):
        if name in _COURSES and names[i] != name:
            found[:, i] = _course(compass, np.radians(rows[:, i]), pose)
    if len(names) == len(part.columns):
        return found
    speeds = (
        np.full(len(rows), part.speed)
        if isinstance(part, HeadingPlatform)
        else _under_way(part, rows, pose, compass)[:, 1]
    )
    return np.column_stack([found, speeds])


def _under_way(part: Platform, rows: Floats, pose: Floats, compass: Compass) -> Floats:
    """Return (num_rows, 2) course, deg, and speed, m/s, just after each action began, or 0 and 0 if it stays."""
    poses = courses_of("platform", part, pose, rows, np.array([_AT_ONCE]))[:, 0]
    away = np.hypot(*(poses[:, :2] - pose[:2]).T) / _AT_ONCE
    speeds = np.round(away, 6)  # at coordinates of a million m there are no more digits
    return np.column_stack([np.where(speeds > 0.0, _course(compass, poses[:, HEADING], pose), 0.0), speeds])


def _own(part: Platform, actions: Floats, pose: Floats, compass: Compass) -> Floats:
    """Return the rows of a platform from actions in compass columns."""
    if isinstance(part, Waypoints):
        return actions[:, :1]
    if isinstance(part, GridPlatform):
        angles = compass.angle(np.radians(actions[:, 0]), pose)
        return np.asarray(actions[:, 2:] * np.column_stack([np.cos(angles), np.sin(angles)]))
    names, found = _columns(part), np.array(actions[:, : len(part.columns)])
    for i, name in enumerate(part.columns):
        if name in _COURSES and names[i] != name:
            found[:, i] = np.degrees(compass.angle(np.radians(actions[:, i]), pose))
    if _is_fixed(part) or not len(part.columns):
        return found
    # A custom platform receives its own row unchanged, to the last bit.
    own = np.asarray(part.actions(pose.copy()), np.float64)
    same = (_given(part, own, pose, compass) == actions[:, np.newaxis]).all(axis=2)
    return np.where(same.any(axis=1)[:, np.newaxis], own[same.argmax(axis=1)], found)


def _course(compass: Compass, angles: Floats, pose: Floats) -> Floats:
    return np.asarray(np.round(course_deg(compass, angles, pose), _DIGITS) % 360.0)
