"""Explanations of the decisions of a run as tables of columns, and back.

A run has all of these tables or, if its decisions were not explained, none. Runs of versions without explanations have
none.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from vedette.control import Bound, Explanation, Plan, RunnerUp, TargetGains
from vedette.errors import InputError
from vedette.simulation.arrow import Columns, Kind, Layout, stacked
from vedette.simulation.decision_tables import DECISION, decision_columns
from vedette.simulation.records import Decision

EXPLANATION_TABLES: dict[str, Layout] = {
    "explanations": Layout(
        {
            **DECISION,
            **dict.fromkeys(("reward", "reward_se", "baseline", "undetected_gain"), Kind.VALUE),
            "evaluations": Kind.INTEGER,
            "bound": Kind.VALUE,
            "bound_kind": Kind.TEXT,
            "num_targets_without_bound": Kind.COUNT,
            "runner_up": Kind.TEXT,
            "margin": Kind.VALUE,
            "margin_se": Kind.VALUE,
            "missing": Kind.TEXT,
        },
        {"price": Kind.VALUE, "action_": Kind.COUNT},
    ),
    "target_gains": Layout(
        {
            **DECISION,
            **dict.fromkeys(("birth_step", "birth_site"), Kind.INTEGER),
            **dict.fromkeys(("existence_gain", "localisation_gain"), Kind.NUMBER),
        }
    ),
    "sensor_gains": Layout(
        {**DECISION, "sensor": Kind.INTEGER, "gain": Kind.NUMBER, "reward_without_sensor": Kind.NUMBER}
    ),
}


def explanation_tables(decisions: Sequence[Decision], num_sensors: int) -> dict[str, Columns]:
    """Return the tables of `EXPLANATION_TABLES`, without rows if no decision was explained.

    Raises `InputError` for explanations with another number of sensors.
    """
    explained = [(number, decision, decision.plan.explanation) for number, decision in enumerate(decisions)]
    stored = [(number, decision, explanation) for number, decision, explanation in explained if explanation is not None]
    for _, _, explanation in stored:
        for name in ("of_sensors", "reward_without_sensor"):
            values = getattr(explanation, name)
            if values is not None and np.shape(values) != (num_sensors,):
                raise InputError(f"plan.explanation.{name}: expected {num_sensors} numbers; got {np.shape(values)}")
    # Only in runs whose actions have prices.
    priced = ("price",) if any(explanation.price for _, _, explanation in stored) else ()
    names = [*EXPLANATION_TABLES["explanations"].fixed, *priced, *(f"action_{sensor}" for sensor in range(num_sensors))]
    parts: dict[str, list[dict[str, Any]]] = {name: [] for name in EXPLANATION_TABLES}
    for number, decision, explanation in stored:
        columns, gains = decision_columns(number, decision), explanation.of_targets
        parts["explanations"].append(
            {**columns, **_explanation_columns(explanation), **dict.fromkeys(priced, explanation.price)}
        )
        if gains is not None:
            labels = {"birth_step": gains.labels[:, 0], "birth_site": gains.labels[:, 1]}
            gained = {"existence_gain": gains.existence, "localisation_gain": gains.localisation}
            parts["target_gains"].append({**columns, **labels, **gained})
        if explanation.of_sensors is not None and explanation.reward_without_sensor is not None:
            shares = {
                "sensor": np.arange(num_sensors),
                "gain": explanation.of_sensors,
                "reward_without_sensor": explanation.reward_without_sensor,
            }
            parts["sensor_gains"].append({**columns, **shares})
    return {
        name: stacked(
            rows, EXPLANATION_TABLES[name], names if name == "explanations" else list(EXPLANATION_TABLES[name].fixed)
        )
        for name, rows in parts.items()
    }


def _explanation_columns(explanation: Explanation) -> dict[str, Any]:
    """Return the row of an explanation."""
    bound, second = explanation.bound, explanation.runner_up
    return {
        "reward": _or_nan(explanation.reward),
        "reward_se": _or_nan(explanation.standard_error),
        "baseline": _or_nan(explanation.baseline),
        "undetected_gain": _or_nan(explanation.of_undetected),
        "evaluations": explanation.evaluations,
        "bound": np.nan if bound is None else bound.upper,
        "bound_kind": "" if bound is None else bound.kind,
        "num_targets_without_bound": -1 if bound is None else bound.unbounded,
        "runner_up": "" if second is None else second.text,
        "margin": np.nan if second is None else second.margin,
        "margin_se": np.nan if second is None else _or_nan(second.standard_error),
        "missing": "\n".join(f"{name}: {reason}" for name, reason in explanation.missing.items()),
        **({} if second is None else {f"action_{sensor}": action for sensor, action in enumerate(second.actions)}),
    }


def with_explanations(decisions: Sequence[Decision], tables: Mapping[str, Mapping[str, Any]]) -> tuple[Decision, ...]:
    """Return the decisions with their explanations and bounds from the tables.

    Raises `InputError`, `KeyError`, `IndexError` or `ValueError` for inconsistent tables.
    """
    table, targets, sensors = (tables[name] for name in EXPLANATION_TABLES)
    explained = list(decisions)
    if len(np.unique(table["decision"])) < len(table["decision"]):
        raise InputError("explanations, column decision: expected each once")
    for row, number in enumerate(table["decision"].tolist()):
        if not 0 <= number < len(explained):
            raise InputError(f"explanations, column decision: expected numbers below {len(explained)}; got {number}")
        plan = explained[number].plan
        explanation = _explanation(plan, table, row, _of(targets, number), _of(sensors, number))
        explained[number] = replace(
            explained[number], plan=replace(plan, explanation=explanation, bound=explanation.bound)
        )
    return tuple(explained)


def _of(table: Mapping[str, Any], number: int) -> dict[str, Any]:
    rows = np.flatnonzero(table["decision"] == number)
    return {name: column[rows] for name, column in table.items()}


def _explanation(
    plan: Plan, table: Mapping[str, Any], row: int, targets: Mapping[str, Any], sensors: Mapping[str, Any]
) -> Explanation:
    missing = dict(line.split(": ", 1) for line in table["missing"][row].splitlines())
    reward, kind = _number(table["reward"][row]), table["bound_kind"][row]
    bound = None
    if kind:
        assert reward is not None
        bound = Bound(float(table["bound"][row]), reward, kind, int(table["num_targets_without_bound"][row]))
    if len(sensors["sensor"]) not in (0, plan.num_sensors):
        raise InputError(f"sensor_gains: expected rows of {plan.num_sensors} sensors; got {len(sensors['sensor'])}")
    has_sensors = len(sensors["sensor"]) > 0
    gains = None
    if "of_targets" not in missing:
        labels = np.stack([targets["birth_step"], targets["birth_site"]], axis=1)
        gains = TargetGains(labels, targets["existence_gain"], targets["localisation_gain"])
    return Explanation(
        planner=plan.planner,
        chosen=tuple(actions.text(index) for actions, index in zip(plan.actions, plan.chosen, strict=True)),
        reward=reward,
        standard_error=_number(table["reward_se"][row]),
        evaluations=int(table["evaluations"][row]),
        baseline=_number(table["baseline"][row]),
        of_targets=gains,
        of_undetected=_number(table["undetected_gain"][row]),
        of_sensors=sensors["gain"] if has_sensors else None,
        reward_without_sensor=sensors["reward_without_sensor"] if has_sensors else None,
        runner_up=None if "runner_up" in missing else _runner_up(plan, table, row),
        bound=bound,
        missing=missing,
        price=float(table["price"][row]) if "price" in table else 0.0,
    )


def _runner_up(plan: Plan, table: Mapping[str, Any], row: int) -> RunnerUp:
    actions = tuple(int(table[f"action_{s}"][row]) for s in range(plan.num_sensors))
    for s, (available, index) in enumerate(zip(plan.actions, actions, strict=True)):
        if not 0 <= index < len(available):
            raise InputError(
                f"explanations, column action_{s}: expected an index of {len(available)} actions; got {index}"
            )
    error = _number(table["margin_se"][row])
    return RunnerUp(actions, table["runner_up"][row], float(table["margin"][row]), error)


def _or_nan(value: float | None) -> float:
    return np.nan if value is None else value


def _number(value: float) -> float | None:
    return None if np.isnan(value) else float(value)
