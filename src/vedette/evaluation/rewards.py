"""Rewards of the actions at each decision, averaged over runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vedette.control.plan import RewardTable
from vedette.errors import InputError
from vedette.kernels.base.types import Floats
from vedette.models.measurement import wrap_angles
from vedette.platforms import Actions
from vedette.simulation.records import Decision, RunRecord


@dataclass(frozen=True, slots=True)
class MeanRewards:
    """The rewards of one decision over the runs of a strategy.

    Attributes:
        time: s.
        actions: for each sensor its actions; where every run came with another heading, `turn_deg` from it in the place
            of `heading_deg`.
        tables: as those of a plan, averaged over the runs that evaluated an entry; the standard error is over the runs
            (0 for a single one), and entries that no run evaluated are NaN.
        shares: for each table, the share of the runs in which each of its entries was chosen.
        num_runs: runs that made this decision.
    """

    time: float
    actions: tuple[Actions, ...]
    tables: tuple[RewardTable, ...]
    shares: tuple[Floats, ...]
    num_runs: int


def mean_rewards(records: Sequence[RunRecord], decision: int) -> MeanRewards:
    """Average the reward tables of one decision, given by its index, over the runs that made it.

    Raises `InputError` where no run made it, the planner weighs no actions, or runs had other actions to choose from.
    """
    made = [record.decisions[decision] for record in records if decision < len(record.decisions)]
    if not made or not all(each.plan.tables for each in made):
        raise InputError(f"records: expected runs with rewards at decision {decision}; got none")
    actions = _common_actions(made)
    tables, shares = [], []
    for place, table in enumerate(made[0].plan.tables):
        if any(each.plan.tables[place].mean.shape != table.mean.shape for each in made):
            raise InputError("records: expected tables of one shape; got several")
        stacked = np.array([each.plan.tables[place].mean for each in made])
        tables.append(RewardTable(table.sensors, *_mean_and_error(stacked)))
        share = np.zeros(table.mean.shape)
        for each in made:
            share[tuple(each.plan.chosen[sensor] for sensor in table.sensors)] += 1.0 / len(made)
        shares.append(share)
    return MeanRewards(made[0].time, actions, tuple(tables), tuple(shares), len(made))


def _common_actions(made: Sequence[Decision]) -> tuple[Actions, ...]:
    actions = [each.plan.actions for each in made]
    if _all_alike(actions):
        return actions[0]
    turns = [
        tuple(_as_turns(own, pose[2]) for own, pose in zip(each.plan.actions, each.poses, strict=True)) for each in made
    ]
    if _all_alike(turns):
        return turns[0]
    raise InputError("records: expected the same actions in every run; got others")


def _as_turns(actions: Actions, heading: float) -> Actions:
    if "heading_deg" not in actions.columns:
        return actions
    values, column = actions.values.copy(), actions.columns.index("heading_deg")
    values[:, column] = np.degrees(wrap_angles(np.radians(values[:, column]) - heading))
    return Actions(tuple("turn_deg" if name == "heading_deg" else name for name in actions.columns), values)


def _all_alike(actions: Sequence[tuple[Actions, ...]]) -> bool:
    """Whether all runs had the same actions, up to rounding and full turns."""
    return all(
        mine.columns == first.columns and len(mine) == len(first) and _off(mine, first) < 1e-4
        for run in actions
        for mine, first in zip(run, actions[0], strict=True)
    )


def _off(mine: Actions, first: Actions) -> float:
    off = np.abs(mine.values - first.values)
    angles = [name.endswith("_deg") for name in mine.columns]
    off[:, angles] = np.abs(np.remainder(off[:, angles] + 180.0, 360.0) - 180.0)
    return float(off.max(initial=0.0))


def _mean_and_error(stacked: Floats) -> tuple[Floats, Floats]:
    """Mean over the first axis and its standard error, gaps left out."""
    known = np.isfinite(stacked)
    count = known.sum(axis=0)
    gap = count == 0
    number = np.maximum(count, 1)
    mean = np.where(known, stacked, 0.0).sum(axis=0) / number
    squares = np.where(known, (stacked - mean) ** 2, 0.0).sum(axis=0)
    error = np.sqrt(squares / np.maximum(count - 1, 1) / number)
    return np.where(gap, np.nan, mean), np.where(gap, np.nan, error)
