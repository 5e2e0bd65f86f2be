"""Sequential greedy search: one sensor after the other, once."""

import heapq
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from vedette.control.search.problem import Joint, JointProblem, RewardCache, first_best
from vedette.errors import InputError
from vedette.kernels.base.types import Floats, Ints
from vedette.models.fields import Checked, part


@part("sequential_greedy", "search")
@dataclass(frozen=True, slots=True)
class SequentialGreedy(Checked):
    """A search that decides sensors one after the other, each by the reward of all. The undecided are assumed to stay.

    The undecided sensors continue as they are (`vedette.control.inputs.stationary_courses`), so that targets that they
    see are not covered twice. The joint action found is never worse than the one in which all sensors stay, if that is
    allowed.

    With a mask a sensor takes only courses compatible with those decided. Sensors without such a course are decided at
    the end, by the fewest changes found (`vedette.control.constraints.nearest_feasible`, `relaxed`).

    Attributes:
        order: "sensor_order": in the order of the sensors. "best_first": always the sensor that adds most. Its gain is
            assumed to shrink as others are decided, which saves most of the evaluations (lazy greedy, Minoux 1978). The
            gain may grow if another sensor leaves a target. Such a sensor is then evaluated later than it should be.
    """

    order: Literal["sensor_order", "best_first"] = "sensor_order"

    def search(self, problem: JointProblem, *, rng: np.random.Generator) -> tuple[int, ...]:
        """Return the joint action decided in this way. Nothing is drawn.

        Raises `InputError` for a problem without rewards of sensors that have not decided (`JointProblem.partial`).
        """
        if problem.partial is None:
            expected = "rewards of sensors that have not decided (JointProblem.partial), for SequentialGreedy"
            raise InputError(f"search: expected {expected}; got none; search by CoordinateAscent")
        cache = RewardCache(problem)
        steps = _Steps(cache, problem.partial)
        if self.order == "sensor_order":
            for sensor in range(len(problem.shape)):
                steps.take(sensor, steps.best(sensor))
        else:
            _best_first(steps)
        return cache.allowed(steps.completed())


class _Steps:
    """The decided sensors' actions with their reward. -1: not decided."""

    def __init__(self, cache: RewardCache, partial: Callable[[Ints], Floats]) -> None:
        self.cache, self.partial = cache, partial
        self.at: list[int] = [-1] * len(cache.problem.shape)
        self.reward = 0.0

    def best(self, sensor: int) -> tuple[float, int] | None:
        """Return the largest reward with one more sensor, and its action, or None if it has no feasible action."""
        actions = self.cache.actions(self.at, sensor)
        if not actions:
            return None
        rows = np.tile(np.array(self.at, np.int64), (len(actions), 1))
        rows[:, sensor] = actions
        rewards = self.partial(rows)
        best = first_best(rewards)
        return float(rewards[best]), actions[best]

    def take(self, sensor: int, best: tuple[float, int] | None) -> None:
        """Decide a sensor, unless it has no feasible action."""
        if best is not None:
            self.reward, self.at[sensor] = best

    def completed(self) -> Joint:
        """Return the joint action with an action for the sensors without a feasible one."""
        return tuple(max(action, 0) for action in self.at)


def _best_first(steps: _Steps) -> None:
    """Decide by lazy greedy: evaluate the sensor with the largest expected gain until that gain is current."""
    steps.reward = float(steps.partial(np.array([steps.at], np.int64))[0])
    num_sensors = len(steps.at)
    # Expected gain, negated; the sensor; the round of its last evaluation; its best action then.
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
