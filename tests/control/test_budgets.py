"""Budgets of scanning time: what is left in poses, and that plans, rules and runs keep to it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from control.examples import Situation, decided
from control.test_additive import shared
from control.test_switched import REWARDS
from vedette.control import IndependentPlanner, JointPlanner
from vedette.control.constraints.active import MaxActive
from vedette.control.inputs import options_of, stationary_courses
from vedette.errors import InputError, ScenarioError
from vedette.evaluation.runs import run_scenario
from vedette.kernels.base.types import BUDGET
from vedette.platforms import HeadingPlatform, Operated, Sequences, Stationary
from vedette.platforms.base import options_at
from vedette.scenarios import load_scenario, replace_fields

TIMES = np.arange(1.0, 7.0)


def pose(left: float) -> Any:
    """At the origin, with so many seconds left."""
    return np.array([0.0, 0.0, 0.0, 0.0, 0.0, left])


def limited(example: Situation, left: float, **operated: Any) -> Situation:
    """All sensors may be off, and have so many seconds left of a hundred."""
    sensors = (
        replace(own, platform=Operated(own.platform, switchable=True, budget=100.0, **operated))
        for own in example.sensors
    )
    poses = np.zeros((len(example.sensors), BUDGET + 1))
    poses[:, :3], poses[:, BUDGET] = example.poses[:, :3], left
    return replace(example, sensors=tuple(sensors), poses=poses)


def test_a_sensor_scans_until_none_is_left() -> None:
    found = options_at("platform", Operated(Stationary(), switchable=True, budget=10.0), pose(3.0), TIMES)
    assert found.scans.tolist() == [[True] * 3 + [False] * 3, [False] * 6]
    assert found.courses[:, :, BUDGET].tolist() == [[2.0, 1.0, 0.0, 0.0, 0.0, 0.0], [3.0] * 6]


def test_a_refill_is_added_up_to_the_budget() -> None:
    platform = Operated(Stationary(), switchable=True, budget=4.0, refill=0.5)
    found = options_at("platform", platform, pose(2.0), TIMES)
    assert found.scans.tolist() == [[True] * 4 + [False] * 2, [False] * 6]
    on, off = found.courses[:, :, BUDGET].tolist()
    assert on == [1.5, 1.0, 0.5, 0.0, 0.5, 1.0]
    assert off == [2.5, 3.0, 3.5, 4.0, 4.0, 4.0]
    always = options_at("platform", Operated(Stationary(), budget=4.0, refill=1.0), pose(0.0), TIMES)
    assert always.scans.all()


def test_sequences_go_on_with_what_is_left() -> None:
    platform = Sequences(Operated(Stationary(), switchable=True, budget=10.0), 3.0, 2)
    found = options_at("platform", platform, pose(4.0), TIMES)
    rows = {tuple(row): scans.sum() for row, scans in zip(found.actions.values.tolist(), found.scans, strict=True)}
    assert rows == {(1.0, 1.0): 4, (1.0, 0.0): 3, (0.0, 1.0): 3, (0.0, 0.0): 0}


@pytest.mark.parametrize("reward", REWARDS)
def test_scans_beyond_the_budget_are_worth_nothing(reward: Any) -> None:
    """With less time left than to the first step of the horizon, a sensor that is on is as one that is off."""
    example = shared(2, platform=HeadingPlatform(30.0, (-90.0, 45.0)))
    table = decided(limited(example, 0.5), reward=reward).tables[0].mean
    rich = decided(limited(example, 50.0), reward=reward).tables[0].mean
    np.testing.assert_allclose(table[:2], table[2:], rtol=1e-12)
    np.testing.assert_allclose(table[2:, 2:], rich[2:, 2:], rtol=1e-12)
    assert (rich[:2, 2:] > table[:2, 2:]).all()


def test_others_that_stay_scan_and_sensors_beyond_a_number_are_switched_off() -> None:
    example = limited(shared(2), 50.0)
    options, mask = options_of(example.sensors, example.poses, example.settings), None
    assert [options[s].scans[course].any() for s, course in enumerate(stationary_courses(options, mask))] == [
        True,
        True,
    ]
    for kind in (JointPlanner, IndependentPlanner):
        plan = decided(example, kind, constraints=(MaxActive(1),))
        assert sum(row[-1] for row in plan.chosen_actions) == 1.0
        assert not any("given up" in note for note in plan.notes)


@pytest.mark.parametrize("planner", ["jdm", "idm", "lookahead", "nearest", "random", "constant"])
def test_no_strategy_scans_longer_than_the_budget(planner: str) -> None:
    scenario = load_scenario("paper-a")
    sensors = [
        {**own, "switchable": True, "budget": {"seconds": seconds, "refill": refill}}
        for own, seconds, refill in zip(
            scenario.model.model_dump(mode="json", exclude_unset=True)["sensors"], (6.0, 4.0), (0.0, 0.25), strict=True
        )
    ]
    model = replace_fields(scenario, {"sensors": sensors, "fusion": {"kind": "sequential"}, "filter": {"kind": "lmb"}})
    record = run_scenario(model, planner, seed=0)
    first = model.model.decision_steps[0]
    num_scans = (~record.off[first:]).sum(axis=0)
    seconds = record.times[first:][-1] - record.times[first - 1]
    assert num_scans[0] * model.model.time.step_period <= 6.0
    assert num_scans[1] * model.model.time.step_period <= 4.0 + 0.25 * seconds
    assert (record.poses[:, :, BUDGET] >= 0.0).all()
    if planner in ("nearest", "constant"):
        assert num_scans[0] * model.model.time.step_period == 6.0


def test_mistakes_are_named() -> None:
    wrong: list[dict[str, Any]] = [{"budget": 0.0}, {"refill": 0.5}, {"budget": 3.0, "refill": -1.0}]
    for own in wrong:
        with pytest.raises(InputError, match=list(own)[-1]):
            Operated(Stationary(), **own)
    with pytest.raises(InputError, match="expected 6 components, the last of them the seconds left to scan; got 3"):
        options_at("platform", Operated(Stationary(), budget=3.0), np.zeros(3), TIMES)
    with pytest.raises(ScenarioError, match=r"sensors\[0\].budget.seconds"):
        replace_fields(load_scenario("paper-a"), {"sensors": [{"position": [0.0, 0.0], "budget": {"seconds": 0.0}}]})
