"""Fusion against the product of powers of the whole multi-target densities on a grid."""

from __future__ import annotations

import numpy as np
import pytest

from densities.examples import plain_glmb, plain_lmb, plain_mixture, random_covs
from fusion.examples import A, B, by_label_set, full_glmbs, lmb, mixture_track
from reference import fusion as oracle
from reference.grid import Grid
from vedette.densities import LMB
from vedette.fusion import Clmb, CmDeltaGlmb, MixturePower

pytestmark = pytest.mark.lanes

GRID = Grid([-14.0], [18.0], 160)
WEIGHTS = [(0.5, 0.5), (0.8, 0.2), (0.5, 0.3, 0.2)]


@pytest.mark.parametrize("weights", WEIGHTS)
@pytest.mark.parametrize("mixture_power", ["moment_matched", "component_wise", "quadrature"])
def test_cm_delta_glmb_of_single_gaussians_is_exact(weights, mixture_power):
    beliefs = full_glmbs(len(weights), np.random.default_rng(len(weights)))
    fused, info = CmDeltaGlmb(weights, mixture_power).fuse(beliefs)
    fused.validate()
    expected = oracle.fuse_glmb([plain_glmb(belief) for belief in beliefs], weights, GRID)
    got = by_label_set(fused)
    assert got.keys() == expected.keys()
    for labels, (weight, moments) in got.items():
        assert weight == pytest.approx(expected[labels].weight, abs=1e-8)
        for label, (mean, cov) in moments.items():
            assert mean == pytest.approx(expected[labels].moments[label][0], abs=1e-8)
            assert cov == pytest.approx(expected[labels].moments[label][1], abs=1e-8)
    assert (info.num_missing_sets, info.num_missing_labels, info.empty_intersection) == (0, 0, False)


@pytest.mark.parametrize("weights", WEIGHTS)
def test_clmb_of_single_gaussians_is_exact(weights):
    rng = np.random.default_rng(3)
    beliefs = [lmb((A, B), rng.uniform(0.1, 0.95, 2), rng) for _ in weights]
    fused, info = Clmb(weights).fuse(beliefs)
    fused.validate()
    expected = oracle.fuse_lmb([plain_lmb(belief) for belief in beliefs], weights, GRID)
    for i, label in enumerate((A, B)):
        existence, mean, cov = expected[label]
        assert fused.existence[i] == pytest.approx(existence, abs=1e-8)
        assert fused.tracks.means[i] == pytest.approx(mean, abs=1e-8)
        assert fused.tracks.covs[i] == pytest.approx(cov, abs=1e-8)
    assert info.num_missing_labels == 0


@pytest.mark.parametrize("weights", WEIGHTS)
def test_two_dimensional_gaussians_are_exact(weights):
    rng = np.random.default_rng(7)
    beliefs = [mixture_track([1.0], [rng.normal(size=2)], random_covs(rng, 1)) for _ in weights]
    fused, info = Clmb(weights).fuse(beliefs)
    grid = Grid([-14.0, -14.0], [14.0, 14.0], 220)
    mixtures = [plain_mixture(belief.tracks, 0) for belief in beliefs]
    integral, mean, cov = oracle.fuse_densities(mixtures, weights, grid)
    assert info.log_normaliser == pytest.approx(np.log(0.1 + 0.9 * integral), abs=1e-8)
    assert fused.tracks.means[0] == pytest.approx(mean, abs=1e-8)
    assert fused.tracks.covs[0] == pytest.approx(cov, abs=1e-8)


def _log_overlap(weights, mixture_power: MixturePower, beliefs, merge_distance=0.0) -> tuple[float, LMB]:
    fusion = Clmb(weights, mixture_power)
    limits = fusion.limits._replace(merge_distance=merge_distance, max_components=6)
    fused, _ = Clmb(weights, mixture_power, limits=limits).fuse(beliefs)
    return float(fused.existence_logit[0] - np.log(9.0)), fused


@pytest.mark.parametrize("separation", [0.0, 1.0, 2.0, 3.0, 4.0, 6.0])
def test_powers_of_mixtures(separation):
    # The figures of docs/decisions/0003-power-of-mixtures.md.
    first = mixture_track([0.5, 0.5], [[0.0], [separation]], np.ones((2, 1, 1)))
    second = mixture_track([0.3, 0.7], [[0.5], [separation + 0.3]], [[[2.0]], [[0.6]]])
    mixtures = [plain_mixture(belief.tracks, 0) for belief in (first, second)]
    integral, mean, cov = oracle.fuse_densities(mixtures, (0.5, 0.5), GRID)
    component_wise, _ = _log_overlap((0.5, 0.5), "component_wise", (first, second))
    assert component_wise >= np.log(integral)
    quadrature, fused = _log_overlap((0.5, 0.5), "quadrature", (first, second))
    assert quadrature == pytest.approx(np.log(integral), abs=0.015)
    tracks = fused.tracks
    got = np.exp(tracks.log_weights) @ tracks.means
    assert got == pytest.approx(mean, abs=0.05)
    deviations = (tracks.means - got)[:, 0]
    variance = np.exp(tracks.log_weights) @ (tracks.covs[:, 0, 0] + deviations**2)
    assert variance == pytest.approx(cov[0, 0], rel=0.05)


@pytest.mark.parametrize(("separation", "inflation"), [(0.0, 1.41), (1.0, 1.34), (2.0, 1.22), (3.0, 1.13), (6.0, 1.01)])
def test_component_wise_power_inflates_the_integral(separation, inflation):
    # Beside a Gaussian so wide that it is constant, what is left is the power 1/2 of the mixture alone.
    belief = mixture_track([0.5, 0.5], [[0.0], [separation]], np.ones((2, 1, 1)))
    wide = mixture_track([1.0], [[0.0]], [[[1.0e6]]])
    exact, *_ = oracle.fuse_densities([plain_mixture(item.tracks, 0) for item in (belief, wide)], (0.5, 0.5), GRID)
    got, _ = _log_overlap((0.5, 0.5), "component_wise", (belief, wide))
    assert np.exp(got) / exact == pytest.approx(inflation, abs=0.006)


def test_moment_matching_and_merging_agree_where_components_are_near():
    belief = mixture_track([0.5, 0.5], [[0.0], [0.5]], np.ones((2, 1, 1)))
    other = mixture_track([1.0], [[0.2]], [[[1.1]]])
    merged, _ = _log_overlap((0.5, 0.5), "component_wise", (belief, other), merge_distance=2.0)
    matched, _ = _log_overlap((0.5, 0.5), "moment_matched", (belief, other))
    assert merged == pytest.approx(matched, abs=1e-13)
