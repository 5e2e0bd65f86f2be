"""Modes of motion in fusion: products mode by mode, kept in averages, and refused where they would be forgotten."""

from __future__ import annotations

import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from fusion.examples import A, lmb
from fusion.sights import views
from vedette.densities import LMB, FactoredGLMB, load_density, map_estimate, marks_of, save_density
from vedette.errors import InputError
from vedette.fusion import ArithmeticAverage, Clmb, ParallelUpdate
from vedette.fusion.rebasing import rebase

WEIGHTS = (0.3, 0.7)


def with_modes(seed: int, modes: tuple[int, ...], dim: int = 2) -> LMB:
    """A belief of one label whose components have these modes."""
    rng, num = np.random.default_rng(seed), len(modes)
    plain = lmb((A,), np.array([0.8]), rng)
    tracks = replace(
        plain.tracks,
        offsets=np.array([0, num]),
        log_weights=np.log(rng.dirichlet(np.ones(num))),
        means=rng.normal(0.0, 1.0, (num, dim)),
        covs=np.array([np.diag(rng.uniform(0.5, 2.0, dim)) for _ in range(num)]),
        marks=marks_of(modes=np.array(modes)),
    )
    return LMB(tracks, plain.existence_logit)


def density(belief: Any, mode: int, x: np.ndarray) -> np.ndarray:
    """Of the state and a mode at points (n, dim)."""
    tracks = belief.tracks
    own = np.flatnonzero(tracks.modes == mode)
    each = [np.exp(tracks.log_weights[c]) * multivariate_normal.pdf(x, tracks.means[c], tracks.covs[c]) for c in own]
    return np.sum(each, axis=0) if each else np.zeros(len(x))


def test_covariance_intersection_multiplies_mode_by_mode():
    first, second = with_modes(1, (0, 1)), with_modes(2, (1, 0))
    fused, _ = Clmb(WEIGHTS).fuse([first, second])
    x = np.random.default_rng(3).normal(0.0, 1.0, (50, 2))
    products = [density(first, mode, x) ** WEIGHTS[0] * density(second, mode, x) ** WEIGHTS[1] for mode in (0, 1)]
    ratios = np.concatenate([density(fused, mode, x) / product for mode, product in enumerate(products)])
    np.testing.assert_allclose(ratios, ratios[0], rtol=1e-10)


def test_a_component_without_a_mode_goes_with_each():
    fused, _ = Clmb(WEIGHTS).fuse([with_modes(1, (-1,)), with_modes(2, (1, 0))])
    assert sorted(fused.tracks.modes) == [0, 1]


def test_averages_keep_modes():
    fused, _ = ArithmeticAverage(WEIGHTS).fuse([with_modes(1, (0, 1)), with_modes(2, (1, 2))])
    assert set(fused.tracks.modes) == {0, 1, 2}


def test_what_forgets_modes_refuses_them():
    prior, first, second = (with_modes(seed, (0, 1)) for seed in (1, 2, 3))
    with pytest.raises(
        InputError, match=r"parallel fusion: expected a motion without modes, .*; got tracks with modes"
    ):
        ParallelUpdate().fuse([first, second], views([0.9, 0.9], prediction=prior))
    with pytest.raises(InputError, match="fusion of late beliefs: expected a motion without modes"):
        rebase(first, second, prior)


@pytest.mark.parametrize("kind", [lambda belief: belief, FactoredGLMB.of])
def test_files_and_pickles_keep_modes(kind, tmp_path):
    belief = kind(with_modes(1, (2, 0, -1)))
    save_density(tmp_path / "belief.npz", belief)
    found: list[Any] = [load_density(tmp_path / "belief.npz"), pickle.loads(pickle.dumps(belief))]
    for again in found:
        np.testing.assert_array_equal(again.tracks.modes, [2, 0, -1])


def test_an_estimate_is_the_mean_over_near_modes():
    belief = with_modes(1, (0, 1, 2))
    tracks = replace(belief.tracks, means=np.array([[0.0, 0.0], [0.1, 0.0], [30.0, 0.0]]))
    tracks = replace(tracks, log_weights=np.log([0.3, 0.3, 0.4]), covs=np.tile(np.eye(2), (3, 1, 1)))
    estimate = map_estimate(LMB(tracks, belief.existence_logit))
    np.testing.assert_allclose(estimate.means, [[0.05, 0.0]])
    np.testing.assert_allclose(estimate.mode_probs, [[0.3, 0.3, 0.4]])


def test_a_mode_below_the_first_is_refused():
    tracks = with_modes(1, (0, 1)).tracks
    with pytest.raises(InputError, match=r"modes: expected whole numbers of at least -1; got -2"):
        replace(tracks, marks=marks_of(modes=np.array([-2, 0])))
