"""What a density says at a glance: how many targets, which exist, and which those of the most probable number are."""

from __future__ import annotations

from typing import Any

import numpy as np

from vedette.densities.checks import take_runs
from vedette.densities.containers import MultiTarget
from vedette.densities.factored import FactoredGLMB
from vedette.densities.labelled import LABELLED, Labelled
from vedette.errors import InputError
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.labelled.cardinality import best_of_pairs


def cardinality_distribution(density: MultiTarget) -> Floats:
    """Probabilities of 0, 1, ..., n targets; they sum to one.

    n is the size of the largest hypothesis of a GLMB (of a product of GLMBs, the sum of theirs), the number of labels
    of an LMB and of Bernoullis of a multi-Bernoulli, and the largest number that an iid cluster holds. A Poisson
    density has no largest number: n is one beyond which less than 1e-20 remains.
    """
    if not isinstance(density, MultiTarget):
        raise InputError(f"density: expected a multi-target density; got {type(density).__name__}")
    return density.cardinality()


def existence_probabilities(density: Labelled) -> tuple[Ints, Floats]:
    """(num_labels, 2) labels in increasing order and (num_labels,) the probability that each one's target exists."""
    return labelled(density).label_existence()


def labelled(density: Any) -> Labelled:
    """The density. Raises `InputError` where it does not name its targets."""
    if not isinstance(density, Labelled):
        raise InputError(f"density: expected {LABELLED}, which have labels; got {type(density).__name__}")
    return density


def heaviest_tracks(density: FactoredGLMB, number: int) -> Ints:
    """(number,) tracks, in label order, of the heaviest product of one hypothesis of each factor that has so many.

    number: of targets, of positive probability. Of equal weights: the smaller number in an earlier factor; the earlier
    hypothesis; of factors of at most one target, those of smaller labels.
    """
    offsets, best, hyps = _best_of_sizes(density)
    at_most = np.diff(offsets) - 1
    singles = np.flatnonzero(at_most == 1)
    first_labels = density.tracks.labels[density.track_offsets[singles]]
    order = singles[np.lexsort((*first_labels.T[::-1], best[offsets[singles]] - best[offsets[singles] + 1]))]
    there, absent = best[offsets[order] + 1], best[offsets[order]]
    # Of factors of one target, the best k are those that gain most by it.
    of_singles = _sums_from_start(there) + _sums_from_start(absent[::-1])[::-1]
    several = np.flatnonzero(at_most > 1)
    sizes, entries = take_runs(offsets, several)
    levels = [(best[entries], sizes, np.empty(0, np.int64))]
    while len(levels[-1][1]) > 2:
        levels.append(best_of_pairs(*levels[-1][:2]))
    of_several = levels[-1][0] if len(several) else np.zeros(1)
    least, most = max(0, number - len(singles)), min(number, len(of_several) - 1)
    split = np.arange(least, most + 1)
    taken = int(split[np.argmax(of_several[split] + of_singles[number - split])])
    sizes_taken = np.zeros(density.num_factors, np.int64)
    sizes_taken[order[: number - taken]] = 1
    if len(several):
        sizes_taken[several] = _shared_out(levels, taken)
    chosen_hyps = hyps[offsets[:-1] + sizes_taken]
    tracks = density.hyp_tracks[take_runs(density.hyp_offsets, chosen_hyps)[1]]
    return np.asarray(tracks[np.lexsort(density.tracks.labels[tracks].T[::-1])])


def _best_of_sizes(density: FactoredGLMB) -> tuple[Ints, Floats, Ints]:
    """For each factor and number of targets from 0 up, the log weight of the heaviest hypothesis, and which it is.

    Returns (num_factors + 1,) offsets of the factors, and what is at each of their places.
    """
    offsets = density.size_offsets()
    place = offsets[density.factor_of] + np.diff(density.hyp_offsets)
    best, hyps = np.full(offsets[-1], -np.inf), np.zeros(offsets[-1], np.int64)
    np.maximum.at(best, place, density.hyp_log_weights)
    # The last to be written stays.
    heaviest = np.flatnonzero(density.hyp_log_weights == best[place])[::-1]
    hyps[place[heaviest]] = heaviest
    return offsets, best, hyps


def _sums_from_start(values: Floats) -> Floats:
    """(num + 1,) sums of the first 0, 1, ..., num values."""
    return np.concatenate([np.zeros(1), np.cumsum(values)])


def _shared_out(levels: list[tuple[Floats, Ints, Ints]], number: int) -> Ints:
    """How much of a number each run of the first level takes; each level is the best of pairs of the one before."""
    counts = np.array([number])
    for (_, before, _), (_, offsets, taken) in zip(levels[-2::-1], levels[:0:-1], strict=True):
        first = taken[offsets[:-1] + counts]
        both = np.stack([first, counts - first], axis=1).ravel()
        counts = both[: len(before) - 1]
    return counts
