"""What a search over joint sequences may ask for, and what it found."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol, TypeAlias, runtime_checkable

import numpy as np

from vedette.control.explanation import Bound
from vedette.control.lookahead.courses import CourseTree, Sequence
from vedette.control.lookahead.laid_courses import LaidCourses, Taken
from vedette.control.lookahead.rules import Rules
from vedette.control.plan import SearchCurve
from vedette.control.search import first_best
from vedette.kernels.base.types import Floats

# A whole sequence of each sensor.
JointSequence: TypeAlias = tuple[Sequence, ...]


class Part(NamedTuple):
    """What the belief at the end of one decision's horizon adds to the value of a sequence."""

    weight: float
    rewards: LaidCourses


class Best(NamedTuple):
    """The best sequence that was found of those that begin with some joint action."""

    value: float
    sequence: JointSequence
    rewards: Floats  # (num_samples,)


@dataclass(slots=True, eq=False)
class SequenceProblem:
    """Values of joint sequences, and of those of some of the sensors while the others do not scan.

    Attributes:
        trees: what each sensor may do.
        depth: number of decisions.
        parts: of which values are sums.
        budget: how many joint sequences are evaluated at most.
        rules: what constraints allow; None: everything.
        found: for each joint first action (numbers of courses) of what was evaluated, the best that begins with it.
    """

    trees: tuple[CourseTree, ...]
    depth: int
    parts: tuple[Part, ...]
    budget: int
    rules: Rules | None = None
    found: dict[tuple[int, ...], Best] = field(default_factory=dict)
    _values: dict[Taken, float] = field(default_factory=dict)
    _evaluations: list[int] = field(default_factory=list)
    _best: list[float] = field(default_factory=list)

    @property
    def num_sensors(self) -> int:
        """Number of sensors."""
        return len(self.trees)

    @property
    def left(self) -> int:
        """How many joint sequences may still be evaluated."""
        return max(0, self.budget - len(self._values))

    def allows(self, joint: Taken) -> bool:
        """Whether constraints allow sequences that sensors take together; None: what a sensor does is not asked."""
        return self.rules is None or self.rules.allows(joint)

    def after(self, sensor: int, taken: Sequence, others: Taken) -> Sequence:
        """The courses that one sensor may take after those taken, beside what others take then; perhaps none.

        others: of each sensor; those that are None, or do not reach so far, are not asked about.
        """
        if self.rules is None:
            return self.trees[sensor].allowed(taken)
        return self.rules.after(sensor, taken, others)

    def kept(self, sensor: int, taken: Sequence, others: Taken) -> Sequence | None:
        """The whole sequence of one sensor that keeps to its last action, or to the one nearest to it that it may take
        beside the others; None: none was found."""
        return self.trees[sensor].kept(taken) if self.rules is None else self.rules.kept(sensor, taken, others)

    def evaluate(self, joints: Iterable[Taken]) -> list[float]:
        """Values of joint sequences, none evaluated twice; -inf for those that the budget has no room for.

        A sensor without a sequence (None) does not scan. A value that is no number is -inf, and so is that of what
        constraints forbid, which is not evaluated.
        """
        wanted = list(joints)
        unknown = [joint for joint in dict.fromkeys(wanted) if joint not in self._values]
        new = list(itertools.islice(filter(self.allows, unknown), self.left))
        if new:
            rewards = self._rewards(new)
            values = rewards.mean(axis=1)
            values[~np.isfinite(values)] = -math.inf
            self._values.update(zip(new, values.tolist(), strict=True))
            self._keep(new, rewards, values)
        return [self._values.get(joint, -math.inf) for joint in wanted]

    def _rewards(self, joints: list[Taken]) -> Floats:
        total: Floats | float = 0.0
        for weight, rewards in self.parts:
            cut = [tuple(None if own is None else own[: rewards.stage] for own in joint) for joint in joints]
            distinct = {joint: i for i, joint in enumerate(dict.fromkeys(cut))}
            total = total + weight * rewards(list(distinct))[[distinct[joint] for joint in cut]]
        return np.asarray(total)

    def _keep(self, joints: list[Taken], rewards: Floats, values: Floats) -> None:
        """Note the best one for each beginning; of equal ones the first in printed order."""
        for joint, own, value in zip(joints, rewards, values.tolist(), strict=True):
            whole = tuple(taken for taken in joint if taken is not None)
            if len(whole) < self.num_sensors:
                continue
            first = tuple(taken[0] for taken in whole)
            old = self.found.get(first)
            if old is None or value > old.value or (value == old.value and printed(whole) < printed(old.sequence)):
                self.found[first] = Best(value, whole, own)
        self._evaluations.append(len(self._values))
        self._best.append(max((best.value for best in self.found.values()), default=-math.inf))

    def begin(self, choice: tuple[int, ...]) -> None:
        """Evaluate a joint sequence to begin with: all sensors keep to a joint action; or another that is allowed."""
        joint: Taken = tuple((course,) for course in choice)
        for s, own in enumerate(joint):
            whole = None if own is None else self.kept(s, own, joint)
            joint = (*joint[:s], whole, *joint[s + 1 :])
        if None not in joint:
            self.evaluate([joint])
        if not self.found and self.rules is not None:
            self.evaluate([self.rules.start])

    def best(self) -> Best:
        """The best of all; of those that are equal up to rounding the first in printed order."""
        each = sorted(self.found.values(), key=lambda best: printed(best.sequence))
        return each[first_best(np.array([best.value for best in each]))]

    def bound(self) -> Bound | None:
        """That of the best, where all joint sequences were evaluated."""
        if math.prod(tree.count(self.budget) for tree in self.trees) > self.budget:
            return None
        best = self.best().value
        return Bound(best, best, "exhaustive")

    def curve(self) -> SearchCurve:
        """How the search went, from the first whole joint sequence on."""
        known = np.array(self._best) > -math.inf
        return SearchCurve(np.array(self._evaluations, np.int64)[known], np.array(self._best)[known])


def printed(sequence: JointSequence) -> tuple[int, ...]:
    """Sorts as tables are printed: by the first courses of all sensors, then by the second ones."""
    return tuple(course for stage in zip(*sequence, strict=True) for course in stage)


@runtime_checkable
class SequenceSearch(Protocol):
    """Finds a joint sequence of large value; what it evaluates is kept in the problem."""

    def search(self, problem: SequenceProblem, *, rng: np.random.Generator) -> None:
        """Evaluate whole joint sequences, at least one, within the budget."""
        ...
