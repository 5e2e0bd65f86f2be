"""Decisions of a run as tables of columns, and back: the available actions and their expected rewards."""

import math
from collections.abc import Iterator, Mapping, Sequence
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise
from typing import Any

import numpy as np

from vedette.control.plan import Plan, RewardTable
from vedette.errors import InputError
from vedette.internal.text import shown
from vedette.kernels.base.types import Floats, Ints
from vedette.platforms import Actions
from vedette.simulation.arrow import RUN_COLUMNS, Columns, Kind, Layout, stacked
from vedette.simulation.records import Decision

DECISION = {"decision": Kind.INTEGER, "step": Kind.INTEGER, "time_s": Kind.NUMBER}

_REWARD = {"reward": Kind.NUMBER, "reward_se": Kind.NUMBER, "chosen": Kind.TRUTH}

DECISION_TABLES: dict[str, Layout] = {
    "decisions": Layout({**DECISION, "planner": Kind.TEXT, "notes": Kind.TEXT}, {"num_": Kind.COUNT}),
    "actions": Layout(
        {**DECISION, "sensor": Kind.INTEGER, "action": Kind.INTEGER, "chosen": Kind.TRUTH}, {"": Kind.VALUE}
    ),
    "rewards": Layout({**DECISION, "reward_table": Kind.INTEGER, **_REWARD}, {"action_": Kind.COUNT}),
}
# Additional table for runs of many sensors: rewards of the actions of a single sensor. In `rewards` each row would have
# a column for every other sensor.
OWN_REWARDS: dict[str, Layout] = {
    "own_rewards": Layout(
        {**DECISION, "reward_table": Kind.INTEGER, "sensor": Kind.INTEGER, "action": Kind.INTEGER, **_REWARD}
    )
}
_FEW_SENSORS = 16  # up to this number of sensors, all rewards are in `rewards`
_MOST_REWARDS = 2**26  # per run, including entries that were not evaluated, as these take memory too
# Other column names in tables of many runs; a platform's own quantity with such a name gets the prefix `action_`.
_TAKEN = {*DECISION_TABLES["actions"].fixed, *RUN_COLUMNS}


def decision_columns(number: int, decision: Decision) -> dict[str, Any]:
    """Return the columns that identify the decision of a row."""
    return {"decision": number, "step": decision.step, "time_s": decision.time}


def decision_tables(decisions: Sequence[Decision], num_sensors: int) -> dict[str, Columns]:
    """Return the tables of `DECISION_TABLES`, and that of `OWN_REWARDS` if it has rows.

    Raises `InputError` for plans that the tables cannot hold.
    """
    of_decisions = [
        {
            **decision_columns(number, decision),
            "planner": decision.plan.planner,
            "notes": _notes(decision.plan),
            **{f"num_{name}": count for name, count in decision.plan.counts.items()},
        }
        for number, decision in enumerate(decisions)
    ]
    if sum(table.mean.size for decision in decisions for table in decision.plan.tables) > _MOST_REWARDS:
        raise InputError(f"plan.tables: expected at most {_MOST_REWARDS} entries in all; got more")
    joint_rows, own_rows = [], []
    for number, decision in enumerate(decisions):
        for index, table in enumerate(decision.plan.tables):
            rows = {**decision_columns(number, decision), "reward_table": index, **_evaluated(table, decision.plan)}
            if len(table.sensors) > 1 or num_sensors <= _FEW_SENSORS:
                joint_rows.append(rows)
            else:
                (sensor,) = table.sensors
                own_rows.append({"sensor": sensor, "action": rows.pop(f"action_{sensor}"), **rows})
    names = (*DECISION, "reward_table", *(f"action_{sensor}" for sensor in range(num_sensors)), *_REWARD)
    columns = {
        "decisions": stacked(of_decisions, DECISION_TABLES["decisions"]),
        "actions": _actions(decisions),
        "rewards": stacked(joint_rows, DECISION_TABLES["rewards"], names),
    }
    layout = OWN_REWARDS["own_rewards"]
    return {**columns, "own_rewards": stacked(own_rows, layout, list(layout.fixed))} if own_rows else columns


def _evaluated(table: RewardTable, plan: Plan) -> dict[str, Any]:
    """Return one row per evaluated action, or combination of actions, with the index of each sensor's action."""
    if list(table.sensors) != sorted(table.sensors):
        raise InputError(f"plan.tables: expected sensors in increasing order; got {table.sensors}")
    index = np.argwhere(~np.isnan(table.mean))
    return {
        **{f"action_{sensor}": column for sensor, column in zip(table.sensors, index.T, strict=True)},
        "reward": table.mean[tuple(index.T)],
        "reward_se": table.standard_error[tuple(index.T)],
        "chosen": (index == [plan.chosen[sensor] for sensor in table.sensors]).all(axis=1),
    }


def decisions_of(tables: Mapping[str, Mapping[str, Any]], poses: Floats) -> tuple[Decision, ...]:
    """Return the decisions from their tables and the poses of the run.

    Raises `InputError`, `KeyError`, `IndexError` or `ValueError` for inconsistent tables.
    """
    table = tables["decisions"]
    num = len(table["decision"])
    if not np.array_equal(table["decision"], np.arange(num)):
        raise InputError("decisions, column decision: expected them numbered from 0")
    counted = DECISION_TABLES["decisions"].others(table)
    of_actions, of_rewards = (parts_of(tables[name], "decision", num) for name in ("actions", "rewards"))
    of_own = parts_of(tables["own_rewards"], "decision", num) if "own_rewards" in tables else [{}] * num
    decisions, room = [], _MOST_REWARDS
    for index, step in enumerate(table["step"].tolist()):
        plan = _plan(
            table["planner"][index],
            of_actions[index],
            of_rewards[index],
            of_own[index],
            table["notes"][index],
            {name.removeprefix("num_"): int(table[name][index]) for name in counted if table[name][index] >= 0},
            room,
        )
        room -= sum(rewards_of.mean.size for rewards_of in plan.tables)
        decisions.append(Decision(step, float(table["time_s"][index]), poses[step - 1], plan))
    return tuple(decisions)


def _plan(
    planner: str,
    actions: Mapping[str, Any],
    rewards: Mapping[str, Any],
    own_rewards: Mapping[str, Any],
    notes: str,
    counts: dict[str, int],
    room: int,
) -> Plan:
    options, chosen = [], []
    for part in parts_of(actions, "sensor"):
        if not np.array_equal(part["action"], np.arange(len(part["action"]))):
            raise InputError("actions, column action: expected those of a sensor numbered from 0")
        (choice,) = np.flatnonzero(part["chosen"])
        chosen.append(int(choice))
        names = [name for name in DECISION_TABLES["actions"].others(part) if not np.isnan(part[name]).all()]
        values = np.empty((len(part["action"]), len(names)))
        for column, name in enumerate(names):
            values[:, column] = part[name]
        options.append(Actions(tuple(name.removeprefix("action_") for name in names), values))
    shape = tuple(len(values) for values in options)
    tables: dict[int, RewardTable] = {}
    for number, rows in _rows_of(rewards):
        tables[number] = _table(rewards, rows, shape, room)
        room -= tables[number].mean.size
    for number, rows in _rows_of(own_rewards) if own_rewards else ():
        if number in tables:
            raise InputError(f"own_rewards, column reward_table: expected none of those in rewards; got {number}")
        tables[number] = _own_table(own_rewards, rows, shape, room)
        room -= tables[number].mean.size
    if set(tables) != set(range(len(tables))):
        raise InputError("column reward_table: expected rows of every number from 0")
    reward_tables = tuple(tables[number] for number in range(len(tables)))
    return Plan(planner, tuple(options), tuple(chosen), reward_tables, counts, tuple(notes.splitlines()))


def _own_table(rewards: Mapping[str, Any], rows: slice, num_actions: tuple[int, ...], room: int) -> RewardTable:
    sensors, actions = rewards["sensor"][rows], rewards["action"][rows]
    sensor = int(sensors[0])
    if np.any(sensors != sensor) or not 0 <= sensor < len(num_actions):
        raise InputError(f"own_rewards, column sensor: expected one of {len(num_actions)} for each reward_table")
    num = num_actions[sensor]
    if num > room:
        raise InputError(f"rewards: expected tables of at most {_MOST_REWARDS} entries in all; got more")
    if np.any(np.diff(actions) <= 0) or actions[0] < 0 or actions[-1] >= num:
        raise InputError(f"own_rewards: expected each of {num} actions at most once, in order")
    mean, error = np.full(num, np.nan), np.full(num, np.nan)
    mean[actions], error[actions] = rewards["reward"][rows], rewards["reward_se"][rows]
    return RewardTable((sensor,), mean, error)


def _table(rewards: Mapping[str, Any], rows: slice, num_actions: tuple[int, ...], room: int) -> RewardTable:
    index = np.stack([rewards[f"action_{sensor}"][rows] for sensor in range(len(num_actions))], axis=1)
    sensors = np.flatnonzero(index[0] >= 0)
    shape = tuple(num_actions[sensor] for sensor in sensors)
    if math.prod(shape) > room:
        raise InputError(f"rewards: expected tables of at most {_MOST_REWARDS} entries in all; got more")
    flat_index = np.ravel_multi_index(tuple(index[:, sensors].T), shape)  # raises for an action that does not exist
    if np.any(np.diff(flat_index) <= 0):
        raise InputError("rewards: expected each combination of actions once, in order")
    mean, error = np.full(shape, np.nan), np.full(shape, np.nan)
    mean.flat[flat_index], error.flat[flat_index] = rewards["reward"][rows], rewards["reward_se"][rows]
    return RewardTable(tuple(sensors.tolist()), mean, error)


def _notes(plan: Plan) -> str:
    """Return the notes of a plan, one per line."""
    text = "\n".join(plan.notes)
    if text.splitlines() != list(plan.notes):
        raise InputError(f"plan.notes: expected notes of one line each; got {shown(text)}")
    return text


def _actions(decisions: Sequence[Decision]) -> Columns:
    """Return one row per decision, sensor and action, null if a sensor has no such column."""
    layout = DECISION_TABLES["actions"]
    parts = [
        {
            **decision_columns(number, decision),
            "sensor": sensor,
            "action": np.arange(len(actions)),
            "chosen": np.arange(len(actions)) == decision.plan.chosen[sensor],
            **dict(zip(map(_column_of, actions.columns), actions.values.T, strict=True)),
        }
        for number, decision in enumerate(decisions)
        for sensor, actions in enumerate(decision.plan.actions)
    ]
    numbers = _in_one_order([actions.columns for decision in decisions for actions in decision.plan.actions])
    return stacked(parts, layout, [*layout.fixed, *map(_column_of, numbers)])


def _in_one_order(orders: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """Return the columns of all sensors in an order that keeps the order of each sensor."""
    sorter: TopologicalSorter[str] = TopologicalSorter()
    for columns in dict.fromkeys(map(tuple, orders)):
        for position, name in enumerate(columns):
            sorter.add(name, *columns[max(position - 1, 0) : position])
    try:
        return tuple(sorter.static_order())
    except CycleError:
        listed = " and ".join(", ".join(columns) for columns in dict.fromkeys(map(tuple, orders)))
        raise InputError(f"plan.actions: expected columns in one order for all; got {listed}") from None


def _column_of(name: str) -> str:
    """Return the column name of a platform's own quantity."""
    return f"action_{name}" if name in _TAKEN or name.startswith("action_") else name


def _rows_of(rewards: Mapping[str, Any]) -> Iterator[tuple[int, slice]]:
    """Yield each number of `reward_table` with its rows, which must be in order."""
    numbers: Ints = rewards["reward_table"]
    if np.any(np.diff(numbers) < 0) or np.any(numbers < 0):
        raise InputError("column reward_table: expected rows in order, of numbers from 0")
    present, first = np.unique(numbers, return_index=True)
    for number, (start, stop) in zip(present.tolist(), pairwise([*first.tolist(), len(numbers)]), strict=True):
        yield number, slice(start, stop)


def parts_of(table: Mapping[str, Any], name: str, num: int | None = None) -> list[Columns]:
    """Return the rows of each number from 0 to `num` - 1, in order (without `num`, of every number up to the last)."""
    numbers: Ints = table[name]
    if num is None and len(numbers) and (numbers[0] != 0 or np.any(np.diff(numbers) > 1)):
        raise InputError(f"column {name}: expected rows of every number from 0")
    num = int(numbers.max(initial=-1)) + 1 if num is None else num
    if np.any(np.diff(numbers) < 0) or np.any(numbers < 0) or np.any(numbers >= num):
        raise InputError(f"column {name}: expected rows in order, of 0 to {num - 1}")
    bounds = np.searchsorted(numbers, np.arange(num + 1)).tolist()
    return [{key: column[start:stop] for key, column in table.items()} for start, stop in pairwise(bounds)]
