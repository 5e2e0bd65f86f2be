"""Options of each row of a scan: absent, missed, or detected as one of the gated measurements.

This is the part of the joint prediction and update that all filters share (Vo, Vo, Hoang 2017, eq. 25-27 and 33-35).
"""

import math
from typing import NamedTuple

import numpy as np

from vedette.errors import ModelError
from vedette.kernels.association.assignment import ABSENT, MISSED, Options, borrowed_options
from vedette.kernels.association.gating import Near, near_measurements
from vedette.kernels.association.predicted import Rows
from vedette.kernels.association.truncation import Truncation
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Ints, Marks, Measurements, ScanInput, Sensor
from vedette.kernels.gaussian.detection import detection_probability, moments_if_missed
from vedette.kernels.gaussian.innovation import copy_innovation, whiten, write_posterior
from vedette.kernels.gaussian.linalg import log_or_minus_inf
from vedette.kernels.gaussian.marks import detection_factor, no_marks, room_for_updated_marks, update_marks
from vedette.kernels.gaussian.relinearisation import Pair, PairWork, make_pair_work, update_pair
from vedette.kernels.gaussian.row_noise import bring_noise, log_likelihood_ratio, mark_missing, noise_of_row


class Sight(NamedTuple):
    """A scan with its sensor, pose and clutter, and working arrays for updates of components that bend."""

    sensor: Sensor
    pose: Floats  # (pose_dim,)
    measurements: Measurements
    log_clutter: Floats  # (>= num_measurements,) log clutter intensity at each measurement
    work: PairWork


@kernel
def make_options(num_rows: int, num_components: int, num_measurements: int, state_dim: int, meas_dim: int) -> Options:
    """Return arrays for every possible option of measurements without features of classes."""
    most_options, most_entries = num_rows * (num_measurements + 2), num_components * (num_measurements + 1)
    updated = np.empty((most_entries, state_dim + 1, state_dim))
    return make_room(num_rows, most_options, most_entries, num_measurements, meas_dim, updated, no_marks())


@kernel
def make_room(
    num_rows: int, num_options: int, num_entries: int, num_columns: int, meas_dim: int, updated: Floats, marks: Marks
) -> Options:
    """Return arrays for this number of options, entries and measurements. updated, marks: as in `Options`."""
    return Options(
        np.zeros(num_rows + 1, np.int64),
        np.empty(num_options, np.int64),
        np.empty(num_options),
        np.empty(num_options, np.int64),
        np.empty(num_entries),
        np.empty((num_entries, meas_dim)),
        updated,
        marks,
        num_columns,
    )


@kernel
def _room_for(rows: Rows, near: Near, measurements: Measurements) -> Options:
    """Return arrays for the options of rows with the measurements near them."""
    num, most_entries = len(rows.log_absent), 0
    for row in range(num):
        most_entries += (rows.offsets[row + 1] - rows.offsets[row]) * (near.offsets[row + 1] - near.offsets[row] + 1)
    updated = room_for_updated(rows, most_entries)
    marks = room_for_updated_marks(measurements, most_entries)
    num_measurements, meas_dim = measurements.values.shape
    return make_room(num, near.offsets[num] + 2 * num, most_entries, num_measurements, meas_dim, updated, marks)


@kernel
def room_for_updated(rows: Rows, num_entries: int) -> Floats:
    """Array (num_entries, state_dim + 1, state_dim).

    (0, ...) if no component bends or is at the edge of the field of view.
    """
    dim, kinds = rows.components.means.shape[1], rows.innovation
    return np.empty((num_entries if kinds.bends.any() or kinds.at_edge.any() else 0, dim + 1, dim))


@inlined
def view_options(options: Options, num_rows: int, num_measurements: int) -> Options:
    """Return arrays for the options of fewer rows and measurements."""
    offsets, columns, log_weights = options.offsets[: num_rows + 1], options.columns, options.log_weights
    return borrowed_options(options, offsets, columns, log_weights, options.entries, num_measurements)


@inlined
def log_clutter_at(sensor: Sensor, measurement: Floats, pose: Floats) -> float:
    """Return the log clutter intensity at a measurement, -inf if clutter is impossible there."""
    level = sensor.log_clutter_intensity(measurement, pose, sensor.clutter_params)
    if math.isnan(level) or level == math.inf:
        raise ModelError("clutter model: log intensity is not a number below infinity")
    return float(level)


@inlined
def log_clutter_of_row(sensor: Sensor, measurements: Measurements, j: int, pose: Floats, values: Floats) -> float:
    """Return the log clutter intensity at measurement `j`, over the likelihood ratio of its features.

    values: (meas_dim,) overwritten if the row brings noise.
    """
    if len(measurements.noise) == 0:
        level = log_clutter_at(sensor, measurements.values[j], pose)
    else:
        mark_missing(measurements, j, values)
        level = log_clutter_at(sensor, values, pose)
    return level - log_likelihood_ratio(measurements, j)


@borrowing
def _log_clutter(
    sensor: Sensor, measurements: Measurements, pose: Floats, floor: float, values: Floats, out: Floats
) -> tuple[float, int]:
    """Write the log clutter intensity at each measurement, raised to `floor`.

    Return their sum and the number raised.
    """
    total, num_raised = 0.0, 0
    for j in range(len(measurements.values)):
        level = log_clutter_of_row(sensor, measurements, j, pose, values)
        # With zero clutter intensity, no hypothesis could leave the measurement unexplained.
        if level < floor:
            level = floor
            num_raised += 1
        out[j] = level
        total += level
    return total, num_raised


@inlined
def sort_row(start: int, stop: int, columns: Ints, log_weights: Floats, entries: Ints) -> None:
    """Sort the options of a row, heaviest first."""
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
def weigh_detection(rows: Rows, c: int, j: int, sight: Sight, gate: float, entry: int, out: Options) -> float:
    """Return the log weight of component `c` detected as measurement `j` over clutter, -inf outside the gate.

    Writes its whitened residual, its updated moments if it bends, and its updated marks, at `entry`.
    """
    innovation, measurements = rows.innovation, sight.measurements
    measurement, distance, log_norm = measurements.values[j], 0.0, innovation.log_norm[c]
    if not bring_noise(measurements):
        distance = whiten(innovation, c, measurement, sight.sensor.periods, gate, out.whitened[entry])
    if innovation.bends[c] and distance <= gate:
        copy_innovation(innovation, c, sight.work.innovation, 0)
        own = noise_of_row(measurements, j)
        pair = Pair(sight.pose, rows.components.means[c], rows.components.covs[c], measurement, own)
        distance = update_pair(sight.sensor, pair, gate, sight.work, out.updated[entry])
        log_norm = sight.work.innovation.log_norm[0]
    if not distance <= gate:
        return -math.inf
    # The predicted component times p_D g(z | x) / kappa(z), integrated over x.
    weight = rows.components.log_weights[c] + log_norm - 0.5 * distance - sight.log_clutter[j]
    weight += update_marks(rows.components.marks, c, measurements, j, out.marks, entry)
    detected = innovation.prob_detection[c]
    if innovation.at_edge[c]:
        detected = _detected_there(rows, c, sight, out.whitened[entry], out.updated[entry])
    return float(weight + log_or_minus_inf(detected))


@inlined
def _detected_there(rows: Rows, c: int, sight: Sight, whitened: Floats, updated: Floats) -> float:
    """Return the mean P_D of a component after a measurement. Its Gaussian is in `updated`, or is written there."""
    if not rows.innovation.bends[c]:
        write_posterior(rows.innovation, c, whitened, rows.components.means[c], updated)
    factor = detection_factor(sight.sensor, rows.components.marks, c)
    return factor * detection_probability(
        sight.sensor, sight.pose, updated[0], updated[1:], sight.work.scratch.points[0]
    )


@inlined
def _detection_option(rows: Rows, row: int, j: int, sight: Sight, gate: float, entry: int, out: Options) -> float:
    """Write the component entries of row `row` detected as measurement `j`.

    Return its log weight, -inf outside the gate.
    """
    peak, first = -math.inf, rows.offsets[row]
    count = rows.offsets[row + 1] - first
    for i in range(count):
        weight = weigh_detection(rows, first + i, j, sight, gate, entry + i, out)
        peak = max(peak, weight)
        out.component_log_weights[entry + i] = weight
    return _total_from_peak(out.component_log_weights, entry, count, peak)


@inlined
def _total_from_peak(values: Floats, start: int, count: int, peak: float) -> float:
    if peak == -math.inf or count == 1:
        return peak
    total = 0.0
    for i in range(start, start + count):
        total += math.exp(values[i] - peak)
    return peak + math.log(total)


@borrowing
def _fill_options(rows: Rows, near: Near, sight: Sight, gate: float, out: Options) -> None:
    """Write the options of every row, heaviest first. Options of weight zero are left out."""
    filled, entry, every = 0, 0, len(near.offsets) == 0
    out.offsets[0] = 0
    components = rows.components
    for row in range(len(rows.log_absent)):
        start = filled
        first = rows.offsets[row]
        count = rows.offsets[row + 1] - first
        if rows.log_absent[row] > -math.inf:
            out.columns[filled], out.log_weights[filled], out.entries[filled] = ABSENT, rows.log_absent[row], -1
            filled += 1
        peak = -math.inf
        for i in range(count):
            missed = log_or_minus_inf(1.0 - rows.innovation.prob_detection[first + i])
            out.component_log_weights[entry + i] = components.log_weights[first + i] + missed
            if rows.innovation.at_edge[first + i]:
                mean, cov, updated = components.means[first + i], components.covs[first + i], out.updated[entry + i]
                state = sight.work.scratch.points[0]
                factor = detection_factor(sight.sensor, components.marks, first + i)
                moments_if_missed(sight.sensor, sight.pose, mean, cov, factor, state, updated[0], updated[1:])
            peak = max(peak, out.component_log_weights[entry + i])
        if peak > -math.inf:
            total = _total_from_peak(out.component_log_weights, entry, count, peak)
            out.columns[filled], out.log_weights[filled], out.entries[filled] = MISSED, total, entry
            filled += 1
            entry += count
        begin, end = (0, len(sight.measurements.values)) if every else (near.offsets[row], near.offsets[row + 1])
        for at in range(begin, end):
            j = at if every else near.measurements[at]
            weight = _detection_option(rows, row, j, sight, gate, entry, out)
            # Outside the gate nothing is kept: the next option overwrites the entries.
            if weight > -math.inf:
                out.columns[filled], out.log_weights[filled], out.entries[filled] = j, weight, entry
                filled += 1
                entry += count
        # The ranking search and the assignment start from the heaviest option of a row.
        sort_row(start, filled, out.columns, out.log_weights, out.entries)
        out.offsets[row + 1] = filled


@inlined
def weigh_options(
    rows: Rows,
    near: Near,
    scan: ScanInput,
    sensor: Sensor,
    caps: Truncation,
    log_clutter: Floats,
    work: PairWork,
    out: Options,
) -> tuple[float, int]:
    """Write the options of every row, with weights relative to clutter, heaviest first.

    near: the measurements to compare with. log_clutter: (>= num_measurements,) receives the log clutter intensity at
    each measurement. work: for updates of components that bend. Returns the sum of the log clutter intensities, and how
    many of them were raised to the floor.
    """
    floor, values = caps.log_clutter_floor, work.scratch.residual
    total, num_raised = _log_clutter(sensor, scan.measurements, scan.pose, floor, values, log_clutter)
    _fill_options(rows, near, Sight(sensor, scan.pose, scan.measurements, log_clutter, work), caps.gate, out)
    return total, num_raised


@kernel
def weighed_options(rows: Rows, scan: ScanInput, sensor: Sensor, caps: Truncation) -> tuple[Options, float, int]:
    """Return the result of `weigh_options` in new arrays."""
    return weighed_options_at(rows, scan, sensor, caps, np.empty(len(scan.measurements.values)))


@kernel
def weighed_options_at(
    rows: Rows, scan: ScanInput, sensor: Sensor, caps: Truncation, log_clutter: Floats
) -> tuple[Options, float, int]:
    """Return the result of `weighed_options`. log_clutter: (num_measurements,) written as in `weigh_options`."""
    near = near_measurements(rows, scan.measurements, sensor.periods, caps.gate)
    options = _room_for(rows, near, scan.measurements)
    work = make_pair_work(rows.components.means.shape[1], len(sensor.periods))
    log_total, num_raised = weigh_options(rows, near, scan, sensor, caps, log_clutter, work, options)
    return options, log_total, num_raised
