"""Conversions between densities: what they keep, and exactness against enumeration."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densities.examples import (
    glmbs,
    label_of,
    lmbs,
    plain_glmb,
    plain_lmb,
    plain_mixture,
    plain_moments,
    random_covs,
    random_glmb,
)
from reference import glmb as oracle
from vedette.densities import (
    GLMB,
    LMB,
    TrackTable,
    as_glmb,
    as_lmb,
    cardinality_distribution,
    existence_probabilities,
    marginalise,
)
from vedette.errors import InputError, NumericalError

EXACT: dict[str, Any] = {"max_components": 10**9, "log_min_weight": -np.inf, "merge_distance": 0.0}
LIMITS = st.sampled_from([{}, EXACT, {"max_components": 3}])


def _close(got, expected):
    np.testing.assert_allclose(got, expected, rtol=1e-10, atol=1e-12)


def _set_moments(glmb: GLMB):
    """(label set, label) -> moments of the label's density given the set."""
    pooled: dict = {}
    for weight, tracks in plain_glmb(glmb):
        for label, mixture in tracks.items():
            place = pooled.setdefault((tuple(sorted(tracks)), label), [])
            place.extend((weight * w, m, c) for w, m, c in mixture)
    return {place: plain_moments(mixture) for place, mixture in pooled.items()}


@given(glmbs(), LIMITS)
def test_marginalise_keeps_label_sets_cardinality_and_existence(glmb, limits):
    marginal = marginalise(glmb, **limits)
    marginal.validate()
    assert marginal.is_marginalised
    assert np.all(np.diff(marginal.hyp_log_weights) <= 0.0)
    assert len(marginal.hyp_tracks) == marginal.tracks.num_tracks
    expected = oracle.label_set_weights(plain_glmb(glmb))
    assert oracle.label_set_weights(plain_glmb(marginal)) == pytest.approx(expected, rel=1e-12)
    _close(np.trim_zeros(cardinality_distribution(marginal), "b"), np.trim_zeros(cardinality_distribution(glmb), "b"))
    for got, wanted in zip(existence_probabilities(marginal), existence_probabilities(glmb), strict=True):
        _close(got, wanted)


@given(glmbs(), st.sampled_from([{}, EXACT, {"max_components": 10**9, "log_min_weight": -np.inf}]))
def test_marginalise_keeps_the_moments_of_each_label_in_each_set(glmb, limits):
    expected, got = _set_moments(glmb), _set_moments(marginalise(glmb, **limits))
    assert got.keys() == expected.keys()
    for place in expected:
        _close(got[place][0], expected[place][0])
        _close(got[place][1], expected[place][1])


@given(glmbs())
def test_marginalising_twice_changes_nothing(glmb):
    once = marginalise(glmb)
    twice = marginalise(once)
    assert np.array_equal(twice.tracks.labels, once.tracks.labels)
    _close(twice.hyp_log_weights, once.hyp_log_weights)
    _close(twice.tracks.means, once.tracks.means)
    _close(twice.tracks.covs, once.tracks.covs)


def test_a_track_that_all_hypotheses_share_is_kept_as_it_is():
    tracks = TrackTable.from_mixtures(
        [[0, 0], [0, 1], [0, 1]],
        [
            ([0.3, 0.7], [[0.0, 0.0], [5.0, 1.0]], [np.eye(2)] * 2),
            ([1.0], [[1.0, 0.0]], [np.eye(2)]),
            ([1.0], [[2.0, 0.0]], [np.eye(2)]),
        ],
    )
    marginal = marginalise(GLMB.from_hypotheses(tracks, [[0, 1], [0, 2]], [0.5, 0.5]), **EXACT)
    assert plain_mixture(marginal.tracks, 0)[0][0] == pytest.approx(0.7)
    assert len(plain_mixture(marginal.tracks, 0)) == 2
    assert len(plain_mixture(marginal.tracks, 1)) == 2


def test_marginalised_hypotheses_of_equal_weight_keep_their_order():
    tracks = TrackTable.from_gaussians([[0, 0], [0, 1]], np.zeros((2, 2)), [np.eye(2)] * 2)
    glmb = GLMB.from_hypotheses(tracks, [[1], [], [0], [0, 1]], [0.25] * 4)
    sizes = np.diff(marginalise(glmb).hyp_offsets)
    assert sizes.tolist() == [1, 0, 1, 2]
    assert marginalise(glmb).tracks.labels[0].tolist() == [0, 1]


def test_a_label_set_of_weight_zero_is_kept():
    tracks = TrackTable.from_gaussians([[0, 0], [0, 0]], [[0.0, 0.0], [2.0, 0.0]], [np.eye(2)] * 2)
    marginal = marginalise(GLMB.from_hypotheses(tracks, [[0], [1], []], [0.0, 0.0, 1.0]))
    marginal.validate()
    assert marginal.hyp_log_weights.tolist() == [0.0, -np.inf]
    _close(marginal.tracks.means, [[1.0, 0.0]])
    lmb = as_lmb(GLMB.from_hypotheses(tracks, [[0], [1], []], [0.0, 0.0, 1.0]))
    lmb.validate()
    assert lmb.existence_logit.tolist() == [-np.inf]


@given(glmbs(), st.randoms(use_true_random=False))
def test_relabelling_changes_nothing(glmb, random):
    pairs = sorted({label_of(glmb.tracks, t) for t in range(glmb.tracks.num_tracks)})
    renamed = dict(zip(pairs, random.sample([(i, j) for i in range(9) for j in range(9)], len(pairs)), strict=True))
    labels = np.array([renamed[label_of(glmb.tracks, t)] for t in range(glmb.tracks.num_tracks)], np.int64).reshape(
        -1, 2
    )
    tracks = TrackTable(labels, glmb.tracks.offsets, *glmb.tracks.to_kernel().components)
    hypotheses = [glmb.hyp_tracks[a:b] for a, b in zip(glmb.hyp_offsets, glmb.hyp_offsets[1:], strict=False)]
    other = GLMB.from_hypotheses(tracks, hypotheses, np.exp(glmb.hyp_log_weights))
    _close(cardinality_distribution(other), cardinality_distribution(glmb))
    _close(marginalise(other).hyp_log_weights, marginalise(glmb).hyp_log_weights)
    before, after = plain_lmb(as_lmb(glmb)), plain_lmb(as_lmb(other))
    assert {renamed[label] for label in before} == set(after)
    for label, (existence, mixture) in before.items():
        assert after[renamed[label]][0] == pytest.approx(existence, rel=1e-12)
        _close(plain_moments(after[renamed[label]][1])[0], plain_moments(mixture)[0])


@given(glmbs())
def test_glmb_to_lmb_equals_enumeration(glmb):
    lmb = as_lmb(glmb, **EXACT)
    lmb.validate()
    expected, got = oracle.to_lmb(plain_glmb(glmb)), plain_lmb(lmb)
    assert list(got) == list(expected)
    for label, (existence, mixture) in expected.items():
        assert got[label][0] == pytest.approx(existence, rel=1e-12)
        for a, b in zip(plain_moments(got[label][1]), plain_moments(mixture), strict=True):
            _close(a, b)
    labels, probabilities = existence_probabilities(glmb)
    assert [tuple(label) for label in labels.tolist()] == list(expected)
    _close(lmb.existence, probabilities)


def test_existence_near_one_keeps_its_precision():
    tracks = TrackTable.from_gaussians([[0, 0]], [[0.0, 0.0]], [np.eye(2)])
    for log_absent in (-50.0, -900.0):
        glmb = GLMB(tracks, np.array([0, 1, 1]), np.array([0]), np.array([0.0, log_absent]))
        assert as_lmb(glmb).existence_logit[0] == pytest.approx(-log_absent, rel=1e-14)
        rare = GLMB(tracks, np.array([0, 1, 1]), np.array([0]), np.array([log_absent, 0.0]))
        assert as_lmb(rare).existence_logit[0] == pytest.approx(log_absent, rel=1e-14)


@given(lmbs())
def test_lmb_to_glmb_and_back_is_the_identity(lmb):
    glmb, discarded = as_glmb(lmb, max_hypotheses=10**6)
    glmb.validate()
    assert discarded == 0.0
    assert glmb.num_hyps == 2**lmb.tracks.num_tracks
    back = as_lmb(glmb)
    assert np.array_equal(back.tracks.labels, lmb.tracks.labels)
    _close(back.existence_logit, lmb.existence_logit)
    _close(back.tracks.means, lmb.tracks.means)
    _close(back.tracks.covs, lmb.tracks.covs)


@given(lmbs(), st.integers(1, 70))
def test_lmb_to_glmb_lists_the_heaviest_subsets_in_order(lmb, max_hypotheses):
    glmb, discarded = as_glmb(lmb, max_hypotheses=max_hypotheses)
    glmb.validate()
    exact = oracle.label_set_weights(oracle.expand_lmb(plain_lmb(lmb)))
    heaviest = np.sort(list(exact.values()))[::-1][:max_hypotheses]
    _close(np.exp(glmb.hyp_log_weights), heaviest / heaviest.sum())
    assert discarded == pytest.approx(1.0 - heaviest.sum(), abs=1e-12)
    for weight, tracks in plain_glmb(glmb):
        assert weight * heaviest.sum() == pytest.approx(exact[tuple(sorted(tracks))], rel=1e-9)


def test_certain_and_impossible_labels_are_not_doubted():
    lmb = LMB.from_bernoullis([[0, 0], [0, 1], [0, 2]], [1.0, 0.0, 0.25], np.zeros((3, 2)), [np.eye(2)] * 3)
    glmb, discarded = as_glmb(lmb, max_hypotheses=100)
    assert discarded == 0.0
    assert oracle.label_set_weights(plain_glmb(glmb)) == pytest.approx(
        {((0, 0),): 0.75, ((0, 0), (0, 2)): 0.25}, rel=1e-12
    )


def test_many_labels_and_few_hypotheses():
    rng = np.random.default_rng(8)
    num = 70
    lmb = LMB.from_bernoullis(
        [(0, i) for i in range(num)], rng.uniform(0.9, 0.99, num), np.zeros((num, 2)), random_covs(rng, num)
    )
    glmb, discarded = as_glmb(lmb, max_hypotheses=500)
    glmb.validate()
    assert glmb.num_hyps == 500
    assert 0.0 < discarded < 1.0
    assert glmb.is_marginalised
    assert np.all(np.diff(glmb.hyp_log_weights) <= 1e-12)


@pytest.mark.parametrize("convert", [marginalise, as_lmb])
@pytest.mark.parametrize(
    ("field", "value"),
    [("max_components", 0), ("log_min_weight", 0.1), ("merge_distance", -1.0), ("merge_distance", np.nan)],
)
def test_limits_outside_their_range_are_refused(convert, field, value):
    glmb = random_glmb(np.random.default_rng(0), 2, 3, 1)
    with pytest.raises(InputError, match=field):
        convert(glmb, **{field: value})


def test_no_hypothesis_at_all_is_refused():
    with pytest.raises(InputError, match="max_hypotheses"):
        as_glmb(LMB.empty(2), max_hypotheses=0)


@pytest.mark.lanes
def test_densities_of_no_target():
    assert marginalise(GLMB.empty(4)).num_hyps == 1
    assert as_lmb(GLMB.empty(4)).tracks.num_tracks == 0
    glmb, discarded = as_glmb(LMB.empty(4), max_hypotheses=5)
    glmb.validate()
    assert (glmb.num_hyps, discarded) == (1, 0.0)


@pytest.mark.lanes
@pytest.mark.parametrize("limits", [{}, EXACT, {"max_components": 2}])
def test_conversions_leave_their_input_alone(limits):
    glmb = random_glmb(np.random.default_rng(1), 4, 12, 3)
    tracks, *hypotheses = glmb.to_kernel()
    *columns, marks = tracks.components
    arrays = tracks.labels, tracks.offsets, *columns, *marks, *hypotheses
    before = [array.copy() for array in arrays]
    marginalise(glmb, **limits)
    as_glmb(as_lmb(glmb, **limits), max_hypotheses=5)
    for array, copy in zip(arrays, before, strict=True):
        assert np.array_equal(array, copy)


def test_targets_too_far_apart_for_one_gaussian():
    tracks = TrackTable.from_gaussians([[0, 0], [0, 0]], [[0.0] * 4, [1e9, 1e9, 0.0, 0.0]], [1e-4 * np.eye(4)] * 2)
    glmb = GLMB.from_hypotheses(tracks, [[0], [1]], [0.5, 0.5])
    for convert in (marginalise, as_lmb):
        with pytest.raises(NumericalError, match="positive definite within the precision"):
            convert(glmb)
        convert(glmb, max_components=2).validate()
