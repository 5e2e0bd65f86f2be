"""Motion at constant speed: the platform turns instantly and keeps its heading (paper section IV)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vedette.kernels.base.types import HEADING, Floats
from vedette.models.arguments import float_array, reject
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
