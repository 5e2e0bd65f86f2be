"""Sensors that may be off: against sensors that do not scan within the horizon, and by enumeration."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

from control.examples import (
    KNOWN,
    NEVER,
    Situation,
    additive_of,
    decided,
    evaluator_of,
    sample_rewards,
    scanning,
    situation,
    sums_of,
)
from control.test_additive import shared, single
from vedette.control import CoordinateAscent, HorizonPlanner, IndependentPlanner, JointPlanner
from vedette.control.inputs import options_of
from vedette.control.rewards.labels import PeecsReward
from vedette.control.rewards.power import CauchySchwarzReward, ExpectedLossReward
from vedette.control.search.greedy import SequentialGreedy
from vedette.control.search.problem import all_joint_actions
from vedette.errors import InputError
from vedette.platforms import Actions, GridPlatform, HeadingPlatform, MountedPlatform, Operated, Pointing, Sequences
from vedette.platforms.base import options_at

REWARDS: list[Any] = [CauchySchwarzReward("reference"), PeecsReward(0.3, 80.0), ExpectedLossReward(60.0)]
POSE, TIMES = np.array([10.0, -5.0, 0.3]), np.array([0.0, 1.0, 2.0, 3.0])
SWITCHED = Operated(HeadingPlatform(30.0, (-90.0, 0.0)), 0.5, switchable=True)


def switchable(example: Situation, price: Any = 0.0) -> Situation:
    """All sensors may be off; where they are on they pay a price."""
    own = (replace(each, platform=Operated(each.platform, price, switchable=True)) for each in example.sensors)
    return replace(example, sensors=tuple(own))


def test_actions_are_listed_on_and_then_off_at_no_price() -> None:
    found = options_at("platform", SWITCHED, POSE, TIMES)
    assert found.actions.columns == ("heading_deg", "on")
    assert found.actions.values.tolist() == [[-90.0, 1.0], [0.0, 1.0], [-90.0, 0.0], [0.0, 0.0]]
    assert found.which.tolist() == [0, 1, 2, 3]
    assert found.prices.tolist() == [0.5, 0.5, 0.0, 0.0]
    assert found.scans.tolist() == [[True] * 4] * 2 + [[False] * 4] * 2
    np.testing.assert_array_equal(found.courses[:2], found.courses[2:])
    assert [found.actions.text(each) for each in (0, 3)] == ["heading_deg -90, on", "heading_deg 0, off"]


def test_parts_of_platforms_are_off_and_have_their_prices() -> None:
    later = Sequences(SWITCHED, 2.0, 2)
    row = np.array([[0.0, 0.0, -90.0, 1.0], [0.0, 1.0, 0.0, 1.0]])
    assert later.columns == ("heading_deg_1", "on_1", "heading_deg_2", "on_2")
    words = Actions(later.columns, row).text(0)
    assert words == "heading_deg_1 0, off at decision 1, heading_deg_2 -90, on at decision 2"
    assert Actions.of(on_time=0.0).text(0) == "on_time 0"
    assert later.scans(POSE, row, TIMES).tolist() == [[False, False, False, True], [True] * 4]
    assert later.prices(row).tolist() == [0.5, 1.0]
    carried = MountedPlatform(
        Operated(GridPlatform(10.0, 5.0), 2.0), Operated(Pointing([-45.0, 45.0]), 0.25, switchable=True)
    )
    pose = np.array([0.0, 0.0, 0.0, 0.0, 0.5])
    options = options_at("platform", carried, pose, TIMES)
    is_on = options.actions.values[:, -1] == 1.0
    np.testing.assert_array_equal(options.scans[options.which], np.tile(is_on[:, np.newaxis], 4))
    np.testing.assert_array_equal(options.prices[options.which], np.where(is_on, 2.25, 2.0))


@pytest.mark.parametrize("reward", REWARDS)
@pytest.mark.parametrize("kind", ["lmb", "shared"])
def test_off_is_a_sensor_that_does_not_scan_for_sums(kind: str, reward: Any) -> None:
    """The first sensor off, the second on; then both off."""
    plain = shared(2) if kind == "shared" else situation("lmb", settings=KNOWN)
    both, joint = switchable(plain), all_joint_actions((3, 3))
    additive = sums_of(additive_of(both, reward))
    for times, off in [((NEVER, None), [3, 0]), ((NEVER, NEVER), [3, 3])]:
        absent = sums_of(additive_of(scanning(plain, *times), reward))
        np.testing.assert_allclose(additive(joint + off), absent(joint), rtol=1e-10, atol=1e-12)
    on = sums_of(additive_of(plain, reward))
    np.testing.assert_allclose(additive(joint), on(joint), rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("kind", ["lmb", "delta", "marginal"])
def test_off_is_a_sensor_that_does_not_scan_case_by_case(kind: str) -> None:
    plain = situation(kind)
    both = switchable(plain)
    found = sample_rewards(evaluator_of(both), (0, 1), both.fusion).reshape(6, 6, -1)
    for times, first, second in [((NEVER, None), 3, 0), ((None, NEVER), 0, 3), ((None, None), 0, 0)]:
        absent = scanning(plain, *times)
        wanted = sample_rewards(evaluator_of(absent), (0, 1), plain.fusion).reshape(3, 3, -1)
        np.testing.assert_allclose(found[first : first + 3, second : second + 3], wanted, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("reward", [REWARDS[0], REWARDS[2]])
def test_searches_find_and_bounds_hold_the_best_of_all(seed: int, reward: Any) -> None:
    """Against enumeration of all joint actions, at a price for which some sensors are better off."""
    free = shared(3, seed)
    joint, settings = all_joint_actions((6, 6, 6)), replace(KNOWN, num_samples=5)
    gains = sums_of(additive_of(replace(free, settings=settings), reward)).each_alone().mean(axis=1)
    example = replace(switchable(free, float(np.ptp(gains))), settings=settings)
    table = sums_of(additive_of(example, reward, seed=1, horizons=None))(joint).mean(axis=1)
    assert decided(example, reward=reward).explain().reward == pytest.approx(table.max(), rel=1e-9)
    for search in (CoordinateAscent(), SequentialGreedy()):
        plan = decided(example, reward=reward, search=search)
        found = plan.explain().reward
        assert found is not None
        assert plan.bound is not None
        assert found <= table.max() + 1e-9 * abs(table.max())
        assert plan.bound.upper >= table.max() - 1e-9 * abs(table.max())


@pytest.mark.parametrize("kind", [JointPlanner, IndependentPlanner, partial(HorizonPlanner, depth=2)])
def test_who_pays_too_much_is_off_and_who_pays_nothing_is_on(kind: Any) -> None:
    example = single(situation("lmb", 2, 6, KNOWN))
    dear, free = decided(switchable(example, 1e6), kind), decided(switchable(example), kind)
    assert [row[-1] for row in dear.chosen_actions] == [0.0, 0.0]
    assert [row[-1] for row in free.chosen_actions] == [1.0, 1.0]


@pytest.mark.parametrize("reward", [REWARDS[0], REWARDS[2]])
def test_looking_ahead_is_worth_what_sequences_are_as_joint_actions(reward: Any) -> None:
    """The best second action, on or off, after each first one; the second time off or on again."""
    example = switchable(shared(2, platform=HeadingPlatform(30.0, (-90.0, 45.0))), 0.05)
    ahead = decided(example, partial(HorizonPlanner, depth=2, discount=None, budget=10_000), reward)
    sensors = tuple(replace(own, platform=Sequences(own.platform, 8.0, 2)) for own in example.sensors)
    longer = replace(example, sensors=sensors, settings=replace(KNOWN, horizon_steps=4))
    joint = all_joint_actions((16, 16))
    mean = sums_of(additive_of(longer, reward, seed=1))(joint).mean(axis=1).reshape((4,) * 4)
    np.testing.assert_allclose(ahead.tables[0].mean, mean.max(axis=(1, 3)), rtol=1e-11)
    assert ahead.bound is not None
    assert ahead.bound.upper == pytest.approx(mean.max(), rel=1e-11)


def test_a_sensor_that_is_off_goes_where_it_will_scan() -> None:
    """Both are off; beyond the horizon they scan again, so that not all directions are worth the same."""
    example = switchable(shared(2), 1e6)
    plan, still = decided(example, reward=REWARDS[2]), decided(example, reward=REWARDS[0])
    assert [row[-1] for row in plan.chosen_actions] == [0.0, 0.0]
    assert np.ptp(plan.tables[0].mean[3:, 3:]) > 1e-3
    assert np.ptp(still.tables[0].mean[3:, 3:]) == 0.0


def test_an_explanation_says_who_is_off() -> None:
    why = decided(switchable(shared(2), 1e6)).explain()
    assert [text.rsplit(", ", 1)[1] for text in why.chosen] == ["off", "off"]
    assert why.price == 0.0
    assert sum("off" in line for line in str(why).splitlines()) >= 2


class Blind:
    """A platform whose sensor scans as it is told."""

    columns = ("dx",)

    def __init__(self, scans: Any) -> None:
        self._scans = scans

    def actions(self, pose: Any) -> Any:
        """Two."""
        return np.array([[0.0], [1.0]])

    def course(self, pose: Any, action: Any, times: Any) -> Any:
        """Where it is."""
        return np.tile(pose, (len(times), 1))

    def scans(self, pose: Any, actions: Any, times: Any) -> Any:
        """As it is told."""
        return self._scans


def test_courses_may_scan_at_some_times_only() -> None:
    """One of the same poses that scans at the first pseudo-update alone is that of such scan times."""
    plain = shared(2)
    halves = np.array([[True, False], [False, True]])
    own = tuple(replace(each, platform=Blind(halves)) for each in plain.sensors)
    found = sums_of(additive_of(replace(plain, sensors=own)))(all_joint_actions((2, 2)))
    assert options_of(own, plain.poses, plain.settings)[0].which.tolist() == [0, 1]
    still = tuple(replace(each, platform=Blind(np.ones((2, 2), bool))) for each in plain.sensors)
    times: list[Any] = [[3.0], [7.0]]
    for row, (one, other) in enumerate(all_joint_actions((2, 2)).tolist()):
        apart = scanning(replace(plain, sensors=still), times[one], times[other])
        np.testing.assert_allclose(found[row], sums_of(additive_of(apart))(np.zeros((1, 2), np.int64))[0], rtol=1e-10)


@pytest.mark.parametrize(
    ("scans", "message"),
    [
        (np.ones((2, 3), bool), r"platform.scans: expected booleans of shape \(2, 4\); got shape \(2, 3\)"),
        (np.ones((2, 4)), "platform.scans: expected .*booleans"),
    ],
)
def test_scans_that_are_none_are_refused(scans: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        options_at("platform", Blind(scans), POSE, TIMES)


def test_a_switch_beside_a_column_of_that_name_is_refused() -> None:
    with pytest.raises(InputError, match="switchable: expected False, as the platform has a column on of its own"):
        Operated(SWITCHED, switchable=True)
    assert Actions.of(on=0.0).text(0) == "off"
