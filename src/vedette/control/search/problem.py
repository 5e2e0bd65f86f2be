"""The search problem over joint actions, with the mean rewards found so far."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from vedette.control.constraints.mask import Mask, nearest_feasible, relaxed
from vedette.errors import InputError
from vedette.kernels.base.types import Floats, Ints
from vedette.models.fields import Checked, Count, part

# Rewards closer than this, relative to the best or to 1, are equal: they differ only by rounding.
_TIE = 1e-9

Joint = tuple[int, ...]


def first_best(rewards: Floats) -> int:
    """Return the index of the first of the largest rewards, equal within 1e-9 relative to the largest or to 1.

    In a symmetric layout mirrored actions differ by rounding only. The decision must not depend on that (paper-notes
    18).
    """
    best = float(rewards.max())
    return int(np.argmax(rewards >= best - tie_tolerance(best)))


def tie_tolerance(reward: float) -> float:
    """Return the difference up to which rewards are equal to this one."""
    return _TIE * max(1.0, abs(reward))


class JointProblem(NamedTuple):
    """The problem given to a search. An action is the index of one of a sensor's distinct courses, in printed order.

    shape: number of distinct courses of each sensor.
    evaluate: returns mean joint rewards (num,) of joint actions (num, num_sensors), each row one action per sensor. The
        same row gives the same number again, at the same cost.
    independent: the joint action in which every sensor takes its own best feasible course.
    mask: allowed courses and pairs of courses. None: all.
    line: returns mean joint rewards (num_courses,) of all courses of a sensor with the others as in a joint action,
        cheaper than their evaluation. None: they are evaluated.
    ascend: returns the result of a compiled coordinate ascent from a joint action. It respects `mask` if its start
        does. None: the search ascends itself.
    partial: as `evaluate`, with -1 for a sensor that has not decided and is assumed to stay as it is. It accepts any
        joint action, allowed or not. Nothing is kept as evidence. None: not available.
    bound: returns an upper bound on the mean reward of any joint action, or inf if not known. None: not available.
    late: returns whether the time for the decision is over. A search with rounds or restarts then ends with the best
        action it has found, after one ascent or round at least. None: no time limit.
    """

    shape: tuple[int, ...]
    evaluate: Callable[[Ints], Floats]
    independent: Callable[[], tuple[int, ...]]
    mask: Mask | None = None
    line: Callable[[tuple[int, ...], int], Floats] | None = None
    ascend: Callable[[tuple[int, ...]], tuple[int, ...]] | None = None
    partial: Callable[[Ints], Floats] | None = None
    bound: Callable[[], float] | None = None
    late: Callable[[], bool] | None = None


@runtime_checkable
class JointSearch(Protocol):
    """A search for a joint action with a large mean reward."""

    def search(self, problem: JointProblem, *, rng: np.random.Generator) -> tuple[int, ...]:
        """Return the joint action to take, one action per sensor, of equally good ones the first in printed order."""


def all_joint_actions(shape: tuple[int, ...]) -> Ints:
    """Return (num_joint, num_sensors) every joint action, the last sensor's action fastest."""
    number = np.arange(math.prod(shape), dtype=np.int64)
    actions = np.empty((len(number), len(shape)), np.int64)
    for s in reversed(range(len(shape))):
        number, actions[:, s] = np.divmod(number, shape[s])
    return actions


class RewardCache:
    """Rewards of a problem's joint actions, each evaluated once.

    Only joint actions that the problem's mask allows are evaluated. If none was found that it allows, the mask is first
    relaxed (`vedette.control.constraints.relaxed`) to those with the fewest violations found.
    """

    def __init__(self, problem: JointProblem) -> None:
        self.problem = problem
        self.values: dict[Joint, float] = {}
        self.mask: Mask | None = None
        self._allowed: Joint | None = None
        if problem.mask is not None:
            self.mask, self._allowed = relaxed(problem.mask)

    def is_late(self) -> bool:
        """Return True if the search has to end."""
        return self.problem.late is not None and self.problem.late()

    def rewards(self, joint_actions: Sequence[Joint]) -> Floats:
        """Return rewards (num,) of joint actions. Those not yet known are evaluated together."""
        new = [joint for joint in dict.fromkeys(joint_actions) if joint not in self.values]
        if new:
            rewards = self.problem.evaluate(np.array(new, np.int64))
            self.values.update(zip(new, rewards.tolist(), strict=True))
        return np.array([self.values[joint] for joint in joint_actions])

    def line(self, through: Joint, sensor: int) -> list[Joint]:
        """Return the allowed joint actions that differ at most in this sensor's action, and evaluate them."""
        ahead, behind = through[:sensor], through[sensor + 1 :]
        joint_actions = [(*ahead, action, *behind) for action in self.actions(through, sensor)]
        if self.problem.line is None:
            self.rewards(joint_actions)
        elif any(joint not in self.values for joint in joint_actions):
            rewards = self.problem.line(through, sensor).tolist()
            self.values.update((joint, rewards[joint[sensor]]) for joint in joint_actions)
        return joint_actions

    def actions(self, at: Sequence[int], sensor: int) -> list[int]:
        """Return the feasible actions of one sensor, given the others in `at`. Below 0: not decided yet."""
        if self.mask is None:
            return list(range(self.problem.shape[sensor]))
        return np.flatnonzero(self.mask.conflicts(at, sensor) == 0).tolist()

    def allowed(self, joint: Sequence[int]) -> Joint:
        """Return a joint action itself if it is allowed, otherwise an allowed one near it."""
        return self.all_allowed(np.array([joint], np.int64))[0]

    def all_allowed(self, actions: Ints) -> list[Joint]:
        """Return joint actions (num, num_sensors), each itself if it is allowed, otherwise an allowed one near it."""
        joints: list[Joint] = list(map(tuple, actions.tolist()))
        if self.mask is None or self._allowed is None:
            return joints
        for row in np.flatnonzero(~self.mask.allows(actions)).tolist():
            near = nearest_feasible(self.mask, joints[row])
            joints[row] = near if self.mask.allows(np.array([near]))[0] else self._allowed
        return joints

    def drawn(self, num: int, *, rng: np.random.Generator) -> list[Joint]:
        """Return `num` joint actions drawn uniformly. Those not allowed are replaced by allowed ones near them."""
        return self.all_allowed(rng.integers(self.problem.shape, size=(num, len(self.problem.shape))))

    def best(self) -> Joint:
        """Return the best known joint action, of equal ones the first in printed order."""
        best = max(self.values.values())
        least = best - tie_tolerance(best)
        return min(joint for joint, value in self.values.items() if value >= least)


@part("exhaustive", "search")
@dataclass(frozen=True, slots=True)
class ExhaustiveSearch(Checked):
    """A search of every joint action (paper, Algorithm 2): the optimum, and the reference for all other searches.

    With a mask only the joint actions that it allows are formed. If there is none, the mask is first relaxed
    (`vedette.control.constraints.relaxed`).

    Attributes:
        max_joint_actions: limit on their number, which grows as a power of the number of sensors.
    """

    max_joint_actions: Count = 1_000_000

    def search(self, problem: JointProblem, *, rng: np.random.Generator) -> tuple[int, ...]:
        """Return the best joint action. Nothing is drawn. Raises `InputError` for more than `max_joint_actions`."""
        return best_of_all(problem, self.max_joint_actions)


def best_of_all(problem: JointProblem, max_actions: int) -> Joint:
    """Return the best of all allowed joint actions. Raises `InputError` for more than `max_actions`."""
    if problem.mask is None:
        num_joint = math.prod(problem.shape)
        if num_joint > max_actions:
            sizes = " x ".join(map(str, problem.shape))
            raise _too_many(max_actions, f"{sizes} = {num_joint}")
        joint_actions = all_joint_actions(problem.shape)
    else:
        joint_actions = _allowed(relaxed(problem.mask)[0], max_actions)
    best = first_best(problem.evaluate(joint_actions))
    return tuple(joint_actions[best].tolist())


def _allowed(mask: Mask, max_actions: int) -> Ints:
    """Return (num_allowed, num_sensors) in printed order, formed sensor by sensor from compatible courses."""
    joint_actions = np.empty((1, 0), np.int64)
    for s, own in enumerate(mask.single):
        courses = np.flatnonzero(own)
        ahead = np.repeat(joint_actions, len(courses), axis=0)
        joint_actions = np.column_stack([ahead, np.tile(courses, len(joint_actions))])
        for other, clash in mask.others(s).items():
            if other < s:
                joint_actions = joint_actions[clash[joint_actions[:, other], joint_actions[:, s]] == 0]
        if mask.active is not None:
            scanning = sum(on[joint_actions[:, i]].astype(np.int64) for i, on in enumerate(mask.active.on[: s + 1]))
            joint_actions = joint_actions[scanning <= mask.active.limit]
        if len(joint_actions) > max_actions:
            raise _too_many(max_actions, f"more than that, of {s + 1} of {len(mask.single)} sensors")
    return np.ascontiguousarray(joint_actions)


def _too_many(max_actions: int, got: str) -> InputError:
    return InputError(
        f"joint actions: expected at most {max_actions} for an exhaustive search; got {got}; "
        "allow more, or search by CoordinateAscent"
    )
