"""Rewards of the actions at each decision, averaged over runs."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vedette.control.plan import RewardTable
from vedette.errors import InputError
from vedette.kernels.base.types import HEADING, Floats
from vedette.models.measurement import wrap_angles
from vedette.platforms import Actions
from vedette.simulation.records import Decision, RunRecord

_TOLERANCE = 1e-4  # degrees, or any other unit


@dataclass(frozen=True, slots=True)
class MeanRewards:
    """The rewards of one decision over the runs of a strategy.

    Attributes:
        time: s.
        actions: for each sensor its actions. If headings differ between runs, `turn_deg` from the heading in place of
            `heading_deg`, and `turn_right_deg` in place of `course_deg`.
        tables: like those of a plan, averaged over the runs that evaluated an entry. The standard error is over the
            runs (0 for a single one), and entries that no run evaluated are NaN.
        shares: for each table, the share of the runs in which each of its entries was chosen.
        num_runs: runs that made this decision.
    """

    time: float
    actions: tuple[Actions, ...]
    tables: tuple[RewardTable, ...]
    shares: tuple[Floats, ...]
    num_runs: int


class RewardSums(NamedTuple):
    """The rewards of one decision, summed over runs: for each entry of a table the mean and the squares about it."""

    first: Decision  # decision with which the other runs are compared
    faults: tuple[str, ...]  # reasons why there is no mean (the first is reported), or empty
    counts: tuple[Floats, ...]  # for each table, arrays of its shape
    means: tuple[Floats, ...]
    squares: tuple[Floats, ...]
    chosen: tuple[Floats, ...]
    is_absolute: bool  # True if all runs had the actions of the first, or the same turns from their headings
    is_relative: bool
    num_runs: int

    @classmethod
    def from_decisions(cls, decision: int, decisions: Sequence[Decision]) -> "RewardSums":
        """Return the sums of runs that made the decision of that index."""
        first, tables = decisions[0], [decision.plan.tables for decision in decisions]
        shapes = [tuple(table.mean.shape for table in run_tables) for run_tables in tables]
        faults = []
        if not all(tables):
            faults.append(f"records: expected runs with rewards at decision {decision}; got none")
        elif len(set(shapes)) > 1:
            faults.append("records: expected tables of one shape; got several")
        summed = [] if faults else [_summed(index, decisions) for index in range(len(tables[0]))]
        counts, means, squares, chosen = zip(*summed, strict=True) if summed else ((), (), (), ())
        is_absolute = _have_equal_actions([decision.plan.actions for decision in decisions])
        is_relative = (
            _have_equal_actions([_turn_actions(decision) for decision in decisions])
            if not is_absolute
            else _have_equal_headings(decisions)
        )
        return cls(first, tuple(faults), counts, means, squares, chosen, is_absolute, is_relative, len(decisions))

    @staticmethod
    def combine(parts: "Sequence[RewardSums]") -> "RewardSums":
        """Return the sums over all runs of several sums."""
        total = parts[0]
        for part in parts[1:]:
            total = total._add(part)
        return total

    def _add(self, other: "RewardSums") -> "RewardSums":
        """Add by T. Chan, G. Golub and R. LeVeque, "Updating formulae and a pairwise algorithm", 1979, eq. 2.1."""
        faults, num_runs = self.faults + other.faults, self.num_runs + other.num_runs
        if not faults and [each.shape for each in self.means] != [each.shape for each in other.means]:
            faults = ("records: expected tables of one shape; got several",)
        if faults:
            return self._replace(faults=faults, num_runs=num_runs)
        counts, means, squares = [], [], []
        for left, right in zip(self._moments(), other._moments(), strict=True):
            count, difference = left[0] + right[0], right[1] - left[1]
            share = right[0] / np.maximum(count, 1.0)
            counts.append(count)
            means.append(left[1] + share * difference)
            squares.append(left[2] + right[2] + left[0] * share * difference**2)
        pair = self.first, other.first
        return self._replace(
            counts=tuple(counts),
            means=tuple(means),
            squares=tuple(squares),
            chosen=tuple(left + right for left, right in zip(self.chosen, other.chosen, strict=True)),
            is_absolute=self.is_absolute
            and other.is_absolute
            and _have_equal_actions([each.plan.actions for each in pair]),
            is_relative=self.is_relative and other.is_relative and _have_equal_actions(list(map(_turn_actions, pair))),
            num_runs=num_runs,
        )

    def _moments(self) -> list[tuple[Floats, Floats, Floats]]:
        return list(zip(self.counts, self.means, self.squares, strict=True))

    def mean(self) -> MeanRewards:
        """Return the means. Raises `InputError` if a run evaluated no actions, or runs had different actions."""
        if self.faults:
            raise InputError(self.faults[0])
        if not self.is_absolute and not self.is_relative:
            raise InputError("records: expected the same actions in every run; got others")
        tables = [
            RewardTable(
                table.sensors,
                np.where(count > 0, mean, np.nan),
                np.where(count > 0, np.sqrt(squares / np.maximum(count - 1, 1) / np.maximum(count, 1)), np.nan),
            )
            for table, (count, mean, squares) in zip(self.first.plan.tables, self._moments(), strict=True)
        ]
        actions = self.first.plan.actions if self.is_absolute else _turn_actions(self.first)
        shares = tuple(chosen / self.num_runs for chosen in self.chosen)
        return MeanRewards(self.first.time, actions, tuple(tables), shares, self.num_runs)


def mean_rewards(records: Sequence[RunRecord], decision: int) -> MeanRewards:
    """Average the reward tables of one decision, given by its index, over the runs that made it.

    Raises `InputError` if no run made it, the planner evaluates no actions, or runs had different actions.
    """
    decisions = [record.decisions[decision] for record in records if decision < len(record.decisions)]
    if not decisions:
        raise InputError(f"records: expected runs with rewards at decision {decision}; got none")
    return RewardSums.from_decisions(decision, decisions).mean()


def _summed(table_index: int, decisions: Sequence[Decision]) -> tuple[Floats, Floats, Floats, Floats]:
    """Return for one table the number of runs with each entry, mean and squares about it, and number that chose it."""
    values = np.array([decision.plan.tables[table_index].mean for decision in decisions])
    finite = np.isfinite(values)
    count = finite.sum(axis=0).astype(np.float64)
    mean = np.where(finite, values, 0.0).sum(axis=0) / np.maximum(count, 1.0)
    squares = np.where(finite, (values - mean) ** 2, 0.0).sum(axis=0)
    chosen = np.zeros(values.shape[1:])
    for decision in decisions:
        chosen[tuple(decision.plan.chosen[sensor] for sensor in decision.plan.tables[table_index].sensors)] += 1.0
    return count, mean, squares, chosen


def _turn_actions(decision: Decision) -> tuple[Actions, ...]:
    return tuple(
        _as_turns(actions, pose[HEADING]) for actions, pose in zip(decision.plan.actions, decision.poses, strict=True)
    )


def _as_turns(actions: Actions, heading: float) -> Actions:
    for name, turn, current in (
        ("heading_deg", "turn_deg", heading),
        ("course_deg", "turn_right_deg", np.pi / 2 - heading),
    ):
        if name in actions.columns:
            values, column = actions.values.copy(), actions.columns.index(name)
            values[:, column] = np.degrees(wrap_angles(np.radians(values[:, column]) - current))
            return Actions(tuple(turn if each == name else each for each in actions.columns), values)
    return actions


def _have_equal_headings(decisions: Sequence[Decision]) -> bool:
    """Return True if all sensors had the headings of the first run, up to rounding and full turns."""
    headings = np.array([each.poses[:, HEADING] for each in decisions])
    return bool(np.abs(wrap_angles(headings - headings[0])).max(initial=0.0) < np.radians(_TOLERANCE))


def _have_equal_actions(actions: Sequence[tuple[Actions, ...]]) -> bool:
    """Return True if all runs had the same actions, up to rounding and full turns."""
    return all(
        other.columns == first.columns
        and len(other) == len(first)
        and (np.array_equal(other.values, first.values) or (other.differences(first.values) < _TOLERANCE).all())
        for run in actions
        for other, first in zip(run, actions[0], strict=True)
    )
