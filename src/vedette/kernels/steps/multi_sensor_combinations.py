"""What may have happened to each track at several sensors at once: a miss or a gated measurement at every one of them.

Combinations of a track grow sensor by sensor: each gated measurement, and the miss, makes one of its own, in which the
components are updated by it. With linear Gaussian models the order of the sensors does not matter: weights and moments
are those of all measurements together.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.association.assignment import MISSED, Options
from vedette.kernels.association.options import (
    Rows,
    clutter_levels,
    expect_rows,
    fill_births,
    fill_survivors,
    list_options,
    make_rows,
)
from vedette.kernels.association.truncation import Truncation
from vedette.kernels.base.arrays import filled_ints
from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Floats, Ints, Lmb, Motion, Sensor
from vedette.kernels.gaussian.kalman import make_innovation, make_scratch
from vedette.kernels.gaussian.linalg import log_sum
from vedette.kernels.gaussian.mixtures import descending_order
from vedette.kernels.steps.assembly import write_updated
from vedette.kernels.steps.lmb import weigh_by_existence


class Combinations(NamedTuple):
    """Combinations of every track over the sensors so far.

    rows: one a combination: the label of its track, and its updated components, whose log weights are those of the
        track's presence, of its mixture, and of the likelihoods of what it took relative to clutter. None is absent.
    tracks: (num,) number of the track that each is of, increasing.
    columns: (num, num_sensors) measurement of each sensor, or MISSED; they are counted through all sensors.
    log_absent: (num_tracks,) log probability that a track is not there.
    """

    rows: Rows
    tracks: Ints
    columns: Ints
    log_absent: Floats


class SensorReport(NamedTuple):
    """log_clutter: sum of the log clutter intensities of a scan. num_raised: how many were raised to the floor.
    log_kept: log of the share of the combinations' weight that the cap has left, as weighed at this sensor.
    """

    log_clutter: float
    num_raised: int
    log_kept: float


@kernel
def predict_combinations(prior: Lmb, birth: Lmb, num_sensors: int, dt: float, motion: Motion) -> Combinations:
    """One combination a predicted track or birth site, before the first sensor."""
    num_tracks, num_births = len(prior.tracks.labels), len(birth.tracks.labels)
    num, dim = num_tracks + num_births, prior.tracks.means.shape[1]
    rows = make_rows(num, len(prior.tracks.log_weights) + len(birth.tracks.log_weights), dim, 0)
    fill_survivors(prior.tracks, motion, dt, rows, make_scratch(dim, 0))
    fill_births(birth, num_tracks, rows)
    weigh_by_existence(prior.existence_logit, rows)
    log_absent, tracks, columns = (
        rows.log_absent.copy(),
        np.empty(num, np.int64),
        np.empty((num, num_sensors), np.int64),
    )
    for i in range(num):
        rows.log_absent[i], tracks[i] = -math.inf, i
    return Combinations(rows, tracks, columns, log_absent)


@kernel
def _options_to_keep(combinations: Combinations, options: Options, most: int) -> tuple[Ints, float]:
    """(num_options,) 1 for the `most` heaviest options of each track, and the log of the share of weight they are."""
    marks, log_kept = filled_ints(options.offsets[-1], 1), 0.0
    first, num = 0, len(combinations.tracks)
    while first < num:
        track, last = combinations.tracks[first], first + 1
        while last < num and combinations.tracks[last] == track:
            last += 1
        start, stop = options.offsets[first], options.offsets[last]
        if stop - start > most:
            log_weights = options.log_weights[start:stop]
            dropped = descending_order(log_weights)[most:]
            log_dropped = np.empty(len(dropped))
            for i in range(len(dropped)):
                marks[start + dropped[i]] = 0
                log_dropped[i] = log_weights[dropped[i]]
            log_kept += math.log1p(-math.exp(log_sum(log_dropped) - log_sum(log_weights)))
        first = last
    return marks, log_kept


@kernel
def _taken(combinations: Combinations, rows: Rows, options: Options, kept: Ints, at: int, shift: int) -> Combinations:
    """The combinations that follow from the kept options at sensor `at`, its measurements counted from `shift`."""
    num, num_components = 0, 0
    for i in range(len(combinations.tracks)):
        for option in range(options.offsets[i], options.offsets[i + 1]):
            num += kept[option]
            num_components += kept[option] * (rows.offsets[i + 1] - rows.offsets[i])
    columns, tracks = np.empty((num, combinations.columns.shape[1]), np.int64), np.empty(num, np.int64)
    grown = make_rows(num, num_components, rows.means.shape[1], 0)
    filled, end = 0, 0
    for i in range(len(combinations.tracks)):
        for option in range(options.offsets[i], options.offsets[i + 1]):
            if kept[option] == 0:
                continue
            end = write_updated(i, option, rows, options, end, grown.log_weights, grown.means, grown.covs)
            tracks[filled] = combinations.tracks[i]
            for sensor in range(at):
                columns[filled, sensor] = combinations.columns[i, sensor]
            column = options.columns[option]
            columns[filled, at] = MISSED if column == MISSED else shift + column
            grown.labels[filled, 0], grown.labels[filled, 1] = rows.labels[i, 0], rows.labels[i, 1]
            grown.log_absent[filled] = -math.inf
            filled += 1
            grown.offsets[filled] = end
    trimmed = Rows(
        grown.labels,
        grown.offsets,
        grown.log_absent,
        grown.log_weights[:end],
        grown.means[:end],
        grown.covs[:end],
        grown.innovation,
    )
    return Combinations(trimmed, tracks, columns, combinations.log_absent)


@kernel
def extend_combinations(
    combinations: Combinations, at: int, shift: int, scan: Floats, pose: Floats, sensor: Sensor, truncation: Truncation
) -> tuple[Combinations, SensorReport]:
    """The combinations after the scan of sensor `at`, whose measurements are counted from `shift` on."""
    levels = np.empty(len(scan))
    log_clutter, num_raised = clutter_levels(sensor, scan, pose, truncation.log_clutter_floor, levels)
    given, meas_dim = combinations.rows, len(sensor.angular)
    rows = Rows(
        given.labels,
        given.offsets,
        given.log_absent,
        given.log_weights,
        given.means,
        given.covs,
        make_innovation(len(given.log_weights), given.means.shape[1], meas_dim),
    )
    expect_rows(sensor, pose, rows, make_scratch(given.means.shape[1], meas_dim))
    options = list_options(rows, scan, levels, sensor, truncation.gate)
    kept, log_kept = _options_to_keep(combinations, options, truncation.max_hypotheses)
    return _taken(combinations, rows, options, kept, at, shift), SensorReport(log_clutter, num_raised, log_kept)
