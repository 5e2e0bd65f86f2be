"""Decisions as plain data of numbers, lists and names, and back."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from vedette.control.plan import Plan, RewardTable
from vedette.errors import InputError
from vedette.kernels.base.types import Floats
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
        "action_headings_rad": [values.tolist() for values in plan.action_values],
        "chosen": [int(index) for index in plan.chosen],
        "chosen_headings_deg": np.rad2deg(plan.chosen_headings).tolist(),
        "counts": {name: int(count) for name, count in plan.counts.items()},
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
        action_values=tuple(np.array(values, np.float64) for values in entry["action_headings_rad"]),
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
    )
    return Decision(int(entry["step"]), float(entry["time_s"]), np.array(entry["poses"], np.float64), plan)
