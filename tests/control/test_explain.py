"""Plans that are questioned: who contributes to a reward, and what another action would have brought."""

from __future__ import annotations

import copy
import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.special import expit

from control.examples import (
    ABSENT,
    KNOWN,
    SETTINGS,
    Situation,
    additive_of,
    cases_of,
    decided,
    evaluator_of,
    situation,
    sums_of,
)
from control.test_additive import shared, single
from vedette.control import (
    CauchySchwarzReward,
    ConstantPlanner,
    Explanation,
    IndependentPlanner,
    JointPlanner,
    Plan,
    RandomPlanner,
)
from vedette.control.additive.rewards import AdditiveRewards
from vedette.control.contributions import contributions_of
from vedette.control.rewards.labels import (
    CardinalityVarianceReward,
    ExpectedGospaReward,
    KullbackLeiblerReward,
    PeecsReward,
)
from vedette.control.rewards.power import ExpectedLossReward, RenyiReward
from vedette.control.search.problem import all_joint_actions
from vedette.densities import LMB
from vedette.errors import InputError
from vedette.kernels.planning.ascent import Cells
from vedette.platforms import Actions

LINEAR = [
    CauchySchwarzReward("reference"),
    RenyiReward(0.3),
    KullbackLeiblerReward(),
    CardinalityVarianceReward(),
    ExpectedGospaReward(50.0),
    ExpectedLossReward(60.0),
]


def planned(example: Situation, reward: Any, kind: Any = JointPlanner) -> tuple[Plan, AdditiveRewards]:
    """A plan, and the rewards that it was made on."""
    plan = decided(example, kind, reward, seed=5)
    return plan, sums_of(additive_of(example, reward))


def near(found: Any, expected: Any, scale: float) -> None:
    """Equal to 1e-9 of a scale."""
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9 * max(1.0, abs(scale)))


def text_fits(explanation: Explanation) -> None:
    assert max(map(len, str(explanation).splitlines())) <= 80


@pytest.mark.parametrize("reward", [*LINEAR, PeecsReward(0.3, 80.0)])
def test_contributions_add_up_and_are_what_joint_actions_say(reward: Any) -> None:
    """In both orders, and each sensor left out: all from rewards of joint actions with sensors that do not scan."""
    plan, additive = planned(shared(3, 2), reward)
    why, chosen = plan.explain(), np.array(plan.chosen)
    assert why.reward == plan.expected_rewards[0][0]
    near(why.standard_error or 0.0, plan.expected_rewards[0][1], why.reward)
    sets = np.array(list(np.ndindex(2, 2, 2)), bool)
    value = dict(zip(map(tuple, sets), additive(np.where(sets, chosen, -1)).mean(axis=1), strict=True))
    orders = ((0, 1, 2), (2, 1, 0))
    shares = np.zeros(3)
    for order in orders:
        scanning = [False] * 3
        for s in order:
            before = value[tuple(scanning)]
            scanning[s] = True
            shares[s] += 0.5 * (value[tuple(scanning)] - before)
    near(why.baseline, value[False, False, False], why.reward)
    near(why.of_sensors, shares, why.reward)
    near(
        why.reward_without_sensor,
        [value[False, True, True], value[True, False, True], value[True, True, False]],
        why.reward,
    )
    assert why.of_sensors is not None
    near(why.baseline + why.of_sensors.sum(), why.reward, why.reward)
    if isinstance(reward, PeecsReward):
        assert why.of_targets is None
        assert "not a sum over targets" in why.missing["of_targets"]
    else:
        assert why.of_targets is not None
        near(why.baseline + why.of_targets.total.sum() + why.of_undetected, why.reward, why.reward)
    text_fits(why)


@pytest.mark.parametrize("rule", ["clmb", "parallel"])
def test_a_targets_gain_is_that_of_a_table_of_it_alone(rule: str) -> None:
    """Cut out of the table, one label has the gain that it has among all; beliefs differ, and labels are not shared."""
    example = single(situation("lmb", 2, 6, KNOWN)) if rule == "clmb" else shared(2, 3)
    plan, additive = planned(example, CauchySchwarzReward("reference"))
    gains = plan.explain().of_targets
    assert gains is not None
    table, chosen = additive.table, np.array([plan.chosen, [-1, -1]])
    for i, label in enumerate(gains.labels.tolist()):
        keep = table.labels == i
        counts = np.concatenate([[0], np.cumsum(keep)])
        own = table._replace(offsets=counts[table.offsets], labels=table.labels[keep], changes=table.changes[keep])
        with_scans, without = replace(additive, table=own)(chosen).mean(axis=1)
        near(gains.total[i], with_scans - without, 1.0)
        assert label == additive_of(example).prediction.tracks.labels[i].tolist()


def test_existence_alone_is_the_gain_of_rewards_that_ask_for_no_place() -> None:
    """And no gain at all of the expected loss, which takes existence as it is."""
    gains = planned(shared(3, 1), CardinalityVarianceReward())[0].explain().of_targets
    assert gains is not None
    assert np.abs(gains.existence).max() > 1e-3
    near(gains.localisation, 0.0, 1.0)
    gains = planned(shared(3, 1), ExpectedLossReward(60.0))[0].explain().of_targets
    assert gains is not None
    near(gains.existence, 0.0, 1e3)


def test_existence_in_plain_numpy() -> None:
    """The expected GOSPA of the updated existence with the predicted covariance, sample by sample."""
    example, square = shared(2, 7), 50.0**2
    plan, _ = planned(example, ExpectedGospaReward(50.0))
    gains = plan.explain().of_targets
    prediction: Any = additive_of(example).prediction
    posteriors = [cases_of(evaluator_of(example)).posteriors[s] for s in range(2)]
    assert gains is not None
    num = example.settings.num_samples
    for i, cov in enumerate(prediction.tracks.covs):
        error = min(float(np.trace(cov[:2, :2])), square)
        values = []
        for sample in range(num):
            logit, information, vector = prediction.existence_logit[i], np.linalg.inv(cov), np.zeros(4)
            constant = _log_gaussian(np.zeros(4), cov)
            base = (information.copy(), constant)
            for s, course in enumerate(plan.chosen):
                after = posteriors[s].density(course * num + sample)
                assert isinstance(after, LMB)
                logit += after.existence_logit[i] - prediction.existence_logit[i]
                own = np.linalg.inv(after.tracks.covs[i])
                off = after.tracks.means[i] - prediction.tracks.means[i]
                information += own - base[0]
                vector += own @ off
                constant += _log_gaussian(off, after.tracks.covs[i]) - base[1]
            joint = np.linalg.inv(information)
            logit += constant + 0.5 * (vector @ joint @ vector + np.linalg.slogdet(2 * np.pi * joint)[1])
            values.append(_gospa(prediction.existence[i], error, square) - _gospa(expit(logit), error, square))
        np.testing.assert_allclose(gains.existence[i], np.mean(values), rtol=1e-6)


def _gospa(existence: float, error: float, square: float) -> float:
    return min(existence * error + 0.5 * (1.0 - existence) * square, 0.5 * existence * square)


def _log_gaussian(off: Any, cov: Any) -> float:
    return float(-0.5 * (off @ np.linalg.solve(cov, off) + np.linalg.slogdet(2 * np.pi * cov)[1]))


def test_targets_not_found_before_are_one_contribution() -> None:
    """Sensors share in it by what each finds before and after the others."""
    example = shared(3, 2)
    additive = sums_of(additive_of(example, ExpectedLossReward(60.0)))
    rng = np.random.default_rng(0)
    offsets = np.arange(10) * 4
    cells = Cells(offsets, np.tile(np.arange(4), 9), np.log(rng.uniform(0.2, 1.0, 36)), rng.uniform(1.0, 100.0, 4))
    searching = replace(additive, cells=cells)
    chosen = np.array([1, 2, 0])
    shares = contributions_of(searching, chosen, np.arange(3))
    reward, baseline = searching(np.array([chosen, [-1, -1, -1]]))[:, 0]
    assert shares.found > 1.0
    assert shares.existence is not None
    assert shares.localisation is not None
    near(shares.baseline + shares.existence.sum() + shares.localisation.sum() + shares.found, reward, reward)
    near(baseline + shares.sensors.sum(), reward, reward)
    for s in range(3):
        without = chosen.copy()
        without[s] = -1
        near(reward - shares.last[s], searching(without[np.newaxis])[0, 0], reward)


def test_what_a_sensor_had_brought_is_the_line_through_the_choice() -> None:
    """By number and by heading; the difference sample by sample."""
    plan, additive = planned(shared(3, 2), CauchySchwarzReward("reference"))
    why, chosen = plan.explain(), np.array(plan.chosen)
    for s in range(3):
        line = additive.line(chosen, s)
        for action, heading in enumerate(plan.actions[s].values[:, 0].tolist()):
            had, paired = why.counterfactual(s, action), line[action] - line[chosen[s]]
            near(had.reward, line[action].mean(), 1.0)
            near(had.difference, paired.mean(), 1.0)
            near(had.standard_error, paired.std(ddof=1) / np.sqrt(len(paired)), 1.0)
            assert why.counterfactual(s, heading_deg=heading + 360.0) == had
            assert f"sensor {s + 1} with heading_deg {heading:g}: reward" in str(had)
    with pytest.raises(
        InputError, match=r"expected something that sensor 2 could do \(heading_deg -90; heading_deg 0;"
    ):
        why.counterfactual(1, heading_deg=17.0)
    cases: list[tuple[Any, dict[str, Any], str]] = [
        ((3, 0), {}, "one of 3 sensors, from 0"),
        ((0, 3), {}, "one of 3 actions, from 0"),
        ((0,), {}, "either the number of an action"),
        ((0,), {"speed": 3.0}, "expected columns heading_deg; got speed"),
    ]
    for arguments, columns, message in cases:
        with pytest.raises(InputError, match=message):
            why.counterfactual(*arguments, **columns)


def test_the_runner_up_is_the_second_of_all_joint_actions() -> None:
    plan, additive = planned(shared(3, 4), CauchySchwarzReward("reference"))
    actions = all_joint_actions((3, 3, 3))
    rewards = additive(actions)
    order = np.argsort(-rewards.mean(axis=1), kind="stable")
    second, paired = actions[order[1]], rewards[order[0]] - rewards[order[1]]
    found = plan.explain().runner_up
    assert found is not None
    assert found.actions == tuple(second.tolist())
    near(found.margin, paired.mean(), 1.0)
    error = paired.std(ddof=1) / np.sqrt(len(paired))
    near(found.standard_error, error, 1.0)
    assert found.in_standard_errors is not None
    np.testing.assert_allclose(found.in_standard_errors, paired.mean() / error, rtol=1e-6)
    assert plan.explain().evaluations == 27
    assert plan.explain().bound is plan.bound


def test_an_independent_decision_is_the_sum_of_the_sensors_own() -> None:
    plan, additive = planned(shared(3, 2), CauchySchwarzReward("reference"), ABSENT)
    why = plan.explain()
    own = [additive.alone(s)(np.array([[0], [1], [2], [-1]])).mean(axis=1) for s in range(3)]
    alone = np.array([values[action] - values[3] for values, action in zip(own, plan.chosen, strict=True)])
    near(why.reward, sum(reward for reward, _ in plan.expected_rewards), 1.0)
    near(why.of_sensors, alone, 1.0)
    near(why.reward_without_sensor, why.reward - alone, 1.0)
    near(why.baseline + why.of_targets.total.sum(), why.reward, 1.0)  # type: ignore[union-attr]
    margins = [np.sort(values[:3])[-1] - np.sort(values[:3])[-2] for values in own]
    assert why.runner_up is not None
    near(why.runner_up.margin, min(margins), 1.0)
    (changed,) = [s for s in range(3) if why.runner_up.actions[s] != plan.chosen[s]]
    assert changed == int(np.argmin(margins))
    near(why.counterfactual(1, 0).difference, own[1][0] - own[1][plan.chosen[1]], 1.0)
    text_fits(why)


@pytest.mark.parametrize("kind", ["lmb", "delta"])
@pytest.mark.parametrize("planner", [JointPlanner, IndependentPlanner])
def test_decisions_case_by_case_say_what_they_cannot_tell(kind: str, planner: Any) -> None:
    example = situation(kind, 2, 1, SETTINGS)
    plan = decided(example, planner, CauchySchwarzReward(), seed=2)
    why = plan.explain()
    assert [why.of_targets, why.of_sensors, why.reward_without_sensor, why.baseline] == [None] * 4
    assert "case by case" in why.missing["reward_without_sensor"]
    assert why.runner_up is not None
    had = why.counterfactual(0, why.runner_up.actions[0])
    if planner is JointPlanner:
        choice = (why.runner_up.actions[0], plan.chosen[1])
        near(had.reward, plan.tables[0].mean[choice], 1.0)
    text_fits(why)


def test_without_samples_there_are_no_standard_errors() -> None:
    why = planned(shared(2, 2), ExpectedLossReward(60.0))[0].explain()
    assert why.standard_error is None
    assert why.runner_up is not None
    assert why.runner_up.standard_error is why.runner_up.in_standard_errors is None
    assert why.counterfactual(0, 0).standard_error is None


def test_plans_without_rewards_say_so() -> None:
    example = shared(2, 2)
    fixed = ConstantPlanner((Actions.of(heading_deg=30.0),) * 2)
    for planner in (RandomPlanner(example.sensors), fixed):
        why = planner.plan(*example.arguments, rng=np.random.default_rng(1)).explain()
        assert why.reward is None
        assert why.runner_up is None
        assert "does not choose by rewards" in str(why)
        with pytest.raises(InputError, match="does not choose by rewards"):
            why.counterfactual(0, 0)


def test_what_is_kept_has_left_its_evidence_behind() -> None:
    plan, _ = planned(shared(2, 2), CauchySchwarzReward("reference"))
    for again in (pickle.loads(pickle.dumps(plan)), copy.deepcopy(plan), plan.without_evidence(explained=False)):
        assert again.chosen == plan.chosen
        with pytest.raises(InputError, match="left its evidence behind"):
            again.explain()
    kept = pickle.loads(pickle.dumps(plan.without_evidence(explained=True)))
    assert str(kept.explain()) == str(plan.explain())
    with pytest.raises(InputError, match="left its evidence behind"):
        kept.explain().counterfactual(0, 0)


def test_threads_change_no_explanation() -> None:
    found = []
    for num_threads in (1, 3):
        example = replace(shared(3, 2), settings=replace(KNOWN, num_threads=num_threads, num_samples=7))
        found.append(planned(example, CauchySchwarzReward("reference"))[0].explain())
    one, three = found
    assert one.of_targets is not None
    assert three.of_targets is not None
    np.testing.assert_array_equal(one.of_sensors, three.of_sensors)
    np.testing.assert_array_equal(one.reward_without_sensor, three.reward_without_sensor)
    np.testing.assert_array_equal(one.of_targets.existence, three.of_targets.existence)
    assert str(one) == str(three)
