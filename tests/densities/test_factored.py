"""Products of GLMBs: what is read off them and made of them, against all their combinations."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densities.examples import (
    factoreds,
    lmbs,
    plain_glmb,
    plain_lmb,
    plain_moments,
    plain_product,
    random_factor,
    random_factored,
    random_lmb,
)
from reference import glmb as oracle
from vedette.densities import (
    GLMB,
    LMB,
    FactoredGLMB,
    as_glmb,
    as_lmb,
    cardinality_distribution,
    existence_probabilities,
    load_density,
    map_estimate,
    marginal_estimate,
    marginalise,
    save_density,
)
from vedette.densities.label_sets import as_single_factor, take_factors, without_labels
from vedette.errors import InputError

ALL = 10**6
EXACT: dict[str, Any] = {"max_components": 10**9, "log_min_weight": -np.inf, "merge_distance": 0.0}


def _close(got, expected):
    np.testing.assert_allclose(got, expected, rtol=1e-10, atol=1e-12)


def _all_of(density: FactoredGLMB) -> GLMB:
    """The GLMB of all combinations, made by NumPy alone."""
    hyps: list[tuple[float, list[int]]] = [(1.0, [])]
    for f in range(density.num_factors):
        own = range(density.factor_offsets[f], density.factor_offsets[f + 1])
        members = [density.hyp_tracks[density.hyp_offsets[h] : density.hyp_offsets[h + 1]].tolist() for h in own]
        weights = np.exp(density.hyp_log_weights[list(own)])
        hyps = [(w * v, [*a, *b]) for w, a in hyps for v, b in zip(weights.tolist(), members, strict=True)]
    total = sum(weight for weight, _ in hyps)
    return GLMB.from_hypotheses(density.tracks, [tracks for _, tracks in hyps], [w / total for w, _ in hyps])


def _same_lmb(got: LMB, expected: LMB):
    np.testing.assert_array_equal(got.tracks.labels, expected.tracks.labels)
    _close(got.existence, expected.existence)
    _close(got.tracks.means, expected.tracks.means)
    _close(got.tracks.covs, expected.tracks.covs)
    _close(np.exp(got.tracks.log_weights), np.exp(expected.tracks.log_weights))


@given(factoreds(3))
def test_products_in_order(density):
    glmb, discarded = as_glmb(density, max_hypotheses=ALL)
    glmb.validate()
    assert discarded == 0.0
    assert (np.diff(glmb.hyp_log_weights) <= 1e-12).all()
    plain = plain_product(density)
    assert glmb.num_hyps == len(plain)
    assert oracle.label_set_weights(plain_glmb(glmb)) == pytest.approx(oracle.label_set_weights(plain), abs=1e-12)
    for label, (_, mixture) in oracle.to_lmb(plain_glmb(glmb)).items():
        for a, b in zip(plain_moments(mixture), plain_moments(oracle.to_lmb(plain)[label][1]), strict=True):
            _close(a, b)


@given(factoreds(), st.integers(1, 20))
def test_the_heaviest_products_are_kept(density, most):
    glmb, discarded = as_glmb(density, max_hypotheses=most)
    glmb.validate()
    weights = np.sort([weight for weight, _ in plain_product(density)])[::-1]
    kept = weights[:most]
    _close(np.exp(glmb.hyp_log_weights), kept / kept.sum())
    assert discarded == pytest.approx(1.0 - kept.sum(), abs=1e-12)


def test_products_of_no_weight_are_not_listed():
    certain = FactoredGLMB.of(LMB.from_bernoullis([[0, 1], [0, 2]], [1.0, 0.0], np.zeros((2, 2)), [np.eye(2)] * 2))
    glmb, discarded = as_glmb(certain, max_hypotheses=ALL)
    assert glmb.num_hyps == 1
    assert discarded == 0.0
    assert glmb.tracks.labels[glmb.hyp_tracks].tolist() == [[0, 1]]
    nothing, discarded = as_glmb(FactoredGLMB.empty(2), max_hypotheses=3)
    assert (nothing.num_hyps, len(nothing.hyp_tracks), discarded) == (1, 0, 0.0)
    with pytest.raises(InputError, match="max_hypotheses: expected at least 1; got 0"):
        as_glmb(certain, max_hypotheses=0)


def test_many_factors_of_many_products():
    rng = np.random.default_rng(5)
    labels = np.stack([np.zeros(300, np.int64), rng.permutation(300)], axis=1)
    density = random_factored(rng, [1] * 150 + [3] * 50, labels=labels)
    glmb, discarded = as_glmb(density, max_hypotheses=500)
    glmb.validate()
    assert 0.99 < discarded <= 1.0
    few, _ = as_glmb(density, max_hypotheses=100)
    _close(glmb.hyp_log_weights[1:100] - glmb.hyp_log_weights[0], few.hyp_log_weights[1:] - few.hyp_log_weights[0])


@given(factoreds(3), st.sampled_from([{}, EXACT, {"max_components": 2}]))
def test_the_lmb_is_that_of_all_combinations(density, caps):
    lmb = as_lmb(density, **caps)
    lmb.validate()
    _same_lmb(lmb, as_lmb(_all_of(density), **caps) if caps != {"max_components": 2} else as_lmb(density, **caps))
    expected = oracle.to_lmb(plain_product(density))
    assert list(plain_lmb(lmb)) == sorted(expected)
    for label, (existence, mixture) in plain_lmb(lmb).items():
        assert existence == pytest.approx(expected[label][0], abs=1e-12)
        if caps != {"max_components": 2}:
            _close(plain_moments(mixture)[0], plain_moments(expected[label][1])[0])


@given(lmbs())
def test_an_lmb_comes_back(lmb):
    density = FactoredGLMB.of(lmb)
    density.validate()
    assert density.is_bernoulli.all()
    _same_lmb(as_lmb(density), lmb)
    _same_lmb(as_lmb(lmb), lmb)


@given(factoreds())
def test_numbers_and_existences(density):
    plain = plain_product(density)
    distribution = cardinality_distribution(density)
    expected = np.bincount([len(tracks) for _, tracks in plain], [weight for weight, _ in plain], len(distribution))
    _close(distribution, expected)
    labels, existence = existence_probabilities(density)
    marginals = oracle.to_lmb(plain)
    assert [tuple(label) for label in labels.tolist()] == sorted(marginals)
    _close(existence, [marginals[label][0] for label in sorted(marginals)])


@given(factoreds(3))
def test_the_map_estimate_is_that_of_all_combinations(density):
    estimate, expected = map_estimate(density), map_estimate(_all_of(density))
    estimate.validate()
    np.testing.assert_array_equal(estimate.labels, expected.labels)
    np.testing.assert_array_equal(estimate.means, expected.means)
    _close(estimate.existence, expected.existence)


@pytest.mark.parametrize("sizes", [[3] * 5, [2, 3, 1, 2, 3], [4, 4, 1, 1], [1] * 8, [5], []])
def test_the_map_estimate_of_factors_of_several_targets(sizes):
    for seed in range(30):
        density = random_factored(np.random.default_rng(seed), sizes, num_hyps=5)
        estimate, expected = map_estimate(density), map_estimate(_all_of(density))
        np.testing.assert_array_equal(estimate.labels, expected.labels)
        np.testing.assert_array_equal(estimate.means, expected.means)


def test_ties_of_a_map_estimate_go_as_for_an_lmb():
    labels = [[0, i] for i in (4, 2, 9, 1)]
    lmb = LMB.from_bernoullis(labels, [0.5] * 4, np.zeros((4, 2)), [np.eye(2)] * 4)
    places = np.array([3, 1, 0, 2])
    density = take_factors(FactoredGLMB.of(lmb), places)
    np.testing.assert_array_equal(map_estimate(density).labels, map_estimate(lmb).labels)


def test_certain_and_impossible_targets_are_estimated():
    labels = [[0, 1], [0, 2], [0, 3]]
    lmb = LMB.from_bernoullis(labels, [1.0, 0.0, 1.0], np.zeros((3, 2)), [np.eye(2)] * 3)
    assert map_estimate(FactoredGLMB.of(lmb)).labels.tolist() == [[0, 1], [0, 3]]


@given(factoreds(3), st.sampled_from([0.0, 0.5, 0.9]))
def test_the_marginal_estimate_is_that_of_its_factors(density, threshold):
    estimate = marginal_estimate(density, threshold)
    parts = [marginal_estimate(factor, threshold) for factor in density.factors]
    assert estimate.num_targets == sum(part.num_targets for part in parts)
    for part in parts:
        own = [estimate.labels.tolist().index(label) for label in part.labels.tolist()]
        _close(estimate.means[own], part.means)
        _close(estimate.existence[own], part.existence)


@given(factoreds(3))
def test_factors_are_marginalised_one_by_one(density):
    marginal = marginalise(density)
    marginal.validate()
    assert len(marginal.tracks.log_weights) == marginal.tracks.num_tracks
    for own, before, bernoulli in zip(marginal.factors, density.factors, density.is_bernoulli, strict=True):
        if bernoulli:
            np.testing.assert_array_equal(own.hyp_log_weights, before.hyp_log_weights)
            for a, b in zip(
                (own.tracks.means[0], own.tracks.covs[0]),
                plain_moments(plain_glmb(before)[1][1][tuple(before.tracks.labels[0].tolist())]),
                strict=True,
            ):
                _close(a, b)
        else:
            expected = marginalise(before)
            np.testing.assert_array_equal(own.hyp_log_weights, expected.hyp_log_weights)
            np.testing.assert_array_equal(own.tracks.means, expected.tracks.means)


@given(factoreds(3), st.integers(0, 2**32 - 1))
def test_labels_are_taken_out(density, seed):
    rng = np.random.default_rng(seed)
    labels, existence = existence_probabilities(density)
    gone = rng.random(len(labels)) < 0.4
    left, dropped = without_labels(density, labels[gone])
    left.validate()
    assert dropped == pytest.approx(existence[gone].sum(), abs=1e-12)
    names = {tuple(label) for label in labels[gone].tolist()}
    plain = [
        (w, {name: own for name, own in tracks.items() if name not in names}) for w, tracks in plain_product(density)
    ]
    expected = oracle.label_set_weights(plain)
    got = oracle.label_set_weights(plain_product(left))
    assert {key: value for key, value in got.items() if value > 0.0} == pytest.approx(expected, abs=1e-12)
    assert (np.diff(left.track_offsets) > 0).all()
    one_label = [len({tuple(label) for label in own.tracks.labels.tolist()}) == 1 for own in left.factors]
    np.testing.assert_array_equal(left.is_bernoulli, one_label)
    for label, (_, mixture) in oracle.to_lmb(plain_product(left)).items():
        _close(plain_moments(mixture)[0], plain_moments(oracle.to_lmb(plain)[label][1])[0])


def test_nothing_is_taken_out_and_everything():
    density = random_factored(np.random.default_rng(1), [1, 3, 2])
    same, dropped = without_labels(density, np.empty((0, 2), np.int64))
    assert same is density
    assert dropped == 0.0
    nothing, _ = without_labels(density, density.tracks.labels)
    nothing.validate()
    assert nothing.num_factors == 0


@given(factoreds(3), st.integers(0, 2**32 - 1))
def test_factors_are_taken_in_any_order(density, seed):
    rng = np.random.default_rng(seed)
    places = rng.permutation(density.num_factors)[: int(rng.integers(density.num_factors + 1))]
    taken = take_factors(density, places)
    taken.validate()
    for place, own in zip(places, taken.factors, strict=True):
        assert plain_glmb(own)[0][0] == plain_glmb(density.factor(int(place)))[0][0]
        np.testing.assert_array_equal(own.tracks.labels, density.factor(int(place)).tracks.labels)
        np.testing.assert_array_equal(own.hyp_tracks, density.factor(int(place)).hyp_tracks)
        np.testing.assert_array_equal(own.tracks.covs, density.factor(int(place)).tracks.covs)


def test_a_factor_of_one_label_is_laid_out_as_of_an_lmb():
    tracks = random_factor(np.random.default_rng(0), [[1, 0], [1, 1]], 3).tracks
    glmb = GLMB.from_hypotheses(tracks, [[0], [1], []], [0.5, 0.3, 0.2])
    own = as_single_factor(glmb)
    own.validate()
    assert own.is_bernoulli.tolist() == [True]
    _close(np.exp(own.hyp_log_weights), [0.2, 0.8])
    assert own.tracks.offsets[1] == tracks.offsets[2]
    assert as_single_factor(GLMB.empty(2)).num_factors == 0


@given(factoreds(3))
def test_every_bit_of_a_file_is_kept(tmp_path_factory, density):
    path = tmp_path_factory.mktemp("densities") / "belief.npz"
    save_density(path, density)
    loaded = load_density(path)
    assert isinstance(loaded, FactoredGLMB)
    for name in ("track_offsets", "hyp_offsets", "hyp_tracks", "hyp_log_weights", "factor_offsets"):
        assert getattr(loaded, name).tobytes() == getattr(density, name).tobytes()
    assert loaded.tracks.covs.tobytes() == density.tracks.covs.tobytes()


def test_a_fault_is_told_with_its_factor():
    density = random_factored(np.random.default_rng(2), [1, 2, 1])
    for change, message in (
        (("hyp_log_weights", 0, 0.5), "factor 0: hyp_log_weights.* sum to 1"),
        (("hyp_log_weights", 3, np.nan), "factor 1: hyp_log_weights.*got nan"),
        (("hyp_tracks", 0, 4), r"factor 0: hyp_tracks\[0\]: expected an index into 1 tracks; got 4"),
    ):
        name, place, value = change
        array = getattr(density, name).copy()
        array[place] = value
        with pytest.raises(InputError, match=message):
            replace(density, **{name: array})
    with pytest.raises(InputError, match=r"tracks.labels: expected each label in one factor; got \[.*\] in \[0, 1\]"):
        FactoredGLMB.product([FactoredGLMB.of(random_lmb(np.random.default_rng(3), 1))] * 2, 2)
    with pytest.raises(InputError, match=r"factors\[0\]: expected a GLMB"):
        FactoredGLMB.from_factors([random_lmb(np.random.default_rng(3), 1)], 2)  # type: ignore[list-item]
