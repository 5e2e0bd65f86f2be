"""The estimate of least expected OSPA, against all combinations of hypotheses."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from densities.examples import plain_product, random_factored
from vedette.densities import (
    LMB,
    FactoredGLMB,
    as_glmb,
    best_estimate,
    least_ospa_estimate,
    map_estimate,
    unlabelled_estimate,
)
from vedette.errors import InputError

from .examples import random_poisson

FAR = 1e6


def candidates(existence: list[float], apart: float = FAR) -> LMB:
    """Labels of these existence probabilities with unit covariances in a row."""
    num = len(existence)
    means = np.zeros((num, 2))
    means[:, 0] = apart * np.arange(num)
    return LMB.from_bernoullis([(1, i) for i in range(num)], existence, means, [np.eye(2)] * num)


def labels_of(estimate: Any) -> list[tuple[int, ...]]:
    return [tuple(label) for label in estimate.labels.tolist()]


def mean_share(combinations: Any, chosen: set[tuple[int, ...]]) -> float:
    """Mean of M / max(n, N), where targets are in place by their labels alone."""
    total = 0.0
    for weight, tracks in combinations:
        larger = max(len(chosen), len(tracks))
        total += weight * (len(chosen & set(tracks)) / larger if larger else 1.0)
    return total


@pytest.mark.parametrize("sizes", [[1] * 6, [3, 2, 1], [2, 2, 2, 1], [4, 1, 1], [5], [1]])
def test_no_number_of_targets_has_a_larger_mean_share(sizes):
    for seed in range(40):
        rng = np.random.default_rng(seed)
        density = random_factored(rng, sizes, num_hyps=4)
        spread = density.tracks.with_fields(means=FAR * density.tracks.means)
        density = density.with_fields(tracks=spread)
        combinations = plain_product(density)
        estimate = least_ospa_estimate(density)
        estimate.validate()
        of_number: dict[int, Any] = {}
        for weight, tracks in combinations:
            if len(tracks) not in of_number or weight > of_number[len(tracks)][0] * (1.0 + 1e-12):
                of_number[len(tracks)] = weight, tracks
        best = max(mean_share(combinations, set(tracks)) for _, tracks in of_number.values())
        assert mean_share(combinations, set(labels_of(estimate))) == pytest.approx(best, abs=1e-9), seed
        for label, existence in zip(labels_of(estimate), estimate.existence, strict=True):
            assert existence == pytest.approx(sum(w for w, tracks in combinations if label in tracks), abs=1e-9)


def test_unrelated_candidates_are_not_shown_because_there_are_many():
    density = FactoredGLMB.of(candidates([0.11] * 9))
    assert len(map_estimate(density)) == 1
    assert len(least_ospa_estimate(density)) == 0
    assert len(best_estimate(density, 1)) == 0


def test_a_target_under_several_names_in_one_place_is_shown_once():
    assert len(least_ospa_estimate(candidates([0.3] * 3))) == 0
    estimate = least_ospa_estimate(candidates([0.3] * 3, apart=0.1))
    assert len(estimate) == 1
    assert estimate.existence == pytest.approx([0.3])


@pytest.mark.parametrize("probability", [0.45, 0.55])
def test_one_candidate_is_shown_where_it_rather_exists(probability):
    assert len(least_ospa_estimate(candidates([probability]))) == (probability > 0.5)


def test_probable_targets_are_shown_where_the_most_probable_number_leaves_some_out():
    density = FactoredGLMB.of(candidates([0.6] * 6))
    assert len(map_estimate(density)) == 4
    assert len(least_ospa_estimate(density)) == 6


def test_all_kinds_with_labels_give_the_same():
    lmb = candidates([0.9, 0.4, 0.2, 0.7], apart=1.5)
    found = [
        least_ospa_estimate(density) for density in (lmb, FactoredGLMB.of(lmb), as_glmb(lmb, max_hypotheses=100)[0])
    ]
    for other in found[1:]:
        assert labels_of(other) == labels_of(found[0])
        np.testing.assert_allclose(other.existence, found[0].existence, atol=1e-12)


def test_hundreds_of_targets_are_all_shown():
    estimate = least_ospa_estimate(candidates([0.97] * 500))
    assert len(estimate) == 500
    assert math.isclose(float(estimate.existence.mean()), 0.97)


def test_densities_without_labels_are_refused():
    poisson = random_poisson(np.random.default_rng(0), 3)
    with pytest.raises(InputError, match="which have labels"):
        least_ospa_estimate(poisson)  # type: ignore[arg-type]
    assert len(best_estimate(poisson, 1)) == len(unlabelled_estimate(poisson, 1))
