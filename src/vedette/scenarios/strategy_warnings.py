"""Warnings of strategies that a run of this scenario refuses."""

from collections.abc import Iterator

from vedette.errors import InputError
from vedette.internal.text import join_alternatives
from vedette.scenarios.diagnostics import Path
from vedette.scenarios.loading import Scenario
from vedette.scenarios.sections.consistency import incompatibility
from vedette.scenarios.sections.planners import STRATEGIES
from vedette.scenarios.trust import custom_code, foreign_code_reason


def strategy_warnings(scenario: Scenario) -> Iterator[tuple[Path, str]]:
    """Yield a warning for each reason why strategies are refused, with their names and the requirement.

    If the scenario names custom code, planners are built as well, as nothing else can detect its faults.
    """
    refused: dict[str, list[str]] = {}
    makes = bool(custom_code(scenario.model)) and not foreign_code_reason(scenario)
    for name, strategy in STRATEGIES.items() if scenario.model.decision_steps else ():
        if wanted := incompatibility(scenario.model, strategy) or (makes and _fault_of_planner(scenario, name)):
            refused.setdefault(wanted, []).append(name)
    for wanted, names in refused.items():
        yield ("control",), f"a run with --planner {join_alternatives(names)} is refused: expected {wanted}"


def _fault_of_planner(scenario: Scenario, name: str) -> str:
    """Return what building the planner of a strategy expects instead; "" if it can be built."""
    from vedette.scenarios.build import build_planner  # with it comes the compiler

    try:
        build_planner(scenario, name)
    except InputError as error:
        return str(error).partition(": expected ")[2].partition("; got")[0]
    return ""
