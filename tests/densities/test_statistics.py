"""Cardinality, existence and moments."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given

from densities.examples import glmbs, lmbs, plain_glmb, plain_lmb, plain_mixture, plain_moments, random_lmb
from reference import glmb as oracle
from vedette.densities import (
    GLMB,
    LMB,
    Poisson,
    TrackTable,
    as_glmb,
    cardinality_distribution,
    existence_probabilities,
    mixture_moments,
    track_moments,
)
from vedette.errors import InputError


@given(glmbs())
def test_cardinality_of_a_glmb(glmb):
    distribution = cardinality_distribution(glmb)
    assert len(distribution) == np.diff(glmb.hyp_offsets).max() + 1
    assert distribution.sum() == pytest.approx(1.0, abs=1e-12)
    expected = np.zeros(len(distribution))
    for labels, weight in oracle.label_set_weights(plain_glmb(glmb)).items():
        expected[len(labels)] += weight
    np.testing.assert_allclose(distribution, expected, atol=1e-12)


@given(lmbs())
def test_cardinality_of_an_lmb(lmb):
    distribution = cardinality_distribution(lmb)
    assert len(distribution) == lmb.tracks.num_tracks + 1
    assert distribution.sum() == pytest.approx(1.0, abs=1e-12)
    expected = np.zeros(len(distribution))
    for weight, tracks in oracle.expand_lmb(plain_lmb(lmb)):
        expected[len(tracks)] += weight
    np.testing.assert_allclose(distribution, expected, atol=1e-12)
    np.testing.assert_allclose(cardinality_distribution(as_glmb(lmb, max_hypotheses=100)[0]), expected, atol=1e-12)


@pytest.mark.parametrize("mean", [0.0, 1e-9, 0.7, 30.0, 4000.0])
def test_cardinality_of_a_poisson(mean):
    poisson = Poisson.from_gaussians([mean], np.zeros((1, 2)), [np.eye(2)])
    distribution = cardinality_distribution(poisson)
    numbers = np.arange(len(distribution))
    assert distribution.sum() == pytest.approx(1.0, abs=1e-9)
    assert distribution @ numbers == pytest.approx(mean, rel=1e-9)
    assert distribution @ (numbers - mean) ** 2 == pytest.approx(mean, rel=1e-9)


def test_densities_of_no_target():
    for density in (GLMB.empty(4), LMB.empty(4), Poisson.from_gaussians([], np.empty((0, 4)), np.empty((0, 4, 4)))):
        assert cardinality_distribution(density).tolist() == [1.0]
    for density in (GLMB.empty(4), LMB.empty(4)):
        labels, existence = existence_probabilities(density)
        assert (labels.shape, existence.shape) == ((0, 2), (0,))


def test_existence_of_an_lmb():
    lmb = random_lmb(np.random.default_rng(0), 4)
    labels, existence = existence_probabilities(lmb)
    assert labels is lmb.tracks.labels
    assert existence.sum() == pytest.approx(cardinality_distribution(lmb) @ np.arange(5))


@given(glmbs())
def test_track_moments(glmb):
    means, covs = track_moments(glmb.tracks)
    for track in range(glmb.tracks.num_tracks):
        expected_mean, expected_cov = plain_moments(plain_mixture(glmb.tracks, track))
        np.testing.assert_allclose(means[track], expected_mean, atol=1e-12)
        np.testing.assert_allclose(covs[track], expected_cov, atol=1e-12)


def test_mixture_moments_of_any_total_weight():
    means, covs = np.array([[0.0], [4.0]]), np.ones((2, 1, 1))
    mean, cov = mixture_moments(np.log([3.0, 1.0]) - 2000.0, means, covs)
    assert mean == pytest.approx([1.0])
    assert cov == pytest.approx(np.array([[4.0]]))
    for log_weights in (np.full(2, -np.inf), np.empty(0)):
        with pytest.raises(InputError, match="log_weights"):
            mixture_moments(log_weights, means[: len(log_weights)], covs[: len(log_weights)])


def test_other_things_than_densities_are_refused():
    tracks = TrackTable.empty(2)
    with pytest.raises(InputError, match="TrackTable"):
        cardinality_distribution(tracks)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="TrackTable"):
        existence_probabilities(tracks)  # type: ignore[arg-type]
