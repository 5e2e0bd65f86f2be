"""The arithmetic average: against plain NumPy, labels that a sensor lacks, mixtures within their caps."""

from __future__ import annotations

import numpy as np
import pytest

from densities.examples import random_glmb, random_lmb
from fusion.sights import LABELS, belief, informed, views
from vedette.densities import as_lmb, track_moments
from vedette.fusion import ArithmeticAverage, FusionLimits
from vedette.models import constant_detection

WIDE = FusionLimits(log_min_component_weight=-np.inf, merge_distance=0.0, max_components=1000)


@pytest.mark.parametrize("seed", range(8))
def test_existence_and_density_are_the_weighted_sums(seed: int) -> None:
    rng = np.random.default_rng(seed)
    num = int(rng.integers(1, 5))
    beliefs, weights = [random_lmb(rng, 4) for _ in range(num)], rng.dirichlet(np.ones(num))
    fused, info = ArithmeticAverage(weights, limits=WIDE).fuse(beliefs)
    fused.validate()
    expected: dict[tuple[int, ...], list[tuple[float, np.ndarray, np.ndarray]]] = {}
    for weight, own in zip(weights, beliefs, strict=True):
        for label, r, m, p in zip(own.tracks.labels.tolist(), own.existence, *track_moments(own.tracks), strict=True):
            expected.setdefault(tuple(label), []).append((weight * r, m, p))
    assert [tuple(label) for label in fused.tracks.labels.tolist()] == sorted(expected)
    means, covs = track_moments(fused.tracks)
    for i, label in enumerate(sorted(expected)):
        parts = expected[label]
        r = sum(part[0] for part in parts)
        assert fused.existence[i] == pytest.approx(r, rel=1e-12)
        mean = sum(part[0] * part[1] for part in parts) / r
        cov = sum(w * (p + np.outer(m - mean, m - mean)) for w, m, p in parts) / r
        np.testing.assert_allclose(means[i], mean, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(covs[i], cov, rtol=1e-9, atol=1e-9)
    assert info.log_normaliser == info.discarded_weight == 0.0


def test_one_belief_is_returned_and_certainty_is_kept_exactly() -> None:
    rng = np.random.default_rng(3)
    own = belief((1.0, 1.0 - 1e-14, 1e-200), rng)
    fused, _ = ArithmeticAverage((0.5, 0.5)).fuse([own, own])
    np.testing.assert_allclose(fused.existence_logit, own.existence_logit, rtol=1e-12)
    np.testing.assert_allclose(fused.tracks.means, own.tracks.means, rtol=1e-12)


def test_mixtures_are_reduced_by_the_caps_and_glmbs_converted() -> None:
    rng = np.random.default_rng(4)
    beliefs = [random_glmb(rng, 3, 10, 2) for _ in range(3)]
    limits = FusionLimits(max_components=2)
    fused, _ = ArithmeticAverage((0.2, 0.3, 0.5), limits=limits).fuse(beliefs)
    fused.validate()
    assert np.diff(fused.tracks.offsets).max() <= 2
    rs = [dict(zip(map(tuple, b.tracks.labels.tolist()), b.existence, strict=True)) for b in map(as_lmb, beliefs)]
    for label, r in zip(fused.tracks.labels.tolist(), fused.existence, strict=True):
        shares = zip((0.2, 0.3, 0.5), rs, strict=True)
        assert r == pytest.approx(sum(weight * own.get(tuple(label), 0.0) for weight, own in shares))


def test_by_views_a_label_is_averaged_over_those_that_see_it() -> None:
    rng = np.random.default_rng(5)
    beliefs = [belief((0.9, 0.8), rng, (0, 1)), belief((0.6, 0.4), rng, (0, 2))]
    seen = views([0.9, constant_detection(0.3)])
    fused, info = ArithmeticAverage((0.5, 0.5), field_of_view_weighting=True).fuse(beliefs, seen)
    assert fused.tracks.labels.tolist() == [list(LABELS[0]), list(LABELS[2])]  # who sees the second lacks it
    np.testing.assert_allclose(fused.existence, [float(informed(0.9, 0.3) @ np.array([0.9, 0.6])), 0.4], rtol=1e-12)
    assert info.missing_labels == (0, 1)
