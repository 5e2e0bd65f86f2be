"""Rewards of joint actions whose courses are laid out when they are first asked for, and once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias

import numpy as np

from vedette.control.additive.rewards import AdditiveRewards
from vedette.control.evaluator import Evaluator
from vedette.control.lookahead.courses import CourseTree, Sequence
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.planning.ascent import Cells
from vedette.kernels.planning.bernoulli_rows import Table
from vedette.platforms import Options

# Of each sensor the courses that it takes; None: it does not scan.
Taken: TypeAlias = tuple[Sequence | None, ...]


class _Rows:
    """An array that grows at its end; what is there is copied each time that its room doubles."""

    def __init__(self, first: np.ndarray[Any, Any]) -> None:
        self._room, self._num = first, len(first)

    def append(self, more: np.ndarray[Any, Any]) -> None:
        """Put rows at the end."""
        num = self._num + len(more)
        if num > len(self._room):
            room = np.empty((max(num, 2 * len(self._room)), *self._room.shape[1:]), self._room.dtype)
            room[: self._num] = self.values
            self._room = room
        self._room[self._num : num], self._num = more, num

    @property
    def values(self) -> np.ndarray[Any, Any]:
        """All rows."""
        return self._room[: self._num]


class _Lists:
    """Lists that grow at their end, of entries in several columns; list i is offsets[i]:offsets[i + 1]."""

    def __init__(self, offsets: Ints, *columns: np.ndarray[Any, Any]) -> None:
        self.offsets, self.columns = _Rows(offsets), tuple(map(_Rows, columns))

    def append(self, offsets: Ints, *columns: np.ndarray[Any, Any]) -> None:
        """Put lists behind those that are there."""
        self.offsets.append(offsets[1:] + self.offsets.values[-1])
        for rows, more in zip(self.columns, columns, strict=True):
            rows.append(more)

    @property
    def values(self) -> tuple[np.ndarray[Any, Any], ...]:
        """Offsets and columns."""
        return self.offsets.values, *(rows.values for rows in self.columns)


@dataclass(slots=True, eq=False)
class LaidCourses:
    """Rewards at the end of the horizon of one decision, the `stage`-th from now.

    Attributes:
        trees: what each sensor may do.
        stage: number of courses that each sensor has taken by then.
        lay_out: makes the changes of some courses of each sensor; with the same samples each time.
        counts: filter steps and rewards so far.
    """

    trees: tuple[CourseTree, ...]
    stage: int
    lay_out: Callable[[tuple[Options, ...]], Evaluator]
    counts: dict[str, int]
    _places: dict[tuple[int, Sequence], int] = field(default_factory=dict)
    _additive: AdditiveRewards | None = None
    _changes: _Lists | None = None
    _cells: _Lists | None = None

    def __call__(self, joints: list[Taken]) -> Floats:
        """(num, num_samples) rewards of joint actions."""
        wanted = {(s, taken) for joint in joints for s, taken in enumerate(joint) if taken is not None}
        # Sensor after sensor, as they are laid out.
        new = sorted(wanted - self._places.keys())
        if new or self._additive is None:
            self._add(new)
        actions = [[-1 if own is None else self._places[s, own] for s, own in enumerate(joint)] for joint in joints]
        rewards = self._rewards()(np.array(actions, np.int64))
        self.counts["rewards"] += rewards.size
        return rewards

    def _add(self, new: list[tuple[int, Sequence]]) -> None:
        courses: list[list[Floats]] = [[] for _ in self.trees]
        for s, taken in new:
            self._places[s, taken] = len(self._places)
            courses[s].append(self.trees[s].course(taken))
        laid = self.lay_out(tuple(self._options(*own) for own in zip(self.trees, courses, strict=True)))
        self.counts["filter_steps"] += laid.counts["filter_steps"]
        assert laid.additive is not None
        table, cells = laid.additive.table, laid.additive.cells
        changes = table.offsets, table.labels, table.changes
        found = cells.offsets, cells.cells, cells.log_miss
        if self._changes is None or self._cells is None:
            self._additive, self._changes, self._cells = laid.additive, _Lists(*changes), _Lists(*found)
        else:
            self._changes.append(*changes)
            self._cells.append(*found)

    def _options(self, tree: CourseTree, courses: list[Floats]) -> Options:
        shape = len(courses), tree.stages.num_steps(self.stage), len(tree.pose)
        return Options(tree.options(()).actions, np.array(courses).reshape(shape), np.arange(len(courses)), tree.pose)

    def _rewards(self) -> AdditiveRewards:
        """Of all courses so far: a sensor might take any of them, and is given its own."""
        assert self._additive is not None
        assert self._changes is not None
        assert self._cells is not None
        firsts, old = np.zeros(len(self.trees) + 1, np.int64), self._additive
        offsets, labels, changes = self._changes.values
        table = Table(firsts, offsets, labels, changes, old.table.start, old.table.powers)
        offsets, cells, log_miss = self._cells.values
        return replace(old, table=table, cells=Cells(offsets, cells, log_miss, old.cells.worth))
