"""Every joint action; and one sensor after the other, once."""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from vedette.control.constraints import Mask, opened
from vedette.control.search.problem import Joint, JointProblem, Known, all_joint_actions, first_best
from vedette.errors import InputError
from vedette.kernels.base.types import Floats, Ints
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


@part("sequential_greedy", "search")
@dataclass(frozen=True, slots=True)
class SequentialGreedy:
    """Sensors are decided one after the other, each by the reward of those decided, while the others do not scan.

    Of a reward that is monotone and submodular in the scans that are made, the joint action found has at least half of
    the largest reward, in either order (Fisher, Nemhauser and Wolsey, An analysis of approximations for maximizing
    submodular set functions II, 1978), where nothing is forbidden. Mutual information is such a reward where
    measurements are conditionally independent given the targets. Cauchy-Schwarz is not known to be: nothing is
    guaranteed for it. Nor is anything guaranteed of a reward that is estimated from samples, beyond their mean.

    With a mask a sensor takes only what goes with those decided; sensors that are left without anything are decided in
    the end, by the fewest changes found (`vedette.control.constraints.repaired`, `opened`).

    Attributes:
        order: "printed": as the sensors stand. "best_first": always the sensor that adds most; what it adds is taken to
            shrink as others are decided, which saves most of the evaluations (lazy greedy; Minoux 1978).

    Raises:
        InputError: another order.
    """

    order: Literal["printed", "best_first"] = "printed"

    def __post_init__(self) -> None:
        check_fields(self)

    def search(self, problem: JointProblem, *, rng: np.random.Generator) -> tuple[int, ...]:
        """The joint action that is decided so; nothing is drawn.

        Raises `InputError` where the rewards of some sensors alone are not to be had (`JointProblem.partial`).
        """
        if problem.partial is None:
            raise InputError(
                "search: expected rewards of some of the sensors alone, for SequentialGreedy; got none: reward and "
                "beliefs of this decision have none; search by CoordinateAscent"
            )
        known = Known(problem)
        steps = _Steps(known, problem.partial)
        if self.order == "printed":
            for sensor in range(len(problem.shape)):
                steps.take(sensor, steps.best(sensor))
        else:
            _best_first(steps)
        return known.allowed(steps.completed())


class _Steps:
    """What has been decided, with its reward; -1: not decided."""

    def __init__(self, known: Known, partial: Callable[[Ints], Floats]) -> None:
        self.known, self.partial = known, partial
        self.at: list[int] = [-1] * len(known.problem.shape)
        self.reward = 0.0

    def best(self, sensor: int) -> tuple[float, int] | None:
        """The largest reward with one more sensor, and its action; None where it may do nothing."""
        actions = self.known.actions(self.at, sensor)
        if not actions:
            return None
        rows = np.tile(np.array(self.at, np.int64), (len(actions), 1))
        rows[:, sensor] = actions
        rewards = self.partial(rows)
        best = first_best(rewards)
        return float(rewards[best]), actions[best]

    def take(self, sensor: int, best: tuple[float, int] | None) -> None:
        """Decide a sensor, unless it may do nothing."""
        if best is not None:
            self.reward, self.at[sensor] = best

    def completed(self) -> Joint:
        """With an action for the sensors that may do nothing."""
        return tuple(max(action, 0) for action in self.at)


def _best_first(steps: _Steps) -> None:
    """Lazy greedy: who seems to add most is looked at again, until that one is known to add most in this round."""
    steps.reward = float(steps.partial(np.array([steps.at], np.int64))[0])
    num_sensors = len(steps.at)
    # What each is expected to add, negative; the sensor; in which round it was last looked at; its best action then.
    waiting: list[tuple[float, int, int, tuple[float, int] | None]] = [
        (-np.inf, s, -1, None) for s in range(num_sensors)
    ]
    for turn in range(num_sensors):
        while waiting[0][2] < turn:
            sensor = waiting[0][1]
            best = steps.best(sensor)
            heapq.heapreplace(waiting, (np.inf if best is None else steps.reward - best[0], sensor, turn, best))
        _, sensor, _, best = heapq.heappop(waiting)
        steps.take(sensor, best)
