"""Joint sequences that constraints allow, pairs of sensors included, and the search for one of them."""

import math
from collections.abc import Iterator
from collections.abc import Sequence as Several
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from vedette.control.constraints.mask import Mask, depth_first, nearest_feasible, relaxed
from vedette.control.constraints.masks import infeasible_note
from vedette.control.lookahead.constraints import MultiStepConstraints
from vedette.control.lookahead.courses import CourseTree, Sequence
from vedette.kernels.base.types import Bools

# Maximum number of courses tried. With more, a decision would wait for the proof that no sequence is feasible;
# a feasible one is nearly always found within this number.
_MOST_TRIES = 10_000


@dataclass(slots=True, eq=False)
class FeasibleSequences:
    """The joint sequences that constraints allow."""

    trees: tuple[CourseTree, ...]  # course tree of each sensor alone
    ahead: MultiStepConstraints  # constraints on pairs of sensors
    mask: Mask  # of the first decision
    until: int  # number of decisions at which pairs of sensors are tested
    start: tuple[Sequence, ...]  # a feasible joint sequence
    _tables: dict[tuple[int, int, bytes, bytes, int], Bools | None] = field(default_factory=dict)
    _together: dict[tuple[int, int, Sequence, Sequence], bool] = field(default_factory=dict)
    _single: dict[tuple[int, Sequence], bool] = field(default_factory=dict)

    @classmethod
    def of(cls, trees: tuple[CourseTree, ...], ahead: MultiStepConstraints) -> "FeasibleSequences":
        """Return the feasible sequences of trees without constraints.

        Dead ends are left out, unless this leaves pairs of sensors no feasible courses at the first decision. If no
        joint sequence is found that satisfies all constraints on pairs, they are tested for as many decisions as one
        was found for. See `notes`. Raises `InputError` as `feasible_action_mask`.
        """
        mask = ahead.mask({s: tree.place(()) for s, tree in enumerate(trees)})
        bound = tuple(replace(tree, ahead=ahead, now=own) for tree, own in zip(trees, mask.single, strict=True))
        furthest = _furthest(bound, ahead, mask)
        if not furthest[0]:
            bound = tuple(tree.with_dead_ends() for tree in bound)
            furthest = _furthest(bound, ahead, mask)
        start = tuple(tree.completed(taken) for tree, taken in zip(bound, furthest, strict=True))
        return cls(bound, ahead, mask, len(furthest[0]), start)

    def first(self) -> Mask:
        """Mask of the first decision, without dead ends."""
        single = tuple(np.zeros(len(own), bool) for own in self.mask.single)
        for own, tree in zip(single, self.trees, strict=True):
            own[list(tree.allowed(()))] = True
        return Mask(single, self.mask.together, active=self.mask.active)

    def allows(self, joint: Several[Sequence | None]) -> bool:
        """Return True if the sequences are allowed together. None: the sensor is not tested."""
        tested = [(s, own) for s, own in enumerate(joint) if own is not None]
        pairs = combinations(tested, 2) if self.ahead.on_pairs else ()
        if not all(self._alone(*each) for each in tested) or not all(
            self._are_compatible(*one, *two) for one, two in pairs
        ):
            return False
        stages = range(1, self.trees[0].stages.depth + 1) if self.mask.active is not None else ()
        return all(self._num_active(joint, stage) <= self.most_active for stage in stages)

    def after(self, sensor: int, taken: Sequence, others: Several[Sequence | None]) -> Sequence:
        """Return feasible next courses of one sensor, given the other sensors' choices. There may be none.

        others: for each sensor its courses. Those that are None, too short, or the sensor's own are not tested.
        """
        feasible, stage = self.trees[sensor].allowed(taken), len(taken) + 1
        for other, own in enumerate(others):
            if other == sensor or own is None or len(own) < stage:
                continue
            table = self._table(sensor, taken, other, own[: stage - 1])
            if table is not None:
                feasible = tuple(course for course in feasible if table[course, own[stage - 1]])
        beside = [None if s == sensor else own for s, own in enumerate(others)]
        if self._num_active(beside, stage) >= self.most_active:
            feasible = tuple(course for course in feasible if not self._scans(sensor, (*taken, course)))
        return feasible

    def completed(self, sensor: int, taken: Sequence, others: Several[Sequence | None]) -> Sequence | None:
        """Return the whole feasible sequence that stays nearest to the last action. None: none found.

        The nearest course is taken from decision to decision, with backtracking from dead ends.
        """
        tree = self.trees[sensor]

        def ways(own: Sequence) -> Iterator[Sequence]:
            return ((*own, k) for k in tree.nearest(own, self.after(sensor, own, others)))

        return depth_first(taken, ways, lambda own: len(own) == tree.stages.depth, _MOST_TRIES)

    def notes(self, sequence: Several[Sequence]) -> tuple[str, ...]:
        """Return notes on a decision for a joint sequence."""
        notes = [
            f"sensor {s + 1}, decision {k} of the sequence: {infeasible_note(self.ahead.constraints)}"
            for s, (tree, own) in enumerate(zip(self.trees, sequence, strict=True))
            for k in tree.blocked(own)
        ]
        if self.until < self.trees[0].stages.depth:
            notes.append(
                f"no joint sequence was found on which the sensors go together after decision {self.until}; from there "
                "on that is given up"
            )
        return *self.mask.notes, *notes

    @property
    def most_active(self) -> float:
        """Number of sensors that may scan. inf: all."""
        return math.inf if self.mask.active is None else self.mask.active.limit

    def _num_active(self, joint: Several[Sequence | None], stage: int) -> int:
        """Return the number of sensors that scan after a decision, counted from 1, among sequences that reach it."""
        if self.mask.active is None:
            return 0
        return sum(self._scans(s, own[:stage]) for s, own in enumerate(joint) if own is not None and len(own) >= stage)

    def _scans(self, sensor: int, taken: Sequence) -> bool:
        """Return True if a sensor scans after the last of the courses taken."""
        return bool(self.trees[sensor].options(taken[:-1]).scans[taken[-1]].any())

    def _alone(self, sensor: int, sequence: Sequence) -> bool:
        key = (sensor, sequence)
        if key not in self._single:
            tree = self.trees[sensor]
            self._single[key] = all(course in tree.allowed(sequence[:k]) for k, course in enumerate(sequence))
        return self._single[key]

    def _are_compatible(self, first: int, one: Sequence, second: int, other: Sequence) -> bool:
        key = (first, second, one, other)
        if key not in self._together:
            stages = range(min(len(one), len(other)))
            tables = ((k, self._table(first, one[:k], second, other[:k])) for k in stages)
            self._together[key] = all(table is None or table[one[k], other[k]] for k, table in tables)
        return self._together[key]

    def _table(self, first: int, one: Sequence, second: int, other: Sequence) -> Bools | None:
        """Return (num_courses of the first, of the second) compatible courses after the courses taken. None: all."""
        stage = len(one) + 1
        if stage > self.until or not self.ahead.on_pairs:
            return None
        if first > second:
            table = self._table(second, other, first, one)
            return None if table is None else table.T
        if stage == 1:
            return self.mask.together.get((first, second))
        first_tree, second_tree = self.trees[first], self.trees[second]
        key = (first, second, first_tree.pose_key(one), second_tree.pose_key(other), self.ahead.moment(stage))
        if key not in self._tables:
            places = {first: first_tree.place(one), second: second_tree.place(other)}
            self._tables[key] = self.ahead.pairs(stage, places).get((first, second))
        return self._tables[key]


class _Begun(NamedTuple):
    """A joint beginning, and the courses of the first sensors at the next decision."""

    joint: tuple[Sequence, ...]
    mask: Mask
    orders: list[list[int]]  # for each sensor its courses there, in the order of the tries
    at: tuple[int, ...] = ()


def _furthest(trees: tuple[CourseTree, ...], ahead: MultiStepConstraints, mask: Mask) -> tuple[Sequence, ...]:
    """Return courses that all sensors may take together, for as many decisions as possible, perhaps for none.

    At each decision the courses that repeat the last action, made feasible, are tried first, depth first, with a limit
    on the tries. mask: of the first decision, which allows a joint action.
    """
    num, depth = len(trees), trees[0].stages.depth
    furthest: tuple[Sequence, ...] = ((),) * num

    def begun(joint: tuple[Sequence, ...]) -> _Begun:
        orders = [tree.nearest(own, tree.allowed(own)) for tree, own in zip(trees, joint, strict=True)]
        single = tuple(np.zeros(len(tree.options(own).courses), bool) for tree, own in zip(trees, joint, strict=True))
        for own, courses in zip(single, orders, strict=True):
            own[courses] = True
        places = {s: tree.place(own) for s, (tree, own) in enumerate(zip(trees, joint, strict=True))}
        together = ahead.pairs(len(joint[0]) + 1, places) if joint[0] else mask.together
        here = Mask(single, together, active=mask.active and ahead.active(places))
        first = nearest_feasible(here, [own[0] for own in orders] if joint[0] else relaxed(mask)[1])
        if not here.allows(np.array([first]))[0]:
            return _Begun(joint, here, [[]] * num)
        return _Begun(
            joint, here, [[best, *(k for k in own if k != best)] for own, best in zip(orders, first, strict=True)]
        )

    def ways(node: _Begun) -> Iterator[_Begun | None]:
        if len(node.at) == num:
            node = begun(joined(node))
        sensor = len(node.at)
        conflicts = node.mask.conflicts((*node.at, *[-1] * (num - sensor)), sensor)
        return (node._replace(at=(*node.at, k)) if conflicts[k] == 0 else None for k in node.orders[sensor])

    def joined(node: _Begun) -> tuple[Sequence, ...]:
        return tuple((*own, course) for own, course in zip(node.joint, node.at, strict=True))

    def is_end(node: _Begun) -> bool:
        nonlocal furthest
        if len(node.at) == num and len(node.joint[0]) == len(furthest[0]):
            furthest = joined(node)
        return len(furthest[0]) == depth

    depth_first(begun(furthest), ways, is_end, _MOST_TRIES + 1)
    return furthest
