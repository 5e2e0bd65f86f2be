"""A unit of hyper-volume that suits a density."""

from __future__ import annotations

import math

import numpy as np

from vedette.densities import LMB, Labelled, Poisson, track_moments
from vedette.densities.factored import LABELLED
from vedette.errors import InputError
from vedette.kernels.base.types import Floats


def reference_unit_volume(density: Labelled | Poisson) -> float:
    """(4 pi)^(d / 2) sqrt(det P_ref): the K under which K <p, p> is 1 for a Gaussian p of covariance P_ref.

    P_ref is the arithmetic mean of the track covariances (of a mixture's moments), each weighted by the probability
    of its track: GLMB, the weights of the hypotheses that hold it; LMB, its existence. Poisson: of the components'
    covariances, weighted by their expected numbers. With K = 1 in SI units K <p, p> is 1e-6 to 1e-8 for a 4-D state,
    and a divergence is then about whether targets exist more than about where they are.

    Raises `InputError` for a density that is not valid or expects no target.
    """
    if not isinstance(density, Labelled | Poisson):
        raise InputError(f"density: expected {LABELLED} or a Poisson; got {type(density).__name__}")
    density.validate(error=InputError)
    weights, covs = _weighted_covariances(density)
    total = float(weights.sum())
    if not total > 0.0:
        raise InputError("density: expected one that expects a target; got an expected number of 0")
    mean_cov = np.einsum("k,kij->ij", weights / total, covs)
    return float(math.exp(0.5 * (density.state_dim * math.log(4.0 * math.pi) + np.linalg.slogdet(mean_cov)[1])))


def _weighted_covariances(density: Labelled | Poisson) -> tuple[Floats, Floats]:
    if isinstance(density, Poisson):
        return np.exp(density.log_weights), density.covs
    covs = track_moments(density.tracks)[1]
    if isinstance(density, LMB):
        return density.existence, covs
    entry_weights = np.repeat(np.exp(density.hyp_log_weights), np.diff(density.hyp_offsets))
    return np.bincount(density.hyp_tracks, entry_weights, density.tracks.num_tracks).astype(np.float64), covs
