"""Logs of inner products, zeta(a, b) = integral of K^|X| a(X) b(X) dX, of labelled densities.

The tracks are Gaussian mixtures. Two densities are stacked in one bundle, the first `split` hypotheses (LMB: tracks)
being a's. Everything is in the log domain: inner products of 4-D tracks in SI units are 1e-6 and less, and enter to the
power of the number of targets. `log_unit_volume` is log K, K the unit of hyper-volume of the paper's eq. 5.
"""

import math

import numpy as np

from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Floats, Glmb, Ints, Tracks
from vedette.kernels.gaussian.linalg import LOG_2PI, cholesky, log_add, log_det_from_factor, solve_lower
from vedette.kernels.labelled.labels import group_by_label_set


@kernel
def _log_gaussians(tracks: Tracks, a: int, b: int, offset: Floats, factor: Floats) -> float:
    """Return the log of the integral of the product of components `a` and `b`: N(m_a; m_b, P_a + P_b)."""
    n, means, covs = len(offset), tracks.components.means, tracks.components.covs
    for i in range(n):
        offset[i] = means[a, i] - means[b, i]
        for j in range(i + 1):
            factor[i, j] = covs[a, i, j] + covs[b, i, j]
    if not cholesky(factor, factor):
        return math.nan
    solve_lower(factor, offset, offset)
    squared = 0.0
    for i in range(n):
        squared += offset[i] * offset[i]
    return -0.5 * (squared + n * LOG_2PI + log_det_from_factor(factor))


@kernel
def log_tracks(tracks: Tracks, a: int, b: int) -> float:
    """Return log <p, q> of the mixtures of tracks `a` and `b`, or NaN if a covariance is not positive definite."""
    n, log_weights = tracks.components.means.shape[1], tracks.components.log_weights
    offset, factor, total = np.empty(n), np.empty((n, n)), -math.inf
    for i in range(tracks.offsets[a], tracks.offsets[a + 1]):
        for j in range(tracks.offsets[b], tracks.offsets[b + 1]):
            weight = log_weights[i] + log_weights[j]
            if weight > -math.inf:
                total = log_add(total, weight + _log_gaussians(tracks, i, j, offset, factor))
    return total


@kernel
def _label_blocks(tracks: Tracks) -> tuple[Ints, Ints, int]:
    """Return places for one number per pair of tracks of one label: (i, j) has start[i] + place[j], in the row of i.

    Returns start, place, and the number of places.
    """
    num = len(tracks.labels)
    each = np.arange(num + 1)
    label_of, _ = group_by_label_set(Glmb(tracks, each, each[:num].copy(), np.zeros(num)))
    count, place, start, total = np.zeros(num, np.int64), np.empty(num, np.int64), np.empty(num, np.int64), 0
    for i in range(num):
        place[i] = count[label_of[i]]
        count[label_of[i]] += 1
    for i in range(num):
        start[i] = total
        total += count[label_of[i]]
    return start, place, total


@kernel
def _log_pair(glmb: Glmb, h: int, g: int, log_unit_volume: float, start: Ints, place: Ints, pairs: Floats) -> float:
    """Return the log of the product over the labels of two hypotheses of K <p, q>.

    Computes each pair of tracks once.
    """
    total, shift = 0.0, glmb.hyp_offsets[g] - glmb.hyp_offsets[h]
    for e in range(glmb.hyp_offsets[h], glmb.hyp_offsets[h + 1]):
        i, j = glmb.hyp_tracks[e], glmb.hyp_tracks[e + shift]
        value = pairs[start[i] + place[j]]
        if math.isnan(value):
            value = log_tracks(glmb.tracks, i, j)
            pairs[start[i] + place[j]] = value
            pairs[start[j] + place[i]] = value
        total += log_unit_volume + value
    return total


@kernel
def log_glmbs(glmb: Glmb, split: int, log_unit_volume: float, common: bool, self_terms: bool) -> Floats:
    """Return log zeta of GLMBs a and b: the sum over all pairs of hypotheses that share a label set (paper eq. 9).

    glmb: hypotheses of a, then from `split` on those of b, over one track table. common: only the label sets that
    both have. Returns log zeta(a, b), zeta(a, a), zeta(b, b), the last two -inf unless `self_terms`.
    """
    group_of, first = group_by_label_set(glmb)
    start, place, num_pairs = _label_blocks(glmb.tracks)
    pairs, num = np.full(num_pairs, math.nan), len(group_of)
    following, head = np.empty(num, np.int64), np.full(len(first), -1, np.int64)
    in_b = np.zeros(len(first), np.bool_)
    for h in range(num - 1, -1, -1):
        following[h] = head[group_of[h]]
        head[group_of[h]] = h
        in_b[group_of[h]] |= h >= split
    peaks, sums = np.full(3, -math.inf), np.zeros(3)
    for h in range(num):
        group = group_of[h]
        if glmb.hyp_log_weights[h] == -math.inf or (common and not (in_b[group] and head[group] < split)):
            continue
        g = h
        while g >= 0:
            weight = glmb.hyp_log_weights[h] + glmb.hyp_log_weights[g]
            term = 0 if h < split <= g else (1 if g < split else 2)
            if weight > -math.inf and (term == 0 or self_terms):
                weight += _log_pair(glmb, h, g, log_unit_volume, start, place, pairs)
                if weight > peaks[term]:
                    sums[term] *= math.exp(peaks[term] - weight)
                    peaks[term] = weight
                # (h, g) also represents (g, h) if both are of one density.
                sums[term] += (2.0 if term > 0 and g != h else 1.0) * math.exp(weight - peaks[term])
            g = following[g]
    for term in range(3):
        if sums[term] > 0.0 or math.isnan(sums[term]):
            peaks[term] += math.log(sums[term])
    return peaks


@kernel
def log_probabilities(logit: float) -> tuple[float, float]:
    """Return log r and log (1 - r) of a logit, exact at +-inf."""
    if logit >= 0.0:
        tail = math.log1p(math.exp(-logit))
        return -tail, -logit - tail
    tail = math.log1p(math.exp(logit))
    return logit - tail, -tail


@kernel
def _log_bernoullis(tracks: Tracks, logits: Floats, i: int, j: int, log_unit_volume: float) -> float:
    present_i, absent_i = log_probabilities(logits[i])
    present_j, absent_j = log_probabilities(logits[j])
    present = present_i + present_j
    if present > -math.inf:
        present += log_unit_volume + log_tracks(tracks, i, j)
    return log_add(absent_i + absent_j, present)


@kernel
def _precedes(labels: Ints, i: int, j: int) -> bool:
    return bool(labels[i, 0] < labels[j, 0] or (labels[i, 0] == labels[j, 0] and labels[i, 1] < labels[j, 1]))


@kernel
def log_lmbs(tracks: Tracks, logits: Floats, split: int, log_unit_volume: float, common: bool) -> Floats:
    """Return log zeta(a, b), zeta(a, a), zeta(b, b) of LMBs: sums over labels of Bernoulli terms.

    tracks, logits: a's in increasing label order, then from `split` on b's. A label that only one of them has exists
    in the other with probability 0. common: only the labels that both have.
    """
    result, labels, num = np.zeros(3), tracks.labels, len(logits)
    j = split
    for i in range(split + 1):
        while j < num and (i == split or _precedes(labels, j, i)):
            if not common:
                result[0] += log_probabilities(logits[j])[1]
                result[2] += _log_bernoullis(tracks, logits, j, j, log_unit_volume)
            j += 1
        if i == split:
            break
        shared = j < num and not _precedes(labels, i, j)
        if shared or not common:
            result[1] += _log_bernoullis(tracks, logits, i, i, log_unit_volume)
        if shared:
            result[0] += _log_bernoullis(tracks, logits, i, j, log_unit_volume)
            result[2] += _log_bernoullis(tracks, logits, j, j, log_unit_volume)
            j += 1
        elif not common:
            result[0] += log_probabilities(logits[i])[1]
    return result
