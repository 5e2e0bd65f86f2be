"""LMBs of the targets that may have been born: from measurements, and within a time."""

from __future__ import annotations

import math

import numpy as np

from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Floats, Lmb, Tracks


@kernel
def births_of_measurements(
    positions: Floats, unexplained: Floats, std: Floats, expected: float, max_existence: float, step: int, first: int
) -> Lmb:
    """One target at rest for each measured position, in their order.

    Args:
        positions: (num, 2) m.
        unexplained: (num,) probabilities that no track explains the measurement.
        std: (state_dim,) standard deviations of each target.
        expected: number of targets in all, shared in proportion to `unexplained`.
        max_existence: largest existence probability.
        step, first: label of the first target; the second number of the others goes on from there.
    """
    num, dim = len(unexplained), len(std)
    total = unexplained.sum()
    labels, offsets = np.empty((num, 2), np.int64), np.arange(num + 1)
    means, covs, logits = np.zeros((num, dim)), np.zeros((num, dim, dim)), np.empty(num)
    for i in range(num):
        labels[i, 0], labels[i, 1] = step, first + i
        means[i, :2] = positions[i]
        for d in range(dim):
            covs[i, d, d] = std[d] ** 2
        existence = min(max_existence, expected * unexplained[i] / total)
        # A share may be too small for a number.
        logits[i] = math.log(existence) - math.log1p(-existence) if existence > 0.0 else -math.inf
    return Lmb(Tracks(labels, offsets, np.zeros(num), means, covs), logits)


@kernel
def births_within(first: Lmb, second: Lmb, share: float) -> Lmb:
    """The targets of two LMBs, of which each is born in a share of the time: 1 - r' = (1 - r)^share; 1: unchanged."""
    num, components = len(first.existence_logit), first.tracks.offsets[-1]
    labels = np.concatenate((first.tracks.labels, second.tracks.labels))
    offsets = np.concatenate((first.tracks.offsets, second.tracks.offsets[1:]))
    offsets[num + 1 :] += components
    logits = np.concatenate((first.existence_logit, second.existence_logit))
    if share != 1.0:
        for i in range(len(logits)):
            log_none = share * (min(-logits[i], 0.0) - math.log1p(math.exp(-abs(logits[i]))))
            some = -math.expm1(log_none)
            logits[i] = (math.log(some) if some > 0.0 else -math.inf) - log_none
    weights = np.concatenate((first.tracks.log_weights, second.tracks.log_weights))
    means = np.concatenate((first.tracks.means, second.tracks.means))
    covs = np.concatenate((first.tracks.covs, second.tracks.covs))
    return Lmb(Tracks(labels, offsets, weights, means, covs), logits)
