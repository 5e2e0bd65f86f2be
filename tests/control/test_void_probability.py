"""Void probabilities against integrals by plain quadrature, sums over all label sets, and samples."""

from __future__ import annotations

import math
from itertools import chain, combinations
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import ndtr

from control.examples import A, B, C, glmb, lmb
from vedette.control import ConstraintContext, VoidProbability, feasible_action_mask, void_probability
from vedette.control.constraints.void import disc_probabilities, near_pairs
from vedette.densities import GLMB, LMB, FactoredGLMB, as_glmb
from vedette.errors import InputError


def in_disc(mean: Any, cov: Any, centre: Any, radius: float) -> float:
    """By Gauss-Legendre in many short pieces across the disc: no axes of the covariance, no window, no series.

    Given x, y is a Gaussian of known mean and variance, so that the integral over y is a difference of two Phi.
    """
    nodes, weights = np.polynomial.legendre.leggauss(20)
    ends = np.linspace(-math.pi / 2.0, math.pi / 2.0, 2001)
    angle = ((ends[1:] + ends[:-1])[:, np.newaxis] + np.diff(ends)[:, np.newaxis] * nodes) / 2.0
    weight = np.diff(ends)[:, np.newaxis] / 2.0 * weights * radius * np.cos(angle)
    x, half = centre[0] + radius * np.sin(angle) - mean[0], radius * np.cos(angle)
    variance = cov[1, 1] - cov[0, 1] ** 2 / cov[0, 0]
    y = centre[1] - mean[1] - cov[0, 1] / cov[0, 0] * x
    density = np.exp(-0.5 * x**2 / cov[0, 0]) / math.sqrt(2.0 * math.pi * cov[0, 0])
    return float((weight * density * (ndtr((y + half) / variance**0.5) - ndtr((y - half) / variance**0.5))).sum())


def covariance(large: float, ratio: float, turn: float) -> Any:
    axes = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    return axes @ np.diag([large**2, (ratio * large) ** 2]) @ axes.T


@given(
    st.floats(0.01, 300.0),
    st.floats(0.01, 1.0),
    st.floats(0.0, math.pi),
    st.floats(-9.0, 9.0),
    st.floats(0.0, 2.0 * math.pi),
    st.booleans(),
)
def test_a_gaussian_in_a_disc(large: float, ratio: float, turn: float, far: float, bearing: float, small: bool) -> None:
    """Discs of radius 1, Gaussians from a hundredth to three hundred times as large, at all distances that matter."""
    cov = covariance(large, ratio, turn)
    cov = (cov + cov.T) / 2.0
    distance = abs(1.0 + far * large * (ratio if small else 1.0))
    offset = distance * np.array([math.cos(bearing), math.sin(bearing)])
    found = disc_probabilities(offset[np.newaxis], np.zeros(1, np.int64), cov[np.newaxis], 1.0)
    assert found[0] == pytest.approx(in_disc(np.zeros(2), cov, offset, 1.0), abs=1e-11)


@given(st.floats(0.05, 20.0))
def test_a_round_gaussian_around_its_mean(radius: float) -> None:
    found = disc_probabilities(np.zeros((1, 2)), np.zeros(1, np.int64), np.eye(2)[np.newaxis], radius)
    assert found[0] == pytest.approx(-math.expm1(-0.5 * radius**2), abs=1e-13)


def test_tiny_and_huge_gaussians() -> None:
    offsets = np.array([[0.5, 0.0], [1.5, 0.0], [1.0, 0.0], [0.0, 0.3], [0.0, 1.0]])
    scales = np.array([1e-9, 1e-9, 1e-6, 1e9, 1e-5])
    found = disc_probabilities(offsets, np.arange(5), scales[:, np.newaxis, np.newaxis] ** 2 * np.eye(2), 1.0)
    np.testing.assert_allclose(found[[0, 1]], [1.0, 0.0], atol=1e-13)
    # On the edge half is inside, but for the edge's curve: sigma / (2 sqrt(2 pi) r) of it.
    np.testing.assert_allclose(found[[2, 4]], 0.5 - scales[[2, 4]] / math.sqrt(8.0 * math.pi), atol=1e-11)
    np.testing.assert_allclose(found[3], 0.5e-18, rtol=1e-6)


def test_many_discs_in_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    draw = np.random.default_rng(1)
    offsets, which = draw.normal(0.0, 2.0, (60, 2)), draw.integers(3, size=60)
    covs = np.array([covariance(2.0, 0.1, 0.3), covariance(0.5, 0.02, 1.0), covariance(0.1, 1.0, 0.0)])
    whole = disc_probabilities(offsets, which, covs, 1.5)
    monkeypatch.setattr("vedette.control.constraints.void._NODES_AT_ONCE", 100)
    np.testing.assert_allclose(disc_probabilities(offsets, which, covs, 1.5), whole, rtol=0.0, atol=1e-15)


def test_what_is_left_out_is_less_than_it_says() -> None:
    draw = np.random.default_rng(2)
    means, covs = draw.normal(0.0, 30.0, (20, 2)), np.array([covariance(3.0, 0.2, angle) for angle in np.arange(20.0)])
    centres = draw.normal(0.0, 30.0, (30, 2))
    kept = set(zip(*(index.tolist() for index in near_pairs(centres, means, covs, 4.0)), strict=True))
    assert 0 < len(kept) < 600
    for disc, gaussian in set(np.ndindex(30, 20)) - kept:
        assert in_disc(means[gaussian], covs[gaussian], centres[disc], 4.0) < 1.3e-14


def track_in_disc(belief: Any, track: int, centre: Any, radius: float) -> float:
    tracks = belief.tracks
    parts = range(tracks.offsets[track], tracks.offsets[track + 1])
    return sum(
        math.exp(tracks.log_weights[i]) * in_disc(tracks.means[i, :2], tracks.covs[i, :2, :2], centre, radius)
        for i in parts
    )


CENTRES = np.array([[-60.0, 250.0], [150.0, -100.0], [0.0, 0.0], [-220.0, -260.0], [5000.0, 0.0]])


@pytest.mark.parametrize("num_components", [1, 3])
@pytest.mark.parametrize("radius", [20.0, 150.0])
def test_of_an_lmb_it_is_a_sum_over_label_sets(num_components: int, radius: float) -> None:
    belief = lmb((A, B, C), np.random.default_rng(3), num_components)
    found = void_probability(belief, CENTRES, radius)
    for centre, value in zip(CENTRES, found, strict=True):
        outside = [1.0 - track_in_disc(belief, track, centre, radius) for track in range(3)]
        total = 0.0
        for exist in chain.from_iterable(combinations(range(3), size) for size in range(4)):
            chances = [own if track in exist else 1.0 - own for track, own in enumerate(belief.existence.tolist())]
            total += math.prod(chances) * math.prod(outside[track] for track in exist)
        assert value == pytest.approx(total, abs=1e-10)
    assert found[-1] == 1.0


@pytest.mark.parametrize("num_components", [1, 2])
def test_of_a_glmb_it_is_a_sum_over_hypotheses(num_components: int, monkeypatch: pytest.MonkeyPatch) -> None:
    belief = glmb(((A, B), (), (A, B, C), (C,), (), (A,)), np.random.default_rng(4), num_components)
    found = void_probability(belief, CENTRES, 80.0)
    for centre, value in zip(CENTRES, found, strict=True):
        outside = [1.0 - track_in_disc(belief, track, centre, 80.0) for track in range(belief.tracks.num_tracks)]
        hyps = np.split(belief.hyp_tracks, belief.hyp_offsets[1:-1])
        weights = np.exp(belief.hyp_log_weights)
        total = sum(weight * math.prod(outside[t] for t in hyp) for weight, hyp in zip(weights, hyps, strict=True))
        assert value == pytest.approx(total, abs=1e-10)
    monkeypatch.setattr("vedette.control.constraints.void._BLOCK", 1)
    np.testing.assert_allclose(void_probability(belief, CENTRES, 80.0), found, rtol=1e-14)


def test_of_a_product_of_glmbs_it_is_that_of_all_combinations() -> None:
    draw = np.random.default_rng(6)
    factors = [glmb(((A, B), (), (A,), (A, B)), draw, 2), glmb(((C,), ()), draw, 2)]
    belief = FactoredGLMB.from_factors(factors, 4)
    found = void_probability(belief, CENTRES, 80.0)
    expected = void_probability(factors[0], CENTRES, 80.0) * void_probability(factors[1], CENTRES, 80.0)
    np.testing.assert_allclose(found, expected, rtol=1e-13)
    whole, _ = as_glmb(belief, max_hypotheses=100)
    np.testing.assert_allclose(found, void_probability(whole, CENTRES, 80.0), rtol=1e-12)
    np.testing.assert_array_equal(void_probability(FactoredGLMB.empty(4), CENTRES, 80.0), 1.0)


def test_against_samples() -> None:
    draw = np.random.default_rng(5)
    belief, centre, radius, num = lmb((A, B, C), draw), np.array([-40.0, 230.0]), 60.0, 200_000
    free = np.ones(num, bool)
    for track in range(3):
        places = draw.multivariate_normal(belief.tracks.means[track, :2], belief.tracks.covs[track, :2, :2], num)
        free &= ~((draw.random(num) < belief.existence[track]) & (np.hypot(*(places - centre).T) <= radius))
    (found,) = void_probability(belief, centre[np.newaxis], radius)
    assert free.mean() == pytest.approx(found, abs=4.0 * math.sqrt(found * (1.0 - found) / num))


@pytest.mark.parametrize("belief", [LMB.empty(4), GLMB.empty(4)])
def test_where_no_target_is_known_all_is_void(belief: Any) -> None:
    np.testing.assert_array_equal(void_probability(belief, CENTRES, 100.0), 1.0)


def test_what_exists_for_certain_and_is_certainly_there() -> None:
    belief = LMB.from_bernoullis([(0, 0)], [1.0], [[10.0, 0.0, 0.0, 0.0]], [np.eye(4)])
    np.testing.assert_allclose(
        void_probability(belief, np.array([[0.0, 0.0], [60.0, 0.0]]), 25.0), [0.0, 1.0], atol=1e-12
    )


def test_courses_keep_it_at_every_time() -> None:
    """A target passes from west to east; who stays at the origin meets it at the second of three times."""
    beliefs = tuple(
        LMB.from_bernoullis([(0, 0)], [0.8], [[x, 0.0, 0.0, 0.0]], [np.diag([4.0, 9.0, 1.0, 1.0])])
        for x in (-100.0, 0.0, 100.0)
    )
    still, aside = np.zeros((3, 3)), np.array([[0.0, 20.0, 0.0], [0.0, 60.0, 0.0], [0.0, 60.0, 0.0]])
    scene = ConstraintContext((np.array([still, aside]), np.array([still])), np.array([1.0, 2.0, 3.0]), beliefs)
    constraint = VoidProbability(30.0, 0.5)
    assert [own.tolist() for own in constraint.courses(scene)] == [[False, True], [False]]
    assert VoidProbability(30.0, 0.19).courses(scene)[0].all()
    mask = feasible_action_mask([constraint], scene)
    said = "sensor 2: no course meets its constraints (void_probability); it may take those that violate them least"
    assert mask.notes == (said,)
    with pytest.raises(
        InputError, match="constraint void_probability: expected 3 predicted beliefs, one a time; got 0"
    ):
        feasible_action_mask([constraint], scene._replace(beliefs=()))
