"""Rewards of the actions at each decision, averaged over runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vedette.control.plan import RewardTable
from vedette.errors import InputError
from vedette.kernels.base.types import Floats
from vedette.models.measurement import wrap_angles
from vedette.platforms import Actions
from vedette.simulation.records import Decision, RunRecord

_ALIKE = 1e-4  # degrees, or any other unit


@dataclass(frozen=True, slots=True)
class MeanRewards:
    """The rewards of one decision over the runs of a strategy.

    Attributes:
        time: s.
        actions: for each sensor its actions; if headings differ between runs, `turn_deg` from the heading in place of
            `heading_deg`, and `turn_right_deg` in place of `course_deg`.
        tables: like those of a plan, averaged over the runs that evaluated an entry; the standard error is over the
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
    """The rewards of one decision, summed over runs: for each entry of a table the mean and the squares about it.

    first: decision with which the other runs are compared. faults: reasons why there is no mean (the first is
    reported), or empty. counts, means, squares, chosen: for each table, arrays of its shape. is_absolute,
    is_relative: True if all runs had the actions of the first, or the same turns from their headings.
    """

    first: Decision
    faults: tuple[str, ...]
    counts: tuple[Floats, ...]
    means: tuple[Floats, ...]
    squares: tuple[Floats, ...]
    chosen: tuple[Floats, ...]
    is_absolute: bool
    is_relative: bool
    num_runs: int

    @classmethod
    def of(cls, decision: int, made: Sequence[Decision]) -> RewardSums:
        """Return the sums of runs that made the decision of that index."""
        first, tables = made[0], [each.plan.tables for each in made]
        shapes = [tuple(table.mean.shape for table in of_run) for of_run in tables]
        faults = []
        if not all(tables):
            faults.append(f"records: expected runs with rewards at decision {decision}; got none")
        elif len(set(shapes)) > 1:
            faults.append("records: expected tables of one shape; got several")
        summed = [] if faults else [_summed(place, made) for place in range(len(tables[0]))]
        counts, means, squares, chosen = zip(*summed, strict=True) if summed else ((), (), (), ())
        alike = _all_alike([each.plan.actions for each in made])
        turned = _all_alike([_turns(each) for each in made]) if not alike else _head_alike(made)
        return cls(first, tuple(faults), counts, means, squares, chosen, alike, turned, len(made))

    @staticmethod
    def added(parts: Sequence[RewardSums]) -> RewardSums:
        """Return the sums over all runs of several sums."""
        total = parts[0]
        for part in parts[1:]:
            total = total._with(part)
        return total

    def _with(self, other: RewardSums) -> RewardSums:
        """Add by T. Chan, G. Golub and R. LeVeque, "Updating formulae and a pairwise algorithm", 1979, eq. 2.1."""
        faults, num_runs = self.faults + other.faults, self.num_runs + other.num_runs
        if not faults and [each.shape for each in self.means] != [each.shape for each in other.means]:
            faults = ("records: expected tables of one shape; got several",)
        if faults:
            return self._replace(faults=faults, num_runs=num_runs)
        counts, means, squares = [], [], []
        for mine, theirs in zip(self._moments(), other._moments(), strict=True):
            count, apart = mine[0] + theirs[0], theirs[1] - mine[1]
            share = theirs[0] / np.maximum(count, 1.0)
            counts.append(count)
            means.append(mine[1] + share * apart)
            squares.append(mine[2] + theirs[2] + mine[0] * share * apart**2)
        pair = self.first, other.first
        return self._replace(
            counts=tuple(counts),
            means=tuple(means),
            squares=tuple(squares),
            chosen=tuple(mine + theirs for mine, theirs in zip(self.chosen, other.chosen, strict=True)),
            is_absolute=self.is_absolute and other.is_absolute and _all_alike([each.plan.actions for each in pair]),
            is_relative=self.is_relative and other.is_relative and _all_alike(list(map(_turns, pair))),
            num_runs=num_runs,
        )

    def _moments(self) -> list[tuple[Floats, Floats, Floats]]:
        return list(zip(self.counts, self.means, self.squares, strict=True))

    def mean(self) -> MeanRewards:
        """Return the means; raises `InputError` if a run evaluated no actions, or runs had different actions."""
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
        actions = self.first.plan.actions if self.is_absolute else _turns(self.first)
        shares = tuple(chosen / self.num_runs for chosen in self.chosen)
        return MeanRewards(self.first.time, actions, tuple(tables), shares, self.num_runs)


def mean_rewards(records: Sequence[RunRecord], decision: int) -> MeanRewards:
    """Average the reward tables of one decision, given by its index, over the runs that made it.

    Raises `InputError` if no run made it, the planner evaluates no actions, or runs had different actions.
    """
    made = [record.decisions[decision] for record in records if decision < len(record.decisions)]
    if not made:
        raise InputError(f"records: expected runs with rewards at decision {decision}; got none")
    return RewardSums.of(decision, made).mean()


def _summed(place: int, made: Sequence[Decision]) -> tuple[Floats, Floats, Floats, Floats]:
    """Return for one table the number of runs with each entry, mean and squares about it, and number that chose it."""
    values = np.array([each.plan.tables[place].mean for each in made])
    known = np.isfinite(values)
    count = known.sum(axis=0).astype(np.float64)
    mean = np.where(known, values, 0.0).sum(axis=0) / np.maximum(count, 1.0)
    squares = np.where(known, (values - mean) ** 2, 0.0).sum(axis=0)
    chosen = np.zeros(values.shape[1:])
    for each in made:
        chosen[tuple(each.plan.chosen[sensor] for sensor in each.plan.tables[place].sensors)] += 1.0
    return count, mean, squares, chosen


def _turns(decision: Decision) -> tuple[Actions, ...]:
    return tuple(_as_turns(own, pose[2]) for own, pose in zip(decision.plan.actions, decision.poses, strict=True))


def _as_turns(actions: Actions, heading: float) -> Actions:
    for name, turn, now in (
        ("heading_deg", "turn_deg", heading),
        ("course_deg", "turn_right_deg", np.pi / 2 - heading),
    ):
        if name in actions.columns:
            values, column = actions.values.copy(), actions.columns.index(name)
            values[:, column] = np.degrees(wrap_angles(np.radians(values[:, column]) - now))
            return Actions(tuple(turn if each == name else each for each in actions.columns), values)
    return actions


def _head_alike(made: Sequence[Decision]) -> bool:
    """Return True if all sensors had the headings of the first run, up to rounding and full turns."""
    headings = np.array([each.poses[:, 2] for each in made])
    return bool(np.abs(wrap_angles(headings - headings[0])).max(initial=0.0) < np.radians(_ALIKE))


def _all_alike(actions: Sequence[tuple[Actions, ...]]) -> bool:
    """Return True if all runs had the same actions, up to rounding and full turns."""
    return all(
        mine.columns == first.columns
        and len(mine) == len(first)
        and (np.array_equal(mine.values, first.values) or _off(mine, first) < _ALIKE)
        for run in actions
        for mine, first in zip(run, actions[0], strict=True)
    )


def _off(mine: Actions, first: Actions) -> float:
    off = np.abs(mine.values - first.values)
    angles = [name.endswith("_deg") for name in mine.columns]
    off[:, angles] = np.abs(np.remainder(off[:, angles] + 180.0, 360.0) - 180.0)
    return float(off.max(initial=0.0))
