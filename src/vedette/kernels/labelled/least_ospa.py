"""The targets of a product of GLMBs of least expected OSPA, if a target is either in place or not.

With n estimated targets of which M are in place, and N true ones, OSPA^p is then c^p (1 - M / max(n, N)). The estimate
is the heaviest hypothesis of n targets, for the n with the largest mean of M / max(n, N).
"""

import math

import numpy as np

from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import FactoredGlmb, Floats, Ints
from vedette.kernels.gaussian.distances import near_pairs
from vedette.kernels.gaussian.mixtures import heaviest_of_runs
from vedette.kernels.labelled.cardinality import convolved
from vedette.kernels.labelled.heaviest import FactorSizes, chosen_labels, factor_sizes, heaviest_tracks, shares

# Squared Mahalanobis distance up to which two tracks share a place: three standard deviations of the difference.
_IN_PLACE = 9.0
# Less probable tracks, and places that are free with less probability, do not affect the choice.
_LEAST = 1e-3
# Less probable numbers of targets are left out of the sums.
_LEAST_NUMBER = 1e-15


@kernel
def least_ospa_tracks(density: FactoredGlmb) -> tuple[Ints, Floats]:
    """Return the tracks of the estimated targets in label order, and the existence probabilities of their labels.

    All numbers of targets are tried from the most probable one outwards, except those whose bound, the mean of
    min(n, N) / max(n, N), is no larger than the best mean. On a tie the smaller number is chosen.
    """
    sizes = factor_sizes(density)
    shared, numbers = shares(density, sizes), convolved(sizes.probabilities, sizes.offsets)
    existence = _track_existence(density)
    start = int(np.argmax(numbers))
    chosen = heaviest_tracks(density, sizes, shared, start)
    best, own = _mean_share(density, sizes, chosen, existence)
    for apart in range(1, len(numbers)):
        for number in (start - apart, start + apart):
            if number < 0 or number >= len(numbers) or numbers[number] < _LEAST_NUMBER:
                continue
            if _bound(numbers, number) < best:
                continue
            tracks = heaviest_tracks(density, sizes, shared, number)
            share, of_tracks = _mean_share(density, sizes, tracks, existence)
            if share > best or (share == best and number < len(chosen)):
                best, chosen, own = share, tracks, of_tracks
    return chosen, own


@kernel
def _bound(numbers: Floats, number: int) -> float:
    """Return the mean of min(n, N) / max(n, N), 1 if both are 0."""
    bound = numbers[0] if number == 0 else 0.0
    for n in range(1, len(numbers)):
        bound += numbers[n] * min(n, number) / max(n, number)
    return bound


@kernel
def _track_existence(density: FactoredGlmb) -> Floats:
    """Probability of each track over the hypotheses of its factor, shape (num_tracks,)."""
    existence, ends = np.zeros(len(density.tracks.labels)), density.hyp_offsets
    for h in range(len(density.hyp_log_weights)):
        weight = math.exp(density.hyp_log_weights[h])
        for e in range(ends[h], ends[h + 1]):
            existence[density.hyp_tracks[e]] += weight
    return existence


@kernel
def _mean_share(density: FactoredGlmb, sizes: FactorSizes, chosen: Ints, existence: Floats) -> tuple[float, Floats]:
    """Return the mean of M / max(n, N), 1 if both are 0, and the existence probability of each chosen label.

    One pass over the factors sums, for each number of targets so far, its probability and the mean of M with it.
    """
    worth, own = _worths(density, chosen, existence)
    offsets, ends, num = sizes.offsets, density.hyp_offsets, len(sizes.offsets) - 1
    width = offsets[num] - num + 1
    probability, matched, last, last_matched = np.zeros(width), np.zeros(width), np.zeros(width), np.zeros(width)
    in_factor = np.zeros(width)
    probability[0] = 1.0
    low, high = 0, 1
    for f in range(num):
        first, most = offsets[f], offsets[f + 1] - offsets[f] - 1
        in_factor[: most + 1] = 0.0
        for h in range(density.factor_offsets[f], density.factor_offsets[f + 1]):
            there = 0.0
            for e in range(ends[h], ends[h + 1]):
                there += worth[density.hyp_tracks[e]]
            in_factor[ends[h + 1] - ends[h]] += math.exp(density.hyp_log_weights[h]) * there
        last[low:high], last_matched[low:high] = probability[low:high], matched[low:high]
        probability[low : high + most], matched[low : high + most] = 0.0, 0.0
        for k in range(most + 1):
            chance, mean = sizes.probabilities[first + k], in_factor[k]
            if chance == 0.0:
                continue
            for n in range(low, high):
                probability[n + k] += chance * last[n]
                matched[n + k] += chance * last_matched[n] + mean * last[n]
        high += most
        while low + 1 < high and probability[low] < _LEAST_NUMBER:
            probability[low], matched[low] = 0.0, 0.0
            low += 1
        while low + 1 < high and probability[high - 1] < _LEAST_NUMBER:
            high -= 1
            probability[high], matched[high] = 0.0, 0.0
    share = probability[0] if len(chosen) == 0 else 0.0
    for n in range(max(low, 1), high):
        share += matched[n] / max(n, len(chosen))
    return share, own


@kernel
def _worths(density: FactoredGlmb, chosen: Ints, existence: Floats) -> tuple[Floats, Floats]:
    """Return the fraction of an estimated target in place for each track, and the existence of each chosen label.

    A track of a chosen label counts 1. A track of another label at the position of a chosen one counts as far as that
    place is free: those of a place together at most 1 minus the label's existence. Labels of largest existence come
    first.
    """
    places, own = chosen_labels(density, chosen)
    worth = np.where(places >= 0, 1.0, 0.0)
    unsure = np.flatnonzero(own < 1.0 - _LEAST)
    others = np.flatnonzero((worth == 0.0) & (existence > _LEAST))
    if len(unsure) == 0 or len(others) == 0:
        return worth, own
    unsure = unsure[np.argsort(-own[unsure], kind="mergesort")]
    offsets, components = density.tracks.offsets, density.tracks.components
    here = heaviest_of_runs(components.log_weights, offsets, chosen[unsure])
    peaks = heaviest_of_runs(components.log_weights, offsets, others)
    means, covs = components.means, components.covs
    near = near_pairs(means[here], covs[here], means[peaks], covs[peaks], _IN_PLACE)
    pair = 0
    for i in range(len(unsure)):
        begin, there = pair, 0.0
        while pair < len(near.firsts) and near.firsts[pair] == i:
            track = others[near.seconds[pair]]
            there += (1.0 - worth[track]) * existence[track]
            pair += 1
        if there > 0.0:
            taken = min(1.0, (1.0 - own[unsure[i]]) / there)
            for p in range(begin, pair):
                track = others[near.seconds[p]]
                worth[track] += taken * (1.0 - worth[track])
    return worth, own
