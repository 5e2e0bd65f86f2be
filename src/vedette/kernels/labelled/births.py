"""LMBs of the targets that may have been born: from measurements, and within a time."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import HEIGHT, Floats, Lmb, Tracks
from vedette.kernels.gaussian.components import make_components, stacked_mixtures


class BirthsOfMeasurements(NamedTuple):
    """How targets may begin at measurements."""

    std: Floats  # (state_dim,) standard deviations of each target
    expected: float  # number of targets in all
    max_existence: float  # largest existence probability
    step: int  # with `first`, the label of the first target; the second number of the others goes on from there
    first: int


@kernel
def births_of_measurements(positions: Floats, unexplained: Floats, begin: BirthsOfMeasurements) -> Lmb:
    """One target at rest for each measured position, in their order.

    Args:
        positions: (num, 2) m; (num, 3) with heights, in states [px, py, vx, vy, pz, ...].
        unexplained: (num,) probabilities that no track explains the measurement, in proportion to which the expected
            number is shared.
        begin: the rest.
    """
    num, dim = len(unexplained), len(begin.std)
    total = unexplained.sum()
    labels, offsets = np.empty((num, 2), np.int64), np.arange(num + 1)
    out, logits = make_components(num, dim), np.empty(num)
    for i in range(num):
        labels[i, 0], labels[i, 1] = begin.step, begin.first + i
        out.log_weights[i] = 0.0
        for d in range(dim):
            out.means[i, d] = positions[i, d] if d < 2 else 0.0
            for e in range(dim):
                out.covs[i, d, e] = begin.std[d] ** 2 if d == e else 0.0
        if positions.shape[1] > 2 and dim > HEIGHT:
            out.means[i, HEIGHT] = positions[i, 2]
        existence = min(begin.max_existence, begin.expected * unexplained[i] / total)
        # A share may be too small for a number.
        logits[i] = math.log(existence) - math.log1p(-existence) if existence > 0.0 else -math.inf
    return Lmb(Tracks(labels, offsets, out), logits)


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
    both = stacked_mixtures(first.tracks.components, second.tracks.components)
    return Lmb(Tracks(labels, offsets, both), logits)
