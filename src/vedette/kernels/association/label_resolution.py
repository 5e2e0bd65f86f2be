"""Which name each target of a hypothesis goes by, once it does not matter any more which of several targets is which.

Hypotheses may differ in nothing but names: {a here, b there} or {b here, a there}; {a here} or {b here}, as one target
was born then or then. A density's marginals by label put either label half here and half there, or take neither for
probable. As a set of targets without names the density says one thing alone, and any names may be given to it that no
two targets of one hypothesis share (Svensson, Svensson, Guerriero, Willett 2011, for fixed numbers of targets). Here
the heaviest hypothesis of a factor keeps its names; of each other, heaviest first, every target takes the name of the
one that it is likeliest to be, by the assignment of the least sum of squared distances; one that is far from all of
them opens a place of its own.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.association.assignment import DualWork, Options, make_dual_work, solve_assignment
from vedette.kernels.base.arrays import counted_ints, filled_ints
from vedette.kernels.base.compile import borrowing, kernel
from vedette.kernels.base.types import Floats, Glmb, Ints
from vedette.kernels.gaussian.distances import pair_distances
from vedette.kernels.gaussian.mixtures import descending_order
from vedette.kernels.gaussian.pooling import Moments, moments_of

# Where two places suit a target equally well, it stays with its own name.
_STAY = 1e-6


class _Places(NamedTuple):
    """The places of one factor's targets: those opened so far, each by a track of a heavier hypothesis."""

    names: Ints  # (num_labels,) label of each place, -1 where it is not open
    place_of: Ints  # (num_labels,) place that bears each label, -1 for none
    squares: Floats  # (num_tracks, num_labels) squared distance of each track from the track that opened a place
    nearest: Ints  # (num_tracks,) the nearest open place, -1 before there is one


class _Choice(NamedTuple):
    """The assignment of one hypothesis's targets to places, and room to solve it in."""

    options: Options
    rows: Ints  # (num_labels,) 0, 1, 2, ...
    work: DualWork
    places: Ints  # (num_labels,) place of each target


@kernel
def _make_choice(num: int) -> _Choice:
    options = Options(
        np.arange(num + 1) * num,
        np.empty(num * num, np.int64),
        np.empty(num * num),
        np.empty(0, np.int64),
        np.empty(0),
        np.empty((0, 0)),
        np.empty((0, 0, 0)),
        num,
    )
    return _Choice(options, counted_ints(num), make_dual_work(num, num), np.empty(num, np.int64))


@borrowing
def _obvious(hyp_tracks: Ints, labels: Ints, places: _Places, most: float, out: Ints) -> bool:
    """Whether every target is nearest to a place of its own, and near it; `out` then has the places."""
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
    """Write the places of the least sum of squared distances; a place that is not open is `most` from everyone."""
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
def _open_places(hyp_tracks: Ints, labels: Ints, places: _Places, moments: Moments, out: Ints) -> None:
    """Open the new places in `out`: under the target's own label, if no place bears it, else under a free one."""
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
def _name_factor(
    glmb: Glmb, first: int, last: int, low: int, high: int, label_of: Ints, distance: float, names: Ints
) -> None:
    """Write into `names` what the targets of hypotheses `first` to `last`, over tracks `low` to `high`, go by.

    label_of: (num_tracks,) number of each track's label. names: (num_entries,) number of the label given.
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
    moments = moments_of(glmb.tracks, low, high)
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
def settled_names(glmb: Glmb, factor_offsets: Ints, track_offsets: Ints, label_of: Ints, distance: float) -> Ints:
    """(num_entries,) number of the label that each entry of `glmb.hyp_tracks` goes by, factor by factor.

    label_of: (num_tracks,) number of each track's own label. distance: of a target from all places that are open, in
    standard deviations of the difference of both, beyond which it opens one of its own.
    """
    names = np.empty(len(glmb.hyp_tracks), np.int64)
    for entry in range(len(names)):
        names[entry] = label_of[glmb.hyp_tracks[entry]]
    for factor in range(len(factor_offsets) - 1):
        low, high = track_offsets[factor], track_offsets[factor + 1]
        if high - low > 1:
            _name_factor(glmb, factor_offsets[factor], factor_offsets[factor + 1], low, high, label_of, distance, names)
    return names
