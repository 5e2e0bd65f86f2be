"""Manoeuvres: tracks whose innovations depend on each other for some scans, which a single motion does not explain."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.stats import binom, chi2

from vedette.evaluation.innovations import Assumed, Compared, Matches, joined
from vedette.internal.text import pluralise
from vedette.kernels.base.types import Floats
from vedette.models.modes import Modes

_SPANS = 2, 4, 8  # successive innovations of a track that are added up
_MOST_TRACKS = 8  # smallest probabilities of tracks that are combined
_MEDIAN = math.sqrt(chi2.ppf(0.5, 1))  # of the absolute value of a normal variable


def manoeuvre_warnings(instants: Sequence[Compared], assumed: Assumed, level: float) -> tuple[str, ...]:
    """Return a warning of tracks that seem to manoeuvre, or none.

    level: highest probability of a warning by chance, for all tracks and sensors together.

    Sensors that measure no places are left out. With modes there is no warning: innovations at a change of the mode are
    not normal.
    """
    if isinstance(assumed.motion, Modes):
        return ()
    found = list[tuple[int, float]]()
    for s, sensor in enumerate(assumed.sensors):
        fits = [fit for each in instants if (fit := each.fits[s]) is not None]
        if fits and sensor.measurement.places is not None:
            found.append(manoeuvring_tracks(joined(fits).matches))
    number = max((number for number, by_chance in found if by_chance * len(found) < level), default=0)
    if not number:
        return ()
    return (
        f"innovations of {pluralise(number, 'track')} depend on each other from scan to scan (turns or changes of "
        "speed): add `motion: {kind: modes}`",
    )


def manoeuvring_tracks(matches: Matches) -> tuple[int, float]:
    """Return how many tracks of a sensor seem to manoeuvre, and the probability of as clear a result by chance.

    Innovations of a track have one direction while its target turns or changes its speed. Their sums over some
    successive scans are compared with normal variables. The standard deviation of these is the robust one (from the
    median) of all sums of the sensor, but at least that of the model. Noise or process noise that are too small at all
    times, steady biases and errors that always last therefore count as no manoeuvre.

    The probability of each track is corrected for the number of its sums, and the result for the number of tracks: it
    is the binomial probability that as many tracks have one as small as the k-th smallest, for the best of several k.
    """
    known = ~np.isnan(matches.whitened[:, 0])
    tracks = [matches.whitened[own[known[own]]] for own in matches.by_label()]
    tracks = [own for own in tracks if len(own) >= _SPANS[0]]
    if not tracks:
        return 0, 1.0
    middle = np.median(np.concatenate(tracks), axis=0)
    probabilities = np.sort(_probabilities([own - middle for own in tracks]))
    most = min(len(tracks), _MOST_TRACKS)
    numbers = np.arange(1, most + 1)
    by_chance = binom.sf(numbers - 1, len(tracks), probabilities[:most])
    best = int(by_chance.argmin())
    return int(numbers[best]), min(1.0, most * float(by_chance[best]))


def _probabilities(tracks: Sequence[Floats]) -> Floats:
    """Return for each track the probability of a sum as large as its largest one, times the number of its sums."""
    smallest, numbers = np.ones(len(tracks)), np.zeros(len(tracks))
    for span in _SPANS:
        sums = [_sums(own, span) for own in tracks]
        pooled = np.concatenate(sums)
        if not len(pooled):
            continue
        spreads = np.maximum(1.0, np.median(np.abs(pooled), axis=0) / _MEDIAN)
        for i, own in enumerate(sums):
            largest = ((own / spreads) ** 2).sum(axis=1).max(initial=0.0)
            numbers[i] += len(own)
            smallest[i] = min(smallest[i], chi2.sf(largest, pooled.shape[1]))
    return np.asarray(np.minimum(1.0, smallest * numbers))


def _sums(values: Floats, span: int) -> Floats:
    """Return the sums of each `span` successive values, divided by its root, (num, meas_dim)."""
    totals = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
    return np.asarray((totals[span:] - totals[:-span]) / math.sqrt(span))
