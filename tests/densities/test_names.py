"""Names that are open are settled: against every way to give them, and in the cases for which it is done."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given

from densities.examples import factoreds, glmbs, lmbs, plain_glmb, plain_lmb
from filters.examples import assert_same_mixtures
from reference import glmb as oracle
from reference.names import settled
from vedette.densities import (
    GLMB,
    FactoredGLMB,
    TrackTable,
    as_lmb,
    cardinality_distribution,
    marginal_estimate,
    resolve_labels,
)

_ALL: dict[str, Any] = {"max_components": 10**6, "log_min_weight": -np.inf, "merge_distance": 0.0}
_FAR = 4.0  # standard deviations, as the library has it


def _renamed(factor):
    plain = plain_glmb(factor)
    names = settled(plain, _FAR)
    return oracle.to_lmb(
        [
            (w, {own[label]: mixture for label, mixture in tracks.items()})
            for (w, tracks), own in zip(plain, names, strict=True)
        ]
    )


def _combined(mixture):
    """Components that are the same one, once."""
    weights: dict[Any, float] = {}
    for weight, mean, cov in mixture:
        key = tuple(mean), tuple(map(tuple, cov))
        weights[key] = weights.get(key, 0.0) + weight
    return [(w, np.array(mean), np.array(cov)) for (mean, cov), w in weights.items() if w > 0.0]


def _same(got, expected):
    assert got.keys() == expected.keys()
    for label, (existence, mixture) in got.items():
        assert existence == pytest.approx(expected[label][0], abs=1e-10)
        assert_same_mixtures(_combined(mixture), _combined(expected[label][1]))


@given(glmbs())
def test_names_of_a_glmb_are_those_of_the_cheapest_assignments(glmb):
    _same(plain_lmb(resolve_labels(glmb, **_ALL)), _renamed(glmb))


@given(factoreds(max_components=2))
def test_factors_are_settled_each_by_itself(density):
    expected: dict[Any, Any] = {}
    for factor in density.factors:
        expected |= _renamed(factor)
    _same(plain_lmb(resolve_labels(density, **_ALL)), expected)


@given(lmbs())
def test_an_lmb_has_no_open_names(lmb):
    assert resolve_labels(lmb) is lmb
    _same(plain_lmb(resolve_labels(FactoredGLMB.of(lmb), **_ALL)), plain_lmb(lmb))


@given(factoreds())
def test_the_mean_number_of_targets_stays(density):
    expected = np.dot(cardinality_distribution(density), np.arange(len(cardinality_distribution(density))))
    assert resolve_labels(density).existence.sum() == pytest.approx(expected, abs=1e-9)


def _tracks(labels, places):
    return TrackTable.from_gaussians(labels, [[float(x)] for x in places], [np.eye(1)] * len(labels))


def test_one_target_with_two_names_is_one_target():
    glmb = GLMB.from_hypotheses(_tracks([[1, 0], [2, 0]], [0, 0.1]), [[0], [1], []], [0.19, 0.78, 0.03])
    settled_names = resolve_labels(glmb)
    assert settled_names.tracks.labels.tolist() == [[2, 0]]
    assert settled_names.existence == pytest.approx([0.97])
    assert as_lmb(glmb).existence == pytest.approx([0.19, 0.78])
    assert marginal_estimate(glmb, 0.9).num_targets == 1


def test_two_targets_that_may_be_swapped_stand_in_two_places():
    tracks = _tracks([[0, 0], [1, 0], [0, 0], [1, 0]], [0, 100, 100, 0])
    density = FactoredGLMB.of(GLMB.from_hypotheses(tracks, [[0, 1], [2, 3]], [0.4, 0.6]))
    lmb = resolve_labels(density)
    assert lmb.existence == pytest.approx([1.0, 1.0])
    assert lmb.tracks.means.ravel() == pytest.approx([100.0, 0.0])


def test_a_target_far_from_all_takes_a_name_that_is_free():
    """One of two labels here, or one of them there: two places, though both hypotheses name the first."""
    tracks = _tracks([[0, 0], [0, 0], [1, 0]], [0, 100, 1])
    lmb = resolve_labels(GLMB.from_hypotheses(tracks, [[0], [1], [2]], [0.5, 0.3, 0.2]))
    assert lmb.existence == pytest.approx([0.7, 0.3])
    assert lmb.tracks.means[1] == pytest.approx([100.0])
