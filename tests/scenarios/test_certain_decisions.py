"""A scenario whose decisions take as many samples as they need: what is built, told and run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from scenarios.minimal import MINIMAL, changed
from vedette.evaluation import run_scenario
from vedette.scenarios import Scenario, parse_scenario
from vedette.scenarios.build import build_planner
from vedette.scenarios.dumping import dump_scenario
from vedette.scenarios.summary import summary_rows

SAMPLED = "reward: {kind: cauchy_schwarz}"
SHORT = (("num_steps: 20", "num_steps: 6"), ("last_scan: 20", "last_scan: 6"), ("end_step: 18", "end_step: 6"))


def scenario(control: str) -> Scenario:
    return Scenario(parse_scenario(changed(("decision_steps: [4, 8]", control), *SHORT), "f.yaml"), Path("f.yaml"))


def test_the_settings_reach_the_planner() -> None:
    own = scenario(f"confidence: 0.9, indifference: 0.02, max_samples: 5e2, max_seconds: 3, {SAMPLED}")
    planner: Any = build_planner(own, "jdm")
    told = planner.settings
    assert (told.confidence, told.indifference, told.max_samples, told.max_seconds) == (0.9, 0.02, 500, 3.0)
    assert "samples until certain at 90 %, to 2 %, at most 500 or 3 s" in dict(summary_rows(own.model))[
        "objective"
    ].replace(",", "", 0)
    again = parse_scenario(dump_scenario(own.model), "f.yaml")
    assert again == own.model
    plain: Any = build_planner(Scenario(parse_scenario(MINIMAL), Path("f.yaml")), "jdm")
    assert plain.settings.confidence is None
    assert "40 samples" in dict(summary_rows(scenario(SAMPLED).model))["objective"]
    assert "no sampling" in dict(summary_rows(parse_scenario(MINIMAL)))["objective"]


@pytest.mark.parametrize("planner", ["jdm", "idm"])
def test_a_run_says_how_each_decision_ended(planner: str) -> None:
    text = "decision_steps: [2, 4], horizon_steps: 2, confidence: 0.9, indifference: 0.1, max_samples: 50"
    for decision in run_scenario(scenario(text), planner, seed=1, num_threads=1).decisions:
        assert decision.plan.certainty is not None
        assert decision.plan.certainty.reason == "no samples"
    record = run_scenario(scenario(f"{text}, {SAMPLED}"), planner, seed=1, num_threads=1)
    for decision in record.decisions:
        assert decision.plan.certainty is not None
        assert str(decision.plan.certainty) in decision.plan.notes
