"""Classes of targets in every fusion: as factors of the products that the same beliefs without classes give."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.special import logsumexp

from fusion.examples import A, B, by_label_set, full_glmbs, lmb
from fusion.sights import views
from vedette.densities import GLMB, LMB, FactoredGLMB, as_lmb, marks_of
from vedette.densities.tracks import merged_tracks
from vedette.errors import InputError
from vedette.fusion import ArithmeticAverage, Clmb, CmDeltaGlmb, ParallelUpdate
from vedette.fusion.rebasing import rebase

WEIGHTS = np.array([0.3, 0.7])


def with_classes(belief: Any, rng: np.random.Generator, num_classes: int = 3) -> Any:
    probs = rng.dirichlet(np.ones(num_classes), len(belief.tracks.log_weights))
    return replace(belief, tracks=replace(belief.tracks, marks=marks_of(np.log(probs))))


def lmbs(seed: int, num: int = 2) -> tuple[list[LMB], list[LMB]]:
    """Beliefs of two labels, without and with classes."""
    rng = np.random.default_rng(seed)
    plain = [lmb((A, B), rng.uniform(0.3, 0.9, 2), rng) for _ in range(num)]
    return plain, [with_classes(belief, rng) for belief in plain]


def assert_fused(fused: LMB, plain: LMB, log_products: Any) -> None:
    """log_products: (num_labels, num_classes) log of the product of the class probabilities."""
    factors = logsumexp(log_products, axis=1)
    np.testing.assert_allclose(fused.existence_logit, plain.existence_logit + factors, rtol=1e-9)
    np.testing.assert_allclose(fused.tracks.log_class_probs, log_products - factors[:, None], atol=1e-9)
    np.testing.assert_allclose(fused.tracks.means, plain.tracks.means)


@pytest.mark.parametrize("seed", range(5))
def test_covariance_intersection_of_lmbs(seed: int) -> None:
    plain, own = lmbs(seed)
    products = np.tensordot(WEIGHTS, [belief.tracks.log_class_probs for belief in own], 1)
    assert_fused(Clmb(WEIGHTS).fuse(own)[0], Clmb(WEIGHTS).fuse(plain)[0], products)


@pytest.mark.parametrize("seed", range(5))
def test_covariance_intersection_of_glmbs(seed: int) -> None:
    """The weight of a label set has the factor of each of its labels, with the densities that the set has."""
    rng = np.random.default_rng(seed)
    plain = full_glmbs(2, rng)
    own = [with_classes(belief, rng) for belief in plain]
    fused, expected = (by_label_set(CmDeltaGlmb(WEIGHTS).fuse(beliefs)[0]) for beliefs in (own, plain))
    logs = {}
    for labels in expected:
        products = [
            np.tensordot(WEIGHTS, [classes_of(belief, labels)[i] for belief in own], 1) for i in range(len(labels))
        ]
        logs[labels] = np.log(expected[labels][0]) + sum(logsumexp(product) for product in products)
    total = logsumexp(list(logs.values()))
    for labels, log in logs.items():
        assert fused[labels][0] == pytest.approx(np.exp(log - total), rel=1e-9)


def classes_of(belief: GLMB, labels: tuple[Any, ...]) -> Any:
    """Log class probabilities of each label in a label set."""
    for first, last in pairwise(belief.hyp_offsets.tolist()):
        tracks = belief.hyp_tracks[first:last]
        if tuple(map(tuple, belief.tracks.labels[tracks].tolist())) == labels:
            return belief.tracks.log_class_probs[tracks]
    raise AssertionError


@pytest.mark.parametrize("seed", range(5))
def test_arithmetic_average(seed: int) -> None:
    _, own = lmbs(seed)
    fused, _ = ArithmeticAverage(WEIGHTS).fuse(own)
    present = WEIGHTS[:, None] * [belief.existence for belief in own]
    expected = (present[..., None] * np.exp([belief.tracks.log_class_probs for belief in own])).sum(0)
    found = np.exp(merged_tracks(fused.tracks).marks[:, 1:])
    np.testing.assert_allclose(found, expected / present.sum(0)[:, None], rtol=1e-9)


def predicted(belief: Any) -> Any:
    """The belief, wider, as the common prediction of posteriors."""
    wide = replace(belief, tracks=replace(belief.tracks, covs=3.0 + belief.tracks.covs))
    return views([0.9, 0.9], prediction=wide)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("of_kind", [as_lmb, FactoredGLMB.of])
def test_parallel_update(of_kind: Any, seed: int) -> None:
    """Each sensor's likelihood of a class is its probability over the predicted one."""
    plain, own = lmbs(seed, 3)
    expected, _ = ParallelUpdate().fuse(list(map(of_kind, plain[1:])), predicted(of_kind(plain[0])))
    fused, _ = ParallelUpdate().fuse(list(map(of_kind, own[1:])), predicted(of_kind(own[0])))
    logs = [belief.tracks.log_class_probs for belief in own]
    assert_fused(as_lmb(fused), as_lmb(expected), logs[1] + logs[2] - logs[0])


@pytest.mark.parametrize("seed", range(3))
def test_parallel_update_of_labels_in_one_factor(seed: int) -> None:
    """Posteriors with the class probabilities of the prediction fuse as those without classes, and keep them."""
    rng, probs = np.random.default_rng(seed), np.log([0.2, 0.8])
    plain, joint = FactoredGLMB.of(lmb((A, B), [0.5, 0.6], rng)), FactoredGLMB.of(full_glmbs(1, rng)[0])

    def classified(belief: Any) -> Any:
        tiled = np.tile(probs, (len(belief.tracks.log_weights), 1))
        return replace(belief, tracks=replace(belief.tracks, marks=marks_of(tiled)))

    expected, _ = ParallelUpdate().fuse([joint, plain], predicted(plain))
    fused, _ = ParallelUpdate().fuse([classified(joint), classified(plain)], predicted(classified(plain)))
    np.testing.assert_allclose(as_lmb(fused).existence, as_lmb(expected).existence, rtol=1e-9)
    np.testing.assert_allclose(as_lmb(fused).tracks.log_class_probs, np.tile(probs, (2, 1)), atol=1e-9)


def test_rebasing_applies_what_a_scan_said_of_the_class() -> None:
    plain, own = lmbs(1, 3)
    found, expected = rebase(own[0], own[1], own[2]), rebase(plain[0], plain[1], plain[2])
    logs = [belief.tracks.log_class_probs for belief in own]
    assert_fused(found, expected, logs[2] + logs[0] - logs[1])


def test_sensors_with_other_classes_are_refused() -> None:
    plain, own = lmbs(2)
    for rule in (Clmb(WEIGHTS), ArithmeticAverage(WEIGHTS)):
        with pytest.raises(InputError, match=r"beliefs: expected one number of classes at all sensors; got \[0, 3\]"):
            rule.fuse([plain[0], own[1]])


def test_a_class_that_is_impossible_before_and_after_a_scan_stays_so() -> None:
    plain, own = lmbs(3, 3)

    def without_first(belief: LMB) -> LMB:
        probs = np.exp(belief.tracks.log_class_probs)
        probs[:, 0] = 0.0
        with np.errstate(divide="ignore"):
            logs = np.log(probs / probs.sum(axis=1, keepdims=True))
        return replace(belief, tracks=replace(belief.tracks, marks=marks_of(logs)))

    own = [without_first(belief) for belief in own]
    fused = [as_lmb(ParallelUpdate().fuse(own[1:], predicted(own[0]))[0]), rebase(own[0], own[1], own[2])]
    expected = [as_lmb(ParallelUpdate().fuse(plain[1:], predicted(plain[0]))[0]), rebase(plain[0], plain[1], plain[2])]
    logs = [belief.tracks.log_class_probs[:, 1:] for belief in own]
    for found, unclassified, log_products in zip(
        fused, expected, (logs[1] + logs[2] - logs[0], logs[2] + logs[0] - logs[1]), strict=True
    ):
        factors = logsumexp(log_products, axis=1)
        logs_of_first, logs_of_others = np.split(found.tracks.log_class_probs, [1], axis=1)
        assert (logs_of_first == -np.inf).all()
        np.testing.assert_allclose(logs_of_others, log_products - factors[:, None], atol=1e-9)
        np.testing.assert_allclose(found.existence_logit, unclassified.existence_logit + factors, rtol=1e-9)
