"""Multi-target samples: valid, reproducible, and of the right distribution."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densities.examples import glmbs, lmbs, plain_glmb, poissons, random_glmb, random_lmb, random_poisson
from reference import glmb as oracle
from vedette.densities import (
    GLMB,
    LMB,
    MultiTargetSamples,
    Poisson,
    TrackTable,
    as_lmb,
    cardinality_distribution,
    existence_probabilities,
    mixture_moments,
    sample_glmb,
    sample_lmb,
    sample_poisson,
)
from vedette.densities.containers import unchecked
from vedette.errors import InputError, NumericalError

MANY = 40_000


def _within(got, expected, standard_error):
    assert np.all(np.abs(got - expected) <= 5.0 * standard_error + 1e-12)


def _check_label_statistics(samples: MultiTargetSamples, lmb: LMB) -> None:
    """Frequency and first two moments of each label against the marginal of the density."""
    for i, label in enumerate(lmb.tracks.labels):
        states = samples.states[(samples.labels == label).all(axis=1)]
        r = lmb.existence[i]
        _within(len(states) / MANY, r, np.sqrt(r * (1 - r) / MANY))
        cov = lmb.tracks.covs[i]
        _within(states.mean(axis=0), lmb.tracks.means[i], np.sqrt(np.diag(cov) / len(states)))
        variances = np.diag(cov)
        _within(np.cov(states.T), cov, np.sqrt((np.outer(variances, variances) + cov**2) * 2 / len(states)))


def test_distribution_of_glmb_samples():
    glmb = random_glmb(np.random.default_rng(11), 3, 8, 3)
    samples = sample_glmb(glmb, MANY, rng=np.random.default_rng(1))
    _check_label_statistics(samples, as_lmb(glmb))
    sets: dict = {}
    for i in range(MANY):
        key = tuple(tuple(label) for label in samples.sample(i)[0].tolist())
        sets[key] = sets.get(key, 0) + 1
    expected = oracle.label_set_weights(plain_glmb(glmb))
    assert set(sets) <= set(expected)
    for labels, weight in expected.items():
        _within(sets.get(labels, 0) / MANY, weight, np.sqrt(weight * (1 - weight) / MANY))


def test_distribution_of_lmb_samples():
    lmb = random_lmb(np.random.default_rng(12), 4)
    samples = sample_lmb(lmb, MANY, rng=np.random.default_rng(2))
    _check_label_statistics(samples, lmb)
    expected = cardinality_distribution(lmb)
    frequencies = np.bincount(np.diff(samples.offsets), minlength=len(expected)) / MANY
    _within(frequencies, expected, np.sqrt(expected * (1 - expected) / MANY))


def test_distribution_of_poisson_samples():
    poisson = random_poisson(np.random.default_rng(13), 3)
    samples = sample_poisson(poisson, MANY, rng=np.random.default_rng(3))
    number = poisson.expected_number
    _within(len(samples.states) / MANY, number, np.sqrt(number / MANY))
    mean, cov = mixture_moments(poisson.log_weights, poisson.means, poisson.covs)
    _within(samples.states.mean(axis=0), mean, np.sqrt(np.diag(cov) / len(samples.states)))
    assert np.all(samples.labels == -1)


@given(glmbs(), lmbs(), poissons(), st.integers(0, 20))
def test_samples_are_valid_and_repeat(glmb, lmb, poisson, num_samples):
    for draw, density in ((sample_glmb, glmb), (sample_lmb, lmb), (sample_poisson, poisson)):
        samples = draw(density, num_samples, rng=np.random.default_rng(9))
        samples.validate()
        assert samples.num_samples == num_samples
        again = draw(density, num_samples, rng=np.random.default_rng(9))
        assert np.array_equal(samples.states, again.states)
        assert np.array_equal(samples.labels, again.labels)


@given(glmbs())
def test_sampled_label_sets_are_those_of_the_density(glmb):
    samples = sample_glmb(glmb, 30, rng=np.random.default_rng(4))
    known = {tuple(label) for label in existence_probabilities(glmb)[0].tolist()}
    for i in range(30):
        labels = [tuple(label) for label in samples.sample(i)[0].tolist()]
        assert labels == sorted(set(labels))
        assert set(labels) <= known


def test_what_has_no_weight_is_never_drawn():
    tracks = TrackTable.from_mixtures(
        [[0, 0], [0, 1]],
        [
            ([0.0, 1.0, 0.0], [[1e6], [0.0], [1e6]], [np.eye(1)] * 3),
            ([0.5, 0.5, 0.0], [[0.0], [1.0], [1e6]], [np.eye(1)] * 3),
        ],
    )
    glmb = GLMB.from_hypotheses(tracks, [[], [0, 1], [1]], [0.0, 1.0, 0.0])
    samples = sample_glmb(glmb, 5000, rng=np.random.default_rng(0))
    assert np.diff(samples.offsets).tolist() == [2] * 5000
    assert np.abs(samples.states).max() < 10.0


class _Highest(np.random.Generator):
    """Draws the largest number below one, which the sum with a track's number rounds up."""

    def random(self, size=None, dtype=np.float64, out=None):
        return np.full(size, np.nextafter(1.0, 0.0))


def test_the_largest_draw_stays_with_its_track():
    num = 40
    labels = [(0, i) for i in range(num)]
    tracks = TrackTable.from_gaussians(labels, 1e6 * np.arange(num).reshape(num, 1), np.ones((num, 1, 1)))
    glmb = GLMB.from_hypotheses(tracks, [range(num)], [1.0])
    states = sample_glmb(glmb, 1, rng=_Highest(np.random.PCG64(0))).states
    assert np.abs(states - tracks.means).max() < 10.0


def test_certain_and_impossible_targets():
    lmb = LMB.from_bernoullis([[0, 0], [0, 1]], [1.0, 0.0], np.zeros((2, 1)), [np.eye(1)] * 2)
    samples = sample_lmb(lmb, 1000, rng=np.random.default_rng(0))
    assert np.all(samples.labels == [0, 0])
    assert samples.num_samples == len(samples.states) == 1000


def test_bad_requests_are_refused():
    rng = np.random.default_rng(0)
    with pytest.raises(InputError, match="num_samples"):
        sample_glmb(GLMB.empty(2), -1, rng=rng)
    with pytest.raises(InputError, match="num_samples"):
        sample_lmb(LMB.empty(2), -1, rng=rng)
    with pytest.raises(InputError, match="num_samples"):
        sample_poisson(random_poisson(rng, 1), -1, rng=rng)
    with pytest.raises(InputError, match="index"):
        sample_glmb(GLMB.empty(2), 3, rng=rng).sample(3)
    singular = unchecked(Poisson, np.array([5.0]), np.zeros((1, 2)), np.zeros((1, 2, 2)), np.empty((1, 0)))
    with pytest.raises(NumericalError, match="covs"):
        sample_poisson(singular, 3, rng=rng)
    for log_weight in (30.0, 1e3):
        many = unchecked(Poisson, np.array([log_weight]), np.zeros((1, 2)), np.eye(2)[None], np.empty((1, 0)))
        with pytest.raises(InputError, match=r"density.expected_number: expected at most 1e\+09 targets in"):
            sample_poisson(many, 10, rng=rng)


@pytest.mark.parametrize(
    ("field", "offsets", "labels", "states"),
    [
        ("offsets", np.empty(0, np.int64), np.empty((0, 2), np.int64), np.empty((0, 1))),
        ("offsets", np.array([0, 2]), np.zeros((1, 2), np.int64), np.zeros((1, 1))),
        ("labels", np.array([0, 1]), np.zeros((2, 2), np.int64), np.zeros((1, 1))),
        ("states", np.array([0, 1]), np.zeros((1, 2), np.int64), np.zeros(1)),
        ("states", np.array([0, 1]), np.zeros((1, 2), np.int64), np.array([[np.nan]])),
    ],
)
def test_invalid_samples_are_found(field, offsets, labels, states):
    with pytest.raises((InputError, NumericalError), match=field):
        MultiTargetSamples(offsets, labels, states).validate()
