"""The LMB filter and its association marginals against enumeration."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import logit

import reference
from filters.examples import (
    DT,
    SCENES,
    assert_same_mixtures,
    linear_scene,
    plain_lmb,
    together,
)
from filters.tables import choices_of, make_options, tables
from reference import glmb as oracle
from vedette.densities import LMB, TrackTable
from vedette.filters import Limits
from vedette.kernels.association.assignment import ABSENT, MISSED
from vedette.kernels.association.marginals import option_marginals
from vedette.kernels.association.search import SearchCaps

pytestmark = pytest.mark.lanes

UNLIMITED = SearchCaps(2**62, math.inf, 2**62)


def marginals_of(options):
    """Log total weight of all joint choices, and the log marginal probability of each option, by enumeration."""
    choices = choices_of(options, range(len(options.offsets) - 1))
    marginals = np.full(len(options.columns), -np.inf)
    if not choices:
        return -math.inf, marginals
    for weight, chosen in choices:
        marginals[list(chosen)] = np.logaddexp(marginals[list(chosen)], weight)
    total = float(np.logaddexp.reduce([weight for weight, _ in choices]))
    return total, marginals - total


def assert_marginals(options, num_ranked=None):
    got, (total, ranked, _) = option_marginals(options, UNLIMITED, None)
    expected_total, expected = marginals_of(options)
    if expected_total == -math.inf:
        assert total == -math.inf
        return
    assert total == pytest.approx(expected_total, abs=1e-10)
    np.testing.assert_allclose(np.exp(got), np.exp(expected), rtol=1e-10, atol=1e-13)
    if num_ranked is not None:
        assert ranked == num_ranked


@given(tables(max_rows=5))
def test_marginals(table):
    options, _ = table
    assert_marginals(options)


@settings(max_examples=5)
@given(st.integers(0, 2**32 - 1))
def test_dense_clusters(seed):
    rng = np.random.default_rng(seed)
    rows = [[(column, rng.normal(scale=2.0)) for column in (ABSENT, MISSED, *range(4))] for _ in range(5)]
    rows += [[(column, rng.normal()) for column in (MISSED, 4, 5)] for _ in range(2)]
    assert_marginals(make_options(rows, 6), num_ranked=0)


def test_more_measurements_than_the_exact_sum_takes_are_ranked():
    rng = np.random.default_rng(2)
    spans = [range(0, 6), range(4, 11), range(9, 15)]
    rows = [[(column, rng.normal(scale=2.0)) for column in (ABSENT, MISSED, *span)] for span in spans]
    assert_marginals(make_options(rows, 15), num_ranked=1)


def test_weights_beyond_the_range_of_floats():
    rows = [[(0, 0.0), (1, -700.0), (MISSED, -800.0)], [(0, 0.0), (MISSED, -650.0)], [(1, -2.0), (0, -3.0)]]
    assert_marginals(make_options(rows, 2), num_ranked=1)


def test_a_row_without_options_forbids_all():
    tables_without_choice: list[list[list[tuple[int, float]]]] = [[[]], [[(0, 1.0)], []], [[(0, 0.0)], [(0, 0.0)]]]
    for rows in tables_without_choice:
        _, sums = option_marginals(make_options(rows, 1), UNLIMITED, None)
        assert sums.log_total == -math.inf


def assert_same_lmb(got, expected):
    assert got.keys() == expected.keys()
    for label, (existence, mixture) in expected.items():
        assert got[label][0] == pytest.approx(existence, abs=1e-10)
        assert_same_mixtures(together(got[label][1]), together(mixture))


@pytest.mark.parametrize("name", SCENES)
def test_filter_equals_enumeration(name):
    scene = SCENES[name]()
    tracker, rng = scene.lmb_filter(), np.random.default_rng(0)
    belief, plain = tracker.initial(), reference.Lmb()
    for step, scan in enumerate(scene.scans, 1):
        plain = oracle.lmb_step(plain, scene.plain_births(step), list(scan), scene.plain)
        plain = {label: (existence, together(mixture)) for label, (existence, mixture) in plain.items()}
        belief, info = tracker.step(belief, scan, scene.pose, DT, step, rng=rng)
        belief.validate()
        assert_same_lmb(plain_lmb(belief), plain)
        assert info.num_inexact_clusters == 0
        assert info.dropped_existence == 0.0


def test_certain_and_impossible_tracks():
    scene = linear_scene()
    tracker, rng = scene.lmb_filter(), np.random.default_rng(0)
    tracks = TrackTable.from_gaussians([[-2, 0], [-1, 0]], scene.births.means, scene.births.covs)
    belief = LMB(tracks, np.array([math.inf, -math.inf]))
    posterior, _ = tracker.step(belief, scene.scans[0], scene.pose, DT, 5, rng=rng)
    posterior.validate()
    certain = {(-2, 0): (1.0, plain_lmb(belief)[-2, 0][1])}
    expected = oracle.lmb_step(certain, {}, list(scene.scans[0]), scene.plain)
    got = plain_lmb(posterior)
    assert got[-2, 0][0] == pytest.approx(expected[-2, 0][0], abs=1e-12)
    assert got[-1, 0][0] == 0.0


def test_caps_drop_and_count():
    scene = linear_scene()
    rng = np.random.default_rng(0)
    limits = Limits(min_existence=0.0, max_labels=1, max_components=2, merge_distance=0.0, min_component_weight=0.0)
    exact, _ = scene.lmb_filter().step(scene.lmb_filter().initial(), scene.scans[0], scene.pose, DT, 1, rng=rng)
    capped, info = scene.lmb_filter(limits=limits).step(
        scene.lmb_filter().initial(), scene.scans[0], scene.pose, DT, 1, rng=rng
    )
    capped.validate()
    order = np.argsort(-exact.existence)
    assert capped.tracks.labels.tolist() == exact.tracks.labels[order[:1]].tolist()
    assert capped.existence[0] == pytest.approx(exact.existence[order[0]], abs=1e-5)
    assert info.dropped_existence == pytest.approx(exact.existence[order[1]], abs=1e-5)
    assert len(capped.tracks.log_weights) == 2
    threshold = float(np.mean(exact.existence))
    few, few_info = scene.lmb_filter(limits=Limits(min_existence=threshold)).step(
        scene.lmb_filter().initial(), scene.scans[0], scene.pose, DT, 1, rng=rng
    )
    assert np.all(few.existence_logit >= logit(threshold))
    assert few_info.dropped_existence > 0.0
