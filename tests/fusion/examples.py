"""Small beliefs of several sensors about the same targets."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from vedette.densities import GLMB, LMB, TrackTable

A, B, C = (0, 0), (0, 1), (2, 0)
ALL_SETS: tuple[tuple[tuple[int, int], ...], ...] = ((), (A,), (B,), (A, B))


def glmb(sets: dict[tuple[tuple[int, int], ...], float], rng: np.random.Generator, dim: int = 1) -> GLMB:
    """GLMB of these label sets and weights; each (label set, label) has its own Gaussian, near the label's place."""
    labels = [label for labels in sets for label in labels]
    places = {A: 0.0, B: 4.0, C: -3.0}
    means = [places[label] + 0.7 * rng.normal(size=dim) for label in labels]
    covs = [np.diag(rng.uniform(0.5, 1.5, dim)) for _ in labels]
    tracks = TrackTable.from_gaussians(
        np.array(labels).reshape(-1, 2), np.reshape(means, (-1, dim)), np.reshape(covs, (-1, dim, dim))
    )
    hyps, used = [], 0
    for labels_of_set in sets:
        hyps.append(list(range(used, used + len(labels_of_set))))
        used += len(labels_of_set)
    return GLMB.from_hypotheses(tracks, hyps, list(sets.values()))


def full_glmbs(num: int, rng: np.random.Generator, dim: int = 1) -> list[GLMB]:
    """Beliefs that all have all four label sets of two labels."""
    return [glmb(dict(zip(ALL_SETS, rng.dirichlet(np.ones(4)), strict=True)), rng, dim) for _ in range(num)]


def lmb(labels: Sequence[tuple[int, int]], existence: Any, rng: np.random.Generator, dim: int = 1) -> LMB:
    places = {A: 0.0, B: 4.0, C: -3.0}
    means = [places[label] + 0.7 * rng.normal(size=dim) for label in labels]
    covs = [np.diag(rng.uniform(0.5, 1.5, dim)) for _ in labels]
    return LMB.from_bernoullis(labels, existence, means, covs)


def mixture_track(weights: Any, means: Any, covs: Any) -> LMB:
    """One label of existence 0.9 with a mixture density."""
    return LMB(TrackTable.from_mixtures([A], [(weights, means, covs)]), np.array([np.log(9.0)]))


def by_label_set(density: GLMB) -> dict[tuple[tuple[int, int], ...], tuple[float, dict[tuple[int, int], Any]]]:
    """Weight of each label set and the (mean, covariance) of each label in it; single Gaussian tracks."""
    found = {}
    for h in range(density.num_hyps):
        tracks = density.hyp_tracks[density.hyp_offsets[h] : density.hyp_offsets[h + 1]]
        labels = [tuple(label) for label in density.tracks.labels[tracks].tolist()]
        moments = [(density.tracks.means[t], density.tracks.covs[t]) for t in density.tracks.offsets[tracks]]
        found[tuple(labels)] = (float(np.exp(density.hyp_log_weights[h])), dict(zip(labels, moments, strict=True)))
    return found


def assert_same_glmb(a: GLMB, b: GLMB, tolerance: float) -> None:
    """The same label sets, weights and single-Gaussian tracks, in whatever order."""
    first, second = by_label_set(a), by_label_set(b)
    assert first.keys() == second.keys()
    for labels, (weight, moments) in first.items():
        assert abs(weight - second[labels][0]) <= tolerance
        for label, (mean, cov) in moments.items():
            np.testing.assert_allclose(mean, second[labels][1][label][0], rtol=tolerance, atol=tolerance)
            np.testing.assert_allclose(cov, second[labels][1][label][1], rtol=tolerance, atol=tolerance)
