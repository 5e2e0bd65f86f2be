"""The delta-GLMB filter with nothing cut off, against the enumeration of every hypothesis."""

from __future__ import annotations

import math

import numpy as np
import pytest

from filters.examples import (
    DT,
    SCENES,
    Scene,
    assert_same_glmb,
    assert_same_mixtures,
    linear_scene,
    plain_glmb,
    together,
)
from reference import glmb as oracle
from vedette.densities import GLMB, TrackTable
from vedette.filters import Gibbs
from vedette.kernels.base.compile import JIT_ENABLED

pytestmark = pytest.mark.lanes


def enumerate_scene(scene: Scene, hypotheses: oracle.Hypotheses, num_steps: int = 3):
    """Posterior and log-likelihood after each scan, by the oracle."""
    for step, scan in enumerate(scene.scans[:num_steps], 1):
        hypotheses, total = oracle.step(hypotheses, scene.plain_births(step), list(scan), scene.plain)
        log_clutter = sum(math.log(scene.plain.clutter_intensity(z)) for z in scan)
        yield hypotheses, math.log(total) + log_clutter - scene.sensor.clutter.rate


@pytest.mark.parametrize("name", SCENES)
def test_ranked_equals_enumeration(name):
    scene = SCENES[name]()
    tracker, rng = scene.glmb_filter(), np.random.default_rng(0)
    belief = tracker.initial()
    for step, (expected, log_likelihood) in enumerate(enumerate_scene(scene, oracle.no_target())):
        belief, info = tracker.step(belief, scene.scans[step], scene.pose, DT, step + 1, rng=rng)
        belief.validate()
        assert_same_glmb(plain_glmb(belief), oracle.as_glmb(expected))
        assert info.log_likelihood == pytest.approx(log_likelihood, abs=1e-10)
        assert info.num_hypotheses == belief.num_hyps == len(expected)
        assert np.all(np.diff(belief.hyp_log_weights) <= 0.0)


@pytest.mark.skipif(not JIT_ENABLED, reason="two million sweeps in plain Python")
def test_gibbs_with_plenty_of_samples_equals_enumeration():
    scene = linear_scene(existence=0.5, prob_survival=0.5, prob_detection=0.6)  # no hypothesis is rare
    tracker = scene.glmb_filter(assignment=Gibbs(2_000_000))
    rng, belief = np.random.default_rng(3), tracker.initial()
    for step, (expected, log_likelihood) in enumerate(enumerate_scene(scene, oracle.no_target(), 2)):
        belief, info = tracker.step(belief, scene.scans[step], scene.pose, DT, step + 1, rng=rng)
        assert_same_glmb(plain_glmb(belief), oracle.as_glmb(expected))
        assert info.log_likelihood == pytest.approx(log_likelihood, abs=1e-10)


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
    tracks = TrackTable.from_mixtures([[-2, 0], [-1, 1], [-2, 0]], mixtures)
    glmb = GLMB.from_hypotheses(tracks, [[0, 1], [2], []], [0.5, 0.3, 0.2])
    # Histories that tell the two versions of the first label apart.
    names: dict[int, oracle.History] = {0: (0,), 1: (0,), 2: (1,)}
    labels = [(-2, 0), (-1, 1), (-2, 0)]
    plain = [[(float(w), m, c) for w, m, c in zip(*mixture, strict=True)] for mixture in mixtures]
    hypotheses: oracle.Hypotheses = {
        tuple((labels[t], names[t]) for t in members): (weight, {labels[t]: plain[t] for t in members})
        for members, weight in (((0, 1), 0.5), ((2,), 0.3), ((), 0.2))
    }
    return glmb, hypotheses


@pytest.mark.parametrize("name", SCENES)
def test_a_prior_of_mixtures(name):
    scene = SCENES[name]()
    tracker, rng = scene.glmb_filter(), np.random.default_rng(0)
    belief, hypotheses = prior_of_mixtures(scene)
    for step, (expected, log_likelihood) in enumerate(enumerate_scene(scene, hypotheses, 1)):
        belief, info = tracker.step(belief, scene.scans[step], scene.pose, DT, step + 1, rng=rng)
        belief.validate()
        assert_same_glmb(plain_glmb(belief), oracle.as_glmb(expected))
        assert info.log_likelihood == pytest.approx(log_likelihood, abs=1e-10)


def test_no_scan_to_speak_of():
    scene = linear_scene()
    tracker, rng = scene.glmb_filter(), np.random.default_rng(0)
    belief, hypotheses = prior_of_mixtures(scene)
    expected, total = oracle.step(hypotheses, scene.plain_births(1), [], scene.plain)
    belief, info = tracker.step(belief, [], scene.pose, DT, 1, rng=rng)
    assert_same_glmb(plain_glmb(belief), oracle.as_glmb(expected))
    assert info.log_likelihood == pytest.approx(math.log(total) - scene.sensor.clutter.rate, abs=1e-10)


def test_marginalised_keeps_the_weight_of_each_label_set():
    scene = linear_scene()
    tracker, rng = scene.glmb_filter(marginalised=True), np.random.default_rng(0)
    expected, _ = oracle.step(oracle.no_target(), scene.plain_births(1), list(scene.scans[0]), scene.plain)
    posterior, _ = tracker.step(tracker.initial(), scene.scans[0], scene.pose, DT, 1, rng=rng)
    posterior.validate()
    assert posterior.is_marginalised
    weights = oracle.label_set_weights(plain_glmb(posterior))
    assert weights == pytest.approx(oracle.label_set_weights(oracle.as_glmb(expected)), abs=1e-10)
    # With nothing merged a track's mixture is that of the label's tracks in the hypotheses of the set.
    pools: dict = {}
    for weight, tracks in oracle.as_glmb(expected):
        for label, mixture in tracks.items():
            pool = pools.setdefault((tuple(sorted(tracks)), label), [])
            pool.extend((weight * w, mean, cov) for w, mean, cov in mixture)
    for _, tracks in plain_glmb(posterior):
        for label, mixture in tracks.items():
            assert_same_mixtures(mixture, oracle.normalised(together(pools[tuple(sorted(tracks)), label]))[1])
