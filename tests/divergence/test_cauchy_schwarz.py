"""Cauchy-Schwarz divergences against set integrals, and their properties."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densities.examples import (
    glmbs,
    lmbs,
    plain_glmb,
    plain_lmb,
    poissons,
    random_covs,
    random_glmb,
    random_lmb,
    random_poisson,
)
from fusion.examples import A, B, C, full_glmbs, glmb, lmb
from reference import set_integral as oracle
from reference.grid import Grid
from vedette.densities import GLMB, LMB, Poisson, TrackTable, as_glmb, marginalise
from vedette.densities.containers import unchecked
from vedette.divergence import cauchy_schwarz, log_inner_product, reference_unit_volume
from vedette.errors import InputError, NumericalError

pytestmark = pytest.mark.lanes

GRID = Grid([-14.0], [18.0], 160)
UNIT_VOLUMES = [1e-3, 1.0, 50.0]


def _delta_glmb(rng) -> GLMB:
    """Two versions of each of two labels' mixtures in five hypotheses, three of one label set."""
    means, covs = rng.normal(size=(4, 2, 1)) + np.array([0.0, 0.5, 4.0, 4.5])[:, None, None], random_covs(rng, 8, 1)
    mixtures = [(rng.dirichlet(np.ones(2)), means[i], covs[2 * i : 2 * i + 2]) for i in range(4)]
    tracks = TrackTable.from_mixtures([A, A, B, B], mixtures)
    return GLMB.from_hypotheses(tracks, [[0, 2], [0, 3], [1, 2], [0], []], rng.dirichlet(np.ones(5)))


@pytest.mark.parametrize("unit_volume", UNIT_VOLUMES)
def test_delta_glmb_equals_the_set_integral(unit_volume):
    rng = np.random.default_rng(1)
    a, b = _delta_glmb(rng), _delta_glmb(rng)
    expected = oracle.cauchy_schwarz(plain_glmb(a), plain_glmb(b), GRID, unit_volume)
    assert cauchy_schwarz(a, b, unit_volume=unit_volume) == pytest.approx(expected, abs=1e-10)
    inner = oracle.inner_product(plain_glmb(a), plain_glmb(b), GRID, unit_volume)
    assert log_inner_product(a, b, unit_volume=unit_volume) == pytest.approx(math.log(inner), abs=1e-10)


@pytest.mark.parametrize("unit_volume", UNIT_VOLUMES)
def test_lmb_equals_the_set_integral(unit_volume):
    rng = np.random.default_rng(2)
    a, b = (lmb((A, B), rng.uniform(0.05, 0.95, 2), rng) for _ in range(2))
    expected = oracle.lmb_cauchy_schwarz(plain_lmb(a), plain_lmb(b), GRID, unit_volume)
    assert cauchy_schwarz(a, b, unit_volume=unit_volume) == pytest.approx(expected, abs=1e-10)


@pytest.mark.parametrize("unit_volume", UNIT_VOLUMES)
def test_poisson_equals_the_set_integral(unit_volume):
    rng = np.random.default_rng(3)
    a, b = (Poisson.from_gaussians(rng.random(2), rng.normal(size=(2, 1)), random_covs(rng, 2, 1)) for _ in range(2))
    plain_a, plain_b = (
        [(math.exp(w), m, c) for w, m, c in zip(p.log_weights, p.means, p.covs, strict=True)] for p in (a, b)
    )
    expected = oracle.poisson_cauchy_schwarz(plain_a, plain_b, GRID, unit_volume)
    assert cauchy_schwarz(a, b, unit_volume=unit_volume) == pytest.approx(expected, rel=1e-9)
    inner = oracle.poisson_inner_product(plain_a, plain_b, GRID, unit_volume)
    assert log_inner_product(a, b, unit_volume=unit_volume) == pytest.approx(math.log(inner), abs=1e-10)


@given(lmbs(), lmbs(), st.sampled_from(UNIT_VOLUMES))
def test_lmbs_equal_their_expanded_glmbs(a, b, unit_volume):
    wide_a, wide_b = (as_glmb(density, max_hypotheses=1000)[0] for density in (a, b))
    expected = cauchy_schwarz(wide_a, wide_b, unit_volume=unit_volume)
    for pair in ((a, b), (a, wide_b), (wide_a, b)):
        assert cauchy_schwarz(*pair, unit_volume=unit_volume) == pytest.approx(expected, abs=1e-10)
        inner = log_inner_product(*pair, unit_volume=unit_volume)
        assert inner == pytest.approx(log_inner_product(wide_a, wide_b, unit_volume=unit_volume), abs=1e-10)


def test_an_lmb_against_a_glmb_that_lacks_sets():
    rng = np.random.default_rng(4)
    a, b = lmb((A, B), (0.6, 0.7), rng), glmb({(A,): 0.5, (A, C): 0.3, (): 0.2}, rng)
    expanded = as_glmb(a, max_hypotheses=100)[0]
    for support in ("full", "common"):
        expected = cauchy_schwarz(expanded, b, unit_volume=3.0, support=support)
        assert cauchy_schwarz(a, b, unit_volume=3.0, support=support) == pytest.approx(expected, abs=1e-11)


@pytest.mark.parametrize("support", ["full", "common"])
@given(a=st.one_of(glmbs(), lmbs()), b=st.one_of(glmbs(), lmbs()), unit_volume=st.sampled_from(UNIT_VOLUMES))
def test_labelled_densities_not_negative_symmetric_zero_for_equal(support, a, b, unit_volume):
    try:
        divergence = cauchy_schwarz(a, b, unit_volume=unit_volume, support=support)
    except InputError:
        assert support == "common"
    else:
        assert divergence >= 0.0
        assert divergence == pytest.approx(cauchy_schwarz(b, a, unit_volume=unit_volume, support=support), abs=1e-10)
    assert cauchy_schwarz(a, a, unit_volume=unit_volume, support=support) == pytest.approx(0.0, abs=1e-12)


@given(poissons(), poissons())
def test_poissons_not_negative_symmetric_zero_for_equal(a, b):
    assert cauchy_schwarz(a, b) >= 0.0
    assert cauchy_schwarz(a, b) == pytest.approx(cauchy_schwarz(b, a), abs=1e-12)
    assert cauchy_schwarz(a, a) == 0.0


def test_marginalising_a_marginalised_density_changes_nothing():
    belief = marginalise(random_glmb(np.random.default_rng(1), 3, 8, 2))
    assert cauchy_schwarz(belief, marginalise(belief)) == pytest.approx(0.0, abs=1e-12)


def test_of_two_certain_gaussians_the_unit_volume_does_not_matter():
    first, second = (LMB.from_bernoullis([A], [1.0], [[mean]], [[[1.0]]]) for mean in (0.0, 2.0))
    # -ln N(0; 2, 2) / N(0; 0, 2).
    for unit_volume in UNIT_VOLUMES:
        assert cauchy_schwarz(first, second, unit_volume=unit_volume) == pytest.approx(1.0, abs=1e-13)


def test_the_unit_volume_weighs_cardinalities():
    rng = np.random.default_rng(5)
    a, b = lmb((A,), (0.9,), rng), lmb((A,), (0.5,), rng)
    # Towards 0 only P(no target) counts, towards infinity only the Gaussians.
    assert cauchy_schwarz(a, b, unit_volume=1e-12) == pytest.approx(0.0, abs=1e-9)
    certain = [LMB(density.tracks, np.array([math.inf])) for density in (a, b)]
    assert cauchy_schwarz(a, b, unit_volume=1e12) == pytest.approx(cauchy_schwarz(*certain), abs=1e-9)


@given(st.integers(0, 2**32 - 1))
def test_the_divergence_of_lmbs_is_the_sum_over_labels(seed):
    rng = np.random.default_rng(seed)
    a, b = (lmb((A, B), rng.uniform(0.0, 1.0, 2), rng) for _ in range(2))
    parts = 0.0
    for i, label in enumerate((A, B)):
        pair = (
            LMB.from_bernoullis([label], [density.existence[i]], density.tracks.means[[i]], density.tracks.covs[[i]])
            for density in (a, b)
        )
        parts += cauchy_schwarz(*pair, unit_volume=2.0)
    assert cauchy_schwarz(a, b, unit_volume=2.0) == pytest.approx(parts, abs=1e-11)


def test_existence_near_one_is_exact():
    mean, cov = np.zeros((1, 1)), np.ones((1, 1, 1))
    tracks = LMB.from_bernoullis([A], [0.5], mean, cov).tracks
    near, surely = LMB(tracks, np.array([40.0])), LMB(tracks, np.array([math.inf]))
    # (1 - r)^2 / (r^2 K <p, p>) = e^-80 / (1e-35 / sqrt(4 pi)); 1 - r is 0 in floats.
    ratio = math.exp(-80.0) / (1e-35 / math.sqrt(4.0 * math.pi))
    assert cauchy_schwarz(near, surely, unit_volume=1e-35) == pytest.approx(0.5 * math.log1p(ratio), rel=1e-10)


def test_large_coordinates_cost_no_digits():
    rng = np.random.default_rng(6)
    a, b = full_glmbs(2, rng, 4)
    shift = np.array([1e6, -1e6, 0.0, 0.0])

    def moved(density: GLMB) -> GLMB:
        t = density.tracks
        tracks = TrackTable(t.labels, t.offsets, t.log_weights, t.means + shift, t.covs)
        return GLMB(tracks, density.hyp_offsets, density.hyp_tracks, density.hyp_log_weights)

    assert cauchy_schwarz(moved(a), moved(b)) == pytest.approx(cauchy_schwarz(a, b), abs=5e-9)
    assert cauchy_schwarz(moved(a), moved(a)) == pytest.approx(0.0, abs=1e-12)


def test_a_truncated_set_is_a_difference_only_on_the_full_support():
    a = glmb({(A,): 0.6, (A, B): 0.3, (): 0.1}, np.random.default_rng(7))
    cut = glmb({(A,): 0.6 / 0.9, (A, B): 0.3 / 0.9}, np.random.default_rng(7))
    assert cauchy_schwarz(a, cut, support="common") == pytest.approx(0.0, abs=1e-12)
    assert cauchy_schwarz(a, cut, unit_volume=1.0) > 1e-3


def test_nothing_in_common_is_infinitely_far():
    rng = np.random.default_rng(8)
    a, b = glmb({(A,): 1.0}, rng), glmb({(B,): 1.0}, rng)
    assert cauchy_schwarz(a, b) == math.inf
    assert log_inner_product(a, b) == -math.inf
    with pytest.raises(InputError, match="share none"):
        cauchy_schwarz(a, b, support="common")
    assert cauchy_schwarz(lmb((A,), (1.0,), rng), lmb((B,), (0.5,), rng)) == math.inf


def test_densities_of_no_target():
    assert cauchy_schwarz(GLMB.empty(4), LMB.empty(4)) == 0.0
    assert cauchy_schwarz(LMB.empty(4), LMB.empty(4)) == 0.0
    nothing = Poisson(np.empty(0), np.empty((0, 4)), np.empty((0, 4, 4)))
    assert cauchy_schwarz(nothing, nothing) == 0.0


def test_what_cannot_be_compared():
    rng = np.random.default_rng(9)
    labelled, unlabelled = random_lmb(rng, 2), random_poisson(rng, 2)
    with pytest.raises(InputError, match="two labelled or two unlabelled densities; got LMB and Poisson"):
        cauchy_schwarz(labelled, unlabelled)
    with pytest.raises(InputError, match="one state dimension; got 2 and 4"):
        cauchy_schwarz(labelled, GLMB.empty(4))
    with pytest.raises(InputError, match="a: expected a GLMB"):
        cauchy_schwarz(1.0, labelled)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="support: 'common'"):
        cauchy_schwarz(unlabelled, unlabelled, support="common")
    with pytest.raises(InputError, match="support: expected"):
        cauchy_schwarz(labelled, labelled, support="union")  # type: ignore[arg-type]
    for unit_volume in (0.0, -1.0, math.inf, math.nan):
        with pytest.raises(InputError, match="unit_volume"):
            cauchy_schwarz(labelled, labelled, unit_volume=unit_volume)
    with pytest.raises(InputError, match=r"b: existence_logit\[0\]"):
        cauchy_schwarz(labelled, unchecked(LMB, labelled.tracks, np.full(2, math.nan)))


def test_reference_volume_makes_the_inner_product_of_a_gaussian_one():
    rng = np.random.default_rng(10)
    cov = random_covs(rng, 1, 4)
    one = LMB.from_bernoullis([A], [1.0], np.zeros((1, 4)), cov)
    unit_volume = reference_unit_volume(one)
    assert log_inner_product(one, one, unit_volume=unit_volume) == pytest.approx(0.0, abs=1e-12)
    poisson = Poisson.from_gaussians([3.0], np.zeros((1, 4)), cov)
    assert reference_unit_volume(poisson) == pytest.approx(unit_volume, rel=1e-12)


def test_reference_volume_weighs_covariances_by_existence():
    rng = np.random.default_rng(11)
    density = lmb((A, B), (0.9, 0.3), rng)
    mean_cov = (0.9 * density.tracks.covs[0, 0, 0] + 0.3 * density.tracks.covs[1, 0, 0]) / 1.2
    expected = math.sqrt(4.0 * math.pi * mean_cov)
    assert reference_unit_volume(density) == pytest.approx(expected, rel=1e-12)
    assert reference_unit_volume(as_glmb(density, max_hypotheses=10)[0]) == pytest.approx(expected, rel=1e-12)
    with pytest.raises(InputError, match="expects a target"):
        reference_unit_volume(GLMB.empty(4))
    with pytest.raises(InputError, match="density: expected a GLMB"):
        reference_unit_volume(None)  # type: ignore[arg-type]


def test_an_overlap_that_is_no_number_is_said():
    """Intensities whose squares are beyond any number."""
    heavy = Poisson(np.array([700.0]), np.zeros((1, 4)), np.eye(4)[None])
    for measure in (cauchy_schwarz, log_inner_product):
        with pytest.raises(NumericalError, match="Poisson densities: expected an overlap that is a number"):
            measure(heavy, heavy)
