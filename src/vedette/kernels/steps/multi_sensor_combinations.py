"""Combinations of the options of each track at several sensors: a miss or a gated measurement at every one of them.

Combinations of a track grow sensor by sensor: each gated measurement, and the miss, gives a new one, in which it
updates the components. With linear Gaussian models the order of the sensors does not matter: weights and moments are
those of all measurements together.
"""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.association.assignment import MISSED, Options
from vedette.kernels.association.options import weighed_options
from vedette.kernels.association.predicted import (
    Rows,
    branched_rows,
    expect_rows,
    fill_births,
    fill_survivors,
    make_rows,
    standing_rows,
)
from vedette.kernels.association.truncation import Truncation
from vedette.kernels.base.arrays import filled_ints
from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Floats, Ints, Lmb, Motion, ScanInput, Sensor
from vedette.kernels.gaussian.components import components_between
from vedette.kernels.gaussian.innovation import make_innovation
from vedette.kernels.gaussian.linalg import log_sum
from vedette.kernels.gaussian.mixtures import descending_order
from vedette.kernels.gaussian.scratch import make_scratch
from vedette.kernels.steps.assembly import write_updated
from vedette.kernels.steps.lmb import weigh_by_existence


class Combinations(NamedTuple):
    """Combinations of every track over the sensors so far.

    The log weights of a row's components combine the track's presence, its mixture, and the likelihoods of its
    measurements relative to clutter.
    """

    rows: Rows  # one per combination: the label of its track, and its updated components; none is absent
    tracks: Ints  # (num,) number of the track of each, increasing
    columns: Ints  # (num, num_sensors) measurement of each sensor, numbered over all sensors, or MISSED
    log_absent: Floats  # (num_tracks,) log probability that a track is absent


class SensorReport(NamedTuple):
    """Sums and truncations of one sensor's scan."""

    log_clutter: float  # sum of the log clutter intensities of the scan
    num_raised: int  # measurements whose clutter intensity was raised to the floor
    log_kept: float  # log of the share of the combinations' weight, at this sensor, that the cap retains


@kernel
def _one_each(prior: Lmb, rows: Rows, num_sensors: int) -> Combinations:
    """Return a combination for each of the rows, of which the first are the prior's tracks, predicted as certain."""
    weigh_by_existence(prior.existence_logit, rows)
    num = len(rows.log_absent)
    log_absent = rows.log_absent.copy()
    tracks = np.empty(num, np.int64)
    columns = np.empty((num, num_sensors), np.int64)
    for i in range(num):
        rows.log_absent[i], tracks[i] = -math.inf, i
    return Combinations(rows, tracks, columns, log_absent)


@kernel
def predict_combinations(prior: Lmb, scan: ScanInput, num_sensors: int, motion: Motion) -> Combinations:
    """Return one combination per predicted track or birth site, before the first sensor, without using measurements."""
    birth = scan.birth
    if len(motion.transition_params) > 1:
        return _one_each(prior, branched_rows(prior.tracks, scan, motion, 0), num_sensors)
    num_tracks, num_births = len(prior.tracks.labels), len(birth.tracks.labels)
    num, dim = num_tracks + num_births, prior.tracks.components.means.shape[1]
    own = prior.tracks.components
    rows = make_rows(num, len(own.log_weights) + len(birth.tracks.components.log_weights), own, 0)
    fill_survivors(prior.tracks, motion, scan.dt, rows, make_scratch(dim, 0))
    fill_births(birth, num_tracks, rows)
    return _one_each(prior, rows, num_sensors)


@kernel
def standing_combinations(prior: Lmb, num_sensors: int) -> Combinations:
    """Return one combination per track, at the time of the scans, without births, deaths or motion."""
    return _one_each(prior, standing_rows(prior.tracks, 0), num_sensors)


@kernel
def _options_to_keep(combinations: Combinations, options: Options, most: int) -> tuple[Ints, float]:
    """Mark the `most` heaviest options of each track, (num_options,).

    Also return the log of their share of the weight.
    """
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
    """Return the combinations that follow from the kept options at sensor `at`, measurements counted from `shift`."""
    num, num_components = 0, 0
    for i in range(len(combinations.tracks)):
        for option in range(options.offsets[i], options.offsets[i + 1]):
            num += kept[option]
            num_components += kept[option] * (rows.offsets[i + 1] - rows.offsets[i])
    columns, tracks = np.empty((num, combinations.columns.shape[1]), np.int64), np.empty(num, np.int64)
    grown = make_rows(num, num_components, rows.components, 0)
    updated, filled, end = grown.components, 0, 0
    for i in range(len(combinations.tracks)):
        for option in range(options.offsets[i], options.offsets[i + 1]):
            if kept[option] == 0:
                continue
            end = write_updated(i, option, rows, options, end, updated)
            tracks[filled] = combinations.tracks[i]
            for sensor in range(at):
                columns[filled, sensor] = combinations.columns[i, sensor]
            column = options.columns[option]
            columns[filled, at] = MISSED if column == MISSED else shift + column
            grown.labels[filled, 0], grown.labels[filled, 1] = rows.labels[i, 0], rows.labels[i, 1]
            grown.log_absent[filled] = -math.inf
            filled += 1
            grown.offsets[filled] = end
    trimmed = components_between(updated, 0, end)
    rows = Rows(grown.labels, grown.offsets, grown.log_absent, trimmed, grown.innovation)
    return Combinations(rows, tracks, columns, combinations.log_absent)


@kernel
def extend_combinations(
    combinations: Combinations, at: int, shift: int, scan: ScanInput, sensor: Sensor, truncation: Truncation
) -> tuple[Combinations, SensorReport]:
    """Return the combinations after the scan of sensor `at`, whose measurements are counted from `shift` on."""
    given, meas_dim = combinations.rows, len(sensor.periods)
    num, dim = given.components.means.shape
    innovation = make_innovation(num, dim, meas_dim)
    rows = Rows(given.labels, given.offsets, given.log_absent, given.components, innovation)
    expect_rows(sensor, scan, rows, make_scratch(dim, meas_dim))
    options, log_clutter, num_raised = weighed_options(rows, scan, sensor, truncation)
    kept, log_kept = _options_to_keep(combinations, options, truncation.search.max_hypotheses)
    return _taken(combinations, rows, options, kept, at, shift), SensorReport(log_clutter, num_raised, log_kept)
