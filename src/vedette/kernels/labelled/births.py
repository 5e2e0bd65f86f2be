"""LMBs of births: from measurements, and within a period."""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Floats, Lmb, Marks, Tracks
from vedette.kernels.gaussian.components import make_components, stacked_mixtures
from vedette.kernels.gaussian.marks import copy_marks


class BirthsOfMeasurements(NamedTuple):
    """Parameters of births at measurements."""

    std: Floats  # (state_dim,) standard deviations of each target
    marks: Marks  # (1, ...) of each target
    expected: float  # expected total number of targets
    max_existence: float  # largest existence probability
    step: int  # with `first`, the label of the first target; the index of the others continues from there
    first: int


@kernel
def births_of_measurements(states: Floats, unexplained: Floats, begin: BirthsOfMeasurements) -> Lmb:
    """Return an LMB of one target at rest for each measured position, in their order.

    Args:
        states: (num, state_dim) of the targets, at rest where they were measured.
        unexplained: (num,) probabilities that no track explains the measurement. The expected number of births is
            divided in proportion to them.
        begin: the other parameters.
    """
    num, dim = len(unexplained), len(begin.std)
    total = unexplained.sum()
    labels, offsets = np.empty((num, 2), np.int64), np.arange(num + 1)
    out, logits = make_components(num, dim, begin.marks), np.empty(num)
    for i in range(num):
        labels[i, 0], labels[i, 1] = begin.step, begin.first + i
        out.log_weights[i] = 0.0
        for d in range(dim):
            out.means[i, d] = states[i, d]
            for e in range(dim):
                out.covs[i, d, e] = begin.std[d] ** 2 if d == e else 0.0
        copy_marks(begin.marks, 0, out.marks, i)
        existence = min(begin.max_existence, begin.expected * unexplained[i] / total)
        # A share may underflow to 0.
        logits[i] = math.log(existence) - math.log1p(-existence) if existence > 0.0 else -math.inf
    return Lmb(Tracks(labels, offsets, out), logits)


@kernel
def births_within(first: Lmb, second: Lmb, share: float) -> Lmb:
    """Return the targets of two LMBs, each born within a share of the time: 1 - r' = (1 - r)^share. 1: unchanged."""
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
