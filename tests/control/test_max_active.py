"""At most so many sensors scan: every planner, against all joint actions of which no more do."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pytest

from control.examples import KNOWN, Situation, additive_of, decided, situation, sums_of
from control.test_additive import shared, single
from control.test_switched import switchable
from vedette.control import (
    ConstraintReportingPlanner,
    CoordinateAscent,
    HorizonPlanner,
    IndependentPlanner,
    JointPlanner,
    MaxActive,
    RandomPlanner,
    Separation,
)
from vedette.control.baselines import ConstantPlanner
from vedette.control.constraints.active import Active
from vedette.control.constraints.mask import Mask, nearest_feasible, relaxed
from vedette.control.inputs import mask_of_decision, options_of
from vedette.control.rewards.power import CauchySchwarzReward, ExpectedLossReward
from vedette.control.rules_of_thumb import RulePlanner
from vedette.control.search.cross_entropy import CrossEntropy
from vedette.control.search.greedy import SequentialGreedy
from vedette.control.search.problem import ExhaustiveSearch, JointProblem, all_joint_actions
from vedette.platforms import Actions

LOSS = ExpectedLossReward(60.0)
SEARCHES: list[Any] = [
    ExhaustiveSearch(),
    CoordinateAscent(),
    SequentialGreedy(),
    SequentialGreedy("best_first"),
    CrossEntropy(num_samples=20),
]


def num_on(plan: Any) -> int:
    """Number of sensors that scan after the first decision."""
    return int(sum(row[-1] for row in plan.chosen_actions))


def active(num_sensors: int, num_courses: int, most: int) -> Active:
    """Courses that scan, and then the same without."""
    on = np.repeat([True, False], num_courses)
    return Active((on,) * num_sensors, (np.tile(np.arange(num_courses, 2 * num_courses), 2),) * num_sensors, most)


def mask_for(example: Situation, *constraints: Any) -> Mask:
    options = options_of(example.sensors, example.poses, example.settings)
    mask = mask_of_decision(constraints, example.sensors, options, example.state, example.poses, example.settings)
    assert mask is not None
    return mask


def test_a_sensor_does_not_take_its_own_place_among_those_that_may_scan() -> None:
    one = active(3, 3, 1)
    assert not one.is_full([0, -1, 5], 0)
    assert one.is_full([0, -1, 5], 1)
    assert not active(3, 3, 2).is_full([0, -1, 5], 1)


@pytest.mark.parametrize("most", [1, 2])
@pytest.mark.parametrize("reward", [CauchySchwarzReward("reference"), LOSS])
def test_exhaustive_search_finds_the_best_of_what_is_allowed_and_bounds_hold(most: int, reward: Any) -> None:
    example, joint = switchable(shared(3)), all_joint_actions((6, 6, 6))
    table = sums_of(additive_of(example, reward, seed=1, horizons=None))(joint).mean(axis=1)
    best = table[(joint < 3).sum(axis=1) <= most].max()
    plan = decided(example, reward=reward, search=ExhaustiveSearch(), constraints=(MaxActive(most),))
    assert plan.explain().reward == pytest.approx(best, rel=1e-9)
    assert num_on(plan) <= most
    for search in SEARCHES[1:]:
        other = decided(example, reward=reward, search=search, constraints=(MaxActive(most),))
        found = other.explain().reward
        assert found is not None
        assert found <= best + 1e-9 * abs(best)
        assert num_on(other) <= most
        assert other.bound is not None
        assert other.bound.upper >= best - 1e-9 * abs(best)


@pytest.mark.parametrize("kind", [JointPlanner, IndependentPlanner, partial(IndependentPlanner, others="absent")])
@pytest.mark.parametrize("of", ["lmb", "delta"])
def test_case_by_case_no_more_scan_either(kind: Any, of: str) -> None:
    plan = decided(switchable(situation(of)), kind, constraints=(MaxActive(1),))
    assert num_on(plan) <= 1


def test_all_planners_keep_to_it_beside_other_constraints() -> None:
    example, both = switchable(shared(3)), (MaxActive(1), Separation(5.0))
    state, poses = example.arguments
    planners = [
        RulePlanner(example.sensors, rule, example.settings, both)
        for rule in ("nearest", "assigned_target", "centroid")
    ]
    for planner in planners:
        assert num_on(planner.plan(state, poses, rng=np.random.default_rng(0))) == 1
    on = np.zeros(3)
    for seed in range(60):
        plan = RandomPlanner(example.sensors, example.settings, both).plan(
            state, poses, rng=np.random.default_rng(seed)
        )
        assert num_on(plan) <= 1
        on += [row[-1] for row in plan.chosen_actions]
    assert on.min() >= 8  # of 52 or so; the draws spare no sensor


def test_independent_decisions_keep_the_sensors_that_gain_most() -> None:
    example = switchable(shared(3))
    alone = decided(example, IndependentPlanner, LOSS)
    gains = [float(table.mean.max() - table.mean.min()) for table in alone.tables]
    plan = decided(example, IndependentPlanner, LOSS, constraints=(MaxActive(1),))
    assert [row[-1] for row in plan.chosen_actions].index(1.0) == int(np.argmax(gains))


@pytest.mark.parametrize("budget", [40, 5000])
def test_sequences_keep_to_it_at_every_decision(budget: int) -> None:
    example = switchable(single(situation("lmb", 3, 6, KNOWN)))
    ahead = partial(HorizonPlanner, depth=2, budget=budget)
    plan = decided(example, ahead, LOSS, constraints=(MaxActive(1),))
    assert num_on(plan) <= 1
    free = decided(example, ahead, LOSS)
    assert num_on(free) > 1
    if plan.sequence:
        assert max(sum(rows[k][-1] for rows in plan.sequence) for k in range(2)) <= 1


@pytest.mark.parametrize("seed", range(20))
def test_exchanges_find_the_sensors_of_largest_gains(seed: int) -> None:
    """Where gains add up, the best is the `most` largest; ascents of one sensor alone stay with whom they start."""
    rng = np.random.default_rng(seed)
    num, most = int(rng.integers(4, 9)), int(rng.integers(1, 4))
    gains = np.concatenate([rng.uniform(0.0, 1.0, (num, 3)), rng.uniform(-0.1, 0.0, (num, 3))], axis=1)
    mask = Mask((np.ones(6, bool),) * num, active=active(num, 3, most))

    def evaluate(actions: Any) -> Any:
        return gains[np.arange(num), actions].sum(axis=1)

    problem = JointProblem((6,) * num, evaluate, lambda: (0,) * num, mask)
    found = CoordinateAscent(num_restarts=0).search(problem, rng=rng)
    assert sum(course < 3 for course in found) <= most
    best, off = gains[:, :3].max(axis=1), gains[:, 3:].max(axis=1)
    wanted = off.sum() + np.sort(best - off)[-most:].sum()
    assert evaluate(np.array([found]))[0] == pytest.approx(wanted)


@pytest.mark.parametrize("seed", range(10))
def test_what_is_repaired_is_allowed_and_keeps_its_courses(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mask = Mask((np.ones(6, bool),) * 5, active=active(5, 3, 2))
    for start in rng.integers(6, size=(50, 5)).tolist():
        found = nearest_feasible(mask, start)
        assert mask.allows(np.array([found]))[0]
        assert [course % 3 for course in found] == [course % 3 for course in start]
        assert sum(course < 3 for course in found) == min(2, sum(course < 3 for course in start))


def test_sensors_that_cannot_be_switched_off_stay_on_and_too_many_are_named() -> None:
    plain, example = shared(3), switchable(shared(3))
    mixed = Situation((plain.sensors[0], *example.sensors[1:]), *vars_of(example))
    mask = mask_for(mixed, MaxActive(1))
    assert mask.active is not None
    assert [own.tolist() for own in mask.active.off] == [[0, 1, 2], [3, 4, 5] * 2, [3, 4, 5] * 2]
    assert nearest_feasible(mask, (0, 0, 0)) == (0, 3, 3)
    assert mask.active.within_limit((0, 0, 0), gains=(0.0, 5.0, 9.0)) == (0, 3, 3)
    never = mask_for(plain, MaxActive(2))
    assert never.active is None
    assert "no more than 2 sensors were to scan, and too few can be switched off" in never.notes[0]
    assert relaxed(never)[0].allows(np.array([[0, 0, 0]]))[0]


def test_of_several_limits_the_least_counts() -> None:
    limits = [MaxActive(3), MaxActive(1), MaxActive(2)]
    mask = mask_for(switchable(shared(3)), *limits)
    assert mask.active is not None
    assert mask.active.limit == 1


def vars_of(example: Situation) -> tuple[Any, ...]:
    return example.fusion, example.settings, example.beliefs, example.fused, example.poses


def test_a_planner_that_keeps_to_no_constraints_is_watched() -> None:
    example = switchable(shared(3))
    fixed = ConstantPlanner((Actions.of(heading_deg=0.0, on=1.0),) * 3)
    watched = ConstraintReportingPlanner(fixed, example.sensors, example.settings, (MaxActive(2),))
    plan = watched.plan(*example.arguments, rng=np.random.default_rng(0))
    assert plan.notes == ("3 sensors scan; expected at most 2",)
