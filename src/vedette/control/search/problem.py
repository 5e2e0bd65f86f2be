"""What a search is given and has to find."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from vedette.control.constraints import Mask
from vedette.kernels.base.types import Floats, Ints

# Rewards nearer than this, relative to the best or to 1, are equal: rounding tells them apart, not what they are worth.
_TIE = 1e-9


def first_best(rewards: Floats) -> int:
    """The first of the largest rewards; those within 1e-9 of the largest, relative to it or to 1, are equal to it.

    In a symmetric layout mirrored actions differ by rounding only; the decision must not hang on that (paper-notes 18).
    """
    return int(np.argmax(rewards >= least_equal(float(rewards.max()))))


def tie_of(reward: float) -> float:
    """Rewards that differ from one by no more than this are equal to it."""
    return _TIE * max(1.0, abs(reward))


def least_equal(best: float) -> float:
    """The least reward that is as good as the best."""
    return best - tie_of(best)


class JointProblem(NamedTuple):
    """What a search may ask for. An action is a number, in printed order, among a sensor's different courses.

    shape: number of different courses of each sensor.
    evaluate: mean joint rewards (num,) of joint actions (num, num_sensors), each row one action a sensor; the same row
        gives the same number again, at its price.
    independent: the joint action in which every sensor takes what is best for it alone, of what it may take.
    mask: which courses and pairs of courses are allowed; None: all.
    line: mean joint rewards (num_courses,) of all courses of a sensor where the others are held as in a joint action;
        cheaper than to evaluate them. None: they are evaluated.
    ascend: the end of a coordinate ascent from a joint action, where it is compiled; it keeps to `mask` if what it
        starts from does. None: the search ascends itself.
    partial: as `evaluate`, where -1 says that a sensor does not scan. None: not to be had.
    bound: what no joint action has a larger mean reward than; inf where that is not known. None: not to be had.
    """

    shape: tuple[int, ...]
    evaluate: Callable[[Ints], Floats]
    independent: Callable[[], tuple[int, ...]]
    mask: Mask | None = None
    line: Callable[[tuple[int, ...], int], Floats] | None = None
    ascend: Callable[[tuple[int, ...]], tuple[int, ...]] | None = None
    partial: Callable[[Ints], Floats] | None = None
    bound: Callable[[], float] | None = None


@runtime_checkable
class JointSearch(Protocol):
    """Finds a joint action of large mean reward."""

    def search(self, problem: JointProblem, *, rng: np.random.Generator) -> tuple[int, ...]:
        """The joint action to take, one action a sensor; of equally good ones the first in printed order."""
        ...


def all_joint_actions(shape: tuple[int, ...]) -> Ints:
    """(num_joint, num_sensors) every joint action, the last sensor's action fastest."""
    number = np.arange(math.prod(shape), dtype=np.int64)
    actions = np.empty((len(number), len(shape)), np.int64)
    for s in reversed(range(len(shape))):
        number, actions[:, s] = np.divmod(number, shape[s])
    return actions
