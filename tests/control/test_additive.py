"""Decisions by sums over labels: against plain NumPy, densities fused one by one, and the full update."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from control.examples import (
    FIRST,
    KNOWN,
    NEVER,
    SECOND,
    SETTINGS,
    A,
    B,
    C,
    Situation,
    additive_of,
    cases_of,
    evaluator_of,
    lmb,
    mobile_sensor,
    scanning,
    situation,
    sums_of,
)
from control.known_association import followed, updated
from vedette import models
from vedette.control import CauchySchwarzReward, Evaluator, RenyiReward
from vedette.control.problem import label_upper_bounds
from vedette.control.pseudo_updates import draw_futures
from vedette.control.rewards.base import reward_value
from vedette.control.rewards.labels import (
    CardinalityVarianceReward,
    ExpectedGospaReward,
    KullbackLeiblerReward,
    PeecsReward,
)
from vedette.control.rewards.power import ExpectedLossReward
from vedette.control.search.problem import all_joint_actions
from vedette.densities import LMB, UndetectedIntensity
from vedette.densities.tracks import single_gaussians
from vedette.fusion import ParallelUpdate
from vedette.kernels.planning.ascent import Allowed
from vedette.kernels.planning.bounds import relaxed_bound


def shared(num_sensors: int = 2, seed: int = 3, **parts: Any) -> Situation:
    """All sensors believe the same, and take their scans in full."""
    rng = np.random.default_rng(seed)
    belief = lmb((A, B, C), rng)
    sensors = tuple(mobile_sensor("lmb", **parts) for _ in range(num_sensors))
    example = situation("lmb", num_sensors, seed, KNOWN)
    return replace(example, sensors=sensors, fusion=ParallelUpdate(), beliefs=(belief,) * num_sensors, fused=belief)


def single(example: Situation) -> Situation:
    """The same with one Gaussian a label at every sensor, the same labels at all."""
    rng = np.random.default_rng(8)
    beliefs = tuple(lmb((A, B), rng) for _ in example.sensors)
    return replace(example, beliefs=beliefs, fused=example.fusion.fuse(beliefs)[0])


@pytest.mark.lanes
@pytest.mark.parametrize(
    ("method", "times"), [("auto", None), ("ekf", None), ("auto", FIRST), ("auto", SECOND), ("auto", NEVER)]
)
def test_labels_are_followed_as_in_plain_numpy(method: str, times: Any) -> None:
    """Existence, mean, covariance of every course, sample and label, at both sensors; one may not scan always."""
    example = scanning(situation("lmb", seed=2, settings=KNOWN, method=method), times, None)
    evaluator = evaluator_of(example)
    labels, futures = draw_futures(example.fused, example.sensors, KNOWN, rng=np.random.default_rng(5))
    for s, (belief, sensor) in enumerate(zip(example.beliefs, example.sensors, strict=True)):
        tracks, cases = single_gaussians(belief.tracks), cases_of(evaluator).posteriors[s]
        for course, sample in np.ndindex(len(evaluator.options[s].courses), KNOWN.num_samples):
            ends = cases.density(course * KNOWN.num_samples + sample)
            assert isinstance(ends, LMB)
            span = slice(futures[s].offsets[sample], futures[s].offsets[sample + 1])
            for i, label in enumerate(tracks.labels.tolist()):
                at = [place for place in range(span.start, span.stop) if labels[place].tolist() == label]
                target = futures[s].states[:, at[0]] if at else None
                logit, mean, cov, _ = followed(
                    belief.existence_logit[i],
                    tracks.means[i],
                    tracks.covs[i],
                    target,
                    sensor,
                    evaluator.options[s].courses[course],
                    KNOWN,
                )
                np.testing.assert_allclose(ends.existence_logit[i], logit, rtol=1e-9, atol=1e-9)
                np.testing.assert_allclose(ends.tracks.means[i], mean, rtol=1e-9)
                np.testing.assert_allclose(ends.tracks.covs[i], cov, rtol=1e-8, atol=1e-9)
    mine, its = (own.joint()(all_joint_actions((3, 3))).mean() for own in (additive_of(example), evaluator))
    np.testing.assert_allclose(mine, its, rtol=0.2)


@pytest.mark.parametrize(
    "reward",
    [
        CauchySchwarzReward(),
        CauchySchwarzReward("reference"),
        RenyiReward(0.3),
        KullbackLeiblerReward(),
        CardinalityVarianceReward(),
        ExpectedGospaReward(50.0),
        PeecsReward(0.3, 80.0),
    ],
)
@pytest.mark.parametrize("rule", ["clmb", "parallel"])
@pytest.mark.filterwarnings("ignore::vedette.errors.SlowRewardWarning")
def test_sums_equal_densities_that_are_fused_one_by_one(reward: Any, rule: str) -> None:
    """Every joint action and sample, and every sensor alone."""
    example = single(situation("lmb", 2, 6, KNOWN)) if rule == "clmb" else shared()
    actions = all_joint_actions((3, 3))
    additive = additive_of(example, reward)
    np.testing.assert_array_equal(additive.joint_shape(), (3, 3))

    class OneByOne:
        """The same reward as a function of two densities, or as power integrals of a fused one."""

        def __call__(self, predicted: Any, updated: Any) -> float:
            return reward_value(reward, predicted, updated)

    plain = evaluator_of(example, OneByOne())
    np.testing.assert_allclose(additive.joint()(actions), plain.joint()(actions), rtol=2e-8, atol=2e-8)
    for s in range(2):
        own = plain.alone(s)(actions[:3, 1:])
        np.testing.assert_allclose(additive.alone(s)(actions[:3, 1:]), own, rtol=2e-8, atol=2e-8)


@pytest.mark.lanes
def test_known_association_is_the_full_update_where_labels_are_apart_and_always_seen() -> None:
    """Nothing else can have given the measurement, and nothing else can have been measured."""
    example = single(situation("lmb", 2, 6, SETTINGS, detection=models.constant_detection(1.0 - 1e-13)))
    for full, known in zip(
        cases_of(evaluator_of(example)).posteriors,
        cases_of(evaluator_of(replace(example, settings=KNOWN))).posteriors,
        strict=True,
    ):
        # Who is not in a sample can only have given another's measurement, with next to no existence.
        there = full.existence_logits > -5.0
        assert 0 < np.count_nonzero(there) < there.size
        np.testing.assert_allclose(known.existence_logits[there], full.existence_logits[there], rtol=1e-6)
        np.testing.assert_allclose(known.means[there], full.means[there], rtol=1e-7, atol=1e-6)
        np.testing.assert_allclose(known.covs[there], full.covs[there], rtol=1e-7, atol=1e-6)


def test_lines_and_ascents_give_what_joint_actions_give() -> None:
    """The same numbers, whichever way they are asked for; and no sensor alone can improve the end of an ascent."""
    for seed in range(5):
        evaluator = additive_of(shared(3, seed), CauchySchwarzReward("reference"))
        additive, actions = sums_of(evaluator), all_joint_actions((3, 3, 3))
        table = additive(actions).mean(axis=1).reshape(3, 3, 3)
        chosen = np.array([1, 2, 0])
        for s in range(3):
            index = [*chosen.tolist()]
            index[s] = slice(None)
            np.testing.assert_allclose(additive.line(chosen, s).mean(axis=1), table[tuple(index)], rtol=1e-12)
        allowed = Allowed(np.ones(9, np.bool_), np.ones((0, 0), np.bool_), np.zeros(9, np.bool_), 3)
        end, reward, trace = additive.ascend(chosen, allowed)
        np.testing.assert_allclose(reward, table[tuple(end)], rtol=1e-12)
        assert trace.best[-1] == reward
        for s in range(3):
            index = [*end.tolist()]
            index[s] = slice(None)
            assert table[tuple(index)].max() <= reward + 1e-8


@pytest.mark.parametrize("reward", [CauchySchwarzReward("reference"), ExpectedLossReward(60.0)])
def test_a_joint_action_has_its_rewards_whatever_was_asked_before(reward: Any) -> None:
    """To the last bit: labels that no scan is another of keep their values from row to row."""
    rng = np.random.default_rng(0)
    for example in (shared(3, 2), single(situation("lmb", 3, 6, KNOWN))):
        additive = sums_of(additive_of(example, reward))
        actions = rng.integers(-1, 3, (60, 3))
        actions[::7] = actions[1::7][: len(actions[::7])]
        each = np.concatenate([additive(actions[i : i + 1]) for i in range(len(actions))])
        np.testing.assert_array_equal(additive(actions), each)


def test_an_ascent_takes_only_what_is_allowed() -> None:
    """A course that may not be taken, and two that may not be taken together."""
    additive = sums_of(additive_of(shared(3, 1), CauchySchwarzReward("reference")))
    table = additive(all_joint_actions((3, 3, 3))).mean(axis=1).reshape(3, 3, 3)
    best = np.unravel_index(table.argmax(), table.shape)
    single_mask, together = np.ones(9, np.bool_), np.ones((9, 9), np.bool_)
    single_mask[best[0]] = False
    together[3 + best[1], 6 + best[2]] = together[6 + best[2], 3 + best[1]] = False
    start = np.array([(best[0] + 1) % 3, (best[1] + 1) % 3, best[2]])
    end, reward, _ = additive.ascend(
        start, Allowed(single_mask, together, np.zeros(len(single_mask), np.bool_), len(start))
    )
    assert end[0] != best[0]
    assert (end[1], end[2]) != (best[1], best[2])
    np.testing.assert_allclose(reward, table[tuple(end)], rtol=1e-12)


@pytest.mark.parametrize(
    "reward", [CauchySchwarzReward("reference"), ExpectedLossReward(60.0), ExpectedLossReward(60.0, 2.0)]
)
def test_no_joint_action_is_better_than_the_bound(reward: Any) -> None:
    """By target, and for the expected loss also by relaxation."""
    for seed in range(8):
        additive = sums_of(additive_of(shared(3, seed), reward))
        best = additive(all_joint_actions((3, 3, 3))).mean(axis=1).max()
        tried = label_upper_bounds(additive, 10**6)
        assert best <= tried.sum() + 1e-9 * abs(best)
        assert np.isinf(label_upper_bounds(additive, 0)).all()
        if isinstance(reward, ExpectedLossReward):
            relaxed = relaxed_bound(additive.table, additive.valuation, additive.cells, additive.prices)
            assert best <= relaxed + 1e-9 * abs(best)


def ospa_of_best_estimates(
    existence: float, missed: float, seen: float, unseen: float, cost: float, undetected: float
) -> float:
    """The mean of max(n, N) times OSPA^p of one label and a Poisson number of undetected targets, without constants.

    The label is reported before it is detected if this is better in the mean. All cases are enumerated.
    """
    others = np.arange(200)
    chances = np.exp(others * np.log(max(undetected, 1e-300)) - undetected - np.cumsum(np.log(np.maximum(others, 1))))

    def mean(num_estimates: int, num_targets: int, error: float) -> float:
        matched = min(num_estimates, num_targets)
        return float(chances @ (cost * np.maximum(num_estimates, num_targets + others) - matched * (cost - error)))

    def of_report(shown: int, missed: float) -> float:
        true = (1.0 - missed) * mean(1, 1, seen) + missed * mean(shown, 1, unseen)
        return existence * (true - mean(0, 0, 0.0)) + (1.0 - existence) * (mean(shown, 0, 0.0) - mean(0, 0, 0.0))

    shown = int(of_report(1, 1.0) <= of_report(0, 1.0))
    constant = (1.0 - existence) * (mean(shown, 0, 0.0) - mean(0, 0, 0.0))
    return of_report(shown, missed) - constant


def plain_loss(
    example: Situation, evaluator: Evaluator, joint: Any, order: float = 1.0, undetected: float = 0.0
) -> float:
    """The expected loss with cutoff 60 m of a joint action, by plain NumPy: one scan of each sensor, at the last step.

    With the detection of the model's own mean over the Gaussian.
    """
    prediction: Any = evaluator.prediction
    total = 0.0
    for i, (mean, cov) in enumerate(zip(prediction.tracks.means, prediction.tracks.covs, strict=True)):
        missed, information = 1.0, np.zeros((4, 4))
        for s, course in enumerate(joint):
            own, pose = example.sensors[s].filter.sensor, evaluator.options[s].courses[course, -1]
            detection = float(own.mean_detection(mean[None], cov[None], pose)[0])
            centre = own.measurement.measure(mean[None], pose)[0]
            _, measured, _ = updated(mean, cov, centre, pose, example.sensors[s], start=mean)
            missed *= 1.0 - detection
            information += detection * (np.linalg.inv(measured) - np.linalg.inv(cov))
        seen = np.linalg.inv(np.linalg.inv(cov) + information / max(1.0 - missed, 1e-300))
        losses = [min(np.sqrt(np.trace(each[:2, :2])), 60.0) ** order for each in (seen, cov)]
        total -= ospa_of_best_estimates(prediction.existence[i], missed, losses[0], losses[1], 60.0**order, undetected)
    return total


# The mean of the last two is by nodes, of which some are beyond the reach.
@pytest.mark.parametrize("steps", [1, 2])
@pytest.mark.parametrize(
    ("order", "parts"),
    [
        (1.0, {}),
        (2.0, {}),
        (0.7, {}),
        (1.0, {"method": "ekf"}),
        (1.0, {"detection": models.soft_sector(0.9, 450.0, range_slope=0.02, hard_limit=True)}),
        (1.0, {"detection": models.soft_sector(0.9, 450.0, 1.0, range_slope=0.02, hard_limit=True)}),
    ],
)
def test_the_expected_loss_is_what_its_formula_says(steps: int, order: float, parts: dict[str, Any]) -> None:
    settings = replace(KNOWN, horizon_steps=steps)
    example = replace(shared(2, 4, **parts), settings=settings)
    assert example.state.time is not None
    last = np.array([example.state.time + steps * settings.horizon_period])
    example = replace(example, sensors=tuple(replace(own, scan_times=last) for own in example.sensors))
    evaluator = additive_of(example, ExpectedLossReward(60.0, order))
    actions = all_joint_actions((3, 3))
    found = evaluator.joint()(actions)[:, 0]
    for joint, value in zip(actions.tolist(), found.tolist(), strict=True):
        np.testing.assert_allclose(value, plain_loss(example, evaluator, joint, order), rtol=1e-9)


@pytest.mark.parametrize("undetected", [0.0, 0.4, 3.0])
def test_a_false_label_may_stand_for_an_undetected_target(undetected: float) -> None:
    """Weak and sure labels, of which some are reported without a detection, among undetected targets."""
    example = replace(shared(2, 4), settings=replace(KNOWN, undetected_target_value=0.0, horizon_steps=1))
    grid = models.CellGrid(models.Region(-500.0, 500.0, -500.0, 500.0), 5, 5)
    for logits in ([-3.0, 0.0, 4.0], [-0.5, 0.5, 1.0]):
        belief = LMB(example.fused.tracks, np.array(logits))
        intensity = UndetectedIntensity.uniform(grid, undetected)
        given = replace(example, beliefs=(belief, belief), fused=belief, undetected=intensity)
        evaluator, actions = additive_of(given, ExpectedLossReward(60.0)), all_joint_actions((3, 3))
        for joint, value in zip(actions.tolist(), evaluator.joint()(actions)[:, 0].tolist(), strict=True):
            wanted = plain_loss(given, evaluator, joint, undetected=undetected)
            np.testing.assert_allclose(value, wanted, rtol=1e-9)
