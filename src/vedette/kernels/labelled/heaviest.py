"""Heaviest product of hypotheses, one from each factor, with a given total number of targets."""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.base.arrays import filled_ints
from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import FactoredGlmb, Floats, Ints
from vedette.kernels.labelled.cardinality import convolved


class FactorSizes(NamedTuple):
    """For each number of targets of each factor, from 0 up: its probability and heaviest hypothesis."""

    offsets: Ints  # (num_factors + 1,) places of the factor's numbers
    probabilities: Floats  # of the number, linear
    best: Floats  # log weight of the heaviest hypothesis of the number, -inf if there is none
    hyps: Ints  # that hypothesis, the first on a tie


class Shares(NamedTuple):
    """Division of a total number of targets among the factors at the largest sum of log weights."""

    singles: Ints  # factors of at most one target, by decreasing gain from it, then by label
    of_singles: Floats  # largest sum of these with 0, 1, ... targets
    several: Ints  # factors of more than one target
    of_several: Floats  # largest sum of these with 0, 1, ... targets
    taken: Ints  # (num_several, len(of_several)) targets in that factor if the factors up to it have 0, 1, ...


@kernel
def factor_sizes(density: FactoredGlmb) -> FactorSizes:
    """Return the possible numbers of targets of each factor, from 0 to the size of its largest hypothesis."""
    num = len(density.factor_offsets) - 1
    offsets, ends = np.zeros(num + 1, np.int64), density.hyp_offsets
    for f in range(num):
        largest = 0
        for h in range(density.factor_offsets[f], density.factor_offsets[f + 1]):
            largest = max(largest, ends[h + 1] - ends[h])
        offsets[f + 1] = offsets[f] + largest + 1
    places = offsets[num]
    probabilities, best, hyps = np.zeros(places), np.empty(places), np.zeros(places, np.int64)
    best[:] = -math.inf
    for f in range(num):
        for h in range(density.factor_offsets[f], density.factor_offsets[f + 1]):
            place, weight = offsets[f] + ends[h + 1] - ends[h], density.hyp_log_weights[h]
            probabilities[place] += math.exp(weight)
            if weight > best[place]:
                best[place], hyps[place] = weight, h
    return FactorSizes(offsets, probabilities, best, hyps)


@kernel
def shares(density: FactoredGlmb, sizes: FactorSizes) -> Shares:
    """Return the largest sums for every total number, separately for factors of one target and for larger ones."""
    offsets, best = sizes.offsets, sizes.best
    width = offsets[1:] - offsets[:-1]
    singles, several = np.flatnonzero(width == 2), np.flatnonzero(width > 2)
    gains, steps, indices = np.empty(len(singles)), np.empty(len(singles)), np.empty(len(singles))
    for i in range(len(singles)):
        place, track = offsets[singles[i]], density.track_offsets[singles[i]]
        gains[i] = best[place] - best[place + 1]
        steps[i], indices[i] = density.tracks.labels[track, 0], density.tracks.labels[track, 1]
    # Stable sorts from the last key to the first.
    order = np.argsort(indices, kind="mergesort")
    order = order[np.argsort(steps[order], kind="mergesort")]
    singles = singles[order[np.argsort(gains[order], kind="mergesort")]]
    of_singles = np.zeros(len(singles) + 1)
    # The first n factors have their target, the others do not.
    for i in range(len(singles)):
        of_singles[i + 1] = of_singles[i] + best[offsets[singles[i]] + 1]
    without = 0.0
    for i in range(len(singles) - 1, -1, -1):
        without += best[offsets[singles[i]]]
        of_singles[i] += without
    of_several, taken = _of_several(sizes, several)
    return Shares(singles, of_singles, several, of_several, taken)


@kernel
def _of_several(sizes: FactorSizes, several: Ints) -> tuple[Floats, Ints]:
    total = 1
    for f in several:
        total += sizes.offsets[f + 1] - sizes.offsets[f] - 1
    sums, last, taken = np.empty(total), np.empty(total), np.zeros((len(several), total), np.int64)
    sums[:] = -math.inf
    sums[0] = 0.0
    end = 1
    for s in range(len(several)):
        first = sizes.offsets[several[s]]
        width = sizes.offsets[several[s] + 1] - first
        last[:end] = sums[:end]
        sums[: end + width - 1] = -math.inf
        # Largest number for this factor first: on a tie, earlier factors have the fewest targets.
        for k in range(width - 1, -1, -1):
            for n in range(end):
                weight = last[n] + sizes.best[first + k]
                if weight > sums[n + k]:
                    sums[n + k], taken[s, n + k] = weight, k
        end += width - 1
    return sums, taken


@kernel
def heaviest_tracks(density: FactoredGlmb, sizes: FactorSizes, shared: Shares, number: int) -> Ints:
    """Tracks of the heaviest product with this number of targets, in label order, shape (number,).

    number: of positive probability. On a tie: the fewest targets in earlier factors, then the earlier hypothesis, then
    among factors of at most one target, those of smaller labels.
    """
    singles, several = shared.singles, shared.several
    most, split, best = len(shared.of_several) - 1, -1, -math.inf
    for n in range(max(0, number - len(singles)), min(number, most) + 1):
        weight = shared.of_several[n] + shared.of_singles[number - n]
        if split < 0 or weight > best:
            split, best = n, weight
    tracks, filled, left = np.empty(number, np.int64), 0, split
    for s in range(len(several) - 1, -1, -1):
        k = shared.taken[s, left]
        filled = _add_tracks(density, sizes.hyps[sizes.offsets[several[s]] + k], tracks, filled)
        left -= k
    for i in range(number - split):
        filled = _add_tracks(density, sizes.hyps[sizes.offsets[singles[i]] + 1], tracks, filled)
    labels = density.tracks.labels
    order = np.argsort(labels[tracks, 1], kind="mergesort")
    order = order[np.argsort(labels[tracks[order], 0], kind="mergesort")]
    return tracks[order]


@kernel
def _add_tracks(density: FactoredGlmb, hyp: int, tracks: Ints, filled: int) -> int:
    for e in range(density.hyp_offsets[hyp], density.hyp_offsets[hyp + 1]):
        tracks[filled] = density.hyp_tracks[e]
        filled += 1
    return filled


@kernel
def chosen_labels(density: FactoredGlmb, chosen: Ints) -> tuple[Ints, Floats]:
    """Return the tracks that have the label of a chosen one, and the existence probabilities of these labels.

    That is (num_tracks,) place among the chosen, or -1, and (num_chosen,) existence probabilities.
    """
    labels, ends = density.tracks.labels, density.hyp_offsets
    places, existence = filled_ints(len(labels), -1), np.zeros(len(chosen))
    for i in range(len(chosen)):
        factor = np.searchsorted(density.track_offsets, chosen[i], side="right") - 1
        for t in range(density.track_offsets[factor], density.track_offsets[factor + 1]):
            if labels[t, 0] == labels[chosen[i], 0] and labels[t, 1] == labels[chosen[i], 1]:
                places[t] = i
    for h in range(len(density.hyp_log_weights)):
        weight = math.exp(density.hyp_log_weights[h])
        for e in range(ends[h], ends[h + 1]):
            place = places[density.hyp_tracks[e]]
            if place >= 0:
                existence[place] += weight
    return places, np.minimum(existence, 1.0)


@kernel
def map_tracks(density: FactoredGlmb) -> tuple[Ints, Floats]:
    """Return the tracks of the heaviest product with the most probable number of targets, and label existence."""
    sizes = factor_sizes(density)
    number = int(np.argmax(convolved(sizes.probabilities, sizes.offsets)))
    chosen = heaviest_tracks(density, sizes, shares(density, sizes), number)
    return chosen, chosen_labels(density, chosen)[1]
