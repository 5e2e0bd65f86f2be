"""The rows that one finished run adds to each table: columns of equal length."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from vedette.control.plan import Plan, RewardTable
from vedette.kernels.base.types import Ints
from vedette.platforms import Actions
from vedette.simulation.columns import flatten
from vedette.simulation.records import Decision
from vedette.simulation.tabulation import POSE_COLUMNS, tables_of

if TYPE_CHECKING:
    from vedette.campaigns.finished import FinishedRun


@dataclass(frozen=True, slots=True)
class Lists:
    """A column of lists: all their entries in one array, and (num_rows,) how many are each row's."""

    values: np.ndarray[Any, Any]
    lengths: Ints

    def __len__(self) -> int:
        return len(self.lengths)

    @classmethod
    def of(cls, rows: Iterable[Any], dtype: type) -> Lists:
        """Of one sequence of numbers a row."""
        arrays: list[np.ndarray[Any, Any]] = [np.asarray(row, dtype) for row in rows]
        lengths = np.array([len(row) for row in arrays], np.int64)
        return cls(np.concatenate([np.empty(0, dtype), *arrays]), lengths)

    @classmethod
    def joined(cls, parts: Iterable[Lists]) -> Lists:
        """One column below another."""
        columns = list(parts)
        values = np.concatenate([column.values for column in columns])
        return cls(values, np.concatenate([column.lengths for column in columns]))


# A column: an array, texts or numbers with gaps, or lists.
Rows: TypeAlias = dict[str, "np.ndarray[Any, Any] | list[Any] | Lists"]


def run_row(run: FinishedRun) -> Rows:
    """One row: numbers of scans and decisions, means over all scans, and the checksum of the run."""
    record = run.record
    means = dict(zip(_MEANS, record.ospa.mean(axis=0), strict=True))
    return {
        "num_scans": np.array([record.num_scans]),
        "num_decisions": np.array([len(record.decisions)]),
        **{name: np.array([value]) for name, value in means.items()},
        "sha256": [run.checksum],
    }


_MEANS = ("mean_ospa_m", "mean_localisation_m", "mean_cardinality_m")


def scan_rows(run: FinishedRun) -> Rows:
    """One row a scan: numbers of targets and estimates, OSPA with its parts, and every other measure."""
    return {**tables_of(run.record)["scans"], **run.metrics.columns()}


def track_rows(run: FinishedRun) -> Rows:
    """One row an estimate: label, existence, mean and covariance (row by row)."""
    return dict(flatten(tables_of(run.record)["tracks"]))


def truth_rows(run: FinishedRun) -> Rows:
    """One row a true target at a scan: id and state."""
    return dict(flatten(tables_of(run.record)["truth"]))


def sensor_rows(run: FinishedRun) -> Rows:
    """One row a sensor at a scan: its pose."""
    return dict(tables_of(run.record)["sensors"])


def decision_rows(run: FinishedRun) -> Rows:
    """One row a decision: poses before it and actions chosen, a sensor each; expected rewards, a reward table each.

    The last columns count what was evaluated, `num_` and its name; null where a planner counts no such thing.
    """
    decisions = run.record.decisions
    plans = [decision.plan for decision in decisions]
    counted = dict.fromkeys(name for plan in plans for name in plan.counts)
    return {
        "decision": np.arange(len(decisions)),
        "step": np.array([decision.step for decision in decisions], np.int64),
        "time_s": np.array([decision.time for decision in decisions], np.float64),
        **{
            f"sensor_{name}": Lists.of((decision.poses[:, axis] for decision in decisions), np.float64)
            for axis, name in enumerate(POSE_COLUMNS)
        },
        "chosen_actions": Lists.of((plan.chosen for plan in plans), np.int64),
        **{
            f"chosen_{name}": Lists.of(([_number(*each, name) for each in _chosen(plan)] for plan in plans), np.float64)
            for name in dict.fromkeys(name for plan in plans for own in plan.actions for name in own.columns)
        },
        "expected_rewards": Lists.of(([mean for mean, _ in plan.expected_rewards] for plan in plans), np.float64),
        "expected_reward_ses": Lists.of(([error for _, error in plan.expected_rewards] for plan in plans), np.float64),
        **{f"num_{name}": [plan.counts.get(name) for plan in plans] for name in counted},
    }


def reward_rows(run: FinishedRun) -> Rows:
    """One row an action, or a combination of actions, of a reward table: what it was expected to bring.

    `sensors` are the sensors of the table, `actions` the index of the action of each, and `action_` with the name of a
    column its number; NaN of a sensor without that column.
    Combinations that were not evaluated have no row.
    """
    tables = [
        (number, decision, place, table)
        for number, decision in enumerate(run.record.decisions)
        for place, table in enumerate(decision.plan.tables)
    ]
    columns = dict.fromkeys(name for _, decision, *_ in tables for own in decision.plan.actions for name in own.columns)
    parts = [_no_rewards(tuple(columns)), *(_rewards_of(*each, tuple(columns)) for each in tables)]
    return {
        name: Lists.joined(part[name] for part in parts)
        if isinstance(column, Lists)
        else np.concatenate([part[name] for part in parts])
        for name, column in parts[0].items()
    }


def _chosen(plan: Plan) -> list[tuple[Actions, int]]:
    return list(zip(plan.actions, plan.chosen, strict=True))


def _number(actions: Actions, index: Any, column: str) -> Any:
    """The number of an action, or of several, in a column; NaN where there is no such column."""
    if column not in actions.columns:
        return np.full(np.shape(index), np.nan)
    return actions.values[index, actions.columns.index(column)]


def _rewards_of(
    number: int, decision: Decision, place: int, table: RewardTable, columns: tuple[str, ...]
) -> dict[str, Any]:
    plan: Plan = decision.plan
    actions = np.argwhere(~np.isnan(table.mean))
    num, width = actions.shape
    index, lengths = tuple(actions.T), np.full(num, width)
    return {
        "decision": np.full(num, number),
        "step": np.full(num, decision.step),
        "time_s": np.full(num, decision.time),
        "reward_table": np.full(num, place),
        "sensors": Lists(np.tile(np.array(table.sensors, np.int64), num), lengths),
        "actions": Lists(actions.ravel(), lengths),
        **{
            f"action_{name}": Lists(
                np.stack(
                    [_number(plan.actions[s], actions[:, axis], name) for axis, s in enumerate(table.sensors)], axis=1
                ).ravel(),
                lengths,
            )
            for name in columns
        },
        "reward": table.mean[index],
        "reward_se": table.standard_error[index],
        "chosen": (actions == [plan.chosen[sensor] for sensor in table.sensors]).all(axis=1),
    }


def _no_rewards(columns: tuple[str, ...]) -> dict[str, Any]:
    """The columns of `_rewards_of` without a row."""
    plan = Plan("", (Actions((), np.empty((1, 0))),), (0,), (), {})
    table = RewardTable((0,), np.full(1, np.nan), np.full(1, np.nan))
    return _rewards_of(0, Decision(0, 0.0, np.zeros((1, 3)), plan), 0, table, columns)


def timing_rows(run: FinishedRun) -> Rows:
    """One row a stage and scan: the seconds it took, and the session that ran it. The only rows that chance decides."""
    record = run.record
    num = record.num_scans
    return {
        "step": np.tile(np.arange(1, num + 1), len(record.timings)),
        "time_s": np.tile(record.times, len(record.timings)),
        "stage": [stage for stage in record.timings for _ in range(num)],
        "duration_s": np.concatenate([*record.timings.values(), np.empty(0)]),
        "session": np.full(num * len(record.timings), run.session),
    }


PER_RUN: Mapping[str, Callable[[FinishedRun], Rows]] = {
    "runs": run_row,
    "scans": scan_rows,
    "decisions": decision_rows,
    "rewards": reward_rows,
    "tracks": track_rows,
    "truth": truth_rows,
    "sensors": sensor_rows,
    "timings": timing_rows,
}
