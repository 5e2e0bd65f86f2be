"""Resolution of ambiguous labels: a single label for each target if hypotheses disagree only on labels.

Hypotheses may differ only in labels: {a here, b there} or {b here, a there}, or {a here} or {b here}, if one target
was born at one of two steps. The marginals of the labels then put either label half at each position, or make neither
probable. The unlabelled set of targets is the same in all of them, and any labels may be given to it that no two
targets of one hypothesis share (Svensson, Svensson, Guerriero, Willett 2011, for fixed numbers of targets). Here
the heaviest hypothesis of a factor keeps its labels. In the others, heaviest first, every target takes the label of the
target that it most likely is, by the assignment of the least sum of squared distances. A target that is far from all of
them opens a new place.
"""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.association.assignment import DualWork, Options, make_dual_work, solve_assignment
from vedette.kernels.association.options import make_room
from vedette.kernels.base.arrays import counted_ints, filled_ints
from vedette.kernels.base.compile import borrowing, kernel
from vedette.kernels.base.types import Floats, Glmb, Ints, Mixture
from vedette.kernels.gaussian.distances import pair_distances
from vedette.kernels.gaussian.marks import no_marks
from vedette.kernels.gaussian.mixtures import descending_order
from vedette.kernels.gaussian.pooling import merged_mixtures

# If two places fit a target equally well, it keeps its own label.
_STAY = 1e-6


class _Places(NamedTuple):
    """The places of one factor's targets opened so far, each by a track of a heavier hypothesis."""

    names: Ints  # (num_labels,) label of each place, -1 if it is not open
    place_of: Ints  # (num_labels,) place with each label, -1 for none
    squares: Floats  # (num_tracks, num_labels) squared distance of each track from the track that opened a place
    nearest: Ints  # (num_tracks,) the nearest open place, -1 if none is open


class _Choice(NamedTuple):
    """The assignment of one hypothesis's targets to places, and working arrays of its solver."""

    options: Options
    rows: Ints  # (num_labels,) 0, 1, 2, ...
    work: DualWork
    places: Ints  # (num_labels,) place of each target


@kernel
def _make_choice(num: int) -> _Choice:
    options = make_room(num, num * num, 0, num, 0, np.empty((0, 1, 0)), no_marks())
    for i in range(num + 1):
        options.offsets[i] = i * num
    return _Choice(options, counted_ints(num), make_dual_work(num, num), np.empty(num, np.int64))


@borrowing
def _obvious(hyp_tracks: Ints, labels: Ints, places: _Places, most: float, out: Ints) -> bool:
    """Return True if each target is nearest to, and near, a different place. `out` then has the places."""
    for i in range(len(hyp_tracks)):
        track = hyp_tracks[i]
        place = places.nearest[track]
        if place < 0 or places.squares[track, place] > most:
            return False
        own = places.place_of[labels[track]]
        if own >= 0 and places.squares[track, own] <= places.squares[track, place] + _STAY:
            place = own
        for k in range(i):
            if out[k] == place:
                return False
        out[i] = place
    return True


@borrowing
def _assign(hyp_tracks: Ints, labels: Ints, places: _Places, most: float, choice: _Choice) -> None:
    """Write the places of the least sum of squared distances.

    A place that is not open is at `most` from every target.
    """
    num, options = len(places.names), choice.options
    for i in range(len(hyp_tracks)):
        track = hyp_tracks[i]
        for place in range(num):
            log_weight = -most
            if places.names[place] >= 0:
                log_weight = -places.squares[track, place]
                if places.names[place] == labels[track]:
                    log_weight += _STAY
            slot = i * num + place
            while slot > i * num and options.log_weights[slot - 1] < log_weight:
                options.log_weights[slot], options.columns[slot] = (
                    options.log_weights[slot - 1],
                    options.columns[slot - 1],
                )
                slot -= 1
            options.log_weights[slot], options.columns[slot] = log_weight, place
    solve_assignment(options, choice.rows[: len(hyp_tracks)], choice.work)
    for i in range(len(hyp_tracks)):
        choice.places[i] = options.columns[choice.work.row_option[i]]


@kernel
def _open_places(hyp_tracks: Ints, labels: Ints, places: _Places, moments: Mixture, out: Ints) -> None:
    """Open the new places in `out`, with the target's own label if it is free, otherwise with a free one."""
    means, covs = moments.means, moments.covs
    for turn in range(2):
        for i in range(len(hyp_tracks)):
            place, name = out[i], labels[hyp_tracks[i]]
            if places.names[place] >= 0 or (turn == 0 and places.place_of[name] >= 0):
                continue
            if places.place_of[name] >= 0:
                name = 0
                while places.place_of[name] >= 0:
                    name += 1
            places.names[place], places.place_of[name] = name, place
            opener = hyp_tracks[i]
            squares, _ = pair_distances(means, covs, means[opener : opener + 1], covs[opener : opener + 1])
            for track in range(len(means)):
                places.squares[track, place] = squares[track, 0]
                nearest = places.nearest[track]
                if nearest < 0 or squares[track, 0] < places.squares[track, nearest]:
                    places.nearest[track] = place


@kernel
def _resolve_factor(
    glmb: Glmb, first: int, last: int, low: int, high: int, label_of: Ints, distance: float, names: Ints
) -> None:
    """Write the resolved labels of the targets of hypotheses `first` to `last`, over tracks `low` to `high`.

    label_of: (num_tracks,) number of each track's label. names: (num_entries,) receives the number of the resolved
    label.
    """
    numbers, labels, num = np.empty(high - low, np.int64), filled_ints(high - low, 0), 0
    for entry in range(glmb.hyp_offsets[first], glmb.hyp_offsets[last]):
        track, place = glmb.hyp_tracks[entry], 0
        while place < num and numbers[place] != label_of[track]:
            place += 1
        numbers[place], labels[track - low] = label_of[track], place
        num = max(num, place + 1)
    if num < 2:
        return
    moments = merged_mixtures(glmb.tracks.components, glmb.tracks.offsets[low : high + 1])
    places = _Places(
        filled_ints(num, -1), filled_ints(num, -1), np.full((high - low, num), math.inf), filled_ints(high - low, -1)
    )
    choice, most = _make_choice(num), distance * distance
    hyp_tracks = np.empty(num, np.int64)
    for i in descending_order(glmb.hyp_log_weights[first:last]):
        start, size = glmb.hyp_offsets[first + i], glmb.hyp_offsets[first + i + 1] - glmb.hyp_offsets[first + i]
        for k in range(size):
            hyp_tracks[k] = glmb.hyp_tracks[start + k] - low
        own = hyp_tracks[:size]
        if not _obvious(own, labels, places, most, choice.places):
            _assign(own, labels, places, most, choice)
            _open_places(own, labels, places, moments, choice.places)
        for k in range(size):
            names[start + k] = numbers[places.names[choice.places[k]]]


@kernel
def resolved_labels(glmb: Glmb, factor_offsets: Ints, track_offsets: Ints, label_of: Ints, distance: float) -> Ints:
    """Number of the resolved label of each entry of `glmb.hyp_tracks`, factor by factor, shape (num_entries,).

    label_of: (num_tracks,) number of each track's own label. distance: from all open places, in standard deviations of
    the difference, beyond which a target opens a new place.
    """
    names = np.empty(len(glmb.hyp_tracks), np.int64)
    for entry in range(len(names)):
        names[entry] = label_of[glmb.hyp_tracks[entry]]
    for factor in range(len(factor_offsets) - 1):
        low, high = track_offsets[factor], track_offsets[factor + 1]
        if high - low > 1:
            _resolve_factor(
                glmb, factor_offsets[factor], factor_offsets[factor + 1], low, high, label_of, distance, names
            )
    return names
