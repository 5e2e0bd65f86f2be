"""Why the decisions of a run are what they are, as tables of columns, and back.

A run has these tables or, where its decisions were not explained, none of them: runs of before they were there read as
such runs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from vedette.control import Bound, Explanation, Plan, RunnerUp, TargetGains
from vedette.errors import InputError
from vedette.kernels.base.types import Floats
from vedette.simulation.arrow import Columns, Kind, Layout
from vedette.simulation.records import Decision

_DECISION = {"decision": Kind.INTEGER, "step": Kind.INTEGER, "time_s": Kind.NUMBER}

EXPLAINED: dict[str, Layout] = {
    "explanations": Layout(
        {
            **_DECISION,
            "reward": Kind.VALUE,
            "reward_se": Kind.VALUE,
            "baseline": Kind.VALUE,
            "undetected_gain": Kind.VALUE,
            "evaluations": Kind.INTEGER,
            "bound": Kind.VALUE,
            "bound_kind": Kind.TEXT,
            "bound_unbounded": Kind.COUNT,
            "runner_up": Kind.TEXT,
            "margin": Kind.VALUE,
            "margin_se": Kind.VALUE,
            "missing": Kind.TEXT,
        },
        {"action_": Kind.COUNT},
    ),
    "target_gains": Layout(
        {
            **_DECISION,
            "birth_step": Kind.INTEGER,
            "birth_site": Kind.INTEGER,
            "existence_gain": Kind.NUMBER,
            "localisation_gain": Kind.NUMBER,
        }
    ),
    "sensor_gains": Layout({**_DECISION, "sensor": Kind.INTEGER, "gain": Kind.NUMBER, "without": Kind.NUMBER}),
}


def explained_tables(decisions: Sequence[Decision], num_sensors: int) -> dict[str, Columns]:
    """The tables of `EXPLAINED`, without rows where no decision was explained.

    Raises `InputError` for explanations of other sensors.
    """
    found = [(number, each, each.plan.explanation) for number, each in enumerate(decisions)]
    kept = [(number, each, why) for number, each, why in found if why is not None]
    for _, _, why in kept:
        for name in ("of_sensors", "without"):
            values = getattr(why, name)
            if values is not None and np.shape(values) != (num_sensors,):
                raise InputError(f"plan.explanation.{name}: expected {num_sensors} numbers; got {np.shape(values)}")
    return {
        "explanations": _explanations(kept, num_sensors),
        "target_gains": _targets(kept),
        "sensor_gains": _sensors(kept),
    }


_Kept = Sequence[tuple[int, Decision, Explanation]]


def _moments(kept: _Kept, repeats: Sequence[int]) -> Columns:
    rows = np.repeat(np.arange(len(kept)), repeats)
    return {
        "decision": np.array([number for number, *_ in kept], np.int64)[rows],
        "step": np.array([each.step for _, each, _ in kept], np.int64)[rows],
        "time_s": np.array([each.time for _, each, _ in kept], np.float64)[rows],
    }


def _explanations(kept: _Kept, num_sensors: int) -> Columns:
    every = [why for *_, why in kept]
    bounds, seconds = [why.bound for why in every], [why.runner_up for why in every]
    others = np.array([[-1] * num_sensors if one is None else one.actions for one in seconds], np.int64)
    return {
        **_moments(kept, [1] * len(kept)),
        "reward": _numbers([why.reward for why in every]),
        "reward_se": _numbers([why.standard_error for why in every]),
        "baseline": _numbers([why.baseline for why in every]),
        "undetected_gain": _numbers([why.of_undetected for why in every]),
        "evaluations": np.array([why.evaluations for why in every], np.int64),
        "bound": _numbers([None if bound is None else bound.upper for bound in bounds]),
        "bound_kind": ["" if bound is None else bound.kind for bound in bounds],
        "bound_unbounded": np.array([-1 if bound is None else bound.unbounded for bound in bounds], np.int64),
        "runner_up": ["" if one is None else one.text for one in seconds],
        "margin": _numbers([None if one is None else one.margin for one in seconds]),
        "margin_se": _numbers([None if one is None else one.standard_error for one in seconds]),
        "missing": ["\n".join(f"{name}: {reason}" for name, reason in why.missing.items()) for why in every],
        **{f"action_{s}": column for s, column in enumerate(others.reshape(-1, num_sensors).T)},
    }


def _targets(kept: _Kept) -> Columns:
    gains = [why.of_targets for *_, why in kept]
    present = [each for each in gains if each is not None]
    labels = np.concatenate([np.empty((0, 2), np.int64), *(each.labels for each in present)])
    return {
        **_moments(kept, [0 if each is None else len(each.labels) for each in gains]),
        "birth_step": labels[:, 0],
        "birth_site": labels[:, 1],
        "existence_gain": np.concatenate([np.empty(0), *(each.existence for each in present)]),
        "localisation_gain": np.concatenate([np.empty(0), *(each.localisation for each in present)]),
    }


def _sensors(kept: _Kept) -> Columns:
    counts = [0 if why.of_sensors is None or why.without is None else len(why.of_sensors) for *_, why in kept]
    present = [why for (*_, why), count in zip(kept, counts, strict=True) if count]
    return {
        **_moments(kept, counts),
        "sensor": np.concatenate([np.empty(0, np.int64), *(np.arange(count) for count in counts)]),
        "gain": np.concatenate([np.empty(0), *(_floats(why.of_sensors) for why in present)]),
        "without": np.concatenate([np.empty(0), *(_floats(why.without) for why in present)]),
    }


def with_explanations(decisions: Sequence[Decision], tables: Mapping[str, Mapping[str, Any]]) -> tuple[Decision, ...]:
    """The decisions with their explanations back from their tables, and with their bounds.

    Raises `InputError`, `KeyError`, `IndexError` or `ValueError` for tables that do not fit together.
    """
    table, targets, sensors = (tables[name] for name in EXPLAINED)
    found = list(decisions)
    if len(np.unique(table["decision"])) < len(table["decision"]):
        raise InputError("explanations, column decision: expected each once")
    for row, number in enumerate(table["decision"].tolist()):
        if not 0 <= number < len(found):
            raise InputError(f"explanations, column decision: expected numbers below {len(found)}; got {number}")
        plan = found[number].plan
        why = _explanation(plan, table, row, _of(targets, number), _of(sensors, number))
        found[number] = replace(found[number], plan=replace(plan, explanation=why, bound=why.bound))
    return tuple(found)


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
        bound = Bound(float(table["bound"][row]), reward, kind, int(table["bound_unbounded"][row]))
    if len(sensors["sensor"]) not in (0, plan.num_sensors):
        raise InputError(f"sensor_gains: expected rows of {plan.num_sensors} sensors; got {len(sensors['sensor'])}")
    has_sensors = len(sensors["sensor"]) > 0
    return Explanation(
        planner=plan.planner,
        chosen=tuple(own.text(index) for own, index in zip(plan.actions, plan.chosen, strict=True)),
        reward=reward,
        standard_error=_number(table["reward_se"][row]),
        evaluations=int(table["evaluations"][row]),
        baseline=_number(table["baseline"][row]),
        of_targets=None if "of_targets" in missing else _gains(targets),
        of_undetected=_number(table["undetected_gain"][row]),
        of_sensors=sensors["gain"] if has_sensors else None,
        without=sensors["without"] if has_sensors else None,
        runner_up=None if "runner_up" in missing else _runner_up(plan, table, row),
        bound=bound,
        missing=missing,
    )


def _gains(targets: Mapping[str, Any]) -> TargetGains:
    labels = np.stack([targets["birth_step"], targets["birth_site"]], axis=1)
    return TargetGains(labels, targets["existence_gain"], targets["localisation_gain"])


def _runner_up(plan: Plan, table: Mapping[str, Any], row: int) -> RunnerUp:
    actions = tuple(int(table[f"action_{s}"][row]) for s in range(plan.num_sensors))
    for s, (own, index) in enumerate(zip(plan.actions, actions, strict=True)):
        if not 0 <= index < len(own):
            raise InputError(f"explanations, column action_{s}: expected an index of {len(own)} actions; got {index}")
    error = _number(table["margin_se"][row])
    return RunnerUp(actions, table["runner_up"][row], float(table["margin"][row]), error)


def _floats(values: Floats | None) -> Floats:
    assert values is not None
    return values


def _numbers(values: Sequence[float | None]) -> Floats:
    return np.array([np.nan if value is None else value for value in values], np.float64)


def _number(value: float) -> float | None:
    return None if np.isnan(value) else float(value)
