"""The search problem over joint sequences: its evaluations and its results."""

import itertools
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, Protocol, TypeAlias, runtime_checkable

import numpy as np

from vedette.control.additive.rewards import AdditiveRewards
from vedette.control.evaluator import Evaluator
from vedette.control.explanation import Bound
from vedette.control.lookahead.courses import CourseTree, Sequence
from vedette.control.lookahead.feasibility import FeasibleSequences
from vedette.control.plan import SearchCurve
from vedette.control.search.problem import first_best
from vedette.kernels.base.types import Bools, Floats, Ints
from vedette.kernels.planning.ascent import Cells
from vedette.platforms import Options

# A whole sequence for each sensor.
JointSequence: TypeAlias = tuple[Sequence, ...]
# The courses taken by each sensor; None: it does not scan.
Taken: TypeAlias = tuple[Sequence | None, ...]


class _Lists:
    """Appendable lists of entries in several columns. List i is offsets[i]:offsets[i + 1].

    The entries are copied each time the capacity doubles.
    """

    def __init__(self, offsets: Ints, *columns: np.ndarray[Any, Any]) -> None:
        self._rooms, self._nums = [offsets, *columns], [len(offsets), *map(len, columns)]

    def append(self, offsets: Ints, *columns: np.ndarray[Any, Any]) -> None:
        """Append lists."""
        last = self._rooms[0][self._nums[0] - 1]
        for i, more in enumerate((offsets[1:] + last, *columns)):
            room, num, end = self._rooms[i], self._nums[i], self._nums[i] + len(more)
            if end > len(room):
                self._rooms[i] = np.empty((max(end, 2 * len(room)), *room.shape[1:]), room.dtype)
                self._rooms[i][:num] = room[:num]
            self._rooms[i][num:end], self._nums[i] = more, end

    @property
    def values(self) -> tuple[np.ndarray[Any, Any], ...]:
        """The offsets and the columns."""
        return tuple(room[:num] for room, num in zip(self._rooms, self._nums, strict=True))


@dataclass(slots=True, eq=False)
class PrecomputedCourses:
    """Rewards at the end of the horizon of one decision, the `stage`-th from now."""

    trees: tuple[CourseTree, ...]  # course tree of each sensor
    stage: int  # number of courses that each sensor has taken by then
    # computes the changes of some courses of each sensor, with the same samples each time
    lay_out: Callable[[tuple[Options, ...]], Evaluator]
    weight: float  # of these rewards in the value of a sequence
    first: int  # the first decision, from 0, whose prices are subtracted here
    counts: dict[str, int]  # filter steps and rewards so far
    _places: dict[tuple[int, Sequence], int] = field(default_factory=dict)
    _additive: AdditiveRewards | None = None
    _lists: tuple[_Lists, ...] = ()
    _prices: list[float] = field(default_factory=list)

    def __call__(self, joints: list[Taken]) -> Floats:
        """Return rewards (num, num_samples) of joint actions."""
        requested = {(s, taken) for joint in joints for s, taken in enumerate(joint) if taken is not None}
        # Sensor by sensor, as they are precomputed.
        new = sorted(requested - self._places.keys())
        if new or self._additive is None:
            self._add(new)
        actions = [[-1 if own is None else self._places[s, own] for s, own in enumerate(joint)] for joint in joints]
        rewards = self._rewards()(np.array(actions, np.int64))
        self.counts["rewards"] += rewards.size
        return rewards

    def _add(self, new: list[tuple[int, Sequence]]) -> None:
        courses: list[list[tuple[Floats, Bools]]] = [[] for _ in self.trees]
        for s, taken in new:
            self._places[s, taken] = len(self._places)
            courses[s].append(self.trees[s].course(taken))
            self._prices.append(self.trees[s].price(taken, self.first))
        evaluator = self.lay_out(tuple(self._options(*own) for own in zip(self.trees, courses, strict=True)))
        self.counts["filter_steps"] += evaluator.counts["filter_steps"]
        assert evaluator.additive is not None
        table, cells = evaluator.additive.table, evaluator.additive.cells
        changes = table.offsets, table.labels, table.changes
        cell_entries = cells.offsets, cells.cells, cells.log_miss
        if self._additive is None:
            self._additive, self._lists = evaluator.additive, (_Lists(*changes), _Lists(*cell_entries))
        else:
            for lists, more in zip(self._lists, (changes, cell_entries), strict=True):
                lists.append(*more)

    def _options(self, tree: CourseTree, courses: list[tuple[Floats, Bools]]) -> Options:
        num_courses, steps = len(courses), tree.stages.num_steps(self.stage)
        poses = np.array([own for own, _ in courses]).reshape(num_courses, steps, len(tree.pose))
        scans = np.array([own for _, own in courses], np.bool_).reshape(num_courses, steps)
        return Options(tree.options(()).actions, poses, np.arange(num_courses), tree.pose, np.zeros(num_courses), scans)

    def _rewards(self) -> AdditiveRewards:
        """Return the rewards of all courses so far. Each sensor may index any of them, and is given its own."""
        old = self._additive
        assert old is not None
        (offsets, labels, changes), (cell_offsets, cells, log_miss) = (own.values for own in self._lists)
        firsts = np.zeros(len(self.trees) + 1, np.int64)
        table = old.table._replace(first_courses=firsts, offsets=offsets, labels=labels, changes=changes)
        cells_of = Cells(cell_offsets, cells, log_miss, old.cells.worth)
        return replace(old, table=table, cells=cells_of, prices=np.array(self._prices))


class Best(NamedTuple):
    """The best sequence found among those that begin with a given joint action."""

    value: float
    sequence: JointSequence
    rewards: Floats  # (num_samples,)


@dataclass(slots=True, eq=False)
class SequenceProblem:
    """Values of joint sequences, and of sequences of some sensors while the others do not scan.

    Attributes:
        trees: course tree of each sensor.
        depth: number of decisions.
        parts: the terms that values are sums of.
        budget: maximum number of joint sequences evaluated.
        rules: sequences that constraints allow. None: all.
        found: for each evaluated joint first action (course indices), the best sequence that begins with it.
    """

    trees: tuple[CourseTree, ...]
    depth: int
    parts: tuple[PrecomputedCourses, ...]
    budget: int
    rules: FeasibleSequences | None = None
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
        """Number of joint sequences that may still be evaluated."""
        return max(0, self.budget - len(self._values))

    def allows(self, joint: Taken) -> bool:
        """Return True if constraints allow the sequences together. None: the sensor is not tested."""
        return self.rules is None or self.rules.allows(joint)

    def after(self, sensor: int, taken: Sequence, others: Taken) -> Sequence:
        """Return the courses that one sensor may take next, given the other sensors' courses. There may be none.

        others: for each sensor. Sequences that are None or too short are not tested.
        """
        if self.rules is None:
            return self.trees[sensor].allowed(taken)
        return self.rules.after(sensor, taken, others)

    def completed(self, sensor: int, taken: Sequence, others: Taken) -> Sequence | None:
        """Return the whole sequence of one sensor that repeats its last action, or the nearest one that is feasible.

        others: sequences of the other sensors. None: no such sequence was found.
        """
        return (
            self.trees[sensor].completed(taken) if self.rules is None else self.rules.completed(sensor, taken, others)
        )

    def evaluate(self, joints: Iterable[Taken]) -> list[float]:
        """Return values of joint sequences, none evaluated twice, with -inf for those beyond the budget.

        A sensor without a sequence (None) does not scan. The value is -inf if it is not finite, and for sequences that
        constraints forbid, which are not evaluated.
        """
        requested = list(joints)
        unknown = [joint for joint in dict.fromkeys(requested) if joint not in self._values]
        new = list(itertools.islice(filter(self.allows, unknown), self.left))
        if new:
            rewards = self._rewards(new)
            values = rewards.mean(axis=1)
            values[~np.isfinite(values)] = -math.inf
            self._values.update(zip(new, values.tolist(), strict=True))
            self._keep(new, rewards, values)
        return [self._values.get(joint, -math.inf) for joint in requested]

    def _rewards(self, joints: list[Taken]) -> Floats:
        total: Floats | float = 0.0
        for part in self.parts:
            cut = [tuple(None if own is None else own[: part.stage] for own in joint) for joint in joints]
            distinct = {joint: i for i, joint in enumerate(dict.fromkeys(cut))}
            total = total + part.weight * part(list(distinct))[[distinct[joint] for joint in cut]]
        return np.asarray(total)

    def _keep(self, joints: list[Taken], rewards: Floats, values: Floats) -> None:
        """Store the best sequence for each first joint action, of equal ones the first in printed order."""
        for joint, own, value in zip(joints, rewards, values.tolist(), strict=True):
            whole = tuple(taken for taken in joint if taken is not None)
            if len(whole) < self.num_sensors:
                continue
            first = tuple(taken[0] for taken in whole)
            old = self.found.get(first)
            if (
                old is None
                or value > old.value
                or (value == old.value and printed_order(whole) < printed_order(old.sequence))
            ):
                self.found[first] = Best(value, whole, own)
        self._evaluations.append(len(self._values))
        self._best.append(max((best.value for best in self.found.values()), default=-math.inf))

    def begin(self, choice: tuple[int, ...]) -> None:
        """Evaluate a first joint sequence: all sensors repeat a joint action, or another that is allowed."""
        joint: Taken = tuple((course,) for course in choice)
        for s, own in enumerate(joint):
            whole = None if own is None else self.completed(s, own, joint)
            joint = (*joint[:s], whole, *joint[s + 1 :])
        if None not in joint:
            self.evaluate([joint])
        if not self.found and self.rules is not None:
            self.evaluate([self.rules.start])

    def best(self) -> Best:
        """Return the best sequence, of those that are equal up to rounding the first in printed order."""
        each = sorted(self.found.values(), key=lambda best: printed_order(best.sequence))
        return each[first_best(np.array([best.value for best in each]))]

    def bound(self) -> Bound | None:
        """Return the bound given by the best sequence, if all joint sequences were evaluated."""
        if math.prod(tree.count(self.budget) for tree in self.trees) > self.budget:
            return None
        best = self.best().value
        return Bound(best, best, "exhaustive")

    def curve(self) -> SearchCurve:
        """Return the progress of the search, from the first whole joint sequence on."""
        has_best = np.array(self._best) > -math.inf
        return SearchCurve(np.array(self._evaluations, np.int64)[has_best], np.array(self._best)[has_best])


def printed_order(sequence: JointSequence) -> tuple[int, ...]:
    """Return the sort key of printed tables: the first courses of all sensors, then the second ones."""
    return tuple(course for stage in zip(*sequence, strict=True) for course in stage)


@runtime_checkable
class SequenceSearch(Protocol):
    """A search for a joint sequence with a large value. The problem stores its evaluations."""

    def search(self, problem: SequenceProblem, *, rng: np.random.Generator) -> None:
        """Evaluate whole joint sequences, at least one, within the budget."""
