"""Rewards, actions and fusions of the user's own, made without touching the library."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from control.examples import ABSENT, SETTINGS, cases_of, decided, evaluator_of, sample_rewards, situation
from vedette.control import CauchySchwarzReward, ExpectedLossReward, IndependentPlanner, JointPlanner, RenyiReward
from vedette.control.pseudo_posterior_rewards import warn_slow
from vedette.densities import cardinality_distribution
from vedette.divergence import cauchy_schwarz
from vedette.errors import InputError, NumericalError, SlowRewardWarning
from vedette.fusion import CmDeltaGlmb

# Own rewards and fusions are mostly computed one by one, which is said once.
pytestmark = pytest.mark.filterwarnings("ignore::vedette.errors.SlowRewardWarning")


def minus_cardinality_variance(predicted: Any, updated: Any) -> float:
    """How sure one would be of the number of targets."""
    distribution = cardinality_distribution(updated)
    numbers = np.arange(len(distribution))
    return -float(distribution @ numbers**2 - (distribution @ numbers) ** 2)


@pytest.mark.parametrize("kind", ["delta", "lmb"])
def test_a_reward_of_the_users_own(kind: str) -> None:
    example = situation(kind)
    given = example.sensors, example.fusion, example.settings, minus_cardinality_variance
    joint = JointPlanner(*given).plan(*example.arguments, rng=np.random.default_rng(5))
    alone = ABSENT(*given).plan(*example.arguments, rng=np.random.default_rng(5))
    evaluator = evaluator_of(example)
    densities = [
        [own.density(action * SETTINGS.num_samples + m) for action in range(3) for m in range(SETTINGS.num_samples)]
        for own in cases_of(evaluator).posteriors
    ]
    for s, table in enumerate(alone.tables):
        rewards = np.reshape([minus_cardinality_variance(None, one) for one in densities[s]], (3, -1))
        np.testing.assert_allclose(table.mean, rewards.mean(axis=1))
        assert alone.chosen[s] == rewards.mean(axis=1).argmax()
    expected = np.empty((3, 3, SETTINGS.num_samples))
    for first, second, m in np.ndindex(expected.shape):
        pair = densities[0][first * SETTINGS.num_samples + m], densities[1][second * SETTINGS.num_samples + m]
        expected[first, second, m] = minus_cardinality_variance(None, example.fusion.fuse(pair)[0])
    np.testing.assert_allclose(joint.tables[0].mean, expected.mean(axis=2))
    assert joint.counts["fusions"] == expected.size


@dataclass(frozen=True)
class TurnsAtMost:
    """A platform of the user's own: it turns on the spot as far as it can, to more sides further out."""

    turn_rad: float
    columns = ("turn_rad", "reach")

    def actions(self, pose: Any) -> Any:
        number = 2 + int(np.hypot(pose[0], pose[1]) > 510.0)
        return np.column_stack([np.linspace(-self.turn_rad, self.turn_rad, number), np.ones(number)])

    def course(self, pose: Any, action: Any, times: Any) -> Any:
        heading = pose[2] + action[0]
        return pose[:3] + np.outer(times * 30.0, [np.cos(heading), np.sin(heading), 0.0])


def test_actions_of_the_users_own() -> None:
    example = situation("marginal", platform=TurnsAtMost(0.6))
    plan = decided(example, JointPlanner, ExpectedLossReward(), seed=5)
    for own in plan.actions:
        assert own.columns == ("turn_rad", "reach")
        np.testing.assert_array_equal(own.values, [[-0.6, 1.0], [0.0, 1.0], [0.6, 1.0]])
    near = replace(example, poses=example.poses * [[1.0, 1.0, 1.0], [0.5, 0.5, 1.0]])
    plan = JointPlanner(example.sensors, example.fusion, SETTINGS).plan(*near.arguments, rng=np.random.default_rng(5))
    assert plan.tables[0].mean.shape == (3, 2)
    plan.validate()


class TrustsTheFirst:
    """A fusion of the user's own: the first sensor is right."""

    def fuse(self, beliefs: Any, views: Any = None) -> Any:
        return beliefs[0], None


@pytest.mark.parametrize("kind", ["marginal", "lmb"])
def test_a_fusion_of_the_users_own(kind: str) -> None:
    example = replace(situation(kind), fusion=TrustsTheFirst())
    evaluator = evaluator_of(example)
    rewards = sample_rewards(evaluator, (0, 1), example.fusion)
    alone = sample_rewards(evaluator, (0,), None)
    np.testing.assert_allclose(rewards, np.repeat(alone, 3, axis=0), rtol=1e-9)
    plan = decided(example, JointPlanner, CauchySchwarzReward(), seed=5)
    assert plan.chosen == (int(alone.mean(axis=1).argmax()), 0)


class LaidOutBefore:
    """A fusion of the user's own that a planner need not call."""

    def __init__(self, weights: Any) -> None:
        self.rule, self.fused = CmDeltaGlmb(weights), 0

    def fuse(self, beliefs: Any, views: Any = None) -> Any:
        self.fused += 1
        return self.rule.fuse(beliefs, views)

    def precompute(self, cases: Any, prediction: Any) -> Any:
        return self.rule.precompute(cases, prediction)


def test_a_fusion_of_the_users_own_that_lays_out() -> None:
    example = situation("marginal")
    expected = sample_rewards(evaluator_of(example), (0, 1), example.fusion)
    fusion = LaidOutBefore(example.fusion.weights)
    evaluator = evaluator_of(replace(example, fusion=fusion))
    np.testing.assert_array_equal(sample_rewards(evaluator, (0, 1), fusion), expected)
    assert (fusion.fused, evaluator.notes) == (0, {})


def test_what_is_computed_one_by_one_is_said_in_the_plan_and_once_by_a_warning() -> None:
    example = situation("marginal")
    warn_slow.cache_clear()
    planner = IndependentPlanner(example.sensors, example.fusion, SETTINGS, minus_cardinality_variance)
    with pytest.warns(SlowRewardWarning, match="one by one: a joint decision .* times as long.*; minus_card") as warned:
        plans = [planner.plan(*example.arguments, rng=np.random.default_rng(5)) for _ in range(2)]
    assert len(warned) == 1
    for plan in plans:
        assert plan.notes == (
            "rewards were computed one by one: minus_cardinality_variance is a function of two densities",
        )


class Nonsense:
    exponents = ((1.0, 1.0),)

    def combine(self, z: Any) -> Any:
        return z  # one number too many


def test_a_combination_of_another_shape() -> None:
    example = situation("marginal")
    planner = IndependentPlanner(example.sensors, example.fusion, SETTINGS, Nonsense())
    with pytest.raises(InputError, match=r"reward.combine: expected shape \(3, 3\) for z of shape \(3, 3, 1\)"):
        planner.plan(*example.arguments, rng=np.random.default_rng(5))


def test_an_order_without_a_finite_reward_is_named() -> None:
    example = situation("marginal")
    planner = IndependentPlanner(example.sensors, example.fusion, SETTINGS, RenyiReward(3.0))
    with pytest.raises(NumericalError, match="expected a finite number; got inf"):
        planner.plan(*example.arguments, rng=np.random.default_rng(5))
    for order in (0.0, 1.0, math.inf, True, "half"):
        with pytest.raises(InputError, match="order: expected a finite number"):
            RenyiReward(order)  # type: ignore[arg-type]


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_reward_that_is_not_finite_is_named_with_action_and_sample(bad: float) -> None:
    example, calls = situation("marginal"), []

    def reward(predicted: Any, updated: Any) -> float:
        calls.append(updated)
        return bad if len(calls) == 5 * SETTINGS.num_samples + 3 else 1.0

    planner = JointPlanner(example.sensors, example.fusion, SETTINGS, reward)
    with pytest.raises(NumericalError) as error:
        planner.plan(*example.arguments, rng=np.random.default_rng(5))
    assert str(error.value) == (
        f"reward of action heading_deg 0 of sensor 1 and action heading_deg 45 of sensor 2, sample 2: "
        f"expected a finite number; got {bad}"
    )


def test_a_reward_that_is_no_number() -> None:
    example = situation("marginal")
    planner = IndependentPlanner(example.sensors, example.fusion, SETTINGS, lambda predicted, updated: "high")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="reward: expected a number; got str 'high'"):
        planner.plan(*example.arguments, rng=np.random.default_rng(5))


def test_a_reward_gets_valid_single_gaussian_densities() -> None:
    example = situation("delta")

    def reward(predicted: Any, updated: Any) -> float:
        for density in (predicted, updated):
            density.validate()
            assert len(density.tracks.log_weights) == density.tracks.num_tracks
            assert density.is_marginalised
        return cauchy_schwarz(predicted, updated, support="common")

    for planner in (JointPlanner, IndependentPlanner):
        given = example.sensors, example.fusion, SETTINGS
        own = planner(*given, reward).plan(*example.arguments, rng=np.random.default_rng(5))
        builtin = planner(*given, CauchySchwarzReward()).plan(*example.arguments, rng=np.random.default_rng(5))
        for a, b in zip(own.tables, builtin.tables, strict=True):
            np.testing.assert_allclose(a.mean, b.mean, rtol=1e-9, atol=1e-9)
