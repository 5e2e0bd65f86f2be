"""Strategies that do not keep to constraints: their plans, and what a run prints of them, say which they violate."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest

from vedette.evaluation import run_scenario
from vedette.scenarios import Scenario, load_scenario, replace_fields

HERE = Path(__file__).parent
ZONE = {"kind": "keep_out", "region": {"x_min": -10_000.0, "x_max": -400.0, "y_min": -10_000.0, "y_max": 500.0}}
APART = {"kind": "separation", "distance": 100_000.0}


def paper_a(tmp_path: Path, *constraints: Any) -> Scenario:
    """With a planner of one's own, and constraints."""
    shutil.copy(HERE / "own_parts.py", tmp_path)
    own = {"kind": "custom", "function": f"{tmp_path / 'own_parts.py'}:Last"}
    fields = {"control.constraints": list(constraints), "planners": {"last": own}, "filter.kind": "lmb"}
    return replace_fields(load_scenario("paper-a"), {**fields, "fusion.kind": "clmb"})


@pytest.mark.parametrize("strategy", ["constant", "last"])
def test_plans_name_the_sensors_and_constraints_that_they_violate(strategy: str, tmp_path: Path) -> None:
    record = run_scenario(paper_a(tmp_path, ZONE, APART), strategy, seed=0)
    for decision in record.decisions:
        x, y = decision.poses[1, :2]
        if x < -450.0 and y < 450.0:
            assert "sensor 2: its course violates keep_out" in decision.plan.notes
        assert "sensors 1 and 2: their courses violate separation" in decision.plan.notes
        assert "sensor 1: its course violates keep_out" not in decision.plan.notes
    assert record.decisions[0].plan.notes == (
        "sensor 2: its course violates keep_out",
        "sensors 1 and 2: their courses violate separation",
    )
    assert record.planner == strategy


def test_independent_decisions_keep_to_zones_and_report_pair_violations(tmp_path: Path) -> None:
    notes = run_scenario(paper_a(tmp_path, APART), "idm", seed=0).decisions[0].plan.notes
    assert "sensors 1 and 2: their courses violate separation" in notes
    fence = {"kind": "keep_out", "region": {"x_min": -300.0, "x_max": 300.0, "y_min": -300.0, "y_max": 300.0}}
    for decision in run_scenario(paper_a(tmp_path, fence), "idm", seed=0).decisions:
        assert not any("violate" in note for note in decision.plan.notes)


def test_satisfied_constraints_are_not_reported(tmp_path: Path) -> None:
    fence = {"kind": "stay_inside", "region": {"x_min": -1e4, "x_max": 1e4, "y_min": -1e4, "y_max": 1e4}}
    for strategy in ("constant", "last"):
        assert run_scenario(paper_a(tmp_path, fence), strategy, seed=0).decisions[0].plan.notes == ()
