"""Searching the joint actions of all sensors for the one of largest mean reward."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

import numpy as np

from vedette.errors import InputError
from vedette.kernels.base.types import Floats, Ints
from vedette.models.arguments import dimension

# Rewards nearer than this, relative to the best or to 1, are equal: rounding tells them apart, not what they are worth.
_TIE = 1e-9


def first_best(rewards: Floats) -> int:
    """The first of the largest rewards; those within 1e-9 of the largest, relative to it or to 1, are equal to it.

    In a symmetric layout mirrored actions differ by rounding only; the decision must not hang on that (paper-notes 18).
    """
    best = float(rewards.max())
    return int(np.argmax(rewards >= best - _TIE * max(1.0, abs(best))))


class JointProblem(NamedTuple):
    """What a search may ask for. An action is a number, in printed order, among a sensor's different directions."""

    shape: tuple[int, ...]
    evaluate: Callable[[Ints], Floats]
    independent: Callable[[], tuple[int, ...]]
    mask: Any = None
    line: Callable[[tuple[int, ...], int], Floats] | None = None
    ascend: Callable[[tuple[int, ...]], tuple[int, ...]] | None = None
    partial: Callable[[Ints], Floats] | None = None


class JointSearch(Protocol):
    """Finds a joint action of large mean reward."""

    def search(self, problem: JointProblem, *, rng: np.random.Generator) -> tuple[int, ...]:
        """The joint action to take, one action a sensor; of equally good ones the first in printed order."""
        ...


@dataclass(frozen=True, slots=True)
class ExhaustiveSearch:
    """Every joint action (paper, Algorithm 2): the best there is, and the oracle for all other searches.

    Attributes:
        max_joint_actions: bound on their number, which grows as a power of the number of sensors.
    """

    max_joint_actions: int = 1_000_000

    def __post_init__(self) -> None:
        dimension("max_joint_actions", self.max_joint_actions)

    def search(self, problem: JointProblem, *, rng: np.random.Generator) -> tuple[int, ...]:
        """The best of all; nothing is drawn. Raises `InputError` for more joint actions than `max_joint_actions`."""
        num_joint = math.prod(problem.shape)
        if num_joint > self.max_joint_actions:
            sizes = " x ".join(map(str, problem.shape))
            raise InputError(
                f"joint actions: expected at most {self.max_joint_actions} for an exhaustive search; got {sizes} = "
                f"{num_joint}; allow more, or search by CoordinateAscent"
            )
        best = first_best(problem.evaluate(all_joint_actions(problem.shape)))
        return tuple(int(action) for action in np.unravel_index(best, problem.shape))


@dataclass(frozen=True, slots=True)
class CoordinateAscent:
    """One sensor at a time, the others held, until no sensor alone can do better; for many sensors.

    The first ascent starts at the independent decision, so that its end is never worse than that. The end is a local
    maximum: no change of one sensor's action improves it, a change of two might. No joint action is evaluated twice.

    Attributes:
        num_restarts: further ascents, from joint actions drawn at random.
    """

    num_restarts: int = 0

    def __post_init__(self) -> None:
        if self.num_restarts != 0:
            dimension("num_restarts", self.num_restarts)

    def search(self, problem: JointProblem, *, rng: np.random.Generator) -> tuple[int, ...]:
        """The best of all ascents; of equal ones that were evaluated the first in printed order."""
        known = _Known(problem)
        _ascend(known, problem.independent())
        for _ in range(self.num_restarts):
            _ascend(known, tuple(int(action) for action in rng.integers(problem.shape)))
        evaluated = sorted(known.values)
        return evaluated[first_best(np.array([known.values[joint] for joint in evaluated]))]


@dataclass(slots=True)
class _Known:
    """A problem with the mean rewards found so far."""

    problem: JointProblem
    values: dict[tuple[int, ...], float] = field(default_factory=dict)

    def line(self, through: tuple[int, ...], sensor: int) -> list[tuple[int, ...]]:
        """All joint actions that differ from one in this sensor's action at most; their values become known."""
        ahead, behind = through[:sensor], through[sensor + 1 :]
        joint_actions = [(*ahead, action, *behind) for action in range(self.problem.shape[sensor])]
        new = [joint for joint in joint_actions if joint not in self.values]
        if new:
            rewards = self.problem.evaluate(np.array(new, np.int64))
            self.values.update(zip(new, rewards.tolist(), strict=True))
        return joint_actions


def _ascend(known: _Known, start: tuple[int, ...]) -> None:
    """One ascent. Along a line the first of the largest is taken, to the last digit, so that none goes in circles."""
    at, settled, sensor, num_sensors = start, 0, 0, len(start)
    while settled < num_sensors:
        line = known.line(at, sensor)
        best = max(line, key=known.values.__getitem__)
        settled = settled + 1 if best == at else 1
        at, sensor = best, (sensor + 1) % num_sensors


def all_joint_actions(shape: tuple[int, ...]) -> Ints:
    """(num_joint, num_sensors) every joint action, the last sensor's action fastest."""
    return np.ascontiguousarray(np.indices(shape).reshape(len(shape), -1).T)
