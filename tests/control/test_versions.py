"""Densities of one label that are all but the same are taken as one at the start of the horizon."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from control.examples import SETTINGS, A, B, Situation, evaluator_of, glmb, sample_rewards, situation
from vedette.control.pseudo_updates import merge_similar_tracks
from vedette.densities import GLMB, TrackTable, existence_probabilities

SETS = [(A, B), (A, B), (A,), (B,), ()]


def nearly_alike(divergence: float, seed: int = 0) -> GLMB:
    """Every hypothesis's tracks are the first's, moved by what makes them diverge by so many nats."""
    belief = glmb(SETS, np.random.default_rng(seed))
    order = np.argsort(-belief.hyp_log_weights)
    weights = np.exp(belief.hyp_log_weights[order])
    first: dict[tuple[int, ...], int] = {}
    means, covs = belief.tracks.means.copy(), belief.tracks.covs.copy()
    for track, label in enumerate(map(tuple, belief.tracks.labels.tolist())):
        leader = first.setdefault(label, track)
        if leader != track:
            covs[track] = covs[leader]
            direction = np.linalg.cholesky(covs[leader])[:, track % 4]
            means[track] = means[leader] + np.sqrt(2.0 * divergence) * direction
    tracks = TrackTable(belief.tracks.labels, belief.tracks.offsets, belief.tracks.log_weights, means, covs)
    hyps = [belief.hyp_tracks[belief.hyp_offsets[h] : belief.hyp_offsets[h + 1]].tolist() for h in range(len(SETS))]
    return GLMB.from_hypotheses(tracks, hyps, weights)


def test_versions_within_the_divergence_become_one_and_equal_hypotheses_with_them() -> None:
    belief = nearly_alike(0.9e-3)
    shared = merge_similar_tracks(belief, 1e-3)
    shared.validate()
    assert shared.tracks.num_tracks == 2
    # The two hypotheses of both targets are one, of the sum of their weights.
    assert len(shared.hyp_log_weights) == len(SETS) - 1
    np.testing.assert_allclose(np.exp(shared.hyp_log_weights).sum(), 1.0, rtol=1e-14)
    for before, after in zip(existence_probabilities(belief), existence_probabilities(shared), strict=True):
        np.testing.assert_allclose(after, before, rtol=1e-14)
    for track in range(2):
        np.testing.assert_array_equal(shared.tracks.means[track], belief.tracks.means[track])
        np.testing.assert_array_equal(shared.tracks.covs[track], belief.tracks.covs[track])


@pytest.mark.parametrize(("divergence", "most"), [(1.1e-3, 1e-3), (1e-12, 0.0)])
def test_others_stay_as_they_are(divergence: float, most: float) -> None:
    belief = nearly_alike(divergence)
    shared = merge_similar_tracks(belief, most)
    np.testing.assert_array_equal(shared.hyp_log_weights, belief.hyp_log_weights)
    for part in ("labels", "means", "covs"):
        mine, theirs = getattr(shared.tracks, part), getattr(belief.tracks, part)
        np.testing.assert_array_equal(mine[shared.hyp_tracks], theirs[belief.hyp_tracks])


def test_an_empty_belief_has_no_versions() -> None:
    assert merge_similar_tracks(GLMB.empty(4), 1e-3).tracks.num_tracks == 0


@pytest.mark.parametrize(("divergence", "change"), [(1e-12, 1e-4), (1e-5, 0.3)])
def test_rewards_change_by_little(divergence: float, change: float) -> None:
    """By about the root of the divergence, as means do."""
    example = situation("delta")
    belief = nearly_alike(divergence)
    beliefs = (belief,) * len(example.sensors)
    found = []
    for most in (0.0, 2.0 * divergence):
        settings = replace(SETTINGS, max_version_divergence=most)
        own = Situation(example.sensors, example.fusion, settings, beliefs, belief, example.poses)
        found.append(sample_rewards(evaluator_of(own), (0, 1), example.fusion))
    whole, shared = found
    assert not np.array_equal(whole, shared)
    assert np.abs(shared - whole).max() <= change * np.ptp(whole)
