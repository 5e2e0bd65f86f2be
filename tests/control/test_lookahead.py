"""Decisions over several periods against all sequences written out, and against single decisions."""

from __future__ import annotations

import itertools
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

from control.examples import HEADINGS, KNOWN, SETTINGS, Situation, decided, mobile_sensor, situation
from vedette import models
from vedette.control import (
    BeamSearch,
    CauchySchwarzReward,
    ExpectedLossReward,
    HorizonPlanner,
    JointPlanner,
    KullbackLeiblerReward,
    MobileSensor,
    Plan,
    TreeSearch,
)
from vedette.densities import LMB
from vedette.errors import InputError
from vedette.evaluation import ospa_of_run
from vedette.fusion import Clmb
from vedette.platforms import GridPlatform, HeadingPlatform, Sequences
from vedette.scenarios import load_scenario, replace_fields
from vedette.scenarios.build import build_experiment, build_planner
from vedette.simulation import simulate

REWARDS = [CauchySchwarzReward(), KullbackLeiblerReward(), ExpectedLossReward()]
SEARCHES = [BeamSearch(), BeamSearch(2), TreeSearch(), TreeSearch(rollout="repeat_last", batch=1)]


def lmbs(num_sensors: int = 2, **sensor: Any) -> Situation:
    return situation("lmb", num_sensors, settings=KNOWN, **sensor)


def planner(given: Situation, reward: Any = None, **arguments: Any) -> HorizonPlanner:
    """Of which only the end counts, unless it is said otherwise."""
    reward = CauchySchwarzReward() if reward is None else reward
    return HorizonPlanner(given.sensors, given.fusion, given.settings, reward, **{"discount": None, **arguments})


def decide(planner: Any, given: Situation, seed: int = 1) -> Plan:
    plan: Plan = planner.plan(*given.arguments, rng=np.random.default_rng(seed))
    plan.validate()
    return plan


def of_sequences(given: Situation, reward: Any, depth: int, period: float, num_steps: int) -> Plan:
    """All joint sequences as joint actions of another platform: the oracle."""
    sensors = tuple(MobileSensor(own.filter, Sequences(own.platform, period, depth)) for own in given.sensors)
    settings = replace(given.settings, horizon_steps=num_steps)
    return decided(replace(given, sensors=sensors, settings=settings), JointPlanner, reward)


@pytest.mark.parametrize("reward", REWARDS, ids=lambda reward: type(reward).__name__)
@pytest.mark.parametrize(("period", "num_steps"), [(None, 4), (4.0, 3)])
def test_values_are_those_of_sequences_as_joint_actions(reward: Any, period: float | None, num_steps: int) -> None:
    given = lmbs()
    ahead = decide(planner(given, reward, depth=2, period=period), given)
    oracle = of_sequences(given, reward, 2, period or 8.0, num_steps)
    # Axes: first and second action of each sensor; the best second ones are left.
    mean = oracle.tables[0].mean.reshape((3,) * 4)
    np.testing.assert_allclose(ahead.tables[0].mean, mean.max(axis=(1, 3)), rtol=1e-12)
    assert ahead.chosen == tuple(np.unravel_index(mean.max(axis=(1, 3)).argmax(), (3, 3)))
    for rows, row in zip(ahead.sequence, oracle.chosen_actions, strict=True):
        np.testing.assert_array_equal(rows.ravel(), row)
    assert ahead.bound is not None
    assert ahead.bound.kind == "exhaustive"
    assert ahead.bound.upper == pytest.approx(mean.max(), rel=1e-12)


def test_a_discount_adds_what_each_decision_gains() -> None:
    given, reward = lmbs(), ExpectedLossReward()
    single = decided(given, JointPlanner, reward).tables[0].mean
    double = of_sequences(given, reward, 2, 8.0, 4).tables[0].mean.reshape((3,) * 4)
    total = single[:, np.newaxis, :, np.newaxis] + 0.7 * double
    ahead = decide(planner(given, reward, depth=2, discount=0.7), given)
    np.testing.assert_allclose(ahead.tables[0].mean, total.max(axis=(1, 3)), rtol=1e-12)
    # Of no weight, later decisions are not looked at.
    first = decide(planner(given, reward, depth=2, discount=0.0), given)
    np.testing.assert_allclose(first.tables[0].mean, single, rtol=1e-12)


@pytest.mark.parametrize("search", SEARCHES, ids=repr)
@pytest.mark.parametrize("budget", [1, 7, 60, 400])
def test_searches_keep_to_their_budget_and_value_as_the_oracle_does(search: Any, budget: int) -> None:
    given = lmbs()
    plan = decide(planner(given, depth=3, search=search, budget=budget), given)
    assert plan.curve is not None
    assert plan.curve.evaluations[-1] <= budget
    assert (np.diff(plan.curve.best) >= 0.0).all()
    mean = of_sequences(given, CauchySchwarzReward(), 3, 8.0, 6).tables[0].mean
    place = [0, 0]
    for s, rows in enumerate(plan.sequence):
        for row in rows:
            place[s] = 3 * place[s] + HEADINGS.index(float(row[0]))
    assert plan.expected_rewards[0][0] == pytest.approx(float(mean[tuple(place)]), rel=1e-12)
    assert plan.expected_rewards[0][0] == pytest.approx(float(plan.curve.best[-1]), rel=1e-12)
    assert plan.bound is None
    if budget == 400:
        assert plan.expected_rewards[0][0] >= 0.99 * mean.max()


@pytest.mark.parametrize("search", SEARCHES, ids=repr)
def test_nothing_is_evaluated_twice(search: Any) -> None:
    given = lmbs(num_sensors=1)
    calls: list[Any] = []

    class Watched:
        def search(self, problem: Any, *, rng: np.random.Generator) -> None:
            inner = problem.parts[0]

            def rewards(joints: list[Any]) -> Any:
                calls.extend(joints)
                return inner(joints)

            rewards.stage, rewards.weight = inner.stage, inner.weight  # type: ignore[attr-defined]
            problem.parts = (rewards,)
            search.search(problem, rng=rng)

    decide(planner(given, depth=3, search=Watched(), budget=26), given)
    assert len(calls) == len(set(calls)) <= 26


def test_a_tree_that_is_known_whole_ends_the_search() -> None:
    given = lmbs(num_sensors=1)

    class Whole:
        def search(self, problem: Any, *, rng: np.random.Generator) -> None:
            problem.budget = 1000
            TreeSearch(batch=4).search(problem, rng=rng)

    plan = decide(planner(given, depth=3, search=Whole(), budget=26), given)
    assert plan.curve is not None
    assert plan.curve.evaluations[-1] == 27


@pytest.mark.parametrize("search", SEARCHES, ids=repr)
def test_what_lies_beyond_the_next_decision_is_found(search: Any) -> None:
    """A target round a corner: east, then north, then north, where a single decision sees nothing."""
    detection = models.limited_range(0.95, 50.0)
    sensor = mobile_sensor("lmb", GridPlatform(100.0, 100.0, (0.0, 90.0, 180.0, 270.0)), detection=detection)
    belief = LMB.from_bernoullis([(0, 0)], [0.9], [[100.0, 200.0, 0.0, 0.0]], [np.diag([25.0, 25.0, 1.0, 1.0])])
    settings = replace(KNOWN, horizon_steps=1, horizon_period=1.0)
    given = Situation((sensor,), Clmb((1.0,)), settings, (belief,), belief, np.zeros((1, 3)))
    reward = CauchySchwarzReward("reference")
    myopic = decide(JointPlanner(given.sensors, given.fusion, settings, reward), given)
    assert np.ptp(myopic.tables[0].mean) < 1e-12
    plan = decide(planner(given, reward, depth=3, search=search, budget=100), given)
    assert plan.sequence[0].sum(axis=0).tolist() == [100.0, 200.0]
    assert plan.expected_rewards[0][0] > 0.1


def test_many_sensors_each_have_their_share_of_the_budget() -> None:
    given = lmbs(num_sensors=3)
    plan = decide(planner(given, depth=3, budget=100), given)
    assert plan.curve is not None
    assert plan.curve.evaluations[-1] <= 100
    assert [rows.shape for rows in plan.sequence] == [(3, 1)] * 3


def test_sensors_may_have_other_platforms() -> None:
    given = lmbs()
    moving = MobileSensor(given.sensors[1].filter, GridPlatform(60.0, 30.0, (0.0, 90.0)))
    turning = MobileSensor(given.sensors[0].filter, HeadingPlatform((10.0, 30.0), (-45.0, 45.0), relative=True))
    mixed = replace(given, sensors=(turning, moving))
    plan = decide(planner(mixed, depth=3, budget=80), mixed)
    assert [rows.shape for rows in plan.sequence] == [(3, 2), (3, 2)]
    for rows, own, index in zip(plan.sequence, plan.actions, plan.chosen, strict=True):
        np.testing.assert_array_equal(rows[0], own.values[index])


def test_glmbs_are_planned_on_as_lmbs_and_the_plan_says_so() -> None:
    given = situation("marginal", settings=KNOWN)
    plan = decide(planner(given, depth=2, notes=("fused otherwise",)), given)
    assert plan.notes == (
        "fused otherwise",
        "planned on the LMBs of the GLMB beliefs: so are all sequences of decisions",
        "depth 2 does not pay: the actions are those of the best single decision",
    )


def test_combined_beams_find_what_no_sensor_finds_alone() -> None:
    """Of all joint sequences none is better than by combining whole beams."""
    given = lmbs()
    best = decide(planner(given, depth=2, budget=81), given).expected_rewards[0][0]
    found = decide(planner(given, depth=2, budget=80, search=BeamSearch(9)), given).expected_rewards[0][0]
    assert found == pytest.approx(best, rel=1e-12)


def test_a_period_of_no_whole_number_of_steps_is_refused() -> None:
    with pytest.raises(InputError, match=r"period: expected a whole multiple of the horizon_period, 4; got 6.0"):
        planner(lmbs(), period=6.0)


def test_what_is_no_sum_over_labels_is_refused() -> None:
    given = lmbs()
    with pytest.raises(InputError, match=r"reward, fusion: expected .* sums over labels"):
        decide(planner(given, reward=lambda predicted, updated: 1.0), given)
    with pytest.raises(InputError, match="left its evidence behind"):
        decide(planner(given, depth=2), given).explain()
    full = replace(given, settings=SETTINGS)
    with pytest.raises(InputError, match="association: expected known"):
        decide(planner(full), full)


def test_all_joint_sequences_are_counted() -> None:
    given = lmbs()
    plan = decide(planner(given, depth=2), given)
    assert plan.curve is not None
    assert plan.curve.evaluations.tolist() == [len(list(itertools.product(range(9), range(9))))]


@pytest.mark.parametrize("search", SEARCHES, ids=repr)
@pytest.mark.parametrize("discount", [None, 0.25, 1.0])
def test_the_best_single_decision_stays_inside_the_search(search: Any, discount: float | None) -> None:
    given, reward = lmbs(num_sensors=3), ExpectedLossReward()
    single = decided(given, JointPlanner, reward)
    for budget in (1, 20, 300):
        plan = decide(planner(given, reward, depth=3, search=search, budget=budget, discount=discount), given)
        kept = float(plan.tables[0].mean[single.chosen])
        assert np.isfinite(kept)
        assert plan.expected_rewards[0][0] >= kept
        told = "depth 3 does not pay: the actions are those of the best single decision" in plan.notes
        assert told == (plan.chosen == single.chosen)


def test_beams_find_the_best_of_all_from_there() -> None:
    """Of 28,561 joint sequences the best, within a budget of 2000."""
    sensor = mobile_sensor("lmb", HeadingPlatform(30.0, tuple(range(-180, 181, 30))))
    budgets: tuple[dict[str, Any], ...] = ({"budget": 28_561}, {})
    found = []
    for seed in range(6):
        given = replace(situation("lmb", 2, seed, KNOWN), sensors=(sensor,) * 2)
        best, short = (
            decide(HorizonPlanner(given.sensors, given.fusion, given.settings, ExpectedLossReward(), 2, **more), given)
            for more in budgets
        )
        assert short.curve is not None
        assert short.curve.evaluations[-1] <= 2000
        assert short.expected_rewards[0][0] == pytest.approx(best.expected_rewards[0][0], rel=1e-9)
        found.append(short.chosen == best.chosen)
    assert all(found)


def test_decisions_after_the_end_are_not_planned_for() -> None:
    """The state is of 1 s, decisions are 8 s apart."""
    given = lmbs()
    for end, left in ((None, 3), (100.0, 3), (25.0, 3), (24.9, 3), (17.0, 2), (9.0, 1), (1.0, 1), (-5.0, 1)):
        ended = replace(given, settings=replace(given.settings, end=end))
        plan = decide(planner(ended, depth=3), ended)
        assert [len(rows) for rows in plan.sequence] == [left] * 2
        np.testing.assert_array_equal(plan.tables[0].mean, decide(planner(given, depth=left), given).tables[0].mean)
        told = f"depth {left} in place of 3: no more decisions come before the end"
        assert (told in plan.notes) == (left < 3)
    timeless = replace(ended.state, time=None)
    plan = planner(ended, depth=2).plan(timeless, ended.poses, rng=np.random.default_rng(1))
    assert len(plan.sequence[0]) == 2


def test_depth_does_not_harm_where_a_single_decision_is_best() -> None:
    """On paper-a, whose sensors see all, whatever is decided now can be mended later."""
    fields = {"filter": {"kind": "lmb"}, "fusion": {"kind": "clmb"}, "control.reward": {"kind": "expected_loss"}}
    scenario = replace_fields(load_scenario("paper-a"), fields)
    experiment, score = build_experiment(scenario), partial(ospa_of_run, cutoff=100.0, order=1.0)
    ahead, single = (build_planner(scenario, name, 1) for name in ("lookahead", "jdm"))
    assert isinstance(ahead, HorizonPlanner)
    assert (ahead.depth, ahead.settings.end) == (3, 40.0)
    more = []
    for run in range(5):
        records = [simulate(experiment, own, seed=0, run=run, score=score) for own in (ahead, single)]
        depths = [len(decision.plan.sequence[0]) for decision in records[0].decisions]
        assert depths == [3, 2, 1]
        mine, its = (record.ospa[10:, 0].mean() for record in records)
        more.append(mine - its)
    assert np.mean(more) < 0.1
