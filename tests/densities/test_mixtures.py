"""Reduction of Gaussian mixtures against plain NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densities.examples import plain_moments, random_mixture
from vedette.kernels.gaussian.components import components_of
from vedette.kernels.gaussian.mixtures import descending_order, moment_match
from vedette.kernels.gaussian.reduction import MixtureCaps, reduce_mixture

pytestmark = pytest.mark.lanes

NO_PRUNING = -np.inf
MANY = 10**9


def _mixture(seed: int, num: int, dim: int = 3):
    weights, means, covs = random_mixture(np.random.default_rng(seed), num, dim)
    return np.log(7.0 * weights), means, covs


def _reduced_moments(log_weights, means, covs):
    return plain_moments(list(zip(np.exp(log_weights), means, covs, strict=True)))


@given(st.lists(st.sampled_from([-np.inf, -3.0, 0.0, 0.5, 1.0, 2.0]), max_size=70))
def test_descending_order_is_a_stable_sort(values):
    array = np.array(values, dtype=float)
    assert descending_order(array).tolist() == np.argsort(-array, kind="stable").tolist()


@pytest.mark.parametrize("num", [0, 1, 16, 17, 40, 100, 1000])
def test_long_lists_are_sorted_stably_too(num):
    values = np.random.default_rng(num).integers(0, 5, num).astype(float)
    assert descending_order(values).tolist() == np.argsort(-values, kind="stable").tolist()


@given(st.integers(0, 10**6), st.integers(1, 6))
def test_moment_match_keeps_mean_and_covariance(seed, num):
    log_weights, means, covs = _mixture(seed, num)
    mean, cov = np.empty(3), np.empty((3, 3))
    moment_match(log_weights, means, covs, mean, cov)
    expected_mean, expected_cov = _reduced_moments(log_weights, means, covs)
    np.testing.assert_allclose(mean, expected_mean, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(cov, expected_cov, rtol=1e-12, atol=1e-12)
    assert np.array_equal(cov, cov.T)


def test_moment_match_far_from_the_origin_loses_no_digits():
    means = np.array([[1e6, 0.0], [1e6 + 1.0, 0.0]])
    mean, cov = np.empty(2), np.empty((2, 2))
    moment_match(np.zeros(2), means, np.tile(1e-4 * np.eye(2), (2, 1, 1)), mean, cov)
    np.testing.assert_allclose(cov, [[0.2501, 0.0], [0.0, 1e-4]], rtol=1e-10)


def test_components_of_no_weight_count_alike():
    _, means, covs = _mixture(0, 2)
    mean, cov = np.empty(3), np.empty((3, 3))
    moment_match(np.full(2, -np.inf), means, covs, mean, cov)
    np.testing.assert_allclose(mean, means.mean(axis=0))


@given(st.integers(0, 10**6), st.integers(1, 9), st.floats(0.0, 6.0), st.integers(1, 5))
def test_reduction_keeps_the_total_and_the_caps(seed, num, merge_distance, max_components):
    log_weights, means, covs = _mixture(seed, num)
    kept, kept_means, kept_covs, _ = reduce_mixture(
        components_of(log_weights, means, covs), MixtureCaps(np.log(0.05), merge_distance, max_components)
    )
    assert 1 <= len(kept) <= max_components
    assert np.logaddexp.reduce(kept) == pytest.approx(np.log(7.0), abs=1e-12)
    assert np.all(np.diff(kept) <= 0.0)
    assert kept_means.shape == (len(kept), 3)
    np.linalg.cholesky(kept_covs)


@given(st.integers(0, 10**6), st.integers(1, 9), st.floats(0.0, 6.0))
def test_merging_alone_keeps_the_moments(seed, num, merge_distance):
    log_weights, means, covs = _mixture(seed, num)
    reduced = reduce_mixture(components_of(log_weights, means, covs), MixtureCaps(NO_PRUNING, merge_distance, MANY))
    expected_moments = _reduced_moments(log_weights, means, covs)
    for got, expected in zip(_reduced_moments(*reduced[:3]), expected_moments, strict=True):
        np.testing.assert_allclose(got, expected, rtol=1e-10, atol=1e-10)


def test_one_component_matches_the_light_ones_too():
    log_weights, means, covs = _mixture(3, 6)
    reduced = reduce_mixture(components_of(log_weights, means, covs), MixtureCaps(np.log(0.9), 0.0, 1))
    kept, kept_means, kept_covs, _ = reduced
    expected_mean, expected_cov = _reduced_moments(log_weights, means, covs)
    np.testing.assert_allclose(kept_means[0], expected_mean)
    np.testing.assert_allclose(kept_covs[0], expected_cov)
    assert kept[0] == pytest.approx(np.log(7.0))


def test_nothing_to_do_gives_the_mixture_sorted():
    log_weights, means, covs = _mixture(4, 6)
    reduced = reduce_mixture(components_of(log_weights, means, covs), MixtureCaps(NO_PRUNING, 0.0, MANY))
    order = np.argsort(-log_weights)
    np.testing.assert_allclose(reduced[0], log_weights[order], atol=1e-12)
    assert np.array_equal(reduced[1], means[order])
    assert np.array_equal(reduced[2], covs[order])


def test_pruning_merging_and_capping_by_hand():
    weights = np.array([0.4, 0.1, 0.3, 0.001, 0.199])
    means = np.array([[0.0], [1.0], [10.0], [0.0], [20.0]])
    covs = np.ones((5, 1, 1))
    log_weights, kept_means, kept_covs, _ = reduce_mixture(
        components_of(np.log(weights), means, covs), MixtureCaps(np.log(0.01), 2.0, 2)
    )
    # The first two merge, 0.001 is too light, and the third cluster exceeds the cap.
    np.testing.assert_allclose(np.exp(log_weights), np.array([0.5, 0.3]) / 0.8, rtol=1e-12)
    np.testing.assert_allclose(kept_means, [[0.2], [10.0]], rtol=1e-12)
    np.testing.assert_allclose(kept_covs, [[[1.16]], [[1.0]]], rtol=1e-12)


def test_the_heaviest_stays_however_light():
    means = np.arange(100.0).reshape(100, 1)
    weights = np.full(100, 0.01)
    weights[70] = 0.0101
    log_weights, kept_means, *_ = reduce_mixture(
        components_of(np.log(weights / weights.sum()), means, np.ones((100, 1, 1))),
        MixtureCaps(np.log(0.02), 0.0, MANY),
    )
    np.testing.assert_allclose(log_weights, [0.0], atol=1e-12)
    assert kept_means.tolist() == [[70.0]]


def test_the_distance_is_measured_by_the_heaviest():
    covs = np.array([[[1.0]], [[100.0]]])
    means = np.array([[0.0], [3.0]])
    assert (
        len(reduce_mixture(components_of(np.log([0.6, 0.4]), means, covs), MixtureCaps(NO_PRUNING, 2.0, MANY))[0]) == 2
    )
    assert (
        len(reduce_mixture(components_of(np.log([0.4, 0.6]), means, covs), MixtureCaps(NO_PRUNING, 2.0, MANY))[0]) == 1
    )


def test_empty_and_weightless_mixtures():
    nothing = reduce_mixture(
        components_of(np.empty(0), np.empty((0, 2)), np.empty((0, 2, 2))), MixtureCaps(-5.0, 1.0, 3)
    )
    assert [len(part) for part in nothing] == [0] * 4
    _, means, covs = _mixture(0, 3)
    log_weights, kept_means, *_ = reduce_mixture(
        components_of(np.full(3, -np.inf), means, covs), MixtureCaps(-5.0, 1.0, 3)
    )
    assert log_weights.tolist() == [-np.inf]
    np.testing.assert_allclose(kept_means[0], means.mean(axis=0))


def test_inputs_are_left_alone():
    mixture = _mixture(5, 5)
    before = [part.copy() for part in mixture]
    log_weights, means, covs = mixture
    reduce_mixture(components_of(log_weights, means, covs), MixtureCaps(np.log(0.1), 3.0, 2))
    for part, copy in zip(mixture, before, strict=True):
        assert np.array_equal(part, copy)
