"""What a sensor may do at a decision: the headings it may take."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from vedette.errors import InputError
from vedette.kernels.base.types import Floats, Ints
from vedette.models.measurement import wrap_angles

PAPER_HEADINGS_DEG = tuple(float(angle) for angle in range(-180, 181, 30))

# Two headings nearer than this are one direction: rounding of degrees to radians and back stays below.
_SAME_DIRECTION = 1e-12


class ActionSet(Protocol):
    """The actions of one sensor, each of which ends in an absolute heading that is kept until the next decision."""

    def headings(self, pose: Floats) -> Floats:
        """(num_actions,) absolute headings in radians open to a sensor at `pose`, in the order of the tables.

        At least one, all finite. Headings that differ by whole turns are one direction, which is evaluated once.
        """
        ...


@dataclass(frozen=True, slots=True)
class HeadingActions:
    """A list of headings, or of changes of heading.

    Attributes:
        headings_deg: degrees, counter-clockwise from +x (the paper's 13 by default, of which -180 and 180 are one).
        relative: whether they are added to the present heading (paper-notes 14).

    Raises:
        InputError: no action, or one that is not finite.
    """

    headings_deg: Sequence[float] = PAPER_HEADINGS_DEG
    relative: bool = False

    def __post_init__(self) -> None:
        try:
            values = tuple(float(value) for value in self.headings_deg)
        except (TypeError, ValueError):
            values = ()
        if not values or not all(math.isfinite(value) for value in values):
            raise InputError(f"headings_deg: expected at least one finite angle in degrees; got {self.headings_deg!r}")
        object.__setattr__(self, "headings_deg", values)

    def headings(self, pose: Floats) -> Floats:
        """(num_actions,) absolute headings in radians; absolute 180 and -180 degrees stay apart as printed."""
        angles = np.radians(np.array(self.headings_deg))
        return np.asarray(wrap_angles(pose[2] + angles)) if self.relative else angles


def distinct_headings(headings: Floats) -> tuple[Floats, Ints]:
    """The different directions among `headings`, each at its first occurrence, and which of them each heading is."""
    seen: list[float] = []
    which = np.empty(len(headings), np.int64)
    for i, heading in enumerate(wrap_angles(headings).tolist()):
        match = [k for k, other in enumerate(seen) if abs(math.remainder(heading - other, math.tau)) < _SAME_DIRECTION]
        which[i] = match[0] if match else len(seen)
        if not match:
            seen.append(heading)
    return np.array(seen), which
