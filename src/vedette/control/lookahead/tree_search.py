"""Monte Carlo tree search over the joint sequences, one sensor's course at a time, decision by decision."""

import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from vedette.control.lookahead.courses import Sequence
from vedette.control.lookahead.problem import JointSequence, SequenceProblem
from vedette.models.fields import Checked, Count, NonNegative

# Number of rounds without a new evaluation after which the search ends.
_IDLE_ROUNDS = 50


@dataclass(frozen=True, slots=True)
class TreeSearch(Checked):
    """A search by upper confidence bounds on trees (Kocsis, Szepesvari 2006), for deterministic values.

    A node is a beginning: the courses of all sensors at the first decisions, and of the first sensors at the next one.
    From
    the root the child is taken whose mean value, scaled to the values seen so far, plus
    exploration sqrt(ln(visits) / visits of the child) is largest, until a node has a child that was never tried. From
    there the sequence is completed by a rollout. Branches that are fully evaluated are not entered again.

    Attributes:
        exploration: weight of rarely tried branches.
        rollout: "random": courses drawn at random. "repeat_last": every sensor repeats its last action.
        batch: rollouts that are evaluated together, which is faster. Each counts as a visit before its value is known.
    """

    exploration: NonNegative = 0.3
    rollout: Literal["random", "repeat_last"] = "random"
    batch: Count = 16

    def search(self, problem: SequenceProblem, *, rng: np.random.Generator) -> None:
        """Search until the budget is used up, or all sequences are evaluated."""
        climb, idle = _Climb(problem, self, rng), 0
        while problem.left > 0 and not climb.root.closed and idle < _IDLE_ROUNDS:
            before = problem.left
            climb.round(min(self.batch, problem.left))
            idle = idle + 1 if problem.left == before else 0


@dataclass(slots=True, eq=False)
class _Node:
    untried: list[int]  # courses of the next sensor, in the order of the tries
    visits: int = 0
    num_known: int = 0  # number of visits with known values
    total: float = 0.0  # sum of these values
    closed: bool = False  # whether all sequences below are evaluated
    children: "dict[int, _Node]" = field(default_factory=dict)


class _Climb:
    """A search tree that grows."""

    def __init__(self, problem: SequenceProblem, search: TreeSearch, rng: np.random.Generator) -> None:
        self.problem, self.search, self.rng = problem, search, rng
        self.lowest, self.highest = math.inf, -math.inf
        self.root = self._node(())

    def round(self, num: int) -> None:
        """Evaluate a batch of rollouts and update the tree."""
        paths, joints = [], []
        for _ in range(num):
            if self.root.closed:
                break
            path, courses = self._descend()
            paths.append(path)
            joints.append(self._completed(courses))
        values = iter(self.problem.evaluate([joint for joint in joints if joint is not None]))
        for path, joint in zip(paths, joints, strict=True):
            value = -math.inf if joint is None else next(values)
            if not math.isfinite(value):
                continue
            self.lowest, self.highest = min(self.lowest, value), max(self.highest, value)
            for node in path:
                node.total += value
                node.num_known += 1

    def _descend(self) -> tuple[list[_Node], tuple[int, ...]]:
        """Return the path to a new node, whose nodes count one more visit, and the courses of that node."""
        courses: tuple[int, ...] = ()
        node, path = self.root, [self.root]
        while not node.closed:
            new = bool(node.untried)
            course = node.untried.pop() if new else self._promising(node)
            courses = (*courses, course)
            if new:
                node.children[course] = self._node(courses)
            node = node.children[course]
            path.append(node)
            if new:
                break
        for node in reversed(path):
            node.visits += 1
            node.closed = node.closed or (not node.untried and all(child.closed for child in node.children.values()))
        return path, courses

    def _node(self, courses: tuple[int, ...]) -> _Node:
        num_sensors = self.problem.num_sensors
        stage, sensor = divmod(len(courses), num_sensors)
        if stage == self.problem.depth:
            return _Node([], closed=True)
        taken = tuple(courses[s::num_sensors] for s in range(num_sensors))
        allowed = self.problem.after(sensor, taken[sensor], taken)
        return _Node([allowed[place] for place in self.rng.permutation(len(allowed))])

    def _promising(self, node: _Node) -> int:
        """Return the child to continue with, among those that are not fully evaluated."""
        spread = self.highest - self.lowest
        log = math.log(node.visits)

        def bound(item: tuple[int, _Node]) -> float:
            child = item[1]
            # Values that are not known yet count as the worst.
            above = child.total - child.num_known * self.lowest
            mean = above / (child.visits * spread) if spread > 0.0 else 0.0
            return mean + self.search.exploration * math.sqrt(log / child.visits)

        return max((item for item in node.children.items() if not item[1].closed), key=bound)[0]

    def _completed(self, courses: tuple[int, ...]) -> JointSequence | None:
        """Return a whole joint sequence with this beginning, or None if no feasible one was found."""
        num_sensors = self.problem.num_sensors
        taken = [courses[s::num_sensors] for s in range(num_sensors)]
        for s in range(num_sensors):
            whole = self._rolled_out(s, tuple(taken))
            if whole is None:
                return None
            taken[s] = whole
        return tuple(taken)

    def _rolled_out(self, sensor: int, joint: JointSequence) -> Sequence | None:
        problem, taken = self.problem, joint[sensor]
        if self.search.rollout == "repeat_last" and taken:
            return problem.completed(sensor, taken, joint)
        while len(taken) < problem.depth:
            allowed = problem.after(sensor, taken, joint)
            if not allowed:  # a random choice led to a dead end
                return problem.completed(sensor, joint[sensor], joint)
            taken = (*taken, allowed[int(self.rng.integers(len(allowed)))])
            if self.search.rollout == "repeat_last":
                return problem.completed(sensor, taken, joint)
        return taken
