"""Platforms at constant speed (paper section IV), by steps, along a path, or at rest."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vedette.kernels.base.types import HEADING, Floats
from vedette.models.arguments import float_array, non_negative, reject
from vedette.models.fields import Positive, check_fields
from vedette.models.measurement import wrap_angles

PAPER_HEADINGS_DEG = tuple(float(angle) for angle in range(-180, 181, 30))


@dataclass(frozen=True, slots=True)
class HeadingPlatform:
    """A platform with a list of headings, or of changes of heading, kept until the next decision. There is no boundary.

    Attributes:
        speed: m/s, or several speeds, of which an action chooses one.
        headings_deg: degrees, counter-clockwise from +x (the paper's 13 by default, of which -180 and 180 are the
            same).
        relative: whether they are changes of heading, added to it (paper-notes 14). Actions are absolute in either
            case.

    Raises:
        InputError: no heading or speed, one that is not finite, a speed below 0.
    """

    speed: float | Sequence[float]
    headings_deg: Sequence[float] = PAPER_HEADINGS_DEG
    relative: bool = False

    def __post_init__(self) -> None:
        several = np.ndim(self.speed) > 0
        speeds = float_array("speed", self.speed if several else [self.speed], (None,))
        headings = float_array("headings_deg", self.headings_deg, (None,))
        if len(speeds) == 0 or (speeds < 0.0).any():
            raise reject("speed", "a number of at least 0, or several", self.speed)
        if len(headings) == 0:
            raise reject("headings_deg", "at least one angle in degrees", "none")
        object.__setattr__(self, "speed", tuple(speeds.tolist()) if several else float(speeds[0]))
        object.__setattr__(self, "headings_deg", tuple(headings.tolist()))

    @property
    def columns(self) -> tuple[str, ...]:
        """`heading_deg`, and `speed` if there are several."""
        return ("heading_deg",) if isinstance(self.speed, float) else ("heading_deg", "speed")

    def actions(self, pose: Floats) -> Floats:
        """Return (num_actions, num_columns) absolute headings, each at every speed. 180 and -180 remain distinct."""
        degrees = np.array(self.headings_deg)
        if self.relative:
            degrees = np.degrees(wrap_angles(pose[HEADING] + np.radians(degrees)))
        if isinstance(self.speed, float):
            return degrees[:, np.newaxis]
        return np.column_stack([np.repeat(degrees, len(self.speed)), np.tile(self.speed, len(degrees))])

    def course(self, pose: Floats, action: Floats, times: Floats) -> Floats:
        """Return poses on a straight line. Headings of -180 and 180 lead to the same poses, bit for bit."""
        return np.asarray(self.courses(pose, action[np.newaxis], times)[0])

    def courses(self, pose: Floats, actions: Floats, times: Floats) -> Floats:
        """Return the courses of many actions at once."""
        headings = wrap_angles(np.radians(actions[:, 0]))
        speeds = self.speed if isinstance(self.speed, float) else actions[:, 1]
        poses = np.empty((len(actions), len(times), len(pose)))
        poses[...] = pose
        poses[:, :, 0] += times * (speeds * np.cos(headings))[:, np.newaxis]
        poses[:, :, 1] += times * (speeds * np.sin(headings))[:, np.newaxis]
        poses[:, :, HEADING] = headings[:, np.newaxis]
        return poses


@dataclass(frozen=True, slots=True)
class Stationary:
    """A platform that stays where it is."""

    @property
    def columns(self) -> tuple[str, ...]:
        """Empty: its action has no numbers."""
        return ()

    def actions(self, pose: Floats) -> Floats:
        """Return (1, 0): its only action."""
        return np.empty((1, 0))

    def course(self, pose: Floats, action: Floats, times: Floats) -> Floats:
        """Return the same pose at every time."""
        return np.tile(pose, (len(times), 1))


@dataclass(frozen=True, slots=True)
class GridPlatform:
    """A platform that moves by steps of equal length, each made at a speed and followed by waiting.

    Attributes:
        length: length of a step [m].
        speed: speed during a step [m/s].
        directions_deg: directions, counter-clockwise from east [deg].
        allow_staying: whether staying is an action, too, the last one.

    Raises:
        InputError: no direction, or one that is not finite, or a length or speed that is not above 0.
    """

    length: Positive
    speed: Positive
    directions_deg: Sequence[float] = (0.0, 45.0, 90.0, 135.0, 180.0, -135.0, -90.0, -45.0)
    allow_staying: bool = True

    def __post_init__(self) -> None:
        check_fields(self)
        directions = float_array("directions_deg", self.directions_deg, (None,))
        if len(directions) == 0:
            raise reject("directions_deg", "at least one angle in degrees", "none")
        object.__setattr__(self, "directions_deg", tuple(directions.tolist()))

    @property
    def columns(self) -> tuple[str, ...]:
        """`dx` and `dy`, m."""
        return ("dx", "dy")

    def actions(self, pose: Floats) -> Floats:
        """Return (num_actions, 2) the step in each direction."""
        angles = np.radians(self.directions_deg)
        steps = self.length * np.column_stack([np.cos(angles), np.sin(angles)])
        steps[np.abs(steps) < 1e-12 * self.length] = 0.0  # no rounding errors in steps due north
        return np.concatenate([steps, np.zeros((1, 2))]) if self.allow_staying else steps

    def course(self, pose: Floats, action: Floats, times: Floats) -> Floats:
        """Return poses during the step, then at its end. The heading is that of the step, and is kept if it stays."""
        return np.asarray(self.courses(pose, action[np.newaxis], times)[0])

    def courses(self, pose: Floats, actions: Floats, times: Floats) -> Floats:
        """Return the courses of many actions at once."""
        lengths = np.hypot(actions[:, 0], actions[:, 1])
        moves = lengths > 0.0
        shares = np.minimum(times * self.speed / np.where(moves, lengths, 1.0)[:, np.newaxis], 1.0)
        poses = np.empty((len(actions), len(times), len(pose)))
        poses[...] = pose
        poses[:, :, :2] += shares[:, :, np.newaxis] * actions[:, np.newaxis]
        headings = np.arctan2(actions[:, 1], actions[:, 0])
        poses[:, :, HEADING] = np.where(moves, headings, pose[HEADING])[:, np.newaxis]
        return poses


@dataclass(frozen=True, slots=True, eq=False)
class Waypoints:
    """A platform that follows a path through waypoints from the one that its action chooses.

    Attributes:
        points: (num_points, 2) m.
        speed: m/s.
        closed: whether the first follows the last, round and round. Otherwise it waits there.

    Raises:
        InputError: no point, or one that is not finite, or a speed below 0.
    """

    points: Sequence[Sequence[float]] | Floats
    speed: float
    closed: bool = False

    def __post_init__(self) -> None:
        points = float_array("points", self.points, (None, 2))
        if len(points) == 0:
            raise reject("points", "at least one point", "none")
        non_negative("speed", self.speed)
        object.__setattr__(self, "points", points)

    @property
    def columns(self) -> tuple[str, ...]:
        """`waypoint`, counted from 1."""
        return ("waypoint",)

    def actions(self, pose: Floats) -> Floats:
        """Return (num_points, 1) every waypoint."""
        return np.arange(1.0, len(self.points) + 1)[:, np.newaxis]

    def course(self, pose: Floats, action: Floats, times: Floats) -> Floats:
        """Return poses straight to the waypoint, then from one to the next. The heading is that of the leg."""
        first = int(action[0]) - 1
        points = np.asarray(self.points)
        ahead = np.concatenate([points[first:], points[: first + 1]]) if self.closed else points[first:]
        corners = np.concatenate([pose[np.newaxis, :2], ahead])
        legs = np.hypot(*np.diff(corners, axis=0).T)
        ends = np.concatenate([np.zeros(1), np.cumsum(legs)])
        gone = self.speed * times
        if self.closed and ends[-1] > ends[1]:
            beyond = gone > ends[1]
            gone = np.where(beyond, ends[1] + np.remainder(gone - ends[1], ends[-1] - ends[1]), gone)
        poses = np.tile(pose, (len(times), 1))
        poses[:, 0], poses[:, 1] = (np.interp(gone, ends, corners[:, axis]) for axis in (0, 1))
        long = np.flatnonzero(legs > 0.0)
        if len(long):
            leg = long[np.minimum(np.searchsorted(ends[long + 1], gone, side="right"), len(long) - 1)]
            away = corners[leg + 1] - corners[leg]
            poses[:, HEADING] = np.arctan2(away[:, 1], away[:, 0])
        return poses
