"""What all labelled densities say, against the list of all label sets with their weights."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densities.examples import factoreds, glmbs, lmbs, plain_glmb, plain_lmb, plain_product
from reference import glmb as oracle
from vedette.densities import (
    GLMB,
    LMB,
    FactoredGLMB,
    LabelledDensity,
    cardinality_distribution,
    existence_probabilities,
    marginalise,
    track_moments,
)
from vedette.densities.conversions import with_single_gaussians
from vedette.densities.label_sets import without_zero_weights
from vedette.densities.tracks import place_labels

ANY = st.one_of(glmbs(), lmbs(), factoreds(3))


def _sets(density: Any) -> dict[Any, float]:
    """The weight of each label set."""
    plain = {
        GLMB: plain_glmb,
        LMB: lambda lmb: oracle.expand_lmb(plain_lmb(lmb)),
        FactoredGLMB: plain_product,
    }
    return oracle.label_set_weights(plain[type(density)](density))


def _close(got: dict[Any, float], expected: dict[Any, float]) -> None:
    """Sets that are listed by one alone have no weight."""
    for labels in got.keys() | expected.keys():
        np.testing.assert_allclose(got.get(labels, 0.0), expected.get(labels, 0.0), rtol=1e-10, atol=1e-12)


@given(ANY)
def test_numbers_and_existences_are_those_of_all_label_sets(density: LabelledDensity) -> None:
    sets = _sets(density)
    distribution = cardinality_distribution(density)
    numbers = np.bincount([len(labels) for labels in sets], list(sets.values()), len(distribution))
    np.testing.assert_allclose(distribution, numbers, rtol=1e-10, atol=1e-12)
    labels, existence = existence_probabilities(density)
    sums = [sum(w for own, w in sets.items() if tuple(label) in own) for label in labels.tolist()]
    np.testing.assert_allclose(existence, sums, rtol=1e-10)
    by_label = {tuple(label): 0.0 for label in labels.tolist()}
    for label, share in zip(density.tracks.labels.tolist(), density.track_existence, strict=True):
        by_label[tuple(label)] = by_label.get(tuple(label), 0.0) + float(share)
    _close(by_label, {tuple(label): e for label, e in zip(labels.tolist(), sums, strict=True)})


@given(ANY)
def test_a_density_is_the_product_of_its_factors(density: LabelledDensity) -> None:
    _close(_sets(FactoredGLMB.of(density)), _sets(density))
    assert (density.is_lmb, density.is_product) == (type(density) is LMB, type(density) is FactoredGLMB)


@given(ANY)
def test_other_labels_change_nothing_else(density: LabelledDensity) -> None:
    def renamed(label: Any) -> tuple[int, int]:
        return label[0], 100 - label[1]  # in the other order within a step

    labels = np.array([renamed(label) for label in density.tracks.labels.tolist()], np.int64).reshape(-1, 2)
    other = density.with_labels(labels)
    other.validate()
    expected = {tuple(sorted(map(renamed, own))): weight for own, weight in _sets(density).items()}
    _close({tuple(sorted(own)): weight for own, weight in _sets(other).items()}, expected)


@given(ANY)
def test_single_gaussians_have_the_same_sets_and_every_one_once(density: Any) -> None:
    single = with_single_gaussians(density)
    assert single.is_marginalised
    assert single.tracks.num_tracks == len(single.tracks.log_weights)
    _close(_sets(single), _sets(density))
    if density.is_lmb:
        np.testing.assert_array_equal(single.tracks.means, track_moments(density.tracks)[0])
    else:
        np.testing.assert_array_equal(single.tracks.means, marginalise(density).tracks.means)


@pytest.mark.parametrize("kind", [GLMB, FactoredGLMB])
def test_what_is_impossible_goes(kind: type[GLMB] | type[FactoredGLMB]) -> None:
    lmb = LMB.from_bernoullis([[1, 0], [1, 1]], [0.5, 1.0], np.zeros((2, 2)), np.tile(np.eye(2), (2, 1, 1)))
    product = FactoredGLMB.of(lmb)
    assert without_zero_weights(lmb) is lmb
    assert product.num_hyps == 4
    hyps: list[list[int]] = [[0, 1], [0], [1]]
    density: Any = product if kind is FactoredGLMB else GLMB.from_hypotheses(lmb.tracks, hyps, [0.5, 0.0, 0.5])
    fewer = without_zero_weights(density)
    fewer.validate()
    assert fewer.num_hyps == density.num_hyps - 1
    _close(_sets(fewer), _sets(lmb))
    assert without_zero_weights(fewer) is fewer


def test_labels_of_tables_are_placed() -> None:
    labels, places = place_labels([np.array([[1, 1], [2, 0]]), np.empty((0, 2), np.int64), np.array([[2, 0], [1, 0]])])
    np.testing.assert_array_equal(labels, [[1, 0], [1, 1], [2, 0]])
    np.testing.assert_array_equal(places, [[-1, -1, 1], [0, -1, -1], [1, -1, 0]])
