"""Random densities for the tests, and their translation into the oracles' plain data."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from hypothesis import strategies as st

import reference
from vedette.densities import GLMB, LMB, FactoredGLMB, Poisson, TrackTable

STATE_DIM = 2


def random_covs(rng: np.random.Generator, num: int, dim: int = STATE_DIM) -> Any:
    roots = rng.normal(size=(num, dim, dim))
    return roots @ roots.transpose(0, 2, 1) + 0.2 * np.eye(dim)


def random_mixture(rng: np.random.Generator, num: int, dim: int = STATE_DIM) -> Any:
    return rng.dirichlet(np.ones(num)), 3.0 * rng.normal(size=(num, dim)), random_covs(rng, num, dim)


def random_labels(rng: np.random.Generator, num: int) -> Any:
    """Distinct labels, in no order."""
    places = rng.choice(36, size=num, replace=False)
    return np.stack([places // 6, places % 6], axis=1)


def random_glmb(rng: np.random.Generator, num_labels: int, num_hyps: int, max_components: int) -> GLMB:
    """A delta-GLMB with up to 3 versions of each label's track; label sets repeat."""
    labels = np.repeat(random_labels(rng, num_labels), 3, axis=0)
    if num_labels == 0:
        tracks = TrackTable.empty(STATE_DIM)
    else:
        sizes = rng.integers(1, max_components + 1, len(labels))
        tracks = TrackTable.from_mixtures(labels, [random_mixture(rng, int(size)) for size in sizes])
    hypotheses = [
        [3 * label + int(rng.integers(3)) for label in range(num_labels) if rng.random() < 0.6] for _ in range(num_hyps)
    ]
    return GLMB.from_hypotheses(tracks, hypotheses, rng.dirichlet(np.ones(num_hyps)))


def random_lmb(rng: np.random.Generator, num_labels: int) -> LMB:
    return LMB.from_bernoullis(
        random_labels(rng, num_labels),
        rng.random(num_labels),
        3.0 * rng.normal(size=(num_labels, STATE_DIM)),
        random_covs(rng, num_labels),
    )


def random_factor(rng: np.random.Generator, labels: Any, max_components: int = 1, num_hyps: int = 4) -> GLMB:
    """A delta-GLMB of these labels; of one label as an LMB lays it out: absent, then there, and one track."""
    if len(labels) == 1:
        mixture = random_mixture(rng, int(rng.integers(1, max_components + 1)))
        existence = float(rng.random())
        return GLMB.from_hypotheses(TrackTable.from_mixtures(labels, [mixture]), [[], [0]], [1 - existence, existence])
    versions = np.repeat(labels, 2, axis=0)
    sizes = rng.integers(1, max_components + 1, len(versions))
    tracks = TrackTable.from_mixtures(versions, [random_mixture(rng, int(size)) for size in sizes])
    members = rng.random((num_hyps, len(labels))) < 0.6
    hypotheses = [(2 * np.flatnonzero(row) + rng.integers(2, size=row.sum())).tolist() for row in members]
    return GLMB.from_hypotheses(tracks, hypotheses, -np.sort(-rng.dirichlet(np.ones(num_hyps))))


def random_factored(
    rng: np.random.Generator, sizes: Sequence[int], max_components: int = 1, num_hyps: int = 4, labels: Any = None
) -> FactoredGLMB:
    """A product of GLMBs of so many labels each, which are mixed over the factors."""
    drawn = random_labels(rng, sum(sizes)) if labels is None else np.array(labels)
    ends = np.cumsum(sizes)
    parts = [drawn[end - size : end] for end, size in zip(ends, sizes, strict=True)]
    return FactoredGLMB.from_factors([random_factor(rng, own, max_components, num_hyps) for own in parts], STATE_DIM)


def random_poisson(rng: np.random.Generator, num: int) -> Poisson:
    return Poisson.from_gaussians(rng.random(num), rng.normal(size=(num, STATE_DIM)), random_covs(rng, num))


_SEEDS = st.integers(0, 2**32 - 1).map(np.random.default_rng)


def glmbs(max_components: int = 3) -> st.SearchStrategy[GLMB]:
    return st.builds(random_glmb, _SEEDS, st.integers(0, 4), st.integers(1, 12), st.just(max_components))


def lmbs() -> st.SearchStrategy[LMB]:
    return st.builds(random_lmb, _SEEDS, st.integers(0, 6))


def factoreds(max_components: int = 1) -> st.SearchStrategy[FactoredGLMB]:
    sizes = st.lists(st.sampled_from([1, 1, 1, 2, 3]), max_size=4)
    return st.builds(random_factored, _SEEDS, sizes, st.just(max_components))


def poissons() -> st.SearchStrategy[Poisson]:
    return st.builds(random_poisson, _SEEDS, st.integers(0, 4))


def plain_mixture(tracks: TrackTable, track: int) -> reference.Mixture:
    run = range(tracks.offsets[track], tracks.offsets[track + 1])
    return [(float(np.exp(tracks.log_weights[i])), tracks.means[i], tracks.covs[i]) for i in run]


def label_of(tracks: TrackTable, track: int) -> reference.Label:
    return int(tracks.labels[track, 0]), int(tracks.labels[track, 1])


def plain_glmb(glmb: GLMB) -> reference.Glmb:
    plain: reference.Glmb = []
    for h in range(glmb.num_hyps):
        chosen = glmb.hyp_tracks[glmb.hyp_offsets[h] : glmb.hyp_offsets[h + 1]]
        tracks = {label_of(glmb.tracks, t): plain_mixture(glmb.tracks, t) for t in chosen}
        plain.append((float(np.exp(glmb.hyp_log_weights[h])), tracks))
    return plain


def plain_product(density: FactoredGLMB) -> reference.Glmb:
    """All products of one hypothesis of each factor."""
    products: reference.Glmb = [(1.0, {})]
    for factor in density.factors:
        products = [
            (weight * own, {**tracks, **more}) for weight, tracks in products for own, more in plain_glmb(factor)
        ]
    return products


def plain_lmb(lmb: LMB) -> reference.Lmb:
    return {
        label_of(lmb.tracks, t): (float(lmb.existence[t]), plain_mixture(lmb.tracks, t))
        for t in range(lmb.tracks.num_tracks)
    }


def plain_moments(mixture: reference.Mixture) -> tuple[Any, Any]:
    """Mean and covariance of a mixture by the definition."""
    total = sum(weight for weight, _, _ in mixture)
    mean = sum(weight * mean for weight, mean, _ in mixture) / total
    cov = sum(weight * (c + np.outer(m - mean, m - mean)) for weight, m, c in mixture) / total
    return mean, cov
