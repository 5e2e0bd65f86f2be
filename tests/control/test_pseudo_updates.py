"""What goes into a decision: samples, ideal measurements, label sets kept beyond the caps."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from control.examples import (
    EXACT_LIMITS,
    POSES,
    SETTINGS,
    cases_of,
    crowded,
    evaluator_of,
    mobile_sensor,
    situation,
)
from control.test_plain_loop import assert_equals_plain_loop
from vedette import models
from vedette.control.pseudo_updates import draw_futures, pseudo_posteriors
from vedette.densities import GLMB, sample_glmb
from vedette.densities.label_sets import label_sets
from vedette.filters import DeltaGlmbFilter
from vedette.kernels.association.marginals import MAX_EXACT_MEASUREMENTS
from vedette.platforms import options_at


@pytest.mark.lanes
def test_every_label_set_keeps_its_heaviest_hypothesis_beyond_the_caps() -> None:
    """With room for one hypothesis only, each label set goes its own way as under a filter with room for one."""
    limits = replace(EXACT_LIMITS, max_hypotheses=1)
    example = situation("delta", seed=1, settings=replace(SETTINGS, limits=limits))
    evaluator = evaluator_of(example)
    for belief, sensor, pose, own in zip(
        example.beliefs, example.sensors, example.poses, cases_of(evaluator).posteriors, strict=True
    ):
        sets, groups = label_sets(belief)
        assert set(own.sets) == set(sets)
        rng = np.random.default_rng(5)
        _, (futures, *_) = draw_futures(example.fused, example.sensors, example.settings, rng=rng)
        actions = sensor.platform.actions(pose)
        for case, (action, sample) in enumerate(np.ndindex(len(actions), SETTINGS.num_samples)):
            course = sensor.platform.course(pose, actions[action], SETTINGS.horizon_times())
            weights, start = {}, 0
            for group, labels in enumerate(sets):
                hyps = np.flatnonzero(groups == group)
                log_weight, end = _alone(belief, hyps, sensor, course, futures, sample, limits)
                weights[labels] = log_weight
                place = own.sets.index(labels)
                start = sum(len(other) for other in own.sets[:place])
                np.testing.assert_allclose(own.means[case, start : start + len(labels)], end.tracks.means, rtol=1e-9)
            total = np.logaddexp.reduce(list(weights.values()))
            expected = [weights[labels] - total for labels in own.sets]
            np.testing.assert_allclose(own.log_weights[case], expected, rtol=1e-9, atol=1e-9)


def _alone(
    belief: GLMB, hyps: Any, sensor: Any, course: Any, futures: Any, sample: int, limits: Any
) -> tuple[float, GLMB]:
    """Log weight and end of one label set's hypotheses, followed by a filter of their own."""
    own = sensor.filter
    immortal = models.TargetModel(own.targets.motion, models.constant_survival(1.0), models.BirthModel.none(4))
    local = DeltaGlmbFilter(immortal, own.sensor, limits)
    chosen = [belief.hyp_tracks[belief.hyp_offsets[h] : belief.hyp_offsets[h + 1]].tolist() for h in hyps]
    total = float(np.logaddexp.reduce(belief.hyp_log_weights[hyps]))
    at = GLMB.from_hypotheses(belief.tracks, chosen, np.exp(belief.hyp_log_weights[hyps] - total))
    targets = slice(futures.offsets[sample], futures.offsets[sample + 1])
    for h, pose in enumerate(course):
        states = futures.states[h, targets]
        seen = own.sensor.detection.prob(states, pose) >= SETTINGS.detection_threshold
        scan = own.sensor.measurement.measure(states[seen], pose)
        at, info = local.step(at, scan, pose, SETTINGS.horizon_period, h + 1, rng=np.random.default_rng(0))
        total += info.log_likelihood
    return total, at


def test_all_sensors_are_told_of_the_same_targets() -> None:
    example = situation("delta", 3)
    _, futures = draw_futures(example.fused, example.sensors, SETTINGS, rng=np.random.default_rng(9))
    samples = sample_glmb(example.fused, SETTINGS.num_samples, rng=np.random.default_rng(9))
    for one in futures:
        np.testing.assert_array_equal(one.offsets, samples.offsets)
        np.testing.assert_array_equal(one.states, futures[0].states)
    assert not np.array_equal(futures[0].uniforms, futures[1].uniforms)
    # No noise on the way.
    moved = samples.states.copy()
    for states in futures[0].states:
        moved[:, :2] += SETTINGS.horizon_period * moved[:, 2:]
        np.testing.assert_allclose(states, moved)


@pytest.mark.parametrize("kind", ["marginal", "lmb"])
@pytest.mark.parametrize("mode", ["ideal", "expected", "sampled"])
def test_an_action_is_updated_alike_whatever_the_others_are(kind: str, mode: Any) -> None:
    settings = replace(SETTINGS, ideal_measurements=mode)
    example = situation(kind, settings=settings)
    labels, (futures, *_) = draw_futures(example.fused, example.sensors, settings, rng=np.random.default_rng(2))
    belief, sensor = example.beliefs[0], example.sensors[0]
    courses = options_at("platform", sensor.platform, example.poses[0], settings.horizon_times()).courses
    always = np.ones((len(courses), settings.horizon_steps), bool)
    together = pseudo_posteriors(belief, sensor, courses, labels, futures, settings, always)
    alone = pseudo_posteriors(belief, sensor, courses[1:2], labels, futures, settings, always[1:2])
    cases = slice(SETTINGS.num_samples, 2 * SETTINGS.num_samples)
    for name in ("log_weights", "means", "covs"):
        np.testing.assert_array_equal(getattr(together, name)[cases], getattr(alone, name))


@pytest.mark.parametrize("mode", ["ideal", "expected"])
def test_a_target_is_seen_with_or_above_its_detection_probability(mode: Any) -> None:
    """Existence rises where the one target is seen, and falls where it is not."""
    settings = replace(SETTINGS, ideal_measurements=mode, num_samples=40, detection_threshold=0.6, horizon_steps=1)
    for probability, share in ((0.55, {"ideal": 0.0, "expected": 0.55}), (0.65, {"ideal": 1.0, "expected": 0.65})):
        sensor = mobile_sensor("lmb", detection=models.constant_detection(probability))
        example = situation("lmb", settings=settings)
        certain = type(example.fused)(example.fused.tracks, np.full(example.fused.tracks.num_tracks, 40.0))
        labels, (futures,) = draw_futures(certain, (sensor,), settings, rng=np.random.default_rng(0))
        own = pseudo_posteriors(
            example.beliefs[0], sensor, POSES[:1, np.newaxis], labels, futures, settings, np.ones((1, 1), bool)
        )
        rose = own.existence_logits > example.beliefs[0].existence_logit
        assert abs(rose.mean() - share[mode]) < 0.15


@pytest.mark.parametrize("num_targets", [5, 16])
def test_targets_may_contend_for_more_measurements_than_there_was_room_for(num_targets: int) -> None:
    example = crowded(num_targets)
    _, (futures, *_) = draw_futures(example.fused, example.sensors, example.settings, rng=np.random.default_rng(5))
    sizes = np.diff(futures.offsets)
    if num_targets > MAX_EXACT_MEASUREMENTS:
        assert sizes.min() <= MAX_EXACT_MEASUREMENTS < sizes.max()
    assert_equals_plain_loop(example)
