"""The tables of rewards, sample by sample, against plain loops over the public filter, fusion and divergence."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from control.examples import (
    EXACT_LIMITS,
    SETTINGS,
    A,
    B,
    C,
    Situation,
    cases_of,
    crowded,
    evaluator_of,
    glmb,
    lmb,
    mobile_sensor,
    sample_rewards,
    situation,
)
from control.plain_loop import plain_rewards
from vedette import models
from vedette.control import CauchySchwarzReward, RenyiReward
from vedette.control.pseudo_posterior_rewards import PlainRewards
from vedette.control.search.problem import all_joint_actions
from vedette.densities import GLMB, LMB
from vedette.fusion import Clmb, CmDeltaGlmb, FusionLimits
from vedette.platforms import HeadingPlatform

SEED = 5

pytestmark = pytest.mark.filterwarnings("ignore::vedette.errors.SlowRewardWarning")


@models.model_function("prob_detection")
def certain(state: Any, pose: Any, params: Any) -> float:
    return 1.0


def assert_equals_plain_loop(
    example: Situation, unit_volume: Any = 1.0, *, laid_out: bool = True, least: float = 1e-5
) -> Any:
    """Joint and independent tables are those of the plain loop, by the path expected; returns the joint one."""
    joint, alone = plain_rewards(example, unit_volume, SEED)
    evaluator = evaluator_of(example, CauchySchwarzReward(unit_volume), SEED)
    everyone = range(len(example.sensors))
    np.testing.assert_allclose(sample_rewards(evaluator, everyone, example.fusion), joint, rtol=1e-9, atol=1e-9)
    assert laid_out == (not evaluator.notes)
    for s, expected in enumerate(alone):
        np.testing.assert_allclose(sample_rewards(evaluator, (s,), None), expected, rtol=1e-9, atol=1e-9)
    assert np.ptp(joint, axis=0).max() > least
    return joint


@pytest.mark.lanes
@pytest.mark.parametrize("kind", ["delta", "marginal", "lmb"])
@pytest.mark.parametrize(
    ("num_sensors", "mode", "unit_volume"),
    [(2, "ideal", 1.0), (3, "ideal", "reference"), (2, "expected", 1e6), (2, "sampled", "reference")],
)
def test_tables_equal_the_plain_loop(kind: str, num_sensors: int, mode: Any, unit_volume: Any) -> None:
    settings = replace(SETTINGS, ideal_measurements=mode, num_threads=2)
    assert_equals_plain_loop(situation(kind, num_sensors, settings=settings), unit_volume)


@pytest.mark.parametrize("kind", ["marginal", "lmb"])
def test_a_turning_motion(kind: str) -> None:
    assert_equals_plain_loop(situation(kind, dim=5, seed=1), "reference")


@pytest.mark.parametrize("kind", ["delta", "lmb"])
def test_sensors_of_other_kinds_speeds_and_actions(kind: str) -> None:
    sensors = (
        mobile_sensor(
            kind,
            HeadingPlatform(10.0, (20.0,)),
            measurement=models.bearing_only(),
            noise=models.range_dependent_noise(sigma_bearing=0.01, eta_bearing=1e-5),
            clutter=models.measurement_space_clutter(2.0, [-np.pi], [np.pi]),
            method="ukf",
        ),
        mobile_sensor(
            kind,
            HeadingPlatform(60.0, (-30.0, 30.0, 90.0, 180.0), relative=True),
            measurement=models.position(),
            noise=models.constant_noise([10.0, 20.0]),
            detection=models.limited_range(0.9, 800.0),
            clutter=models.measurement_space_clutter(3.0, [-2000.0, -2000.0], [2000.0, 2000.0]),
            method="ckf",
        ),
        mobile_sensor(kind, HeadingPlatform(30.0, (0.0, 120.0))),
    )
    settings = replace(SETTINGS, ideal_measurements="sampled")
    joint = assert_equals_plain_loop(replace(situation(kind, 3, settings=settings), sensors=sensors), "reference")
    assert joint.shape == (1 * 4 * 2, SETTINGS.num_samples)


def test_only_the_heaviest_prior_hypotheses_are_updated() -> None:
    example = situation("delta", settings=replace(SETTINGS, max_prior_hypotheses=2))
    assert_equals_plain_loop(example, "reference")


def test_caps_of_the_pseudo_updates_are_the_filters_own() -> None:
    # One label set, so that none needs to be kept beyond the caps.
    rng = np.random.default_rng(2)
    limits = replace(EXACT_LIMITS, max_hypotheses=3, min_relative_weight=1e-3, gate_probability=0.9)
    example = situation("delta", settings=replace(SETTINGS, limits=limits))
    beliefs = (glmb([(A, B)] * 4, rng), glmb([(A, B)] * 3, rng))
    example = replace(example, beliefs=beliefs, fused=example.fusion.fuse(beliefs)[0])
    capped = assert_equals_plain_loop(example, "reference")
    free = evaluator_of(replace(example, settings=SETTINGS), CauchySchwarzReward("reference"), SEED)
    assert not np.allclose(sample_rewards(free, (0, 1), example.fusion), capped, rtol=1e-6)


def test_an_lmb_keeps_all_its_labels() -> None:
    example = situation("lmb")
    expected = sample_rewards(evaluator_of(example), (0, 1), example.fusion)
    few = replace(example, settings=replace(SETTINGS, limits=replace(EXACT_LIMITS, max_labels=1)))
    np.testing.assert_array_equal(sample_rewards(evaluator_of(few), (0, 1), example.fusion), expected)


@pytest.mark.parametrize("kind", ["delta", "marginal", "lmb"])
def test_label_sets_that_certain_detection_rules_out(kind: str) -> None:
    example = situation(kind, seed=3, detection=models.DetectionModel(certain))
    assert_equals_plain_loop(example)


@pytest.mark.parametrize(
    ("kind", "changed", "laid_out"),
    [
        ("delta", {"mixture_power": "component_wise"}, False),
        ("delta", {"mixture_power": "quadrature"}, False),
        ("delta", {"weights": (0.0, 1.0)}, True),
        ("delta", {"limits": FusionLimits(max_hypotheses=3)}, False),
        ("delta", {"limits": FusionLimits(max_hypotheses=8)}, True),
        ("lmb", {"mixture_power": "component_wise"}, True),
        ("lmb", {"mixture_power": "quadrature"}, True),
        ("lmb", {"weights": (0.0, 1.0)}, True),
    ],
)
def test_fusions_of_all_sorts(kind: str, changed: dict[str, Any], laid_out: bool) -> None:
    example = situation(kind)
    assert_equals_plain_loop(replace(example, fusion=replace(example.fusion, **changed)), laid_out=laid_out)


@pytest.mark.parametrize("kind", ["marginal", "lmb"])
def test_powers_of_single_gaussians_are_exact(kind: str) -> None:
    example, rng = situation(kind), np.random.default_rng(4)
    beliefs: Any
    if kind == "lmb":
        beliefs = lmb((A, B), rng), lmb((A, B), rng)
    else:
        beliefs = glmb([(), (A,), (A, B)], rng), glmb([(), (A,), (A, B)], rng)
    fusion = replace(example.fusion, mixture_power="component_wise")
    example = replace(example, beliefs=beliefs, fusion=fusion, fused=fusion.fuse(beliefs)[0])
    assert_equals_plain_loop(example, laid_out=True)


@pytest.mark.parametrize("kind", ["delta", "marginal"])
@pytest.mark.parametrize("num_sensors", [2, 3])
@pytest.mark.parametrize("unit_volume", [1.0, "reference"])
def test_glmbs_may_be_fused_to_an_lmb(kind: str, num_sensors: int, unit_volume: Any) -> None:
    example = situation(kind, num_sensors)
    fusion = Clmb(np.arange(1.0, num_sensors + 1.0) / sum(range(1, num_sensors + 1)), "moment_matched")
    example = replace(example, fusion=fusion, fused=fusion.fuse(example.beliefs)[0])
    assert isinstance(example.fused, LMB)
    assert_equals_plain_loop(example, unit_volume)


@pytest.mark.parametrize("labels", [(A,), (A, C), (A, B, C)])
def test_an_lmb_prediction_may_lack_labels_of_glmb_filters(labels: Any) -> None:
    example = replace(
        situation("delta"), fusion=Clmb((0.5, 0.5), "moment_matched"), fused=lmb(labels, np.random.default_rng(3))
    )
    assert_equals_plain_loop(example)


def test_mixtures_of_glmb_filters_are_fused_to_an_lmb_by_the_plain_path() -> None:
    fusion = Clmb((0.4, 0.6), mixture_power="component_wise")
    example = situation("delta")
    example = replace(example, fusion=fusion, fused=fusion.fuse(example.beliefs)[0])
    joint, _ = plain_rewards(example, 1.0, SEED)
    np.testing.assert_allclose(sample_rewards(evaluator_of(example), (0, 1), fusion), joint, rtol=1e-9, atol=1e-9)


def test_a_prediction_may_have_sets_of_weight_zero() -> None:
    example = situation("marginal")
    fused = example.fused
    log_weights = fused.hyp_log_weights.copy()
    log_weights[0] = -np.inf
    log_weights -= np.logaddexp.reduce(log_weights)
    fused = GLMB(fused.tracks, fused.hyp_offsets, fused.hyp_tracks, log_weights)
    assert_equals_plain_loop(replace(example, fused=fused), "reference")


@pytest.mark.parametrize("kind", ["delta", "marginal"])
@pytest.mark.parametrize("most", [1, 2, 3, 4])
def test_a_prediction_may_lack_label_sets_of_the_sensors(kind: str, most: int) -> None:
    """Stand-ins for what a sensor lacks draw on sets that are not compared."""
    example = situation(kind, 3)
    fused, _ = replace(example.fusion, limits=FusionLimits(max_hypotheses=most)).fuse(example.beliefs)
    assert fused.num_hyps == most
    assert_equals_plain_loop(replace(example, fused=fused), "reference")


@pytest.mark.parametrize("labels", [(A,), (C,), (A, C), (B, C)])
def test_a_prediction_may_lack_labels_of_the_sensors(labels: Any) -> None:
    example = situation("lmb", 3)
    assert_equals_plain_loop(replace(example, fused=lmb(labels, np.random.default_rng(3))), "reference")


@pytest.mark.parametrize("kind", ["marginal", "lmb"])
@pytest.mark.parametrize("num_sensors", [1, 2, 3])
def test_the_general_path_gives_the_same_rewards(kind: str, num_sensors: int) -> None:
    example = situation(kind, num_sensors)
    evaluator = evaluator_of(example)
    for which, fusion in ((tuple(range(num_sensors)), example.fusion), ((0,), None)):
        actions = all_joint_actions(tuple(evaluator.joint_shape()[s] for s in which))
        cases = cases_of(evaluator)
        posteriors = [cases.posteriors[s] for s in which]
        general = PlainRewards(
            posteriors,
            evaluator.prediction,
            fusion,
            cases_of(evaluator).reward,
            SETTINGS.num_samples,
            cases_of(evaluator).views,
        )
        laid_out = cases.rewards(which, fusion)
        np.testing.assert_allclose(laid_out(actions), general(actions), rtol=1e-9, atol=1e-9)


class Combination:
    """A reward of the user's own, of power integrals with a K, of normalised densities."""

    exponents = ((0.4, 1.3), (0.0, 0.6), (2.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0))
    unit_volume = 1e4

    def combine(self, z: Any) -> Any:
        crossed, alone, own, update, prediction, product = np.moveaxis(z, -1, 0)
        crossed = crossed - 0.4 * prediction - 1.3 * update
        return crossed + alone - 0.6 * update + own - 2.0 * prediction - 0.3 * (product - prediction - update)


@pytest.mark.parametrize("reward", [RenyiReward(), RenyiReward(0.2), Combination()], ids=["half", "fifth", "own"])
@pytest.mark.parametrize("kind", ["delta", "lmb", "glmbs to lmb", "certain"])
@pytest.mark.parametrize("num_sensors", [1, 2, 3])
def test_rewards_of_power_integrals(reward: Any, kind: str, num_sensors: int) -> None:
    """Laid out and one by one; with certain detection label sets lose all their weight in some cases."""
    detection: dict[str, Any] = {"detection": models.DetectionModel(certain)} if kind == "certain" else {}
    example = situation("lmb" if kind == "lmb" else "delta", num_sensors, seed=3, **detection)
    if kind == "glmbs to lmb":
        clmb = Clmb(example.fusion.weights, "moment_matched")
        example = replace(example, fusion=clmb, fused=clmb.fuse(example.beliefs)[0])
    evaluator = evaluator_of(example, reward)
    if kind == "certain":
        assert any(np.isneginf(own.log_weights).any() for own in cases_of(evaluator).posteriors)
    for which, fusion in ((tuple(range(num_sensors)), example.fusion), ((0,), None)):
        actions = all_joint_actions(tuple(evaluator.joint_shape()[s] for s in which))[-4:]
        cases = cases_of(evaluator)
        posteriors = [cases.posteriors[s] for s in which]
        plain = PlainRewards(
            posteriors, evaluator.prediction, fusion, reward, SETTINGS.num_samples, cases_of(evaluator).views
        )
        np.testing.assert_allclose(cases.rewards(which, fusion)(actions), plain(actions), rtol=1e-9, atol=1e-9)
    assert not evaluator.notes


@pytest.mark.parametrize("most", [1, 3, 300])
def test_a_crowd_that_is_summed_in_part_is_still_laid_out(most: int) -> None:
    """A label that no kept choice has absent, or present, was certain: an infinite reward, or the long way round."""
    example = crowded(18)
    settings = replace(example.settings, limits=replace(example.settings.limits, max_hypotheses=most))
    evaluator = evaluator_of(replace(example, settings=settings))
    assert all(np.isfinite(own.log_weights).all() for own in cases_of(evaluator).posteriors)
    assert np.isfinite(sample_rewards(evaluator, (0, 1), example.fusion)).all()
    assert np.isfinite(sample_rewards(evaluator, (0,), None)).all()
    assert not evaluator.notes


def test_a_subclass_is_asked_itself() -> None:
    class Doubled(CauchySchwarzReward):
        def __call__(self, predicted: Any, updated: Any) -> float:
            return 2.0 * CauchySchwarzReward.__call__(self, predicted, updated)

    class Tripled(CauchySchwarzReward):
        def combine(self, z: Any) -> Any:
            return 3.0 * CauchySchwarzReward.combine(self, z)

    class Fused(CmDeltaGlmb):
        def fuse(self, beliefs: Any, views: Any = None) -> Any:
            return CmDeltaGlmb((1.0,)).fuse(beliefs[:1])

    example = situation("marginal")
    evaluator = evaluator_of(example)
    expected = sample_rewards(evaluator, (0, 1), example.fusion)
    assert not evaluator.notes
    for reward, factor, laid_out in ((Doubled(), 2.0, False), (Tripled(), 3.0, True)):
        other = evaluator_of(example, reward)
        for fusion, rewards in ((example.fusion, expected), (Fused((0.5, 0.5)), None)):
            found = sample_rewards(other, (0, 1), fusion)
            rewards = factor * (sample_rewards(evaluator, (0, 1), fusion) if rewards is None else rewards)
            np.testing.assert_allclose(found, rewards, rtol=1e-9, atol=1e-9)
            if fusion is example.fusion:
                assert laid_out == (not other.notes)
    fused = sample_rewards(evaluator, (0, 1), Fused((0.5, 0.5)))
    first = sample_rewards(evaluator, (0,), None)
    np.testing.assert_allclose(fused, np.repeat(first, 3, axis=0), rtol=1e-9, atol=1e-9)


def test_a_prediction_may_be_certain_of_a_label_that_a_glmb_filter_lacks() -> None:
    """The scale of the prediction's weights says nothing."""
    tracks, rewards = lmb((A, B, C), np.random.default_rng(3)).tracks, []
    for existence_logit in (1.0, np.inf):
        fused = LMB(tracks, np.array([0.0, 0.0, existence_logit]))
        example = replace(situation("delta"), fusion=Clmb((0.5, 0.5), "moment_matched"), fused=fused)
        evaluator = evaluator_of(example)
        assert not any(C in labels for labels in cases_of(evaluator).posteriors[0].sets)
        rewards.append(sample_rewards(evaluator, (0,), None))
    assert all(np.isfinite(values).all() for values in rewards)
