"""Joint decisions from belief to plan: what is planned on, what is said of it, what is allowed, what is looked for."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from control.examples import KNOWN, A, B, C, Situation, lmb, mobile_sensor, situation
from vedette import models
from vedette.control import (
    AutomaticSearch,
    CauchySchwarzReward,
    CoordinateAscent,
    ExhaustiveSearch,
    ExpectedLossReward,
    IndependentPlanner,
    JointPlanner,
    KullbackLeiblerReward,
    PlanningSettings,
    RandomPlanner,
    Separation,
    SequentialGreedy,
    StayInside,
)
from vedette.densities import LMB, UndetectedIntensity
from vedette.fusion import Clmb, ParallelUpdate
from vedette.platforms import HeadingPlatform
from vedette.tracking import State


def planner_of(
    example: Situation, reward: Any = None, settings: PlanningSettings = KNOWN, **parts: Any
) -> JointPlanner:
    """Joint decisions in a situation, by K that weighs number and places alike."""
    chosen = CauchySchwarzReward("reference") if reward is None else reward
    return JointPlanner(example.sensors, example.fusion, settings, chosen, **parts)


def crowd(num_sensors: int, seed: int = 2) -> Situation:
    """One belief of all sensors, which are scattered and take their scans in full."""
    rng = np.random.default_rng(seed)
    belief, sensors = lmb((A, B, C), rng), tuple(mobile_sensor("lmb") for _ in range(num_sensors))
    poses = np.column_stack([rng.uniform(-400.0, 400.0, (num_sensors, 2)), rng.uniform(-3.0, 3.0, num_sensors)])
    return Situation(sensors, ParallelUpdate(), KNOWN, (belief,) * num_sensors, belief, poses)


def test_a_plan_says_how_far_from_the_best_it_can_be() -> None:
    """All joint actions tried; or more of them than the search tries, within the bound by target."""
    example = crowd(3)
    best = planner_of(example, search=ExhaustiveSearch()).plan(*example.arguments, rng=np.random.default_rng(1))
    assert best.bound is not None
    assert best.bound.kind == "exhaustive"
    assert best.bound.gap == 0.0
    assert str(best.bound) == "the best of all joint actions"
    settings = replace(KNOWN, max_bound_work=10**6)
    plan = planner_of(example, settings=settings, search=CoordinateAscent(0)).plan(
        *example.arguments, rng=np.random.default_rng(1)
    )
    assert plan.bound is not None
    assert plan.bound.kind == "by target"
    assert plan.bound.unbounded == 0
    assert plan.bound.reward - 1e-9 <= best.bound.reward <= plan.bound.upper + 1e-9
    assert plan.curve is not None
    assert (np.diff(plan.curve.best) >= 0.0).all()
    few = planner_of(example, settings=replace(KNOWN, max_bound_work=0), search=CoordinateAscent(0))
    told = few.plan(*example.arguments, rng=np.random.default_rng(1)).bound
    assert told is not None
    assert told.unbounded > 0
    assert "no bound" in str(told)


def test_twenty_sensors_decide_alike_for_any_number_of_threads() -> None:
    """By an ascent, with a line of rewards a sensor; the default beyond three sensors."""
    example, plans = crowd(20), []
    for num_threads in (1, 2):
        settings = replace(KNOWN, num_threads=num_threads)
        planner = planner_of(example, ExpectedLossReward(60.0), settings)
        assert isinstance(planner.search, AutomaticSearch)
        plans.append(planner.plan(*example.arguments, rng=np.random.default_rng(1)))
        plans[-1].validate()
    assert plans[0].chosen == plans[1].chosen
    assert len(plans[0].tables) == 20
    for one, other in zip(plans[0].tables, plans[1].tables, strict=True):
        np.testing.assert_array_equal(one.mean, other.mean)
        assert one.mean[plans[0].chosen[one.sensors[0]]] == pytest.approx(one.mean.max(), rel=1e-9)


def test_greedy_has_half_of_the_best_where_nothing_is_lost_by_more_scans() -> None:
    """Kullback-Leibler from the baseline of no scan, three sensors."""
    example = crowd(3)
    best = planner_of(example, KullbackLeiblerReward()).plan(*example.arguments, rng=np.random.default_rng(1))
    greedy = planner_of(example, KullbackLeiblerReward(), search=SequentialGreedy()).plan(
        *example.arguments, rng=np.random.default_rng(1)
    )
    assert best.bound is not None
    assert greedy.bound is not None
    assert greedy.bound.reward >= 0.5 * best.bound.reward


def test_glmbs_of_many_sensors_are_planned_on_their_lmbs() -> None:
    """Beyond the caps, and the plan says so; within them their own filter is run."""
    example = situation("marginal", 3, settings=KNOWN)
    rng = np.random.default_rng
    own = planner_of(example).plan(*example.arguments, rng=rng(1))
    assert not any("LMB" in note for note in own.notes)
    few = planner_of(example, settings=replace(KNOWN, max_glmb_sensors=2)).plan(*example.arguments, rng=rng(1))
    assert "planned on the LMBs of the GLMB beliefs: 3 sensors, of at most 2" in few.notes
    crowded = planner_of(example, settings=replace(KNOWN, max_glmb_targets=0)).plan(*example.arguments, rng=rng(1))
    assert any("targets expected, of at most 0" in note for note in crowded.notes)
    loss = planner_of(example, ExpectedLossReward()).plan(*example.arguments, rng=rng(1))
    assert any("expected loss" in note for note in loss.notes)


def test_an_action_without_a_reward_is_left_out_and_told() -> None:
    """One bad case costs that case only."""

    @models.model_function("label_reward")
    def picky(existence, mean, cov, new_existence, new_mean, new_cov, params, out):
        gain = cov[0, 0] + cov[1, 1] - new_cov[0, 0] - new_cov[1, 1]
        out[0] = gain if gain < params[0] else np.nan

    class Picky:
        function = staticmethod(picky)
        num_terms = 1

        def __init__(self, most: float) -> None:
            self.params = np.array([most])

        def combine(self, sums: Any) -> Any:
            return sums[..., 0]

    belief, settings = lmb((A,), np.random.default_rng(2)), replace(KNOWN, num_samples=1)
    example = replace(crowd(2), beliefs=(belief,) * 2, fused=belief)
    free = planner_of(example, Picky(np.inf), settings).plan(*example.arguments, rng=np.random.default_rng(1))
    assert free.notes == ()
    most = float(free.tables[0].mean.max())
    plan = planner_of(example, Picky(most), settings).plan(*example.arguments, rng=np.random.default_rng(1))
    assert any(note.startswith("joint actions without a finite reward were left out") for note in plan.notes)
    np.testing.assert_array_equal(np.isnan(plan.tables[0].mean), free.tables[0].mean == most)
    assert plan.expected_rewards[0][0] < most


def test_sensors_keep_apart_and_inside() -> None:
    """Whatever decides: no two nearer than a distance, none beyond a border."""
    example = crowd(4)
    poses = np.array([[0.0, 0.0, 0.0], [30.0, 0.0, 0.0], [0.0, 40.0, 0.0], [300.0, 300.0, 0.0]])
    region = models.Region(-150.0, 420.0, -400.0, 420.0)
    constraints = (Separation(35.0), StayInside(region))
    planners: list[Any] = [
        planner_of(example, ExpectedLossReward(60.0), constraints=constraints),
        planner_of(example, search=ExhaustiveSearch(), constraints=constraints),
        RandomPlanner(example.sensors, KNOWN, constraints),
    ]
    for planner in planners:
        plan = planner.plan(example.state, poses, rng=np.random.default_rng(3))
        times = KNOWN.horizon_times()
        ways = np.stack(
            [
                sensor.platform.course(pose, action, times)
                for sensor, pose, action in zip(example.sensors, poses, plan.chosen_actions, strict=True)
            ]
        )
        assert (ways[:, :, 0] <= 420.0).all()
        assert (ways[:, :, 1] <= 420.0).all()
        gaps = np.linalg.norm(ways[:, None, :, :2] - ways[None, :, :, :2], axis=-1)
        assert (gaps[np.triu_indices(4, 1)] >= 35.0 - 1e-9).all()
    alone = IndependentPlanner(example.sensors, example.fusion, KNOWN, ExpectedLossReward(60.0), constraints[1:])
    assert alone.plan(example.state, poses, rng=np.random.default_rng(3)).chosen


def test_targets_not_found_yet_are_looked_for() -> None:
    """With nobody known, sensors go where somebody may be; the reward is the cutoff times the number that they find."""
    sensor = mobile_sensor(
        "lmb", HeadingPlatform(100.0, [0.0, 90.0, 180.0]), detection=models.limited_range(0.9, 100.0)
    )
    grid = models.CellGrid.covering(models.Region(-500.0, 500.0, -500.0, 500.0), 50.0)
    expected = np.where((grid.centres[:, 0] > 100.0) & (np.abs(grid.centres[:, 1]) < 100.0), 0.05, 0.0)
    empty = LMB.empty(4)
    state = State((empty,) * 2, empty, 1, 1.0, undetected=UndetectedIntensity(grid, expected))
    poses = np.array([[0.0, 0.0, 0.0], [200.0, -250.0, 0.0]])
    settings = replace(KNOWN, horizon_steps=1, horizon_period=2.0)
    planner = JointPlanner((sensor,) * 2, ParallelUpdate(), settings, ExpectedLossReward(100.0))
    plan = planner.plan(state, poses, rng=np.random.default_rng(1))
    assert [action[0] for action in plan.chosen_actions] == [0.0, 90.0]
    assert 0.0 < plan.expected_rewards[0][0] < 100.0 * expected.sum()
    twice, none = (
        replace(planner, settings=replace(settings, undetected_target_value=worth)).plan(
            state, poses, rng=np.random.default_rng(1)
        )
        for worth in (2.0, 0.0)
    )
    np.testing.assert_allclose(twice.tables[0].mean, 2.0 * plan.tables[0].mean, rtol=1e-12)
    assert not none.tables[0].mean.any()
    assert plan.bound is not None
    assert plan.bound.reward <= plan.bound.upper + 1e-12
    ascent = replace(planner, search=CoordinateAscent(1)).plan(state, poses, rng=np.random.default_rng(1))
    assert ascent.chosen == plan.chosen
    assert ascent.bound is not None
    assert plan.bound.reward <= ascent.bound.upper + 1e-12
    wanted = replace(planner, settings=replace(settings, undetected_target_value=1.0))
    nowhere = wanted.plan(replace(state, undetected=None), poses, rng=np.random.default_rng(1))
    assert any("not looked for" in note for note in nowhere.notes)


def test_plain_covariance_intersection_keeps_to_its_weights() -> None:
    """A sensor of weight 0 has no say in where the others go."""
    example = situation("lmb", 3, settings=KNOWN)
    weights = (0.5, 0.5, 0.0)
    fusion = Clmb(weights)
    joint = replace(example, fusion=fusion, fused=fusion.fuse(example.beliefs)[0])
    plan = planner_of(joint, search=ExhaustiveSearch()).plan(*joint.arguments, rng=np.random.default_rng(1))
    np.testing.assert_allclose(plan.tables[0].mean, plan.tables[0].mean[:, :, :1] * np.ones(3), rtol=1e-12)
