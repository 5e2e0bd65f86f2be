"""Feasible joint actions, by course and by pair of courses, and the search for one near a given joint action."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, TypeVar

import numpy as np

from vedette.control.constraints.active import Active
from vedette.errors import InputError
from vedette.kernels.base.types import Bools, Ints

# Maximum number of courses tried for a group of conflicting sensors. With more, a decision would wait for the proof
# that no joint action is feasible; a feasible one is nearly always found within this number.
_TRIES = 1000

_Node = TypeVar("_Node")
_OVER: Any = object()  # end of an iterator

_GIVEN = "the constraint is given up"


@dataclass(frozen=True, slots=True, eq=False)
class Mask:
    """Allowed courses and pairs of courses, and the number of sensors that may scan.

    A joint action is allowed if all its courses and pairs are, and not too many sensors scan.

    Attributes:
        single: (num_courses,) allowed courses of each sensor, one array per sensor.
        together: (num_courses of i, of j) compatible courses of sensors i < j, by (i, j). All courses of other pairs
            are compatible.
        notes: notes for readers of the decision.
        active: the courses that scan, and the number of sensors that may. None: all may.

    Raises:
        InputError: a table of the wrong shape, or of a pair that does not exist.
    """

    single: tuple[Bools, ...]
    together: Mapping[tuple[int, int], Bools] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    active: Active | None = None
    _conflicts: tuple[Mapping[int, Ints], ...] = field(init=False)

    def __post_init__(self) -> None:
        conflicts: tuple[dict[int, Ints], ...] = tuple({} for _ in self.single)
        shape = self.shape
        for (first, second), table in self.together.items():
            if not 0 <= first < second < len(shape):
                raise InputError(f"mask: expected pairs of sensors below {len(shape)}; got {first, second}")
            expected_shape = (shape[first], shape[second])
            if table.shape != expected_shape:
                raise InputError(f"mask of sensors {first, second}: expected shape {expected_shape}; got {table.shape}")
            clash = np.asarray(~table, np.int64)
            # One row per course of the other sensor, so that a look-up reads one contiguous row.
            conflicts[first][second] = np.ascontiguousarray(clash.T)
            conflicts[second][first] = clash
        object.__setattr__(self, "_conflicts", conflicts)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of courses of each sensor."""
        return tuple(len(own) for own in self.single)

    def violations(self, actions: Ints) -> Ints:
        """Return (num,) the number of violations of each joint action (num, num_sensors).

        Counts forbidden courses, forbidden pairs of courses, and sensors that scan beyond the limit.
        """
        violations = np.zeros(len(actions), np.int64)
        for s, own in enumerate(self.single):
            if not own.all():
                violations += ~own[actions[:, s]]
        for (first, second), table in self.together.items():
            violations += ~table[actions[:, first], actions[:, second]]
        return violations if self.active is None else violations + self.active.excess(actions)

    def allows(self, actions: Ints) -> Bools:
        """Return (num,) whether joint actions (num, num_sensors) are allowed."""
        return np.asarray(self.violations(actions) == 0)

    def others(self, sensor: int) -> Mapping[int, Ints]:
        """Return the sensors that `sensor` may conflict with, each with its table of conflicts.

        A table has shape (num_courses of the other, num_courses of `sensor`). 1: conflict.
        """
        return self._conflicts[sensor]

    def conflicts(self, at: Sequence[int], sensor: int) -> Ints:
        """Return (num_courses,) the violations that each course of one sensor causes with the others' courses.

        at: courses. Negative ones belong to undecided sensors, which cause no conflict.
        """
        conflicts = self.forbidden(at, sensor)
        if self.active is not None and self.active.is_full(at, sensor):
            conflicts += self.active.on[sensor]
        return conflicts

    def forbidden(self, at: Sequence[int], sensor: int) -> Ints:
        """Return the same numbers as `conflicts`, without the limit on the number of sensors that scan."""
        counts = (~self.single[sensor]).astype(np.int64)
        for other, clash in self._conflicts[sensor].items():
            if at[other] >= 0:
                counts += clash[at[other]]
        return counts


def nearest_feasible(mask: Mask, start: Sequence[int]) -> tuple[int, ...]:
    """Return a joint action with few violations near `start`: none if one is found, and `start` if it has none.

    Sensor by sensor, each takes its course with the fewest violations, as long as this improves any. The remaining
    conflicts are searched by branch and bound, for each group of conflicting sensors, with a limit on the number of
    tries. Within the limit the fewest violations are found, beyond it perhaps not. Sensors that scan beyond the allowed
    number then continue without scans, on the same courses.
    """
    at = list(start)
    _descend(mask, at)
    in_conflict = [s for s in range(len(at)) if mask.forbidden(at, s)[at[s]]]
    done: set[int] = set()
    for sensor in in_conflict:
        if sensor not in done:
            group = _group(mask, sensor)
            done.update(group)
            _settle(mask, at, group)
    return tuple(at) if mask.active is None else mask.active.within_limit(at)


def relaxed(mask: Mask) -> tuple[Mask, tuple[int, ...]]:
    """Return the mask and a joint action that it allows. If none was found, the mask is relaxed as little as possible.

    A sensor without an allowed course may take any. Then the violations of the joint action with the fewest are
    permitted: its forbidden courses, and all courses of its incompatible pairs of sensors. No joint action that the
    relaxed mask allows has more of these violations. The notes name the sensors.
    """
    blocked = [s for s, own in enumerate(mask.single) if not own.any()]
    mask = _forgiven(mask, {s: slice(None) for s in blocked}, set())
    start = nearest_feasible(mask, [int(own.argmax()) for own in mask.single])
    courses = {s: course for s, course in enumerate(start) if not mask.single[s][course]}
    pairs = {pair for pair, table in mask.together.items() if not table[start[pair[0]], start[pair[1]]]}
    mask = _forgiven(mask, courses, pairs)
    if mask.active is not None and mask.active.excess(np.array([start]))[0]:
        too_many = f"no more than {mask.active.limit} sensors were to scan, and too few can be switched off; {_GIVEN}"
        mask = replace(mask, active=None, notes=(*mask.notes, too_many))
    return mask, start


def _forgiven(mask: Mask, courses: Mapping[int, int | slice], pairs: set[tuple[int, int]]) -> Mask:
    """Return the mask with these courses of sensors allowed, and with all courses of these pairs of sensors."""
    if not courses and not pairs:
        return mask
    single = [own.copy() for own in mask.single]
    for s, allowed in courses.items():
        single[s][allowed] = True
    together = {pair: table for pair, table in mask.together.items() if pair not in pairs}
    notes = [f"sensor {s + 1}: no course was found that is allowed; {_GIVEN}" for s in courses]
    notes += [
        f"sensors {i + 1} and {j + 1}: no courses were found that go together; {_GIVEN}" for i, j in sorted(pairs)
    ]
    return Mask(tuple(single), together, (*mask.notes, *notes), mask.active)


def _descend(mask: Mask, at: list[int]) -> None:
    """Move each sensor to its first course of fewest violations, as long as one has fewer than now."""
    moved = True
    while moved:
        moved = False
        for s in range(len(at)):
            conflicts = mask.forbidden(at, s)
            best = int(conflicts.argmin())
            if conflicts[best] < conflicts[at[s]]:
                at[s], moved = best, True


def _group(mask: Mask, sensor: int) -> list[int]:
    """Return the sensors that `sensor` conflicts with, directly or indirectly, in printed order."""
    group, waiting = {sensor}, [sensor]
    while waiting:
        new = set(mask.others(waiting.pop())) - group
        group |= new
        waiting.extend(new)
    return sorted(group)


def depth_first(
    start: _Node, ways: Callable[[_Node], Iterator[_Node | None]], is_end: Callable[[_Node], bool], tries: int
) -> _Node | None:
    """Return the first end node of a depth-first search with backtracking, or None if none is found within `tries`.

    ways: successors of a node. None is a closed branch, which counts as a try.
    """
    waiting: list[Iterator[_Node | None]] = [iter((start,))]
    for _ in range(tries):
        while (node := next(waiting[-1], _OVER)) is _OVER:
            waiting.pop()
            if not waiting:
                return None
        if node is not None:
            if is_end(node):
                return node
            waiting.append(ways(node))
    return None


class _Decided(NamedTuple):
    """Courses of some sensors of a group."""

    courses: dict[int, int]
    violated: int  # number of violations by these courses
    costs: dict[int, Ints]  # for each other sensor, certain violations of each of its courses


def _settle(mask: Mask, at: list[int], group: list[int]) -> None:
    """Search one group for the fewest violations by branch and bound, and write better joint actions into `at`.

    A group is left unchanged if it is so large that one dive would take all tries.
    """
    costs: dict[int, Ints] = {s: (~mask.single[s]).astype(np.int64) for s in group}
    alone = sum(int(costs[s][at[s]]) for s in group)
    every = sum(int(mask.forbidden(at, s)[at[s]]) for s in group)
    fewest = (every + alone) // 2  # each pair is counted twice

    def is_end(node: _Decided) -> bool:
        nonlocal fewest
        if not node.costs and node.violated < fewest:
            fewest = node.violated
            for s, course in node.courses.items():
                at[s] = course
        return fewest == 0

    def ways(node: _Decided) -> Iterator[_Decided]:
        least = {s: int(own.min()) for s, own in node.costs.items()}
        if not least or node.violated + sum(least.values()) >= fewest:
            return
        sensor = min(least, key=lambda s: (-least[s], int((node.costs[s] == least[s]).sum())))
        own = node.costs[sensor]
        for course in np.argsort(own, kind="stable").tolist():
            costs = {s: each for s, each in node.costs.items() if s != sensor}
            for other in mask.others(sensor):
                if other in costs:
                    costs[other] = costs[other] + mask.others(other)[sensor][course]
            yield _Decided({**node.courses, sensor: course}, node.violated + int(own[course]), costs)

    if len(group) <= _TRIES // 2:
        depth_first(_Decided({}, 0, costs), ways, is_end, _TRIES + 1)
