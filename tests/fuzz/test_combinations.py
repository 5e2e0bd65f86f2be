"""What the check accepts runs: combinations of all kinds of all sections, under every strategy."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from fuzz.combinations import STRATEGIES, combination, lay_beside
from fuzz.outcomes import bounded, check_message
from vedette.cli import app
from vedette.errors import InputError, ScenarioError, SlowRewardWarning
from vedette.evaluation.runs import custom_metrics, measure_run, run_scenario
from vedette.scenarios import Scenario, load_scenario
from vedette.scenarios.build import build_planner
from vedette.scenarios.dumping import dump_scenario
from vedette.scenarios.strategy_warnings import strategy_warnings
from vedette.simulation import RunRecord

Check = Callable[[np.random.Generator], object]

_MOST_DRAWS = 8
SECONDS = 900  # a first run compiles kernels

pytestmark = [pytest.mark.fuzz, pytest.mark.filterwarnings("ignore::vedette.errors.ImplausibleWarning")]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    lay_beside(tmp_path)
    return tmp_path


def accepted(path: Path) -> bool:
    """Whether `vedette check` accepts the file; what it says otherwise can be read."""
    result = CliRunner().invoke(app, ["check", str(path)])
    if result.exit_code not in (0, 1):
        raise AssertionError(f"vedette check ended with {result.exit_code}: {result.output}") from result.exception
    if result.exit_code:
        check_message(ScenarioError(result.output.splitlines()))
    return result.exit_code == 0


def strategies(scenario: Scenario) -> list[str]:
    """Every strategy but those of which the check warns that a run refuses them; the scenario's own must go."""
    found, warned = [], "".join(text.partition(" is refused")[0] for _, text in strategy_warnings(scenario))
    for name in (*STRATEGIES, *scenario.model.planners):
        try:
            build_planner(scenario, name)
        except InputError as error:
            check_message(error)
            if name in scenario.model.planners or f"planner {name}" not in str(error) or name not in warned:
                raise
        else:
            found.append(name)
    return found


def check_limit(scenario: Scenario, name: str, record: RunRecord) -> None:
    """No more sensors scan after decisions than `max_active` says, where all can be switched off."""
    model = scenario.model
    limits = [own.sensors for own in model.control.constraints if own.kind == "max_active"]
    keeps = name in STRATEGIES[:-2] or (name in model.planners and model.planners[name].kind != "custom")
    if limits and keeps and all(own.switchable for own in model.sensors):
        on = (~record.off[model.decision_steps[0] :]).sum(axis=1)
        assert on.max(initial=0) <= min(limits), f"{name}: {on} sensors scan"


def run(scenario: Scenario) -> int:
    """Run and measure it under every strategy; the number of these."""
    names = strategies(scenario)
    for name in names:
        try:
            record = run_scenario(scenario, name, seed=0, num_threads=1)
            measure_run(record, scenario, custom_metrics(scenario))
            check_limit(scenario, name, record)
        except Exception as error:
            error.add_note(f"{name}: {dump_scenario(scenario.model)}")
            raise
    return len(names)


def test_what_is_accepted_runs(try_cases: Callable[[Check, int], None], folder: Path) -> None:
    path = folder / "scenario.yaml"
    counts = {"accepted": 0, "refused": 0, "run": 0}

    def check(rng: np.random.Generator) -> None:
        for _ in range(_MOST_DRAWS):
            data = combination(rng)
            path.write_text(json.dumps(data, indent=1))
            with bounded(data, SECONDS), warnings.catch_warnings():
                warnings.simplefilter("ignore", SlowRewardWarning)
                if accepted(path):
                    counts["accepted"] += 1
                    counts["run"] += run(load_scenario(path))
                    return
                counts["refused"] += 1

    try_cases(check, 40)
    print(counts)
    assert counts["run"] >= counts["accepted"]
