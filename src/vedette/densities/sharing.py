"""How a number of targets is best shared out over the factors of a density."""

from __future__ import annotations

import numpy as np

from vedette.densities.checks import offsets_of, take_runs
from vedette.densities.factored import FactoredGLMB
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.labelled.cardinality import best_of_pairs


def heaviest_tracks(density: FactoredGLMB, number: int) -> Ints:
    """(number,) tracks, in label order, of the heaviest product of one hypothesis of each factor that has so many.

    number: of targets, of positive probability. Of equal weights: the smaller number in an earlier factor; the earlier
    hypothesis; of factors of at most one target, those of smaller labels.
    """
    offsets, best, hyps = _best_of_sizes(density)
    at_most = np.diff(offsets) - 1
    singles = np.flatnonzero(at_most == 1)
    order = singles[
        np.lexsort((*_first_labels(density, singles).T[::-1], best[offsets[singles]] - best[offsets[singles] + 1]))
    ]
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
    sizes = np.diff(density.hyp_offsets)
    factor = np.repeat(np.arange(density.num_factors), np.diff(density.factor_offsets))
    largest = np.maximum.reduceat(sizes, density.factor_offsets[:-1]) if density.num_factors else sizes
    offsets = offsets_of(largest + 1)
    place = offsets[factor] + sizes
    best, hyps = np.full(offsets[-1], -np.inf), np.zeros(offsets[-1], np.int64)
    np.maximum.at(best, place, density.hyp_log_weights)
    # The last to be written stays.
    heaviest = np.flatnonzero(density.hyp_log_weights == best[place])[::-1]
    hyps[place[heaviest]] = heaviest
    return offsets, best, hyps


def _first_labels(density: FactoredGLMB, factors: Ints) -> Ints:
    return density.tracks.labels[density.track_offsets[factors]]


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


__all__ = ["heaviest_tracks"]
