"""What a density says at a glance: how many targets, which exist, where they are."""

from __future__ import annotations

import math

import numpy as np

from vedette.densities.checks import distinct_labels, offsets_of, run_log_sums
from vedette.densities.factored import LABELLED, FactoredGLMB, Labelled
from vedette.densities.glmb import GLMB
from vedette.densities.iid_cluster import IidCluster
from vedette.densities.lmb import LMB
from vedette.densities.multi_bernoulli import MultiBernoulli
from vedette.densities.poisson import Poisson
from vedette.densities.tracks import TrackTable
from vedette.errors import InputError
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.labelled.cardinality import convolved
from vedette.probabilities import expit


def cardinality_distribution(density: Labelled | Poisson | IidCluster | MultiBernoulli) -> Floats:
    """Probabilities of 0, 1, ..., n targets; they sum to one.

    n is the size of the largest hypothesis of a GLMB (of a product of GLMBs, the sum of theirs), the number of labels
    of an LMB and of Bernoullis of a multi-Bernoulli, and the largest number that an iid cluster holds. A Poisson
    density has no largest number: n is one beyond which less than 1e-20 remains.
    """
    if isinstance(density, GLMB):
        sizes = np.diff(density.hyp_offsets)
        return np.asarray(np.bincount(sizes, weights=np.exp(density.hyp_log_weights)), np.float64)
    if isinstance(density, FactoredGLMB):
        return _of_factors(density)
    if isinstance(density, LMB | MultiBernoulli):
        return _poisson_binomial(density.existence_logit)
    if isinstance(density, IidCluster):
        return np.asarray(np.exp(density.log_cardinality))
    if isinstance(density, Poisson):
        from scipy.special import gammaln

        mean = density.expected_number
        numbers = np.arange(math.ceil(mean + 12.0 * math.sqrt(mean)) + 41)
        return np.asarray(np.exp(numbers * _log(mean) - mean - gammaln(numbers + 1.0))) if mean > 0.0 else np.ones(1)
    raise InputError(f"density: expected a multi-target density; got {type(density).__name__}")


def _log(value: float) -> float:
    return math.log(value) if value > 0.0 else -math.inf


def _of_factors(density: FactoredGLMB) -> Floats:
    """The distributions of all factors, convolved."""
    sizes, factor = (
        np.diff(density.hyp_offsets),
        np.repeat(np.arange(density.num_factors), np.diff(density.factor_offsets)),
    )
    largest = np.maximum.reduceat(sizes, density.factor_offsets[:-1]) if density.num_factors else sizes
    offsets = offsets_of(largest + 1)
    chances = np.bincount(offsets[factor] + sizes, np.exp(density.hyp_log_weights), minlength=offsets[-1])
    return convolved(np.asarray(chances, np.float64), offsets)


def _poisson_binomial(existence_logit: Floats) -> Floats:
    chances = np.stack([expit(-existence_logit), expit(existence_logit)], axis=1)
    return convolved(chances.ravel(), 2 * np.arange(len(chances) + 1))


def existence_probabilities(density: Labelled) -> tuple[Ints, Floats]:
    """(num_labels, 2) labels in increasing order and (num_labels,) the probability that each one's target exists."""
    if isinstance(density, LMB):
        return density.tracks.labels, density.existence
    if isinstance(density, GLMB | FactoredGLMB):
        labels, label_of = distinct_labels(density.tracks.labels[density.hyp_tracks])
        weights = np.repeat(np.exp(density.hyp_log_weights), np.diff(density.hyp_offsets))
        existence = np.bincount(label_of, weights=weights, minlength=len(labels))
        return labels, np.minimum(existence, 1.0)
    raise InputError(f"density: expected {LABELLED}, which have labels; got {type(density).__name__}")


def mixture_moments(log_weights: Floats, means: Floats, covs: Floats) -> tuple[Floats, Floats]:
    """Mean (state_dim,) and covariance (state_dim, state_dim) of one Gaussian mixture of any total weight.

    Raises `InputError` for a mixture of weight zero.
    """
    offsets = np.array([0, len(log_weights)])
    log_total = run_log_sums(log_weights, offsets)[0] if len(log_weights) else -math.inf
    if log_total == -math.inf:
        raise InputError("log_weights: expected a mixture of positive weight; got none")
    mean, cov = _run_moments(np.exp(log_weights - log_total), means, covs, offsets)
    return mean[0], cov[0]


def track_moments(tracks: TrackTable) -> tuple[Floats, Floats]:
    """Mean (num_tracks, state_dim) and covariance (num_tracks, state_dim, state_dim) of every track."""
    if len(tracks.log_weights) == tracks.num_tracks:
        return tracks.means.copy(), tracks.covs.copy()
    return _run_moments(np.exp(tracks.log_weights), tracks.means, tracks.covs, tracks.offsets)


def _run_moments(weights: Floats, means: Floats, covs: Floats, offsets: Ints) -> tuple[Floats, Floats]:
    """Moments of consecutive mixtures of linear weights that sum to one, none of them empty."""
    starts, lengths = offsets[:-1], np.diff(offsets)
    run_means = np.add.reduceat(weights[:, None] * means, starts)
    deviations = means - np.repeat(run_means, lengths, axis=0)
    seconds = covs + deviations[:, :, None] * deviations[:, None, :]
    return run_means, np.add.reduceat(weights[:, None, None] * seconds, starts)


__all__ = ["cardinality_distribution", "existence_probabilities", "mixture_moments", "track_moments"]
