"""Iid clusters and multi-Bernoullis: validity, numbers, samples, files; estimates of densities without labels."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from densities.examples import random_covs, random_mixture
from vedette.densities import (
    GLMB,
    LMB,
    IidCluster,
    MultiBernoulli,
    Poisson,
    cardinality_distribution,
    load_density,
    sample_iid_cluster,
    sample_multi_bernoulli,
    sample_poisson,
    save_density,
    unlabelled_estimate,
)
from vedette.errors import InputError


def cluster() -> IidCluster:
    return IidCluster.from_gaussians([0.1, 0.3, 0.6], *random_mixture(np.random.default_rng(0), 3))


def bernoullis() -> MultiBernoulli:
    rng = np.random.default_rng(1)
    return MultiBernoulli.from_gaussians([0.9, 0.2, 0.7], rng.normal(size=(3, 2)), random_covs(rng, 3))


def test_they_are_valid_and_survive_the_way_through_a_kernel() -> None:
    for density in (cluster(), bernoullis(), IidCluster.empty(3), MultiBernoulli.empty(3), Poisson.empty(3)):
        density.validate()
    there = cluster()
    back = IidCluster.from_kernel(*there.to_kernel())
    np.testing.assert_array_equal(back.log_cardinality, there.log_cardinality)
    assert np.shares_memory(back.means, there.means)
    bundle = bernoullis().to_kernel()
    assert (bundle.tracks.labels == -1).all()
    again = MultiBernoulli.from_kernel(bundle)
    np.testing.assert_array_equal(again.existence, bernoullis().existence)
    again.validate()


def test_numbers() -> None:
    np.testing.assert_allclose(cardinality_distribution(cluster()), [0.1, 0.3, 0.6])
    assert cluster().expected_number == pytest.approx(1.5)
    expected = [0.1 * 0.8 * 0.3, 0.9 * 0.8 * 0.3 + 0.1 * 0.2 * 0.3 + 0.1 * 0.8 * 0.7]
    np.testing.assert_allclose(cardinality_distribution(bernoullis())[:2], expected)
    assert bernoullis().expected_number == pytest.approx(1.8)
    np.testing.assert_allclose(cardinality_distribution(IidCluster.empty(2)), [1.0])
    np.testing.assert_allclose(cardinality_distribution(Poisson.empty(2)), [1.0])


WRONG: list[tuple[Any, type[Exception], str]] = [
    (
        lambda: IidCluster.from_gaussians([0.5, 0.6], *random_mixture(np.random.default_rng(0), 2)),
        InputError,
        "sum to 1",
    ),
    (lambda: IidCluster.from_gaussians([], *random_mixture(np.random.default_rng(0), 2)), InputError, "no target"),
    (lambda: IidCluster.from_gaussians([1.0], [0.5], np.zeros((1, 2)), np.eye(2)[None]), InputError, "log_weights"),
    (lambda: IidCluster.from_gaussians([1.0], [1.0], np.zeros((1, 2)), -np.eye(2)[None]), InputError, "positive def"),
    (lambda: IidCluster(np.log([0.5, 0.5]), *IidCluster.empty(2).to_kernel()[1]), InputError, "density"),
    (lambda: IidCluster(np.array([np.nan]), *cluster().to_kernel()[1]), InputError, "log_cardinality"),
    (lambda: MultiBernoulli.from_gaussians([1.5], np.zeros((1, 2)), np.eye(2)[None]), InputError, "probabilities"),
    (lambda: MultiBernoulli.from_gaussians([0.5], np.zeros((2, 2)), np.eye(2)[None]), InputError, "means"),
    (lambda: MultiBernoulli.from_gaussians([0.5], np.zeros((1, 2)), -np.eye(2)[None]), InputError, "positive def"),
    (lambda: MultiBernoulli(np.array([np.nan]), *one_bernoulli()[1:]), InputError, "existence_logit"),
    (lambda: MultiBernoulli(np.zeros(2), *one_bernoulli()[1:]), InputError, "offsets"),
    (
        lambda: dataclasses.replace(MultiBernoulli(*one_bernoulli()), log_weights=np.ones(1)),
        InputError,
        "sum",
    ),
]


def one_bernoulli() -> tuple[Any, ...]:
    return np.zeros(1), np.arange(2), np.zeros(1), np.zeros((1, 2)), np.eye(2)[None].copy()


@pytest.mark.parametrize(("make", "error", "words"), WRONG, ids=range(len(WRONG)))
def test_what_is_no_density_is_named(make: Any, error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        make()


def test_samples_have_the_numbers_and_the_moments() -> None:
    rng = np.random.default_rng(5)
    drawn = sample_iid_cluster(cluster(), 20_000, rng=rng)
    drawn.validate()
    assert (drawn.labels == -1).all()
    shares = np.bincount(np.diff(drawn.offsets), minlength=3) / 20_000
    np.testing.assert_allclose(shares, [0.1, 0.3, 0.6], atol=0.015)
    np.testing.assert_allclose(drawn.states.mean(axis=0), np.exp(cluster().log_weights) @ cluster().means, atol=0.1)
    density = bernoullis()
    drawn = sample_multi_bernoulli(density, 20_000, rng=rng)
    drawn.validate()
    assert len(drawn.states) / 20_000 == pytest.approx(1.8, abs=0.03)
    mean = density.existence @ density.means / 1.8
    np.testing.assert_allclose(drawn.states.mean(axis=0), mean, atol=0.1)


def test_samples_of_nothing() -> None:
    rng = np.random.default_rng(5)
    for drawn in (
        sample_iid_cluster(IidCluster.empty(2), 3, rng=rng),
        sample_multi_bernoulli(MultiBernoulli.empty(2), 3, rng=rng),
        sample_poisson(Poisson.empty(2), 3, rng=rng),
    ):
        drawn.validate()
        assert drawn.num_samples == 3
        assert drawn.states.shape == (0, 2)


@pytest.mark.parametrize("make", [cluster, bernoullis])
def test_files_keep_every_bit(make: Any, tmp_path: Path) -> None:
    density = make()
    save_density(tmp_path / "density.npz", density)
    back = load_density(tmp_path / "density.npz")
    assert type(back) is type(density)
    for name in type(density).__slots__:
        np.testing.assert_array_equal(getattr(back, name), getattr(density, name))


def spread(num: int) -> tuple[Any, Any]:
    return np.column_stack([10.0 * np.arange(num), np.zeros(num)]), np.tile(np.eye(2), (num, 1, 1))


def test_a_component_of_weight_two_is_two_targets() -> None:
    means, covs = spread(4)
    estimate = unlabelled_estimate(Poisson.from_gaussians([0.1, 2.1, 0.95, 0.3], means, covs), 7)
    estimate.validate()
    assert estimate.labels.tolist() == [[7, 0], [7, 1], [7, 2]]
    np.testing.assert_array_equal(estimate.means[:, 0], [10.0, 10.0, 20.0])
    np.testing.assert_allclose(estimate.existence, [1.0, 1.0, 0.95])


def test_a_component_of_weight_one_and_a_half_is_one_target_before_any_that_is_not_light() -> None:
    means, covs = spread(4)
    heavy = unlabelled_estimate(Poisson.from_gaussians([0.1, 1.6, 0.95, 0.3], means, covs), 7)
    np.testing.assert_array_equal(heavy.means[:, 0], [10.0, 20.0, 30.0])
    np.testing.assert_allclose(heavy.existence, [1.0, 0.95, 0.3])
    light = unlabelled_estimate(Poisson.from_gaussians([0.1, 1.6, 0.95, 0.15], means, covs), 7)
    np.testing.assert_array_equal(light.means[:, 0], [10.0, 20.0, 10.0])
    np.testing.assert_allclose(light.existence, [1.0, 0.95, 0.6])


def test_a_component_with_less_than_half_a_target_left_stands_for_no_other() -> None:
    means, covs = spread(3)
    density = IidCluster.from_gaussians([0.0, 0.1, 0.0, 0.9], [0.6, 0.38, 0.02], means, covs)
    estimate = unlabelled_estimate(density, 1)
    np.testing.assert_array_equal(estimate.means[:, 0], [0.0, 10.0, 0.0])
    few = IidCluster.from_gaussians([0.0, 0.1, 0.0, 0.9], [0.5, 0.48, 0.02], means, covs)
    np.testing.assert_array_equal(unlabelled_estimate(few, 1).means[:, 0], [0.0, 10.0, 20.0])
    alone = IidCluster.from_gaussians([0.5, 0.0, 0.0, 0.5 + 1e-12], [1.0], means[:1], covs[:1])
    assert unlabelled_estimate(alone, 1).num_targets == 2


@pytest.mark.parametrize(("mean", "number"), [(0.0, 0), (0.49, 0), (0.5, 1), (1.49, 1), (1.51, 2)])
def test_the_mean_number_of_a_poisson_is_rounded(mean: float, number: int) -> None:
    means, covs = spread(1)
    assert unlabelled_estimate(Poisson.from_gaussians([mean], means, covs), 1).num_targets == number


def test_the_most_probable_number_of_an_iid_cluster() -> None:
    means, covs = spread(3)
    density = IidCluster.from_gaussians([0.1, 0.2, 0.4, 0.3], [0.2, 0.5, 0.3], means, covs)
    estimate = unlabelled_estimate(density, 3)
    np.testing.assert_array_equal(estimate.means[:, 0], [10.0, 20.0])
    np.testing.assert_allclose(estimate.existence, [0.95, 0.57])
    tie = IidCluster.from_gaussians([0.3, 0.35, 0.35], [0.2, 0.5, 0.3], means, covs)
    assert unlabelled_estimate(tie, 3).num_targets == 1


def test_the_likeliest_bernoullis_by_their_heaviest_components() -> None:
    means, covs = spread(4)
    logit = np.array([-3.0, 2.0, 3.0])
    density = MultiBernoulli(logit, np.array([0, 1, 3, 4]), np.log([1.0, 0.3, 0.7, 1.0]), means, covs)
    density.validate()
    estimate = unlabelled_estimate(density, 2)
    np.testing.assert_array_equal(estimate.means[:, 0], [30.0, 20.0])
    np.testing.assert_allclose(estimate.existence, 1.0 / (1.0 + np.exp([-3.0, -2.0])))
    assert estimate.labels.tolist() == [[2, 0], [2, 1]]


@pytest.mark.parametrize("density", [GLMB.empty(2), LMB.empty(2), "nothing"])
def test_a_density_with_labels_has_estimates_of_its_own(density: Any) -> None:
    with pytest.raises(InputError, match="density: expected one without labels; got"):
        unlabelled_estimate(density, 1)
