"""CLMB fusion: properties, labels that a sensor lacks, bad input."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import logit

from densities.examples import random_glmb
from fusion.examples import A, B, lmb, mixture_track
from vedette.densities import LMB, as_lmb
from vedette.fusion import Clmb

HALVES = (0.5, 0.5)


def _assert_same(a: LMB, b: LMB, tolerance: float) -> None:
    assert a.tracks.labels.tolist() == b.tracks.labels.tolist()
    for name in ("means", "covs", "log_weights"):
        np.testing.assert_allclose(getattr(a.tracks, name), getattr(b.tracks, name), rtol=tolerance, atol=tolerance)
    np.testing.assert_allclose(a.existence_logit, b.existence_logit, rtol=tolerance, atol=tolerance)


def test_one_blind_sensor_pulls_a_target_down():
    mean, cov = [[1.0, 2.0]], [np.eye(2)]
    beliefs = [LMB.from_bernoullis([A], [existence], mean, cov) for existence in (0.98, 0.1)]
    assert Clmb(HALVES).fuse(beliefs)[0].existence[0] == pytest.approx(0.7, abs=0.02)
    odds = math.sqrt(0.98 / 0.02 * 0.1 / 0.9)
    assert Clmb(HALVES).fuse(beliefs)[0].existence[0] == pytest.approx(odds / (1.0 + odds), rel=1e-12)


@given(st.integers(0, 2**32 - 1))
def test_existence_is_never_above_the_mean_log_odds(seed):
    rng = np.random.default_rng(seed)
    beliefs = [lmb((A, B), rng.uniform(0.01, 0.99, 2), rng) for _ in range(2)]
    fused, _ = Clmb(HALVES).fuse(beliefs)
    assert np.all(fused.existence_logit <= 0.5 * sum(belief.existence_logit for belief in beliefs) + 1e-12)


def test_a_label_that_a_sensor_lacks():
    rng = np.random.default_rng(2)
    first, second = lmb((A, B), (0.9, 0.8), rng), lmb((A,), (0.7,), rng)
    fused, info = Clmb((0.6, 0.4), missing_existence=1e-3).fuse([first, second])
    assert (info.num_missing_sets, info.num_missing_labels, info.empty_intersection) == (1, 1, False)
    assert fused.tracks.means[1] == pytest.approx(first.tracks.means[1], rel=1e-12)
    assert fused.existence_logit[1] == pytest.approx(0.6 * logit(0.8) + 0.4 * logit(1e-3), rel=1e-12)


def test_existence_zero_counts_as_missing_and_one_is_exact():
    mean, cov = [[1.0]], [np.eye(1)]
    never, surely = (LMB.from_bernoullis([A], [existence], mean, cov) for existence in (0.0, 1.0))
    fused, info = Clmb(HALVES).fuse([never, surely])
    assert info.num_missing_labels == 1
    assert fused.existence[0] == 1.0
    assert Clmb(HALVES).fuse([surely, surely])[1].log_normaliser == pytest.approx(0.0, abs=1e-12)
    assert Clmb(HALVES).fuse([never, never])[0].tracks.num_tracks == 0


def test_a_glmb_is_converted_first():
    rng = np.random.default_rng(8)
    beliefs = [random_glmb(rng, 3, 10, 2) for _ in range(2)]
    for rule, most in ((Clmb(HALVES, "moment_matched"), 1), (Clmb(HALVES), 4)):
        fused, _ = rule.fuse(beliefs)
        _assert_same(fused, rule.fuse([as_lmb(belief, max_components=most) for belief in beliefs])[0], 1e-10)


def test_auto_keeps_components_apart_while_the_number_of_sensors_allows_it():
    """One target in one of two places far apart, by all sensors alike, is not half way between them."""
    weights, means, covs = np.array([0.6, 0.4]), np.array([[0.0], [100.0]]), np.ones((2, 1, 1))
    belief = mixture_track(weights, means, covs)
    for num_sensors, components in ((2, 2), (12, 2), (13, 1)):
        fused, _ = Clmb([1.0 / num_sensors] * num_sensors).fuse([belief] * num_sensors)
        assert len(fused.tracks.log_weights) == components
    heaviest = Clmb(HALVES).fuse([belief, belief])[0].tracks
    assert heaviest.means[np.argmax(heaviest.log_weights)] == pytest.approx(0.0)


@pytest.mark.parametrize("mixture_power", ["component_wise", "quadrature"])
def test_mixtures_are_reduced_to_the_limit(mixture_power):
    means = 10.0 * np.arange(6.0)[:, None]
    belief = mixture_track(np.full(6, 1.0 / 6.0), means, np.ones((6, 1, 1)))
    fused, _ = Clmb(HALVES, mixture_power).fuse([belief, belief])
    fused.validate()
    assert len(fused.tracks.log_weights) == 4
