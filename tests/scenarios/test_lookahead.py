"""Decisions over several periods in a scenario."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from vedette.control import BeamSearch, HorizonPlanner, TreeSearch
from vedette.errors import ScenarioError
from vedette.evaluation.runs import run_scenario
from vedette.scenarios import Scenario, load_scenario, replace_fields
from vedette.scenarios.build import build_planner, build_targets


@pytest.fixture(scope="module")
def gap() -> Scenario:
    """The first scans of the scene across a gap."""
    return replace_fields(
        load_scenario("beyond-the-gap"), {"time.num_steps": 8, "control.decision_steps": [1, 2, 3, 4, 5]}
    )


@pytest.fixture(scope="module")
def plain(gap: Scenario) -> Scenario:
    """The same without a section of its own."""
    return replace_fields(gap, {"control.lookahead": None})


def planner_of(scenario: Scenario, lookahead: Any) -> HorizonPlanner:
    planner = build_planner(replace_fields(scenario, {"control.lookahead": lookahead}), "lookahead")
    assert isinstance(planner, HorizonPlanner)
    return planner


def test_without_a_section_the_defaults_hold(plain: Scenario) -> None:
    planner = planner_of(plain, None)
    assert (planner.depth, planner.period, planner.budget, planner.discount) == (3, None, 2000, 0.25)
    assert planner.search == BeamSearch(8)
    made = HorizonPlanner(planner.sensors, planner.fusion)
    names = ("depth", "period", "budget", "discount", "search")
    assert all(getattr(made, name) == getattr(planner, name) for name in names)
    assert planner.settings.end == 8.0


def test_the_section_sets_the_planner(plain: Scenario) -> None:
    beam = planner_of(plain, {"depth": 2, "beam_width": 3, "budget": 50, "discount": 0.5, "period": 4.0})
    assert (beam.depth, beam.period, beam.budget, beam.discount) == (2, 4.0, 50, 0.5)
    assert beam.search == BeamSearch(3)
    tree = planner_of(plain, {"method": "tree", "exploration": 0.1, "rollout": "repeat_last"})
    assert tree.search == TreeSearch(0.1, "repeat_last")


def test_constraints_are_those_of_all_strategies(gap: Scenario) -> None:
    """A wall across the gap is gone round, or not passed."""
    wall = {"kind": "keep_out", "region": {"x_min": 70.0, "x_max": 80.0, "y_min": -290.0, "y_max": 5.0}}
    apart = {"kind": "separation", "distance": 12.0}
    walled = replace_fields(gap, {"control.constraints": [wall, apart]})
    record = run_scenario(walled, "lookahead", seed=1, num_threads=1)
    first, second = record.poses[:, 0, :2], record.poses[:, 1, :2]
    assert first[:, 0].max() > 100.0 or second[:, 0].max() > 100.0
    legs = np.concatenate([np.linspace(own[:-1], own[1:], 101).reshape(-1, 2) for own in (first, second)])
    inside = (legs[:, 0] >= 70.0) & (legs[:, 0] <= 80.0) & (legs[:, 1] <= 5.0)
    assert not inside.any()
    between = np.linspace(first[:-1] - second[:-1], first[1:] - second[1:], 101)
    assert np.sqrt((between**2).sum(axis=2)).min() >= 12.0


def test_lookahead_crosses_the_gap(gap: Scenario) -> None:
    """A single decision that ends with its horizon has nothing to gain there; one that looks on goes, too."""
    ends = replace_fields(gap, {"control.reward": {"kind": "kullback_leibler"}})
    ahead, single = run_scenario(gap, "lookahead", seed=1, num_threads=1), run_scenario(ends, "jdm", seed=1)
    assert run_scenario(gap, "jdm", seed=1, num_threads=1).poses[-1, :, 0].max() > 100.0
    assert {decision.plan.planner for decision in ahead.decisions} == {"lookahead"}
    assert ahead.poses[-1, :, 0].max() > 100.0
    assert single.poses[-1, :, 0].max() < 100.0
    plan = ahead.decisions[0].plan
    assert [rows.shape for rows in plan.sequence] == [(5, 2), (5, 2)]


def test_the_searchers_targets_differ_from_run_to_run() -> None:
    scenario = load_scenario("two-searchers")
    times = scenario.model.time.build()
    first, second = (build_targets(scenario).truth(times, rng=np.random.default_rng(seed)) for seed in (1, 2))
    first.validate()
    assert not np.array_equal(first.ids, second.ids)
    assert (np.abs(first.states[:, :2]) <= 250.0).all()


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("targets.expected", 0.0, "targets.expected"),
        ("targets.mean", [0.0, 0.0], "targets.mean: expected 4 numbers, as a state under motion has"),
        ("targets.std", [1.0, 1.0, 1.0, -1.0], "targets.std[3]: expected a number of at least 0"),
        ("targets.death_probability", 1.5, "targets.death_probability"),
    ],
)
def test_faults_of_targets(field: str, value: Any, message: str) -> None:
    with pytest.raises(ScenarioError) as fault:
        replace_fields(load_scenario("two-searchers"), {field: value})
    assert message in str(fault.value)
