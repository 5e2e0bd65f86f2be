"""Fast validation of labelled densities.

A density that passes here also passes `validate`, since the tolerances are narrower than those of
`vedette.densities.checks`. One that fails must be given to `validate`, which reports the fault or accepts it.
"""

import math

import numpy as np

from vedette.kernels.base.compile import inlined, kernel
from vedette.kernels.base.types import CLASSES, MODE, Floats, Glmb, Ints, Lmb, Marks, Tracks
from vedette.kernels.gaussian.linalg import cholesky, log_sum
from vedette.kernels.gaussian.marks import NOT_DRAWN

_TOLERANCE = 0.5e-9  # of the log of sums that must be 1, and of symmetry, relative to the largest variance
_LEAST_PIVOT = 1e-7  # of a Cholesky factor, relative to the standard deviation


@kernel
def _cuts(offsets: Ints, count: int, total: int, least: int) -> bool:
    """Return True if offsets divide `total` entries into `count` runs of at least `least`."""
    if len(offsets) != count + 1 or offsets[0] != 0 or offsets[count] != total:
        return False
    shortest = total
    for i in range(count):
        shortest = min(shortest, offsets[i + 1] - offsets[i])
    return bool(count == 0 or shortest >= least)


@kernel
def _sum_to_one(log_weights: Floats) -> bool:
    for log_weight in log_weights:
        if math.isnan(log_weight) or log_weight == math.inf:
            return False
    return abs(log_sum(log_weights)) <= _TOLERANCE


@kernel
def _increases(labels: Ints, before: int, after: int) -> bool:
    step = labels[after, 0] - labels[before, 0]
    return bool(step > 0 or (step == 0 and labels[after, 1] > labels[before, 1]))


@kernel
def _is_gaussian(mean: Floats, cov: Floats, factor: Floats) -> bool:
    dim, scale = len(mean), 0.0
    for i in range(dim):
        scale = max(scale, abs(cov[i, i]))
    for i in range(dim):
        if not math.isfinite(mean[i]):
            return False
        for j in range(i + 1):
            if not (math.isfinite(cov[i, j]) and abs(cov[i, j] - cov[j, i]) <= _TOLERANCE * scale):
                return False
    if not cholesky(cov, factor):
        return False
    is_far_from_singular = True
    for i in range(dim):
        is_far_from_singular &= factor[i, i] > _LEAST_PIVOT * math.sqrt(cov[i, i])
    return is_far_from_singular


@inlined
def _are_marks(marks: Marks, c: int) -> bool:
    mode = marks[c, MODE]
    return (marks.shape[1] == CLASSES or _sum_to_one(marks[c, CLASSES:])) and mode >= NOT_DRAWN and mode == int(mode)


@kernel
def _are_mixtures(tracks: Tracks) -> bool:
    """Return True if every track is a density."""
    log_weights, means, covs, marks = tracks.components
    num, (num_components, dim) = len(tracks.labels), means.shape
    if tracks.labels.shape[1] != 2 or dim == 0 or marks.shape[1] < CLASSES or len(log_weights) != num_components:
        return False
    if covs.shape != (num_components, dim, dim) or len(marks) != num_components:
        return False
    if not _cuts(tracks.offsets, num, num_components, 1):
        return False
    factor = np.empty((dim, dim))
    for i in range(num_components):
        if not _is_gaussian(means[i], covs[i], factor):
            return False
    are_normalised = True
    for i in range(num_components):
        are_normalised &= _are_marks(marks, i)
    for track in range(num):
        are_normalised &= _sum_to_one(log_weights[tracks.offsets[track] : tracks.offsets[track + 1]])
    return are_normalised


@kernel
def is_valid_lmb(density: Lmb) -> bool:
    """Return True if tracks are densities of labels in order, and existence is a probability."""
    labels, logits = density.tracks.labels, density.existence_logit
    if not _are_mixtures(density.tracks) or len(logits) != len(labels):
        return False
    is_sound = True
    for i in range(len(labels)):
        is_sound &= not math.isnan(logits[i]) and (i == 0 or _increases(labels, i - 1, i))
    return is_sound


@kernel
def is_valid_glmb(density: Glmb) -> bool:
    """Return True if tracks are densities, and hypotheses are normalised and hold tracks of labels in order."""
    offsets, members, num_hyps = density.hyp_offsets, density.hyp_tracks, len(density.hyp_log_weights)
    if not _are_mixtures(density.tracks) or num_hyps == 0 or not _cuts(offsets, num_hyps, len(members), 0):
        return False
    for member in members:
        if not 0 <= member < len(density.tracks.labels):
            return False
    for hyp in range(num_hyps):
        for i in range(offsets[hyp] + 1, offsets[hyp + 1]):
            if not _increases(density.tracks.labels, members[i - 1], members[i]):
                return False
    return _sum_to_one(density.hyp_log_weights)
