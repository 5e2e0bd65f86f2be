"""Every joint action."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vedette.control.constraints import Mask, opened
from vedette.control.search.problem import JointProblem, all_joint_actions, first_best
from vedette.errors import InputError
from vedette.kernels.base.types import Ints
from vedette.models.fields import Count, check_fields, part


@part("exhaustive", "search")
@dataclass(frozen=True, slots=True)
class ExhaustiveSearch:
    """Every joint action (paper, Algorithm 2): the best there is, and the oracle for all other searches.

    With a mask only the joint actions that it allows are formed; if there is none, the mask is opened first
    (`vedette.control.constraints.opened`).

    Attributes:
        max_joint_actions: bound on their number, which grows as a power of the number of sensors.

    Raises:
        InputError: a bound below 1.
    """

    max_joint_actions: Count = 1_000_000

    def __post_init__(self) -> None:
        check_fields(self)

    def search(self, problem: JointProblem, *, rng: np.random.Generator) -> tuple[int, ...]:
        """The best of all; nothing is drawn. Raises `InputError` for more joint actions than `max_joint_actions`."""
        if problem.mask is None:
            num_joint = math.prod(problem.shape)
            if num_joint > self.max_joint_actions:
                sizes = " x ".join(map(str, problem.shape))
                raise self._too_many(f"{sizes} = {num_joint}")
            joint_actions = all_joint_actions(problem.shape)
        else:
            joint_actions = self._allowed(opened(problem.mask)[0])
        best = first_best(problem.evaluate(joint_actions))
        return tuple(joint_actions[best].tolist())

    def _allowed(self, mask: Mask) -> Ints:
        """(num_allowed, num_sensors) in printed order, sensor by sensor those that what went before allows."""
        found = np.empty((1, 0), np.int64)
        for s, own in enumerate(mask.single):
            courses = np.flatnonzero(own)
            ahead = np.repeat(found, len(courses), axis=0)
            found = np.column_stack([ahead, np.tile(courses, len(found))])
            for other, clash in mask.others(s).items():
                if other < s:
                    found = found[clash[found[:, other], found[:, s]] == 0]
            if len(found) > self.max_joint_actions:
                raise self._too_many(f"more than that, of {s + 1} of {len(mask.single)} sensors")
        return np.ascontiguousarray(found)

    def _too_many(self, got: str) -> InputError:
        return InputError(
            f"joint actions: expected at most {self.max_joint_actions} for an exhaustive search; got {got}; "
            "allow more, or search by CoordinateAscent"
        )
