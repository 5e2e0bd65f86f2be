"""Decisions as plain data of numbers, lists and names, and back."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from vedette.control.plan import Plan, RewardTable
from vedette.errors import InputError
from vedette.kernels.base.types import Floats
from vedette.platforms import Actions
from vedette.reading import parse_json
from vedette.simulation.records import Decision


def write_decisions(decisions: Sequence[Decision], *, indent: int | None = None) -> str:
    """JSON text. Every float is written so that it reads back as itself; null where nothing was evaluated.

    Raises `InputError` for a number that is not finite.
    """
    try:
        return json.dumps([_data(decision) for decision in decisions], indent=indent, allow_nan=False) + "\n"
    except ValueError as error:
        raise InputError(f"record.decisions: expected finite numbers; {error}") from error


def read_decisions(text: str) -> tuple[Decision, ...]:
    """The decisions back from their text. Raises `KeyError`, `TypeError` or `ValueError` for data of another form."""
    return tuple(_decision(entry) for entry in parse_json(text))


def _data(decision: Decision) -> dict[str, Any]:
    plan = decision.plan
    return {
        "step": int(decision.step),
        "time_s": float(decision.time),
        "poses": decision.poses.tolist(),
        "planner": plan.planner,
        "actions": [{"columns": list(own.columns), "values": own.values.tolist()} for own in plan.actions],
        "chosen": [int(index) for index in plan.chosen],
        "chosen_actions": [row.tolist() for row in plan.chosen_actions],
        "counts": {name: int(count) for name, count in plan.counts.items()},
        "notes": list(plan.notes),
        "reward_tables": [
            {
                "sensors": [int(sensor) for sensor in table.sensors],
                "mean": _with_gaps(table.mean),
                "standard_error": _with_gaps(table.standard_error),
            }
            for table in plan.tables
        ],
    }


def _with_gaps(values: Floats) -> Any:
    """Nested lists, null where there is no number."""
    gaps = np.isnan(values)
    if not gaps.any():
        return values.tolist()
    numbers = values.astype(object)
    numbers[gaps] = None
    return numbers.tolist()


def _decision(entry: Mapping[str, Any]) -> Decision:
    plan = Plan(
        planner=str(entry["planner"]),
        actions=tuple(
            Actions(
                tuple(str(name) for name in own["columns"]),
                np.array(own["values"], np.float64).reshape(len(own["values"]), len(own["columns"])),
            )
            for own in entry["actions"]
        ),
        chosen=tuple(int(index) for index in entry["chosen"]),
        tables=tuple(
            RewardTable(
                tuple(int(sensor) for sensor in table["sensors"]),
                np.array(table["mean"], np.float64),
                np.array(table["standard_error"], np.float64),
            )
            for table in entry["reward_tables"]
        ),
        counts={str(name): int(count) for name, count in entry["counts"].items()},
        notes=tuple(str(note) for note in entry["notes"]),
    )
    return Decision(int(entry["step"]), float(entry["time_s"]), np.array(entry["poses"], np.float64), plan)
