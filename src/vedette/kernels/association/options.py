"""What may happen to each track at a scan: absent, missed, or detected as one of the gated measurements.

The rows of a scan are the surviving tracks followed by the birth sites. This is the part of the joint prediction and
update that the delta-GLMB and the LMB filter share (Vo, Vo, Hoang 2017, eq. 25-27 and 33-35).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vedette.errors import ModelError
from vedette.kernels.association.assignment import ABSENT, MISSED, Options
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Ints, Lmb, Motion, Sensor, Tracks
from vedette.kernels.gaussian.kalman import Innovation, Scratch, expect, make_innovation, predict, whiten
from vedette.kernels.gaussian.linalg import log_add
from vedette.kernels.gaussian.mixtures import copy_component


class Rows(NamedTuple):
    """Predicted tracks of a scan, ready to be updated.

    log_absent: (num_rows,) log probability of not being there. log_weights: (num_components,) log of mixture weight
    times probability of being there. means, covs: predicted moments.
    """

    labels: Ints
    offsets: Ints
    log_absent: Floats
    log_weights: Floats
    means: Floats
    covs: Floats
    innovation: Innovation


@inlined
def log_or_minus_inf(value: float) -> float:
    return math.log(value) if value > 0.0 else -math.inf


@kernel
def make_rows(num_rows: int, num_components: int, state_dim: int, meas_dim: int) -> Rows:
    return Rows(
        np.empty((num_rows, 2), np.int64),
        np.zeros(num_rows + 1, np.int64),
        np.empty(num_rows),
        np.empty(num_components),
        np.empty((num_components, state_dim)),
        np.empty((num_components, state_dim, state_dim)),
        make_innovation(num_components, state_dim, meas_dim),
    )


@inlined
def view_rows(rows: Rows, first: int, num: int) -> Rows:
    """Room for `num` rows of one component each, from row `first` on."""
    last, innovation = first + num, rows.innovation
    return Rows(
        rows.labels[first:last],
        rows.offsets[first : last + 1],
        rows.log_absent[first:last],
        rows.log_weights[first:last],
        rows.means[first:last],
        rows.covs[first:last],
        Innovation(
            innovation.predicted[first:last],
            innovation.factor[first:last],
            innovation.whitened_cross[first:last],
            innovation.covs[first:last],
            innovation.log_norm[first:last],
            innovation.prob_detection[first:last],
        ),
    )


@borrowing
def fill_survivors(tracks: Tracks, motion: Motion, dt: float, rows: Rows, scratch: Scratch) -> None:
    """Predict every track into the first rows."""
    rows.offsets[0] = 0
    for i in range(len(tracks.labels)):
        absent = 0.0
        for c in range(tracks.offsets[i], tracks.offsets[i + 1]):
            mean = tracks.means[c]
            survival = motion.prob_survival(mean, dt, motion.survival_params)
            if not 0.0 <= survival <= 1.0:
                raise ModelError("survival model: probability is not in [0, 1]")
            absent += math.exp(tracks.log_weights[c]) * (1.0 - survival)
            rows.log_weights[c] = tracks.log_weights[c] + log_or_minus_inf(survival)
            predict(motion, dt, mean, tracks.covs[c], rows.means[c], rows.covs[c], scratch)
        rows.log_absent[i] = log_or_minus_inf(absent)
        rows.labels[i, 0], rows.labels[i, 1] = tracks.labels[i, 0], tracks.labels[i, 1]
        rows.offsets[i + 1] = tracks.offsets[i + 1]


@borrowing
def fill_births(birth: Lmb, first_row: int, rows: Rows) -> None:
    """Append the birth sites after `first_row` survivors."""
    sites = birth.tracks
    shift = rows.offsets[first_row]
    for i in range(len(sites.labels)):
        row = first_row + i
        rows.labels[row, 0], rows.labels[row, 1] = sites.labels[i, 0], sites.labels[i, 1]
        rows.log_absent[row] = -log_add(0.0, birth.existence_logit[i])
        log_existence = -log_add(0.0, -birth.existence_logit[i])
        rows.offsets[row + 1] = shift + sites.offsets[i + 1]
        for c in range(sites.offsets[i], sites.offsets[i + 1]):
            rows.log_weights[shift + c] = sites.log_weights[c] + log_existence
            copy_component(sites.means, sites.covs, c, rows.means, rows.covs, shift + c)


@borrowing
def clutter_levels(sensor: Sensor, scan: Floats, pose: Floats, floor: float, out: Floats) -> tuple[float, int]:
    """Log clutter intensity at each measurement, raised to `floor`; returns their sum and how often that was needed."""
    total, num_raised = 0.0, 0
    for j in range(len(scan)):
        level = sensor.log_clutter_intensity(scan[j], pose, sensor.clutter_params)
        if math.isnan(level) or level == math.inf:
            raise ModelError("clutter model: log intensity is not a number below infinity")
        if level < floor:
            level = floor
            num_raised += 1
        out[j] = level
        total += level
    return total, num_raised


@borrowing
def expect_rows(sensor: Sensor, pose: Floats, rows: Rows, scratch: Scratch) -> None:
    for c in range(len(rows.log_weights)):
        expect(sensor, pose, rows.means[c], rows.covs[c], c, rows.innovation, scratch)


@inlined
def _sort_row(start: int, stop: int, columns: Ints, log_weights: Floats, entries: Ints) -> None:
    for i in range(start + 1, stop):
        column, weight, entry = columns[i], log_weights[i], entries[i]
        slot = i
        while slot > start and log_weights[slot - 1] < weight:
            columns[slot], log_weights[slot], entries[slot] = (
                columns[slot - 1],
                log_weights[slot - 1],
                entries[slot - 1],
            )
            slot -= 1
        columns[slot], log_weights[slot], entries[slot] = column, weight, entry


@inlined
def _detection_option(
    rows: Rows, row: int, scan: Floats, j: int, level: float, sensor: Sensor, gate: float, entry: int, opts: Options
) -> float:
    """Write the component entries of row `row` detected as measurement `j`; its log weight, -inf outside the gate."""
    innovation = rows.innovation
    peak = -math.inf
    first = rows.offsets[row]
    count = rows.offsets[row + 1] - first
    for i in range(count):
        c = first + i
        distance = whiten(innovation, c, scan[j], sensor.angular, gate, opts.whitened[entry + i])
        weight = -math.inf
        if distance <= gate:
            weight = rows.log_weights[c] + innovation.log_norm[c] - 0.5 * distance - level
            weight += log_or_minus_inf(innovation.prob_detection[c])
            peak = max(peak, weight)
        opts.component_log_weights[entry + i] = weight
    return _total_from_peak(opts.component_log_weights, entry, count, peak)


@inlined
def _total_from_peak(values: Floats, start: int, count: int, peak: float) -> float:
    if peak == -math.inf or count == 1:
        return peak
    total = 0.0
    for i in range(start, start + count):
        total += math.exp(values[i] - peak)
    return peak + math.log(total)


@kernel
def make_options(num_rows: int, num_components: int, num_measurements: int, meas_dim: int) -> Options:
    """Room for every option that there can be."""
    most_options, most_entries = num_rows * (num_measurements + 2), num_components * (num_measurements + 1)
    return Options(
        np.zeros(num_rows + 1, np.int64),
        np.empty(most_options, np.int64),
        np.empty(most_options),
        np.empty(most_options, np.int64),
        np.empty(most_entries),
        np.empty((most_entries, meas_dim)),
    )


@inlined
def view_options(options: Options, num_rows: int) -> Options:
    """Room for the options of the first `num_rows` rows."""
    return Options(
        options.offsets[: num_rows + 1],
        options.columns,
        options.log_weights,
        options.entries,
        options.component_log_weights,
        options.whitened,
    )


@borrowing
def fill_options(rows: Rows, scan: Floats, levels: Floats, sensor: Sensor, gate: float, opts: Options) -> None:
    """Options of every row, heaviest first; options of weight zero are left out."""
    filled, entry = 0, 0
    opts.offsets[0] = 0
    for row in range(len(rows.log_absent)):
        start = filled
        first = rows.offsets[row]
        count = rows.offsets[row + 1] - first
        if rows.log_absent[row] > -math.inf:
            opts.columns[filled], opts.log_weights[filled], opts.entries[filled] = ABSENT, rows.log_absent[row], -1
            filled += 1
        peak = -math.inf
        for i in range(count):
            missed = log_or_minus_inf(1.0 - rows.innovation.prob_detection[first + i])
            opts.component_log_weights[entry + i] = rows.log_weights[first + i] + missed
            peak = max(peak, opts.component_log_weights[entry + i])
        if peak > -math.inf:
            total = _total_from_peak(opts.component_log_weights, entry, count, peak)
            opts.columns[filled], opts.log_weights[filled], opts.entries[filled] = MISSED, total, entry
            filled += 1
            entry += count
        for j in range(len(scan)):
            weight = _detection_option(rows, row, scan, j, levels[j], sensor, gate, entry, opts)
            if weight > -math.inf:
                opts.columns[filled], opts.log_weights[filled], opts.entries[filled] = j, weight, entry
                filled += 1
                entry += count
        _sort_row(start, filled, opts.columns, opts.log_weights, opts.entries)
        opts.offsets[row + 1] = filled


@kernel
def list_options(rows: Rows, scan: Floats, levels: Floats, sensor: Sensor, gate: float) -> Options:
    """As `fill_options`, into arrays of its own."""
    opts = make_options(len(rows.log_absent), len(rows.log_weights), len(scan), scan.shape[1])
    fill_options(rows, scan, levels, sensor, gate, opts)
    return opts
