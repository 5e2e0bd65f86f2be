"""Prices of actions: against rewards without them, by enumeration, whichever planner subtracts them."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

from control.examples import KNOWN, Situation, additive_of, decided, evaluator_of, situation, sums_of
from control.test_additive import shared, single
from vedette.control import CoordinateAscent, HorizonPlanner, IndependentPlanner, JointPlanner
from vedette.control.inputs import options_of
from vedette.control.rewards.labels import PeecsReward
from vedette.control.rewards.power import CauchySchwarzReward, ExpectedLossReward
from vedette.control.search.greedy import SequentialGreedy
from vedette.control.search.problem import all_joint_actions
from vedette.errors import InputError
from vedette.kernels.planning.ascent import Allowed
from vedette.platforms import HeadingPlatform, Operated, Stationary
from vedette.platforms.base import options_at

SHAPE = (6, 6, 6)
JOINT = all_joint_actions(SHAPE)
REWARDS: list[Any] = [CauchySchwarzReward("reference"), PeecsReward(0.3, 80.0), ExpectedLossReward(60.0)]


def unpriced(seed: int = 0) -> Situation:
    """Three sensors that go in one of three directions at one of two speeds."""
    return shared(3, seed, platform=HeadingPlatform((20.0, 30.0), (-90.0, 0.0, 45.0)))


def priced(example: Situation, scale: float = 0.02) -> Situation:
    """The same, where the first sensor pays the same for all actions, and the others by their speed."""
    prices: list[Any] = [scale, "speed", "speed"]
    sensors = tuple(
        replace(own, platform=Operated(own.platform, price)) for own, price in zip(example.sensors, prices, strict=True)
    )
    return replace(example, sensors=sensors)


def cost(joint: Any) -> Any:
    """(num_joint,) of joint actions (num_joint, 3) of `priced`: the second speed of each direction is the faster."""
    speeds = np.array([20.0, 30.0])
    return 0.02 + speeds[joint[:, 1] % 2] + speeds[joint[:, 2] % 2]


@pytest.mark.parametrize("reward", REWARDS)
@pytest.mark.parametrize("seed", range(3))
def test_prices_are_subtracted_from_every_reward(reward: Any, seed: int) -> None:
    """Of joint actions, along lines, of sensors alone, and in compiled ascents."""
    free, paid = unpriced(seed), priced(unpriced(seed))
    additive, before = sums_of(additive_of(paid, reward)), sums_of(additive_of(free, reward))
    table, price = additive(JOINT), cost(JOINT)
    np.testing.assert_allclose(table, before(JOINT) - price[:, np.newaxis], rtol=1e-12)
    values, chosen = table.mean(axis=1).reshape(SHAPE), np.array([1, 2, 5])
    for s, line in enumerate(np.split(additive.lines(chosen).mean(axis=1), 3)):
        index: list[Any] = chosen.tolist()
        index[s] = slice(None)
        np.testing.assert_allclose(line, values[tuple(index)], rtol=1e-12)
    own = np.concatenate([np.full(6, 0.02), np.tile([20.0, 30.0], 6)])
    np.testing.assert_allclose(additive.each_alone(), before.each_alone() - own[:, np.newaxis], rtol=1e-12)
    alone = additive.alone(2)(np.arange(6)[:, np.newaxis])
    np.testing.assert_allclose(alone, before.alone(2)(np.arange(6)[:, np.newaxis]) - own[12:, np.newaxis], rtol=1e-12)
    if not isinstance(reward, PeecsReward):
        end, best, _ = additive.ascend(
            chosen, Allowed(np.ones(18, np.bool_), np.ones((0, 0), np.bool_), np.zeros(18, np.bool_), 3)
        )
        np.testing.assert_allclose(best, values[tuple(end)], rtol=1e-12)


def test_prices_are_subtracted_case_by_case() -> None:
    """Of all sensors, and of one alone."""
    free = situation("marginal", 2, 1)
    paid = replace(free, sensors=tuple(replace(own, platform=Operated(own.platform, 0.5)) for own in free.sensors))
    joint = all_joint_actions((3, 3))
    np.testing.assert_allclose(evaluator_of(paid).joint()(joint), evaluator_of(free).joint()(joint) - 1.0)
    own = np.arange(3)[:, np.newaxis]
    np.testing.assert_allclose(evaluator_of(paid).alone(1)(own), evaluator_of(free).alone(1)(own) - 0.5)


def scaled(seed: int, scale: float) -> Situation:
    """Prices of the size of rewards: speeds in other units."""
    example = shared(3, seed, platform=HeadingPlatform((20.0 * scale, 30.0), (-90.0, 0.0, 45.0)))
    return priced(replace(example, settings=replace(KNOWN, num_samples=5)), 0.7)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("reward", [REWARDS[0], REWARDS[2]])
def test_searches_find_and_bounds_hold_the_best_of_all(seed: int, reward: Any) -> None:
    """Against enumeration: the exhaustive search exactly, every other no better, and no bound below it."""
    example = scaled(seed, 0.5)
    exhaustive = decided(example, reward=reward)
    table = sums_of(additive_of(example, reward, seed=1))(JOINT).mean(axis=1)
    assert exhaustive.explain().reward == pytest.approx(table.max(), rel=1e-9)
    for search in (CoordinateAscent(), SequentialGreedy()):
        plan = decided(example, reward=reward, search=search)
        found = plan.explain()
        assert found.reward is not None
        assert found.reward <= table.max() + 1e-9 * abs(table.max())
        assert plan.bound is not None
        assert plan.bound.upper >= table.max() - 1e-9 * abs(table.max())


@pytest.mark.parametrize("kind", [JointPlanner, IndependentPlanner, partial(IndependentPlanner, others="absent")])
def test_an_explanation_adds_up_with_the_price_as_a_term(kind: Any) -> None:
    why = decided(priced(unpriced()), kind).explain()
    assert why.baseline is not None
    assert why.of_targets is not None
    assert why.of_sensors is not None
    assert why.reward is not None
    assert why.price > 40.0
    gained = why.of_targets.total.sum() + why.of_undetected
    np.testing.assert_allclose(why.baseline + gained - why.price, why.reward, rtol=1e-9)
    np.testing.assert_allclose(why.baseline + why.of_sensors.sum(), why.reward, rtol=1e-9)
    (row,) = [line for line in str(why).splitlines() if line.startswith("price")]
    assert float(row.split()[1]) == pytest.approx(-why.price, rel=1e-3)


@pytest.mark.parametrize("discount", [0.25, None])
def test_sequences_pay_for_every_decision(discount: float | None) -> None:
    """All sequences cost the same, so that the same ones are best, at the price of two decisions, discounted."""
    ahead = partial(HorizonPlanner, depth=2, discount=discount, budget=10_000)
    free = single(situation("lmb", 2, 6, KNOWN))
    paid = replace(free, sensors=tuple(replace(own, platform=Operated(own.platform, 0.5)) for own in free.sensors))
    one, other = decided(free, ahead), decided(paid, ahead)
    assert one.chosen == other.chosen
    due = 1.0 if discount is None else 1.0 + discount
    np.testing.assert_allclose(other.tables[0].mean, one.tables[0].mean - due - (discount is None), rtol=1e-9)


class Hired:
    """Stays, at a price that an action says."""

    columns = ("fee",)

    def actions(self, pose: Any) -> Any:
        """A dear and a cheap way to stay, and the dear one again."""
        return np.array([[3.0], [1.0], [3.0]])

    def course(self, pose: Any, action: Any, times: Any) -> Any:
        """Where it is."""
        return np.tile(pose, (len(times), 1))


def test_actions_of_one_course_and_different_prices_are_different() -> None:
    pose, times = np.zeros(3), np.array([1.0, 2.0])
    found = options_at("platform", Operated(Hired(), "fee"), pose, times)
    assert found.which.tolist() == [0, 1, 0]
    assert found.prices.tolist() == [3.0, 1.0]
    assert options_at("platform", Hired(), pose, times).which.tolist() == [0, 0, 0]
    example = shared(2)
    hired = replace(example, sensors=tuple(replace(own, platform=Operated(Hired(), "fee")) for own in example.sensors))
    assert decided(hired).chosen == (1, 1)
    assert options_of(hired.sensors, hired.poses, hired.settings)[0].prices.tolist() == [3.0, 1.0]


def test_prices_that_are_none_are_refused() -> None:
    with pytest.raises(InputError, match=r"price: expected a number or one of fee; got fees"):
        Operated(Hired(), "fees")
    with pytest.raises(InputError, match="price: expected a number or one of no columns; got fee"):
        Operated(Stationary(), "fee")
    with pytest.raises(InputError, match="price: expected a finite number"):
        Operated(Stationary(), float("nan"))
