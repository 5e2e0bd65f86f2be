"""What the check accepts runs: combinations of all kinds of all sections, under every strategy."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from fuzz.combinations import STRATEGIES, combination, lay_beside
from fuzz.mutations import pick
from fuzz.outcomes import bounded, check_message, outcome
from vedette.errors import InputError, ScenarioError, SlowRewardWarning
from vedette.evaluation.runs import measure_run, own_metrics, run_scenario
from vedette.scenarios import Scenario, load_scenario
from vedette.scenarios.build import build_planner
from vedette.scenarios.cautions import cautions
from vedette.scenarios.code_checks import code_faults
from vedette.scenarios.dumping import dump_scenario

Check = Callable[[np.random.Generator], object]

_MOST_DRAWS = 8
SECONDS = 900  # a first run compiles kernels

pytestmark = [pytest.mark.fuzz, pytest.mark.filterwarnings("ignore::vedette.errors.ImplausibleWarning")]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    lay_beside(tmp_path)
    return tmp_path


def checked(path: Path) -> Scenario:
    """As `vedette check` does."""
    scenario = load_scenario(path)
    if faults := code_faults(scenario):
        raise ScenarioError(faults)
    for line in cautions(scenario):
        assert line.isprintable()
    return scenario


def strategy(scenario: Scenario, rng: np.random.Generator) -> str | None:
    """One of the scenario's own, which must go; or a built-in one, unless it is refused by name before the run."""
    name: str = pick(rng, [*STRATEGIES, *scenario.model.planners, "jdm"])
    try:
        build_planner(scenario, name)
    except InputError as error:
        check_message(error)
        if name in scenario.model.planners or f"planner {name}" not in str(error):
            raise
        return None
    return name


def run(scenario: Scenario, rng: np.random.Generator) -> bool:
    """Run and measure it, if it goes with the strategy drawn."""
    name = strategy(scenario, rng)
    if name is None:
        return False
    try:
        record = run_scenario(scenario, name, seed=0, num_threads=1)
        measure_run(record, scenario, own_metrics(scenario))
    except Exception as error:
        error.add_note(f"{name}: {dump_scenario(scenario.model)}")
        raise
    return True


def test_what_is_accepted_runs(try_cases: Callable[[Check, int], None], folder: Path) -> None:
    path = folder / "scenario.yaml"
    counts = {"accepted": 0, "refused": 0, "run": 0}

    def check(rng: np.random.Generator) -> None:
        for _ in range(_MOST_DRAWS):
            data = combination(rng)
            path.write_text(json.dumps(data, indent=1))
            with bounded(data, SECONDS), warnings.catch_warnings():
                warnings.simplefilter("ignore", SlowRewardWarning)
                scenario = outcome(lambda: checked(path))
                counts["refused" if scenario is None else "accepted"] += 1
                if scenario is not None:
                    counts["run"] += run(scenario, rng)
                    return

    try_cases(check, 40)
    print(counts)
    assert counts["run"] or not counts["accepted"]
