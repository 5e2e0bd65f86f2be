"""Searches of the joint actions: the exhaustive one is the oracle of the others."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from control.examples import SETTINGS, Situation, decided, situation
from vedette.control import (
    AutomaticSearch,
    CauchySchwarzReward,
    CoordinateAscent,
    CrossEntropy,
    ExhaustiveSearch,
    ExpectedLossReward,
    IndependentPlanner,
    JointPlanner,
    JointProblem,
    JointSearch,
    Plan,
    evidence,
)
from vedette.control.search.problem import all_joint_actions, first_best
from vedette.errors import InputError
from vedette.platforms import HeadingPlatform


@dataclass
class Table:
    """A problem of known rewards that keeps what it was asked for."""

    rewards: Any
    asked: list[tuple[int, ...]] = field(default_factory=list)

    def problem(self, independent: tuple[int, ...] | None = None) -> JointProblem:
        start = independent or (0,) * self.rewards.ndim
        return JointProblem(self.rewards.shape, self.evaluate, lambda: start)

    def evaluate(self, actions: Any) -> Any:
        self.asked.extend(tuple(row) for row in actions.tolist())
        return self.rewards[tuple(actions.T)]


def rng() -> np.random.Generator:
    return np.random.default_rng(7)


SHAPES = st.lists(st.integers(1, 5), min_size=1, max_size=4).map(tuple)


@given(SHAPES, st.integers(0, 2**32 - 1))
def test_the_exhaustive_search_finds_the_first_of_the_best(shape: tuple[int, ...], seed: int) -> None:
    table = Table(np.random.default_rng(seed).integers(0, 4, shape).astype(float))
    found = ExhaustiveSearch().search(table.problem(), rng=rng())
    assert found == min(index for index in np.ndindex(*shape) if table.rewards[index] == table.rewards.max())
    assert sorted(table.asked) == list(np.ndindex(*shape))


@given(SHAPES, st.integers(0, 2**32 - 1), st.integers(0, 3), st.booleans())
def test_coordinate_ascent_ends_where_no_sensor_alone_does_better(
    shape: tuple[int, ...], seed: int, num_restarts: int, coarse: bool
) -> None:
    draw = np.random.default_rng(seed)
    table = Table(draw.integers(0, 3, shape).astype(float) if coarse else draw.random(shape))
    start = tuple(int(action) for action in draw.integers(shape))
    found = CoordinateAscent(num_restarts).search(table.problem(start), rng=draw)
    value = table.rewards[found]
    assert table.rewards[start] <= value <= table.rewards.max()
    assert len(set(table.asked)) == len(table.asked)
    assert found in table.asked
    for axis, size in enumerate(shape):
        for action in range(size):
            assert table.rewards[(*found[:axis], action, *found[axis + 1 :])] <= value
    assert value == max(table.rewards[joint] for joint in table.asked)


@given(SHAPES, st.integers(0, 2**32 - 1))
def test_coordinate_ascent_is_exact_where_sensors_do_not_interact(shape: tuple[int, ...], seed: int) -> None:
    draw = np.random.default_rng(seed)
    own = [draw.random(size) for size in shape]
    table = Table(sum(np.ix_(*own), start=np.zeros(shape)))
    found = CoordinateAscent(0).search(table.problem(), rng=draw)
    assert found == tuple(int(values.argmax()) for values in own)
    assert len(table.asked) <= 1 + 2 * sum(shape)


def test_restarts_leave_a_local_maximum() -> None:
    rewards = np.zeros((6, 6))
    rewards[0, 0], rewards[4, 5] = 1.0, 2.0
    problem = Table(rewards).problem()
    assert CoordinateAscent(0).search(problem, rng=rng()) == (0, 0)
    assert CoordinateAscent(40).search(problem, rng=rng()) == (4, 5)


def test_automatic_search_goes_on_while_the_bound_is_loose() -> None:
    """Pairs of four sensors interact: two restarts often end beside the best joint action."""
    found = {None: 0, "loose": 0, "tight": 0}
    for seed in range(40):
        draw = np.random.default_rng(seed)
        rewards = np.zeros((7,) * 4)
        for pair in itertools.combinations(range(4), 2):
            rewards += np.expand_dims(draw.random((7, 7)), tuple({0, 1, 2, 3} - set(pair)))
        for kind in found:
            table = Table(rewards)
            problem, least = table.problem(), CoordinateAscent(2)
            if kind == "loose":
                problem = problem._replace(bound=lambda: 6.0)
            elif kind == "tight":
                first = rewards[least.search(Table(rewards).problem(), rng=rng())]
                problem = problem._replace(bound=lambda: 1.005 * first)  # noqa: B023
            best = AutomaticSearch().search(problem, rng=rng())
            if kind != "loose":
                other = Table(rewards)
                assert best == least.search(other.problem(), rng=rng())
                assert table.asked == other.asked
            found[kind] += int(rewards[best] == rewards.max())
    assert found[None] == found["tight"] < 26
    assert found["loose"] >= 38


@pytest.mark.parametrize(
    ("search", "once"),
    [
        (CoordinateAscent(40), CoordinateAscent(0)),
        (AutomaticSearch(), CoordinateAscent(0)),
        (CrossEntropy(20), CrossEntropy(20, max_rounds=1)),
    ],
)
def test_a_search_that_is_late_ends_with_the_best_so_far(search: JointSearch, once: JointSearch) -> None:
    """One ascent, or round, is always made; in time, nothing is as if there were no limit."""
    rewards = np.random.default_rng(3).random((6,) * 4)
    late, least, free, timely = (Table(rewards) for _ in range(4))
    found = search.search(late.problem()._replace(late=lambda: True, bound=lambda: 9.0), rng=rng())
    assert found == once.search(least.problem(), rng=rng())
    assert late.asked == least.asked
    unlimited = search.search(free.problem()._replace(bound=lambda: 9.0), rng=rng())
    assert unlimited == search.search(timely.problem()._replace(late=lambda: False, bound=lambda: 9.0), rng=rng())
    assert free.asked == timely.asked
    assert len(free.asked) > len(late.asked)
    assert rewards[unlimited] >= rewards[found] == max(rewards[one] for one in late.asked)


def test_a_plan_says_that_its_search_ran_out_of_time() -> None:
    example = situation("lmb", 3, platform=COURSES)
    plans = [
        joint_plan(replace(example, settings=replace(example.settings, max_seconds=seconds)), CoordinateAscent(9))
        for seconds in (None, 1e6, 1e-9)
    ]
    words = "the search ended with the best that it had found, as 1e-09 s were over"
    assert [words in plan.notes for plan in plans] == [False, False, True]
    assert plans[0].chosen == plans[1].chosen
    np.testing.assert_array_equal(plans[0].tables[0].mean, plans[1].tables[0].mean)
    assert np.isfinite(plans[2].tables[0].mean).sum() < np.isfinite(plans[0].tables[0].mean).sum()


def test_many_sensors_do_with_two_restarts() -> None:
    """Of 500 courses in all, more ascents would take too long."""
    own = np.random.default_rng(1).random((50, 10))
    asked: list[Any] = []

    def evaluate(rows: Any) -> Any:
        asked[-1] += len(rows)
        return own[np.arange(50), rows].sum(axis=1)

    for bound in (None, lambda: np.inf):
        asked.append(0)
        problem = JointProblem((10,) * 50, evaluate, lambda: (0,) * 50, bound=bound)
        AutomaticSearch().search(problem, rng=rng())
    assert asked[0] == asked[1] > 0


@pytest.mark.parametrize("reward", [CauchySchwarzReward(), ExpectedLossReward()], ids=lambda own: type(own).__name__)
def test_no_joint_action_is_beyond_the_bound_that_searches_are_given(reward: Any) -> None:
    seen: list[JointProblem] = []

    class Watched:
        def search(self, problem: JointProblem, *, rng: np.random.Generator) -> tuple[int, ...]:
            seen.append(problem)
            return ExhaustiveSearch().search(problem, rng=rng)

    for kind in ("lmb", "marginal"):
        given = situation(kind, 3, settings=replace(SETTINGS, association="known"))
        planner = JointPlanner(given.sensors, given.fusion, given.settings, reward, Watched())
        plan = planner.plan(*given.arguments, rng=rng())
        if seen[-1].bound is not None:
            assert seen[-1].bound() >= np.nanmax(plan.tables[0].mean) - 1e-12
    assert seen[0].bound is not None
    assert np.isfinite(seen[0].bound())
    assert (seen[1].bound is None) == isinstance(reward, CauchySchwarzReward)  # of GLMBs it is no sum over targets


def test_rounding_does_not_decide() -> None:
    assert first_best(np.array([1.0, 3.0, 3.0 + 1e-10, 2.0])) == 1
    assert first_best(np.array([1.0, 3.0, 3.0 + 1e-7, 2.0])) == 2
    assert first_best(np.array([1e6, 1e6 + 1e-4])) == 0
    assert first_best(np.array([-5.0])) == 0


def test_more_joint_actions_than_allowed() -> None:
    table = Table(np.zeros((3, 4)))
    assert ExhaustiveSearch(12).search(table.problem(), rng=rng()) == (0, 0)
    with pytest.raises(InputError, match=r"at most 11 for an exhaustive search; got 3 x 4 = 12; .*CoordinateAscent"):
        ExhaustiveSearch(11).search(table.problem(), rng=rng())
    many = JointProblem((12,) * 40, table.evaluate, lambda: (0,) * 40)
    with pytest.raises(InputError, match="12 x 12"):
        ExhaustiveSearch().search(many, rng=rng())


def joint_plan(example: Situation, search: JointSearch) -> Plan:
    planner = JointPlanner(example.sensors, example.fusion, example.settings, CauchySchwarzReward("reference"), search)
    plan = planner.plan(*example.arguments, rng=np.random.default_rng(5))
    plan.validate()
    return plan


COURSES = HeadingPlatform(30.0, (-180.0, -90.0, 0.0, 45.0, 90.0, 180.0))


@pytest.mark.parametrize("kind", ["delta", "marginal", "lmb"])
@pytest.mark.parametrize("seed", range(3))
def test_a_partial_search_has_the_rewards_of_the_exhaustive_one(kind: str, seed: int) -> None:
    example = situation(kind, 3, seed, platform=COURSES)
    full, partial = joint_plan(example, ExhaustiveSearch()), joint_plan(example, CoordinateAscent(0))
    (table,), (some,) = full.tables, partial.tables
    evaluated = np.isfinite(some.mean)
    np.testing.assert_array_equal(some.mean[evaluated], table.mean[evaluated])
    np.testing.assert_array_equal(some.standard_error[evaluated], table.standard_error[evaluated])
    assert table.mean[partial.chosen] == some.mean[evaluated].max()
    alone = decided(example, IndependentPlanner, CauchySchwarzReward("reference"), seed=5)
    assert table.mean[alone.chosen] <= table.mean[partial.chosen] <= table.mean[full.chosen]
    # -180 and 180 degrees are one direction, counted once.
    num_evaluated = int(evaluated[1:, 1:, 1:].sum())
    assert partial.counts["fusions"] == num_evaluated * SETTINGS.num_samples
    assert partial.counts["divergences"] == (num_evaluated + 3 * 5) * SETTINGS.num_samples
    assert num_evaluated < 5**3 == full.counts["fusions"] // SETTINGS.num_samples


def test_restarts_are_drawn_from_the_planners_generator() -> None:
    example = situation("lmb", 3, platform=COURSES)
    first, again = (joint_plan(example, CoordinateAscent(3)) for _ in range(2))
    np.testing.assert_array_equal(first.tables[0].mean, again.tables[0].mean)
    more = np.isfinite(first.tables[0].mean).sum()
    assert more > np.isfinite(joint_plan(example, CoordinateAscent(0)).tables[0].mean).sum()


def test_a_table_too_large_to_hold_is_kept_as_a_line_a_sensor(monkeypatch: pytest.MonkeyPatch) -> None:
    example = situation("marginal", 3, platform=COURSES)
    whole = joint_plan(example, CoordinateAscent(0))
    monkeypatch.setattr(evidence, "MAX_TABLE", 6**3 - 1)
    lines = joint_plan(example, CoordinateAscent(0))
    assert lines.chosen == whole.chosen
    assert [table.sensors for table in lines.tables] == [(0,), (1,), (2,)]
    for s, table in enumerate(lines.tables):
        through = tuple(slice(None) if axis == s else action for axis, action in enumerate(whole.chosen))
        np.testing.assert_array_equal(table.mean, whole.tables[0].mean[through])
        assert np.isfinite(table.mean).all()


def test_many_sensors() -> None:
    """Eight sensors of twelve directions have 4e8 joint actions."""
    four = situation("lmb", 2)
    example = Situation(
        sensors=four.sensors * 4,
        fusion=replace(four.fusion, weights=(0.125,) * 8),
        settings=four.settings,
        beliefs=four.beliefs * 4,
        fused=four.fused,
        poses=np.concatenate([four.poses + np.array([0.0, 40.0 * i, 0.0]) for i in range(4)]),
    )
    example = replace(
        example, sensors=tuple(replace(sensor, platform=HeadingPlatform(30.0)) for sensor in example.sensors)
    )
    with pytest.raises(InputError, match="CoordinateAscent"):
        joint_plan(example, ExhaustiveSearch())
    plan = joint_plan(example, CoordinateAscent(0))
    assert len(plan.tables) == 8
    assert max(float(table.mean.max()) for table in plan.tables) == plan.tables[0].mean[plan.chosen[0]]


class FirstOfTwo:
    """A search of the user's own: two joint actions at random, the better one."""

    def search(self, problem: JointProblem, *, rng: np.random.Generator) -> tuple[int, ...]:
        two = rng.integers(problem.shape, size=(2, len(problem.shape)))
        return tuple(int(action) for action in two[problem.evaluate(two).argmax()])


@dataclass
class Says:
    """A search that says what it was told to say, and evaluates what it was told to evaluate."""

    answer: Any
    rows: Any = None

    def search(self, problem: JointProblem, *, rng: np.random.Generator) -> Any:
        if self.rows is not None:
            problem.evaluate(self.rows)
        return self.answer


def test_a_search_of_the_users_own() -> None:
    plan = joint_plan(situation("marginal"), FirstOfTwo())
    assert 1 <= np.isfinite(plan.tables[0].mean).sum() <= 2


def test_a_choice_that_the_search_did_not_evaluate_is_evaluated() -> None:
    example = situation("marginal")
    full = joint_plan(example, ExhaustiveSearch()).tables[0].mean
    plan = joint_plan(example, Says(np.array([2, 1])))
    assert plan.chosen == (2, 1)
    expected = np.full((3, 3), np.nan)
    expected[2, 1] = full[2, 1]
    np.testing.assert_array_equal(plan.tables[0].mean, expected)


@pytest.mark.parametrize("answer", [(0,), (0, 3), (-1, 0), (0.0, 1.0), None, "no", ((0, 1),)])
def test_a_search_that_answers_with_no_joint_action(answer: Any) -> None:
    with pytest.raises(InputError, match=r"search: expected one action of each sensor, numbers below \(3, 3\)"):
        joint_plan(situation("marginal"), Says(answer))


@pytest.mark.parametrize("rows", [[[0, 3]], [[-1, 0]], [[0]], [0, 1], [[0.5, 0.0]]])
def test_a_search_that_asks_for_no_joint_action(rows: Any) -> None:
    with pytest.raises(InputError, match="joint actions: expected rows of whole numbers below"):
        joint_plan(situation("marginal"), Says((0, 0), np.array(rows)))


def test_blocks_of_an_exhaustive_search_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    example = situation("marginal", 3)
    whole = joint_plan(example, ExhaustiveSearch())
    monkeypatch.setattr(evidence, "_BLOCK", 5 * SETTINGS.num_samples)
    blocks = joint_plan(example, ExhaustiveSearch())
    np.testing.assert_array_equal(blocks.tables[0].mean, whole.tables[0].mean)
    assert blocks.counts == whole.counts


def test_all_joint_actions_have_the_last_sensor_fastest() -> None:
    shape = (2, 1, 3)
    expected = list(itertools.product(*map(range, shape)))
    actions = all_joint_actions(shape)
    assert actions.tolist() == [list(joint) for joint in expected]
    assert actions.flags.c_contiguous
    assert len(actions) == math.prod(shape)
