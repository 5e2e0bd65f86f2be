"""The labelled filters with nothing cut off, against the enumeration of every death, birth and association."""

from __future__ import annotations

import dataclasses
import functools
import math

import numpy as np
import pytest
from scipy.special import logit

import reference
from filters.examples import (
    DT,
    SCENES,
    Scene,
    assert_same_glmb,
    assert_same_lmb,
    assert_same_mixtures,
    linear_scene,
    plain_glmb,
    plain_lmb,
    together,
)
from reference import glmb as oracle
from vedette.densities import GLMB, LMB, TrackTable, cardinality_distribution, marginalise
from vedette.filters import Gibbs, Limits
from vedette.kernels.base.compile import JIT_ENABLED

pytestmark = pytest.mark.lanes

every_scene = pytest.mark.parametrize("name", SCENES)
Steps = list[tuple[oracle.Hypotheses, float]]


def log_density(scene: Scene, total: float, scan: reference.Floats) -> float:
    """From the sum of weights relative to clutter to the log density of the scan."""
    return math.log(total) + sum(math.log(scene.plain.clutter_intensity(z)) for z in scan) - scene.sensor.clutter.rate


def enumerate_scene(scene: Scene, hypotheses: oracle.Hypotheses, num_steps: int = 3) -> Steps:
    """Posterior and log-likelihood after each scan, by the oracle."""
    found = []
    for step, scan in enumerate(scene.scans[:num_steps], 1):
        hypotheses, total = oracle.step(hypotheses, scene.plain_births(step), list(scan), scene.plain)
        found.append((hypotheses, log_density(scene, total, scan)))
    return found


@functools.cache
def enumerated(name: str) -> Steps:
    """From no target on."""
    return enumerate_scene(SCENES[name](), oracle.no_target())


def assert_same_weights(found: reference.Glmb, wanted: reference.Glmb, tolerance: float) -> None:
    """Of label sets."""
    weights, expected = oracle.label_set_weights(found), oracle.label_set_weights(wanted)
    for labels in weights.keys() | expected.keys():
        assert weights.get(labels, 0.0) == pytest.approx(expected.get(labels, 0.0), abs=tolerance)


@every_scene
def test_ranked_equals_enumeration(name):
    scene = SCENES[name]()
    tracker, rng = scene.glmb_filter(), np.random.default_rng(0)
    belief = tracker.initial()
    for step, (expected, log_likelihood) in enumerate(enumerated(name)):
        belief, info = tracker.step(belief, scene.scans[step], scene.pose, DT, step + 1, rng=rng)
        belief.validate()
        assert_same_glmb(plain_glmb(belief), oracle.as_glmb(expected))
        assert info.log_likelihood == pytest.approx(log_likelihood, abs=1e-10)
        assert info.num_hypotheses == belief.num_hyps == len(expected)
        assert not info.search_truncated
        assert np.all(np.diff(belief.hyp_log_weights) <= 0.0)
        sizes = np.zeros(1 + max(len(tracks) for _, tracks in expected.values()))
        for weight, tracks in expected.values():
            sizes[len(tracks)] += weight
        np.testing.assert_allclose(cardinality_distribution(belief)[: len(sizes)], sizes, rtol=0, atol=1e-10)


@pytest.mark.skipif(not JIT_ENABLED, reason="millions of sweeps in plain Python")
@every_scene
def test_plenty_of_gibbs_samples_are_the_enumeration(name):
    """What a sampler never came across in so many sweeps has next to no weight, and what it found has its own."""
    scene = SCENES[name]()
    tracker, rng = scene.glmb_filter(assignment=Gibbs(1_000_000)), np.random.default_rng(0)
    belief = tracker.initial()
    for step, (expected, log_likelihood) in enumerate(enumerated(name)):
        belief, info = tracker.step(belief, scene.scans[step], scene.pose, DT, step + 1, rng=rng)
        assert_same_weights(plain_glmb(belief), oracle.as_glmb(expected), tolerance=5e-5)
        assert info.log_likelihood == pytest.approx(log_likelihood, abs=1e-4)


@pytest.mark.skipif(not JIT_ENABLED, reason="two million sweeps in plain Python")
def test_gibbs_finds_every_hypothesis_of_an_even_scene():
    scene = linear_scene(existence=0.5, prob_survival=0.5, prob_detection=0.6)  # no hypothesis is rare
    tracker = scene.glmb_filter(assignment=Gibbs(2_000_000))
    rng, belief = np.random.default_rng(3), tracker.initial()
    for step, (expected, log_likelihood) in enumerate(enumerate_scene(scene, oracle.no_target(), 2)):
        belief, info = tracker.step(belief, scene.scans[step], scene.pose, DT, step + 1, rng=rng)
        assert_same_glmb(plain_glmb(belief), oracle.as_glmb(expected))
        assert info.log_likelihood == pytest.approx(log_likelihood, abs=1e-10)
    few = scene.glmb_filter(assignment=Gibbs(20_000))
    for scan in (np.empty((0, 2)), np.array([[115.0, 55.0]])):
        hypotheses, _ = oracle.step(oracle.no_target(), scene.plain_births(1), list(scan), scene.plain)
        found, _ = few.step(few.initial(), scan, scene.pose, DT, 1, rng=rng)
        assert_same_glmb(plain_glmb(found), oracle.as_glmb(hypotheses))


def prior_of_mixtures(scene: Scene) -> tuple[GLMB, oracle.Hypotheses]:
    """Three hypotheses over two labels, one of them with two histories, every track a mixture."""
    rng, dim = np.random.default_rng(7), scene.motion.state_dim
    offsets = np.array([[10.0, 5.0, 2.0, 1.0, 0.03], [-5.0, -5.0, -3.0, 4.0, -0.04], [0.0, 20.0, 1.0, 1.0, 0.02]])
    mixtures = []
    for centre in offsets[:, :dim] + scene.births.means[0] * (np.arange(dim) < 2):
        means = centre + rng.normal(size=(2, dim)) * np.array([15.0, 15.0, 3.0, 3.0, 0.02])[:dim]
        roots = rng.normal(size=(2, dim, dim)) * 0.2 + np.eye(dim)
        scale = np.diag([12.0, 10.0, 3.0, 3.0, 0.03][:dim])
        mixtures.append((np.array([0.3, 0.7]), means, scale @ roots @ roots.transpose(0, 2, 1) @ scale))
    labels = [(-2, 0), (-1, 1), (-2, 0)]
    members: list[tuple[list[int], float]] = [([0, 1], 0.5), ([2], 0.3), ([], 0.2)]
    tracks = TrackTable.from_mixtures(labels, mixtures)
    glmb = GLMB.from_hypotheses(tracks, [own for own, _ in members], [weight for _, weight in members])
    # Histories that tell the two versions of the first label apart.
    plain = [[(float(w), m, c) for w, m, c in zip(*mixture, strict=True)] for mixture in mixtures]
    hypotheses: oracle.Hypotheses = {
        tuple((labels[t], (int(t == 2),)) for t in own): (weight, {labels[t]: plain[t] for t in own})
        for own, weight in members
    }
    return glmb, hypotheses


@every_scene
@pytest.mark.parametrize("is_empty", [False, True])
def test_a_prior_of_mixtures(name, is_empty):
    scene = SCENES[name]()
    if is_empty:
        scene = dataclasses.replace(scene, scans=[np.empty((0, 2))])
    tracker, rng = scene.glmb_filter(), np.random.default_rng(0)
    belief, hypotheses = prior_of_mixtures(scene)
    ((expected, log_likelihood),) = enumerate_scene(scene, hypotheses, 1)
    belief, info = tracker.step(belief, scene.scans[0], scene.pose, DT, 1, rng=rng)
    belief.validate()
    assert_same_glmb(plain_glmb(belief), oracle.as_glmb(expected))
    assert info.log_likelihood == pytest.approx(log_likelihood, abs=1e-10)


@every_scene
def test_marginalised_keeps_the_weight_of_each_label_set(name):
    """From a prior that has been marginalised before, and with one component a track, too."""
    scene = SCENES[name]()
    marginalised, plain = scene.glmb_filter(marginalised=True), scene.glmb_filter()
    rng, belief = np.random.default_rng(0), marginalised.initial()
    few = dataclasses.replace(marginalised, limits=dataclasses.replace(Limits.none(), max_components=1))
    for step, scan in enumerate(scene.scans, 1):
        arguments = scan, scene.pose, DT, step
        wanted, info = plain.step(belief, *arguments, rng=rng)
        short, _ = few.step(belief, *arguments, rng=rng)
        belief, found = marginalised.step(belief, *arguments, rng=rng)
        belief.validate()
        assert belief.is_marginalised
        assert found.log_likelihood == info.log_likelihood
        assert_same_weights(plain_glmb(belief), plain_glmb(wanted), 1e-10)
        assert_same_weights(plain_glmb(short), plain_glmb(wanted), 1e-10)
        if step == 1:
            assert_same_weights(plain_glmb(belief), oracle.as_glmb(enumerated(name)[0][0]), 1e-10)
        # With nothing merged a track's mixture is that of the label's tracks in the hypotheses of the set.
        pooled = marginalise(wanted, max_components=10**6, log_min_weight=-math.inf, merge_distance=0.0)
        pools = {tuple(sorted(tracks)): tracks for _, tracks in plain_glmb(pooled)}
        for _, tracks in plain_glmb(belief):
            for label, mixture in tracks.items():
                assert_same_mixtures(together(mixture), together(pools[tuple(sorted(tracks))][label]))


@every_scene
def test_lmb_equals_enumeration(name):
    scene = SCENES[name]()
    tracker, rng = scene.lmb_filter(), np.random.default_rng(0)
    belief, plain = tracker.initial(), reference.Lmb()
    for step, scan in enumerate(scene.scans, 1):
        plain, total = oracle.lmb_step(plain, scene.plain_births(step), list(scan), scene.plain)
        plain = {label: (existence, together(mixture)) for label, (existence, mixture) in plain.items()}
        belief, info = tracker.step(belief, scan, scene.pose, DT, step, rng=rng)
        belief.validate()
        assert_same_lmb(belief, plain)
        assert info.log_likelihood == pytest.approx(log_density(scene, total, scan), abs=1e-10)
        assert info.num_inexact_clusters == 0
        assert info.dropped_existence == 0.0


def test_certain_and_impossible_tracks():
    scene = linear_scene()
    tracker, rng = scene.lmb_filter(), np.random.default_rng(0)
    tracks = TrackTable.from_gaussians([[-2, 0], [-1, 0]], scene.births.means, scene.births.covs)
    belief = LMB(tracks, np.array([math.inf, -math.inf]))
    posterior, _ = tracker.step(belief, scene.scans[0], scene.pose, DT, 5, rng=rng)
    posterior.validate()
    certain = {(-2, 0): (1.0, plain_lmb(belief)[-2, 0][1])}
    expected, _ = oracle.lmb_step(certain, {}, list(scene.scans[0]), scene.plain)
    got = plain_lmb(posterior)
    assert got[-2, 0][0] == pytest.approx(expected[-2, 0][0], abs=1e-12)
    assert got[-1, 0][0] == 0.0


def test_caps_drop_and_count():
    scene = linear_scene()
    rng = np.random.default_rng(0)
    limits = Limits(min_existence=0.0, max_labels=1, max_components=2, merge_distance=0.0, min_component_weight=0.0)
    exact, _ = scene.lmb_filter().step(scene.lmb_filter().initial(), scene.scans[0], scene.pose, DT, 1, rng=rng)
    capped, info = scene.lmb_filter(limits=limits).step(
        scene.lmb_filter().initial(), scene.scans[0], scene.pose, DT, 1, rng=rng
    )
    capped.validate()
    order = np.argsort(-exact.existence)
    assert capped.tracks.labels.tolist() == exact.tracks.labels[order[:1]].tolist()
    assert capped.existence[0] == pytest.approx(exact.existence[order[0]], abs=1e-5)
    assert info.dropped_existence == pytest.approx(exact.existence[order[1]], abs=1e-5)
    assert len(capped.tracks.log_weights) == 2
    threshold = float(np.mean(exact.existence))
    few, few_info = scene.lmb_filter(limits=Limits(min_existence=threshold)).step(
        scene.lmb_filter().initial(), scene.scans[0], scene.pose, DT, 1, rng=rng
    )
    least = min(threshold, 0.1 * float(scene.targets.birth.existence.min()))  # births are weaker than the threshold
    assert np.all(few.existence_logit >= logit(least))
    assert few.existence.sum() + few_info.dropped_existence == pytest.approx(exact.existence.sum(), abs=1e-5)
