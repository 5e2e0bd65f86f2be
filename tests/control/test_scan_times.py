"""Decisions with sensors that do not always scan: what they will not see is not counted on."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from control.examples import (
    FIRST,
    NEVER,
    SECOND,
    SETTINGS,
    A,
    B,
    C,
    Situation,
    additive_of,
    lmb,
    scanning,
    situation,
)
from control.test_plain_loop import assert_equals_plain_loop
from vedette.control import (
    CauchySchwarzReward,
    HorizonPlanner,
    IndependentPlanner,
    JointPlanner,
    PlanningSettings,
)
from vedette.control.rewards.power import ExpectedLossReward
from vedette.control.search.problem import all_joint_actions
from vedette.densities import UndetectedIntensity
from vedette.errors import InputError
from vedette.fusion import ParallelUpdate
from vedette.models import CellGrid, Region
from vedette.scenarios import load_scenario, replace_fields
from vedette.scenarios.build import build_sensors


def shared() -> Situation:
    """Two sensors of one belief, of which all scans count in full, at default settings."""
    belief = lmb((A, B, C), np.random.default_rng(3))
    example = situation("lmb", settings=PlanningSettings(num_threads=1))
    return replace(example, fusion=ParallelUpdate(), beliefs=(belief,) * 2, fused=belief)


def test_a_pseudo_update_counts_where_a_scan_is_within_its_period() -> None:
    own = situation("lmb").sensors[0]
    cases: tuple[tuple[Any, list[bool]], ...] = (
        (FIRST, [True, False]),
        (SECOND, [False, True]),
        (NEVER, [False, False]),
        ([], [False] * 2),
    )
    for times, wanted in cases:
        assert replace(own, scan_times=times).scans(1.0, SETTINGS).tolist() == wanted
    assert own.scans(1.0, SETTINGS).all()
    assert replace(own, scan_times=NEVER).scans(None, SETTINGS).all()
    # Times that are sums: a tenth of a second is none of binary.
    tenths = PlanningSettings(horizon_steps=50, horizon_period=0.1)
    for now in (0.1 * np.arange(1, 80)).tolist():
        found = replace(own, scan_times=0.3 * np.arange(100.0)).scans(now, tenths)
        steps = np.arange(1, 51) + round(now / 0.1)
        np.testing.assert_array_equal(found, steps % 3 == 0)


@pytest.mark.parametrize("times", [[1.0, 1.0], [2.0, 1.0], [np.nan], "soon", [[1.0]]])
def test_scan_times_are_times_in_order(times: Any) -> None:
    with pytest.raises(InputError, match="scan_times"):
        replace(situation("lmb").sensors[0], scan_times=times)


@pytest.mark.parametrize("kind", ["delta", "marginal", "lmb"])
@pytest.mark.parametrize("times", [(FIRST, SECOND), (SECOND, None), (NEVER, FIRST)])
def test_case_by_case_as_the_filters_themselves(kind: str, times: Any) -> None:
    """GLMB and LMB filters, joint and alone, against plain loops."""
    assert_equals_plain_loop(scanning(situation(kind), *times), least=0.0)


@pytest.mark.parametrize("reward", [CauchySchwarzReward(), ExpectedLossReward()])
def test_a_sensor_that_scans_at_every_step_is_as_one_that_says_nothing_of_it(reward: Any) -> None:
    example = shared()
    every = scanning(example, np.arange(1.0, 30.0, 2.0), np.arange(1.0, 30.0))
    actions = all_joint_actions((3, 3))
    np.testing.assert_array_equal(
        additive_of(every, reward).joint()(actions), additive_of(example, reward).joint()(actions)
    )


@pytest.mark.parametrize("reward", [CauchySchwarzReward(), ExpectedLossReward()])
@pytest.mark.parametrize("planner", [JointPlanner, IndependentPlanner, HorizonPlanner])
def test_who_does_not_scan_within_the_horizon_is_not_counted_on(planner: Any, reward: Any) -> None:
    example = scanning(shared(), None, [0.0, 1.0, 1000.0])
    decides = planner(example.sensors, example.fusion, example.settings, reward)
    plan = decides.plan(*example.arguments, rng=np.random.default_rng(1))
    worth = [own.mean for own in plan.tables]
    if planner is IndependentPlanner:
        assert np.ptp(worth[0]) > 0.0
        assert np.ptp(worth[1]) == 0.0
    elif planner is JointPlanner:
        assert np.ptp(worth[0], axis=0).min() > 0.0
        assert np.ptp(worth[0], axis=1).max() == 0.0
    assert "sensor 2: no scan within the horizon; all of its courses are worth the same" in plan.notes


def test_later_decisions_of_a_sequence_count_on_later_scans() -> None:
    """Of two decisions 10 s each the second alone has scans of the second sensor."""
    late = scanning(shared(), None, [1.0, 13.0, 15.0])
    plans = []
    for example in (late, scanning(shared(), None, [1.0, 1000.0]), shared()):
        decides = HorizonPlanner(example.sensors, example.fusion, example.settings, ExpectedLossReward(), depth=2)
        plans.append(decides.plan(*example.arguments, rng=np.random.default_rng(1)))
    late_worth, never_worth, always_worth = (plan.expected_rewards[0][0] for plan in plans)
    assert never_worth < late_worth < always_worth
    assert not plans[0].notes


def test_who_does_not_scan_finds_nobody() -> None:
    undetected = UndetectedIntensity(CellGrid(Region(-500.0, 500.0, -500.0, 500.0), 10, 10), np.full(100, 0.05))
    settings = PlanningSettings(undetected_target_value=1e4, num_threads=1)
    example = scanning(replace(shared(), settings=settings), None, [0.0, 1000.0])
    decides = JointPlanner(example.sensors, example.fusion, settings, ExpectedLossReward())
    state = replace(example.state, undetected=undetected)
    table = decides.plan(state, example.poses, rng=np.random.default_rng(1)).tables[0].mean
    assert np.ptp(table, axis=0).min() > 0.0
    assert np.ptp(table, axis=1).max() == 0.0


def test_scenarios_tell_planners_when_their_sensors_scan() -> None:
    scenario = replace_fields(load_scenario("paper-a"), {"sensors.1.scans": {"every": 4, "first": 2}})
    first, second = build_sensors(scenario)
    assert first.scan_times is None
    assert second.scan_times is not None
    start, horizon = scenario.model.time.build(), np.prod(scenario.model.horizon)
    np.testing.assert_allclose(second.scan_times[:3], start[[1, 5, 9]])
    # Decisions near the end look past it, as far as three in a row.
    assert second.scan_times[-1] >= start[-1] + 3 * horizon - 4.0
