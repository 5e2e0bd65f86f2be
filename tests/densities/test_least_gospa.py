"""The estimate of least expected GOSPA, against all sets of points and closed forms."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest

from reference import gospa as reference
from vedette.densities import (
    GLMB,
    LMB,
    FactoredGLMB,
    TrackTable,
    as_glmb,
    least_gospa_estimate,
    marginal_estimate,
)
from vedette.errors import InputError

from .examples import random_poisson
from .test_least_ospa import candidates, labels_of

CUTOFF = 20.0


def two_places(existence: float, weight: float, apart: float, std: float = 1.0) -> LMB:
    """A label that is at 0 with this probability, or else `apart` metres along x."""
    means = np.array([[0.0, 0.0], [apart, 0.0]])
    mixture = np.log([weight, 1.0 - weight])
    tracks = TrackTable(np.array([[1, 0]]), np.array([0, 2]), mixture, means, np.array([std**2 * np.eye(2)] * 2))
    return LMB(tracks, logits([existence]))


def logits(existence: Any) -> Any:
    r = np.array(existence)
    return np.log(r) - np.log1p(-r)


@pytest.mark.parametrize("order", [1.0, 2.0])
def test_no_set_of_points_has_a_lower_expected_gospa(order):
    """All subsets of the means of labels and of their components, over samples of the true targets."""
    for seed in range(4):
        rng = np.random.default_rng(seed)
        num, sizes = 3, rng.integers(1, 3, 3)
        offsets = np.concatenate([[0], np.cumsum(sizes)])
        centres = np.repeat(np.column_stack([1e3 * np.arange(num), np.zeros(num)]), sizes, axis=0)
        means = centres + rng.normal(0.0, 0.5 * CUTOFF, centres.shape)
        covs = np.array([np.diag(rng.uniform(1.0, CUTOFF, 2) ** 2 / 4.0) for _ in means])
        weights = [rng.dirichlet(np.ones(size)) for size in sizes]
        existence = rng.uniform(0.4, 1.0, num)
        labels = np.column_stack([np.ones(num, np.int64), np.arange(num)])
        density = LMB(TrackTable(labels, offsets, np.log(np.concatenate(weights)), means, covs), logits(existence))
        choices: list[list[Any]] = []
        for i, weight in enumerate(weights):
            own = means[offsets[i] : offsets[i + 1]]
            choices.append([None, *own, weight @ own])
        truths = np.full((2000, num, 2), np.nan)
        for sample in truths:
            for i in np.flatnonzero(rng.random(num) < existence).tolist():
                j = int(offsets[i] + rng.choice(sizes[i], p=weights[i]))
                sample[i] = rng.multivariate_normal(means[j], covs[j])
        found = power_of_gospa(least_gospa_estimate(density, CUTOFF, order).means, truths, order)
        for points in itertools.product(*choices):
            difference = found - power_of_gospa([point for point in points if point is not None], truths, order)
            assert difference.mean() <= 3.5 * difference.std() / math.sqrt(len(truths)) + 1e-9, (seed, points)


def power_of_gospa(points: Any, truths: Any, order: float) -> Any:
    """GOSPA^p of points and (..., n, 2) truths, NaN where there is none, if each is near at most one of the others."""
    given, num = np.array(points).reshape(-1, 2), (~np.isnan(truths[..., 0])).sum(axis=-1)
    distances = np.linalg.norm(truths[..., None, :] - given, axis=-1)
    gains = CUTOFF**order - np.minimum(np.nan_to_num(distances, nan=math.inf), CUTOFF) ** order
    return 0.5 * CUTOFF**order * (len(given) + num) - gains.sum(axis=(-1, -2))


def test_the_sum_over_near_pairs_is_gospa():
    rng = np.random.default_rng(1)
    grid = np.column_stack([1e3 * np.arange(4), np.zeros(4)])
    for _ in range(30):
        points, truths = (grid[rng.random(4) < 0.6] + rng.normal(0.0, 8.0) for _ in range(2))
        total, *_ = reference.gospa_parts(points, truths, CUTOFF, 2.0)
        assert power_of_gospa(points, truths, 2.0) == pytest.approx(total**2)


@pytest.mark.parametrize("num_hyps", [1, 2, 5, 12])
def test_dependent_labels_have_the_least_expected_gospa_of_all_subsets(num_hyps):
    """Far apart, and with a spread that is small against the cutoff; a GLMB and one factor of a product."""
    tracks = candidates([0.5] * 6).tracks
    subsets = np.array(list(itertools.product([0.0, 1.0], repeat=6)))
    for seed in range(10):
        rng = np.random.default_rng(seed)
        there, weights = rng.random((num_hyps, 6)) < 0.6, -np.sort(-rng.dirichlet(np.ones(num_hyps)))
        glmb = GLMB.from_hypotheses(tracks, [np.flatnonzero(row).tolist() for row in there], weights)
        costs = np.abs(subsets[:, None] - there).sum(axis=-1) @ weights
        for density in (glmb, FactoredGLMB.from_factors([glmb], 2)):
            found = least_gospa_estimate(density, 1e5)
            found.validate()
            chosen = np.isin(np.arange(6), found.labels[:, 1])
            assert np.abs(chosen - 1.0 * there).sum(axis=-1) @ weights == pytest.approx(costs.min(), abs=1e-3), seed


@pytest.mark.parametrize("std", [1.0, 6.0, 9.0])
def test_the_least_existence_of_a_gaussian_is_that_of_the_closed_form(std):
    """For p = 2: the mean of min(d^2, c^2) is 2 s^2 (1 - exp(-c^2 / (2 s^2)))."""
    error = 2.0 * std**2 / CUTOFF**2 * (1.0 - math.exp(-(CUTOFF**2) / (2.0 * std**2)))
    least = 0.5 / (1.0 - error)
    for existence in (0.995 * least, 1.005 * least):
        lmb = LMB.from_bernoullis([(1, 0)], [existence], np.zeros((1, 2)), [std**2 * np.eye(2)])
        assert len(least_gospa_estimate(lmb, CUTOFF, 2.0)) == (existence > least)


@pytest.mark.parametrize(("apart", "weight", "at"), [(10.0, 0.5, 5.0), (100.0, 0.7, 0.0), (100.0, 0.3, 100.0)])
def test_a_target_is_reported_at_the_point_of_least_error(apart, weight, at):
    """Between two near components, and at the heavier one of two far ones."""
    found = least_gospa_estimate(two_places(0.999, weight, apart, 3.0), CUTOFF, 2.0)
    np.testing.assert_allclose(found.means, [[at, 0.0]], atol=1e-9)
    found.validate()


def test_a_target_without_a_probable_place_is_not_reported():
    assert len(least_gospa_estimate(two_places(0.999, 0.5, 100.0, 3.0), CUTOFF)) == 0
    assert len(marginal_estimate(two_places(0.999, 0.5, 100.0, 3.0))) == 1


def test_a_large_cutoff_leaves_the_marginal_estimate_of_half():
    density = FactoredGLMB.of(candidates([0.9, 0.49, 0.51, 0.2]))
    for order in (1.0, 2.0, 50.0):
        found = least_gospa_estimate(density, 1e6, order)
        assert labels_of(found) == labels_of(marginal_estimate(density)) == [(1, 0), (1, 2)]
    assert len(least_gospa_estimate(density, 1e-3, 1.0)) == 0


def test_two_labels_of_one_target_are_one():
    tracks = candidates([0.5, 0.5], apart=0.1).tracks
    density = GLMB.from_hypotheses(tracks, [[0], [1], []], [0.45, 0.4, 0.15])
    found = least_gospa_estimate(density, CUTOFF)
    assert len(found) == 1
    assert found.existence == pytest.approx([0.85])


def test_all_kinds_with_labels_give_the_same():
    lmb = candidates([0.9, 0.4, 0.2, 0.7])
    other = least_gospa_estimate(lmb)
    for density in (FactoredGLMB.of(lmb), as_glmb(lmb, max_hypotheses=100)[0]):
        found = least_gospa_estimate(density)
        assert labels_of(found) == labels_of(other) == [(1, 0), (1, 3)]
        np.testing.assert_allclose(found.existence, other.existence, atol=1e-12)
        np.testing.assert_allclose(found.means, other.means, atol=1e-9)


def test_densities_without_targets_have_empty_estimates():
    assert least_gospa_estimate(LMB.empty(4)).means.shape == (0, 4)
    assert least_gospa_estimate(candidates([0.1])).means.shape == (0, 2)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"cutoff": 0.0}, "cutoff: expected a number above 0; got 0.0"),
        ({"cutoff": math.inf}, "cutoff: expected a finite number; got inf"),
        ({"order": 0.5}, "order: expected a number of at least 1; got 0.5"),
        ({"order": math.nan}, "order: expected a finite number; got nan"),
    ],
)
def test_cutoffs_and_orders_out_of_range_are_refused(given, message):
    with pytest.raises(InputError, match=message):
        least_gospa_estimate(candidates([0.9]), **given)


def test_densities_without_labels_are_refused():
    poisson = random_poisson(np.random.default_rng(0), 3)
    with pytest.raises(InputError, match="which have labels"):
        least_gospa_estimate(poisson)  # type: ignore[arg-type]
