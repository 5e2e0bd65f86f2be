"""The options of a sensor at a decision: its actions, where they lead, and which of them lead the same way."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.base.types import Bools, Floats, Ints
from vedette.platforms.actions import Actions
from vedette.platforms.base import Platform, actions_at, courses_of

# Poses nearer than this, relative to their size, are one: rounding of degrees to radians and back stays below.
_SAME_POSE = 1e-9


class Options(NamedTuple):
    """What one sensor may do at a decision.

    actions: all of them, in the order of tables. courses: (num_courses, num_times, pose_dim) the different courses that
    they lead to, each in the place of its first action. which: (num_actions,) which course each action takes. pose:
    (pose_dim,) where it is now.
    """

    actions: Actions
    courses: Floats
    which: Ints
    pose: Floats

    def first_action(self, course: int) -> int:
        """The first action that takes a course."""
        return int(np.flatnonzero(self.which == course)[0])


def options_at(field: str, platform: Platform, pose: Floats, times: Floats) -> Options:
    """The options of a platform at a pose, told apart by where it is at `times`, in seconds from now.

    Raises `InputError`, with the name of the platform, for actions or courses that are none.
    """
    actions = actions_at(field, platform, pose)
    courses = courses_of(field, platform, pose, actions.values, times)
    firsts = _same(courses).argmax(axis=1)  # itself, if none before it
    own, which = np.unique(firsts, return_inverse=True)
    return Options(actions, courses[own], which, pose)


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
