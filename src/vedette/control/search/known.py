"""A problem with the mean rewards found so far, and with what its mask allows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vedette.control.constraints import Mask, opened, repaired
from vedette.control.search.problem import JointProblem, least_equal
from vedette.kernels.base.types import Floats, Ints

Joint = tuple[int, ...]


class Known:
    """Rewards of a problem's joint actions, each asked for once.

    Only joint actions that the problem's mask allows are evaluated. Where none was found that it allows, the mask is
    opened first (`vedette.control.constraints.opened`): to those with the fewest violations that were found.
    """

    def __init__(self, problem: JointProblem) -> None:
        self.problem = problem
        self.values: dict[Joint, float] = {}
        self.mask: Mask | None = None
        self._allowed: Joint | None = None
        if problem.mask is not None:
            self.mask, self._allowed = opened(problem.mask)

    def rewards(self, joint_actions: Sequence[Joint]) -> Floats:
        """(num,) of joint actions; those not yet known are evaluated, all at once."""
        new = [joint for joint in dict.fromkeys(joint_actions) if joint not in self.values]
        if new:
            rewards = self.problem.evaluate(np.array(new, np.int64))
            self.values.update(zip(new, rewards.tolist(), strict=True))
        return np.array([self.values[joint] for joint in joint_actions])

    def line(self, through: Joint, sensor: int) -> list[Joint]:
        """The allowed joint actions that differ from one in this sensor's action at most; they become known."""
        ahead, behind = through[:sensor], through[sensor + 1 :]
        joint_actions = [(*ahead, action, *behind) for action in self.actions(through, sensor)]
        if self.problem.line is None:
            self.rewards(joint_actions)
        elif any(joint not in self.values for joint in joint_actions):
            rewards = self.problem.line(through, sensor).tolist()
            self.values.update((joint, rewards[joint[sensor]]) for joint in joint_actions)
        return joint_actions

    def actions(self, at: Sequence[int], sensor: int) -> list[int]:
        """What one sensor may do where the others are as in `at`; below 0: not decided yet."""
        if self.mask is None:
            return list(range(self.problem.shape[sensor]))
        return np.flatnonzero(self.mask.clashes(at, sensor) == 0).tolist()

    def allowed(self, joint: Sequence[int]) -> Joint:
        """A joint action itself where it is allowed; else one near it that is."""
        return self.all_allowed(np.array([joint], np.int64))[0]

    def all_allowed(self, actions: Ints) -> list[Joint]:
        """Joint actions (num, num_sensors), each itself where it is allowed; else one near it that is."""
        joints: list[Joint] = list(map(tuple, actions.tolist()))
        if self.mask is None or self._allowed is None:
            return joints
        for row in np.flatnonzero(~self.mask.allows(actions)).tolist():
            near = repaired(self.mask, joints[row])
            joints[row] = near if self.mask.allows(np.array([near]))[0] else self._allowed
        return joints

    def drawn(self, num: int, *, rng: np.random.Generator) -> list[Joint]:
        """`num` joint actions, drawn uniformly, and those that are not allowed moved to near ones that are."""
        return self.all_allowed(rng.integers(self.problem.shape, size=(num, len(self.problem.shape))))

    def best(self) -> Joint:
        """The best of all that are known; of equal ones the first in printed order."""
        least = least_equal(max(self.values.values()))
        return min(joint for joint, value in self.values.items() if value >= least)
