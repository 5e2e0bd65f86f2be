"""Explanation of a decision as the plain data that the page shows."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from vedette.control.explanation import Explanation, RunnerUp, TargetGains, margin_text, number_text, with_error
from vedette.control.plan import Plan
from vedette.evaluation.actions import describe_action, rounded
from vedette.internal.text import pluralise

_MOST_TARGETS = 10
_SAME = 1e-9
_WORDS = {"of_targets": "gain by target", "of_sensors": "shares of the sensors", "runner_up": "second best"}


def explanation_data(plan: Plan, names: Sequence[str] = ()) -> dict[str, Any] | None:
    """Return the data that the page shows, with the sensors' names, or None for a decision stored without explanation.

    Facts as pairs of texts: label and gains of the ten targets with the largest gains, and number and sums of the
    others; the gain from targets not detected before; the cost of the actions; and for each sensor its number, action,
    share, and the reward without it.
    """
    explanation = plan.explanation
    if explanation is None or explanation.reward is None:
        return None
    return {
        "facts": _facts(
            plan, explanation, explanation.reward, names or [f"sensor {s + 1}" for s in range(plan.num_sensors)]
        ),
        **({"targets": [], "more": None} if explanation.of_targets is None else _targets(explanation.of_targets)),
        "undetected": _number(explanation.of_undetected or 0.0),
        "price": _number(explanation.price),
        "sensors": _sensors(plan, explanation),
    }


def _facts(plan: Plan, explanation: Explanation, reward: float, names: Sequence[str]) -> list[tuple[str, str]]:
    start = "" if explanation.baseline is None else f"; {number_text(explanation.baseline, reward)} without any scan"
    facts = [("Reward", f"{with_error(reward, explanation.standard_error, '±')}{start}")]
    if explanation.runner_up is not None:
        margin = margin_text(explanation.runner_up, reward, "±", (", ", ""))
        facts.append(("Second best", f"{margin}: {_others(plan, explanation.runner_up, names)}"))
    facts.append(("Evaluated", pluralise(explanation.evaluations, "choice")))
    if bound := str(explanation.bound or ""):
        facts.append(("Bound", bound))
    reasons: dict[str, list[str]] = {}
    for name, reason in explanation.missing.items():
        if name in _WORDS:
            reasons.setdefault(reason, []).append(_WORDS[name])
    return facts + [("Not known", f"{', '.join(names)}: {reason}") for reason, names in reasons.items()]


def _others(plan: Plan, runner_up: RunnerUp, names: Sequence[str]) -> str:
    words = (
        f"{names[s]} to {describe_action(rounded(actions.columns, actions.values[other]))}"
        for s, (actions, chosen, other) in enumerate(zip(plan.actions, plan.chosen, runner_up.actions, strict=True))
        if other != chosen
    )
    return ", ".join(words)


def _targets(gains: TargetGains) -> dict[str, Any]:
    order = np.argsort(-np.abs(gains.total), kind="stable")
    largest, rest = order[:_MOST_TARGETS].tolist(), order[_MOST_TARGETS:].tolist()
    least = _SAME * float(np.abs(gains.total).max(initial=0.0))  # smaller gains are rounding

    def gained(indices: list[int]) -> tuple[float, float]:
        existence, localisation = float(gains.existence[indices].sum()), float(gains.localisation[indices].sum())
        return _number(existence, least), _number(localisation, least)

    shown = [(".".join(map(str, gains.labels[i].tolist())), *gained([i])) for i in largest]
    return {"targets": shown, "more": (len(rest), *gained(rest)) if rest else None}


def _sensors(plan: Plan, explanation: Explanation) -> list[tuple[int, str, float, float]]:
    if explanation.of_sensors is None or explanation.reward_without_sensor is None:
        return []
    return [
        (s, describe_action(rounded(actions.columns, actions.values[chosen])), _number(share), _number(without))
        for s, (actions, chosen, share, without) in enumerate(
            zip(
                plan.actions,
                plan.chosen,
                explanation.of_sensors.tolist(),
                explanation.reward_without_sensor.tolist(),
                strict=True,
            )
        )
    ]


def _number(value: float, least: float = 0.0) -> float:
    """Return a number with four significant digits, or 0 if it is not finite or smaller than `least`."""
    return float(f"{value:.4g}") if math.isfinite(value) and abs(value) >= least else 0.0
