"""Estimates and track histories."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densities.examples import glmbs, lmbs, plain_glmb, plain_lmb, random_poisson
from reference import glmb as oracle
from vedette.densities import (
    GLMB,
    LMB,
    Estimate,
    TrackTable,
    as_glmb,
    as_lmb,
    at_dominant_components,
    cardinality_distribution,
    map_estimate,
    marginal_estimate,
    resolve_labels,
    track_histories,
)
from vedette.errors import InputError, NumericalError


def _labels(estimate: Estimate):
    return [tuple(label) for label in estimate.labels.tolist()]


@given(glmbs())
def test_map_estimate_of_a_glmb(glmb):
    estimate = map_estimate(glmb)
    estimate.validate()
    plain = plain_glmb(glmb)
    number = int(np.argmax(cardinality_distribution(glmb)))
    weight, tracks = max((hyp for hyp in plain if len(hyp[1]) == number), key=lambda hyp: hyp[0])
    assert _labels(estimate) == sorted(tracks)
    marginals = oracle.to_lmb(plain)
    for i, label in enumerate(_labels(estimate)):
        _, mean, cov = max(tracks[label], key=lambda component: component[0])
        np.testing.assert_allclose(estimate.means[i], mean, atol=1e-12)
        np.testing.assert_allclose(estimate.covs[i], cov, atol=1e-12)
        assert estimate.existence[i] == pytest.approx(marginals[label][0], abs=1e-12)
    assert weight <= 1.0


@given(lmbs())
def test_map_estimate_of_an_lmb_is_that_of_its_glmb(lmb):
    estimate, other = map_estimate(lmb), map_estimate(as_glmb(lmb, max_hypotheses=10**6)[0])
    estimate.validate()
    assert _labels(estimate) == _labels(other)
    np.testing.assert_allclose(estimate.means, other.means)
    np.testing.assert_allclose(estimate.existence, other.existence, atol=1e-12)


@given(glmbs())
def test_each_label_at_its_heaviest_component(glmb):
    lmb = as_lmb(glmb)
    peaks = at_dominant_components(lmb)
    peaks.validate()
    plain = plain_lmb(lmb)
    assert peaks.tracks.labels.tolist() == lmb.tracks.labels.tolist()
    np.testing.assert_array_equal(peaks.existence_logit, lmb.existence_logit)
    assert len(peaks.tracks.means) == len(peaks.tracks.labels)
    for i, label in enumerate(lmb.tracks.labels.tolist()):
        _, mean, cov = max(plain[tuple(label)][1], key=lambda component: component[0])
        np.testing.assert_allclose(peaks.tracks.means[i], mean, atol=1e-12)
        np.testing.assert_allclose(peaks.tracks.covs[i], cov, atol=1e-12)


def test_of_components_of_equal_weight_the_first_is_the_heaviest():
    mixture = np.full(2, 0.5), np.array([[3.0, 1.0], [-3.0, 1.0]]), np.tile(np.eye(2), (2, 1, 1))
    rivals = LMB(TrackTable.from_mixtures([(0, 1)], [mixture]), np.zeros(1))
    np.testing.assert_array_equal(at_dominant_components(rivals).tracks.means, [[3.0, 1.0]])
    assert at_dominant_components(at_dominant_components(rivals)).tracks.means.tolist() == [[3.0, 1.0]]
    assert at_dominant_components(LMB.empty(2)).tracks.num_tracks == 0


@given(glmbs(), lmbs(), st.sampled_from([0.0, 0.3, 0.5, 0.9]))
def test_marginal_estimate(glmb, lmb, threshold):
    for density, settled in ((glmb, resolve_labels(glmb, max_components=10)), (lmb, lmb)):
        estimate = marginal_estimate(density, threshold)
        estimate.validate()
        expected = {label: entry for label, entry in plain_lmb(settled).items() if entry[0] > threshold}
        assert _labels(estimate) == sorted(expected)
        for i, label in enumerate(_labels(estimate)):
            assert estimate.existence[i] == pytest.approx(expected[label][0], abs=1e-12)
            _, mean, cov = max(expected[label][1], key=lambda component: component[0])
            np.testing.assert_array_equal(estimate.means[i], mean)
            np.testing.assert_array_equal(estimate.covs[i], cov)


def test_targets_whose_labels_may_be_swapped_are_not_estimated_halfway_between():
    tracks = TrackTable.from_gaussians(
        [[0, 0], [1, 0], [0, 0], [1, 0]], [[0.0], [100.0], [100.0], [0.0]], [np.eye(1)] * 4
    )
    estimate = marginal_estimate(GLMB.from_hypotheses(tracks, [[0, 1], [2, 3]], [0.55, 0.45]))
    assert estimate.means.tolist() == [[0.0], [100.0]]


def test_ties_go_to_the_smaller_number_the_earlier_hypothesis_and_the_smaller_label():
    tracks = TrackTable.from_gaussians([[0, 0], [0, 1]], [[0.0], [1.0]], [np.eye(1)] * 2)
    glmb = GLMB.from_hypotheses(tracks, [[1], [0], [0, 1]], [0.25, 0.25, 0.5])
    assert _labels(map_estimate(glmb)) == [(0, 1)]
    lmb = LMB.from_bernoullis([[0, 0], [0, 1]], [0.4, 0.4], [[0.0], [1.0]], [np.eye(1)] * 2)
    assert cardinality_distribution(lmb) == pytest.approx([0.36, 0.48, 0.16])
    assert _labels(map_estimate(lmb)) == [(0, 0)]


def test_no_target():
    for density in (GLMB.empty(4), LMB.empty(4)):
        for estimate in (map_estimate(density), marginal_estimate(density), Estimate.empty(4)):
            estimate.validate()
            assert estimate.num_targets == 0
            assert estimate.means.shape == (0, 4)


def test_bad_requests_are_refused():
    for threshold in (-0.1, 1.0, np.nan):
        with pytest.raises(InputError, match="threshold"):
            marginal_estimate(LMB.empty(2), threshold)
    poisson = random_poisson(np.random.default_rng(0), 2)
    with pytest.raises(InputError, match="Poisson"):
        map_estimate(poisson)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="Poisson"):
        marginal_estimate(poisson)  # type: ignore[arg-type]


def _estimate(labels, shift=0.0):
    num = len(labels)
    means = np.array([[step + shift, index + shift] for step, index in labels], float).reshape(-1, 2)
    return Estimate(
        np.array(labels, np.int64).reshape(-1, 2), means, np.tile(np.eye(2), (num, 1, 1)), np.full(num, 0.9)
    )


def test_track_histories_follow_labels():
    estimates = [_estimate([(1, 0)]), _estimate([]), _estimate([(0, 1), (1, 0)], 0.5), _estimate([(0, 1)], 0.75)]
    histories = track_histories(estimates, np.array([10.0, 11.0, 12.0, 13.0]))
    assert [history.label for history in histories] == [(0, 1), (1, 0)]
    assert histories[0].steps.tolist() == [3, 4]
    assert histories[0].times.tolist() == [12.0, 13.0]
    assert histories[1].times.tolist() == [10.0, 12.0]
    assert histories[1].means.tolist() == [[1.0, 0.0], [1.5, 0.5]]
    assert histories[1].covs.shape == (2, 2, 2)
    assert histories[1].existence.tolist() == [0.9, 0.9]
    assert track_histories([], np.empty(0)) == ()
    with pytest.raises(InputError, match="times"):
        track_histories(estimates, np.zeros(3))


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("labels", np.zeros((2, 2), np.int64)),
        ("labels", np.zeros(2, np.int64)),
        ("means", np.full((2, 2), np.nan)),
        ("means", np.zeros((3, 2))),
        ("covs", np.zeros((2, 2, 2))),
        ("existence", np.array([0.5, 1.5])),
        ("existence", np.zeros(3)),
    ],
)
def test_invalid_estimates_are_found(field, value):
    good = _estimate([(0, 0), (0, 1)])
    parts = {name: getattr(good, name) for name in ("labels", "means", "covs", "existence")} | {field: value}
    with pytest.raises((InputError, NumericalError), match=field):
        Estimate(**parts).validate()


def test_the_first_of_the_heaviest_components_stands_for_a_track() -> None:
    rng = np.random.default_rng(5)
    sizes = rng.integers(1, 5, 300)
    mixtures = [
        (weights / weights.sum(), rng.normal(size=(len(weights), 4)), np.tile(np.eye(4), (len(weights), 1, 1)))
        for weights in (rng.integers(1, 3, size).astype(float) for size in sizes)  # many are equally heavy
    ]
    tracks = TrackTable.from_mixtures(np.column_stack([np.ones(300, int), np.arange(300)]), mixtures)
    logits = rng.normal(size=300)
    found = marginal_estimate(LMB(tracks, logits), 0.5)
    chosen = np.flatnonzero(logits > 0.0)
    heaviest = [mixtures[i][1][int(np.argmax(np.log(mixtures[i][0])))] for i in chosen]
    np.testing.assert_array_equal(found.means, heaviest)
    np.testing.assert_array_equal(found.labels[:, 1], chosen)
    assert marginal_estimate(LMB(tracks, np.full(300, -1.0)), 0.5).means.shape == (0, 4)
