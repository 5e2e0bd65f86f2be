"""Rewards of the actions at each decision, averaged over runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vedette.control.plan import RewardTable
from vedette.errors import InputError
from vedette.kernels.base.types import Floats
from vedette.models.measurement import wrap_angles
from vedette.simulation.records import Decision, RunRecord


@dataclass(frozen=True, slots=True)
class MeanRewards:
    """The rewards of one decision over the runs of a strategy.

    Attributes:
        time: s.
        action_values: for each sensor, (num_actions,) rad: headings, or turns from the heading before.
        are_turns: whether they are turns, as every run came with another heading.
        tables: as those of a plan, averaged over the runs that evaluated an entry; the standard error is over the runs
            (0 for a single one), and entries that no run evaluated are NaN.
        shares: for each table, the share of the runs in which each of its entries was chosen.
        num_runs: runs that made this decision.
    """

    time: float
    action_values: tuple[Floats, ...]
    are_turns: bool
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
    values, are_turns = _common_actions(made)
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
    return MeanRewards(made[0].time, values, are_turns, tuple(tables), tuple(shares), len(made))


def _common_actions(made: Sequence[Decision]) -> tuple[tuple[Floats, ...], bool]:
    headings = [each.plan.action_values for each in made]
    if _all_alike(headings):
        return headings[0], False
    turns = [
        tuple(wrap_angles(values - pose[2]) for values, pose in zip(each.plan.action_values, each.poses, strict=True))
        for each in made
    ]
    if _all_alike(turns):
        return turns[0], True
    raise InputError("records: expected the same actions in every run; got others")


def _all_alike(actions: Sequence[tuple[Floats, ...]]) -> bool:
    """Whether all runs had the same actions, up to rounding and full turns."""
    return all(
        len(mine) == len(first) and float(np.abs(wrap_angles(mine - first)).max(initial=0.0)) < 1e-6
        for values in actions
        for mine, first in zip(values, actions[0], strict=True)
    )


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
