"""Decisions that take as many samples as they need."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import t as student

from control.examples import ABSENT, SETTINGS, Situation, decided, situation
from vedette.control import (
    CauchySchwarzReward,
    CoordinateAscent,
    ExpectedLossReward,
    decisions,
)
from vedette.control.preparation import Preparation
from vedette.control.racing import FIRST_ROUND, Race, next_total
from vedette.control.search.problem import all_joint_actions
from vedette.platforms import HeadingPlatform

REWARD = CauchySchwarzReward("reference")


def race_of(num: int, confidence: float = 0.95, indifference: float = 0.0) -> Race:
    return Race(np.arange(num)[:, np.newaxis], confidence, indifference)


def run(race: Race, draw: Any, most: int = 2000) -> Race:
    """All rounds; draw(num) gives (num_candidates, num) rewards of all that began."""
    while race.verdict is None and race.num_samples < most:
        new = draw(next_total(race.num_samples, most) - race.num_samples)
        race.add(new[race.left])
    return race


def test_rounds_grow() -> None:
    totals = [0]
    while totals[-1] < 100:
        totals.append(next_total(totals[-1], 100))
    assert totals == [0, 8, 12, 18, 27, 41, 62, 93, 100]


@pytest.mark.parametrize("indifference", [0.0, 0.01, 0.1])
def test_candidates_are_dropped_as_in_plain_python(indifference: float) -> None:
    rng = np.random.default_rng(1)
    for _ in range(20):
        means, race = 10.0 + rng.normal(size=6), race_of(6, 0.9, indifference)
        alive, rewards = list(range(6)), np.empty((6, 0))
        for number in (1, 2, 3):
            common = rng.normal(size=8)
            new = means[:, np.newaxis] + common + 0.5 * rng.normal(size=(6, 8))
            race.add(new[race.left])
            rewards = np.concatenate([rewards, new], axis=1)
            best = max(alive, key=lambda a: rewards[a].mean())
            reach, quantile = {}, student.ppf(1.0 - 0.1 / (5 * number * (number + 1)), rewards.shape[1] - 1)
            for a in alive:
                difference = rewards[a] - rewards[best]
                reach[a] = difference.mean() + quantile * difference.std(ddof=1) / math.sqrt(len(difference))
            alive = [a for a in alive if a == best or reach[a] >= 0.0]
            assert race.best == (best,)
            np.testing.assert_array_equal(race.left, alive)
            np.testing.assert_array_equal(race.rewards, rewards[alive])
            near = all(reach[a] <= indifference * abs(rewards[best].mean()) for a in alive if a != best)
            expected = "one left" if len(alive) == 1 else ("indifferent" if near else None)
            assert race.verdict == expected
            if expected:
                assert race.reached == 0.9
                break
            assert race.reached < 0.9


@pytest.mark.parametrize("kind", ["normal", "skewed", "seen or not"])
@pytest.mark.parametrize("indifference", [0.0, 0.02])
def test_the_best_is_kept_in_as_many_races_as_the_confidence_says(kind: str, indifference: float) -> None:
    """300 races of 20 candidates, which have most of their luck in common."""
    rng, good, num_samples = np.random.default_rng(2), 0, []
    for _ in range(300):
        means = 20.0 + rng.normal(size=20)

        def draw(num: int, means: Any = means) -> Any:
            if kind == "normal":
                own = rng.normal(size=(20, num))
            elif kind == "skewed":
                own = rng.exponential(size=(20, num)) - 1.0
            else:
                own = (rng.random((20, num)) - 0.7 < 0.0) / 0.46 - 0.7 / 0.46
            return means[:, np.newaxis] + 3.0 * rng.normal(size=num) + own

        race = run(race_of(20, 0.95, indifference), draw)
        num_samples.append(race.num_samples)
        if race.verdict is None:
            good += int(means.argmax() in race.left)
        else:
            good += bool(means[race.best[0]] >= means.max() * (1.0 - indifference))
    assert good >= 285
    if indifference:
        assert np.median(num_samples) < 100


def test_the_confidence_reached_is_that_at_which_the_race_would_be_over() -> None:
    rng = np.random.default_rng(3)
    rewards = 5.0 + np.array([[0.0], [-0.4], [-0.5]]) + 0.2 * rng.normal(size=(3, 8))
    race = race_of(3, 0.999, 0.01)
    race.add(rewards)
    assert race.verdict is None
    assert 0.0 < race.reached < 0.999
    for level, over in ((race.reached - 1e-9, True), (race.reached + 1e-9, False)):
        again = race_of(3, level, 0.01)
        again.add(rewards)
        assert (again.verdict is not None) == over


def test_equal_candidates_end_a_race_at_once_and_the_first_is_taken() -> None:
    race, luck = race_of(4), np.random.default_rng(4).normal(size=8)
    race.add(np.array([0.0, 1.0, 1.0 + 1e-13, 1.0])[:, np.newaxis] + luck)
    assert race.verdict == "indifferent"
    assert race.best == (1,)
    np.testing.assert_array_equal(race.left, [1, 2, 3])


def test_a_single_candidate_and_one_without_a_finite_reward() -> None:
    assert race_of(1).verdict == "one left"
    race, rewards = race_of(3, indifference=0.5), np.random.default_rng(5).normal(9.0, 1.0, (3, 8))
    rewards[1, 3] = math.nan
    race.add(rewards)
    np.testing.assert_array_equal(race.left, [0, 2])
    race = race_of(2)
    race.add(np.full((2, 8), math.nan))
    assert race.best == (0,)


def certain(example: Situation, **settings: Any) -> Situation:
    return replace(example, settings=replace(example.settings, confidence=0.95, max_samples=64, **settings))


def sample_rewards(example: Situation, sizes: list[int]) -> list[Any]:
    """Rewards of all joint actions, and of each sensor alone, round after round."""
    prepared = Preparation.of(example.sensors, example.fusion, example.settings, REWARD, *example.arguments)
    rng, found = np.random.default_rng(5), []
    for size in sizes:
        evaluator = prepared.evaluator(size, rng=rng)
        shape = evaluator.joint_shape()
        alone = [evaluator.alone(s)(all_joint_actions((num,))) for s, num in enumerate(shape)]
        found.append([evaluator.joint()(all_joint_actions(shape)), *alone])
    return [np.concatenate(rewards, axis=1) for rewards in zip(*found, strict=True)]


@pytest.mark.parametrize(("kind", "association"), [("lmb", "known"), ("lmb", "full"), ("delta", "full")])
def test_tables_hold_means_over_the_samples_that_an_action_got(kind: str, association: Any) -> None:
    """With courses taken away as they are no longer wanted, every reward is that of all courses on all samples."""
    example = certain(situation(kind, 2, 3), association=association)
    totals = [0]
    while totals[-1] < 64:
        totals.append(next_total(totals[-1], 64))
    joint, *alone = sample_rewards(example, np.diff(totals).tolist())
    joint_plan, own_plan = decided(example, seed=5), decided(example, ABSENT, seed=5)
    tables = [*zip((joint_plan, *[own_plan] * 2), (*joint_plan.tables, *own_plan.tables), (joint, *alone), strict=True)]
    for plan, table, rewards in tables:
        assert plan.certainty is not None
        assert plan.certainty.samples in totals
        got = set()
        for index, mean, error in zip(rewards, table.mean.ravel(), table.standard_error.ravel(), strict=True):
            means = [index[:num].mean() for num in totals[1:]]
            num = totals[1 + int(np.argmin(np.abs(np.array(means) - mean)))]
            np.testing.assert_allclose(mean, index[:num].mean(), rtol=1e-9)
            np.testing.assert_allclose(error, index[:num].std(ddof=1) / math.sqrt(num), rtol=1e-7)
            got.add(num)
        chosen = tuple(plan.chosen[s] for s in table.sensors)
        assert rewards[:, : max(got)].mean(axis=1).argmax() == np.ravel_multi_index(chosen, table.mean.shape)
        assert plan.certainty.samples >= max(got)
    assert joint_plan.bound is not None
    assert (joint_plan.bound.kind, joint_plan.bound.gap) == ("exhaustive", 0.0)
    assert joint_plan.certainty is not None
    assert joint_plan.certainty.started == (9,)
    assert str(joint_plan.certainty) in joint_plan.notes


def test_a_plan_says_why_it_ended() -> None:
    example = certain(situation("lmb", 2, 3), association="known")
    reasons = {}
    cases: dict[str, dict[str, Any]] = {
        "indifferent": {"indifference": 0.9},
        "max_samples": {"confidence": 1.0 - 1e-15, "max_samples": 24},
        "max_seconds": {"confidence": 1.0 - 1e-15, "max_seconds": 1e-9},
    }
    for name, settings in cases.items():
        own = replace(example, settings=replace(example.settings, **settings))
        reasons[name] = decided(own).certainty
    for name, certainty in reasons.items():
        assert certainty is not None
        assert certainty.reason == name
        assert certainty.certain == (name == "indifferent")
    assert reasons["max_seconds"] is not None
    assert reasons["max_seconds"].samples == FIRST_ROUND
    assert "not certain, time ran out" in str(reasons["max_seconds"])
    assert "not certain, samples ran out" in str(reasons["max_samples"])
    assert str(reasons["indifferent"]).startswith("certain at 95 % after")


def test_a_reward_without_samples_is_certain_at_once() -> None:
    example = certain(situation("lmb", 2, 3))
    plan, plain = (
        decided(each, reward=ExpectedLossReward(60.0)) for each in (example, situation("lmb", 2, 3, SETTINGS))
    )
    assert plan.certainty is not None
    assert plan.certainty.reason == "no samples"
    assert plan.certainty.certain
    assert plan.chosen == plain.chosen
    assert plain.certainty is None


def test_what_a_search_picks_races_on_fresh_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its own samples speak for what it picked; the race's speak for the choice."""
    monkeypatch.setattr(decisions, "_MOST_OF_ALL", 1)
    example = situation("lmb", 3, 2, platform=HeadingPlatform(30.0))
    example = certain(example, association="known", indifference=0.02)
    plan = decided(example, search=CoordinateAscent(1))
    assert plan.certainty is not None
    assert plan.curve is not None
    assert plan.certainty.samples >= 3 * FIRST_ROUND
    assert 1 < plan.certainty.started[0] <= 64
    (table,) = plan.tables
    assert np.isfinite(table.mean).sum() >= plan.certainty.started[0]
    assert table.standard_error[plan.chosen] > 0.0
