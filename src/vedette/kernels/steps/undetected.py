"""Prediction and update of undetected targets: survival, motion and births, and missed detections.

They are a Poisson intensity of Gaussians, and tables of expected numbers in the cells of a grid.
"""

import math
from typing import NamedTuple

import numpy as np

from vedette.errors import ModelError
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Marks, Mixture, Motion, Sensor
from vedette.kernels.gaussian.components import make_components, stacked_mixtures
from vedette.kernels.gaussian.marks import copy_marks
from vedette.kernels.gaussian.modes import predicted_intensity
from vedette.kernels.gaussian.prediction import survival_probabilities
from vedette.kernels.gaussian.reduction import reduce_intensity

# Standard deviations of a birth's position that represent "anywhere" about a measurement: wide relative to the noise.
WIDE = 3.0


class Cells(NamedTuple):
    """The cells of a grid, row after row."""

    num_columns: int
    corner: Floats  # (2,) least coordinates of the region
    size: Floats  # (2,) width and height of a cell
    middles: Floats  # (num_cells, state_dim) targets at rest in the middle of each
    states: Floats  # (num_cells, num_nodes, state_dim) the same at the nodes of each
    node_weights: Floats  # (num_nodes,) that sum to 1
    entering: Floats  # (num_cells,) relative rates of targets that appear; of any sum


class Arrivals(NamedTuple):
    """Changes of the undetected targets between two scans, in addition to motion and survival of the states."""

    born: Mixture  # intensity of births at sites
    max_components: int  # of the intensity
    survival: float  # survival probability in a cell; negative: that of the motion at its middle
    across: Floats  # shares of a cell that move 0, 1, ... columns to one side
    along: Floats  # the same of rows
    numbers: Floats  # (num_tables,) of targets that appear in the cells of each table


class Undetected(NamedTuple):
    """The undetected targets, and the label of the first of those that a scan detects.

    Targets in the cells are represented, about each measurement, by one Gaussian that is wide relative to the noise.
    """

    intensity: Mixture
    tables: Floats  # (num_tables, num_cells) expected numbers; the first is of the targets, others move as they do
    cells: Cells
    places: Floats  # (num_measurements, state_dim) states at rest at them; empty: no first detections in cells
    std: Floats  # (state_dim,) of a target that appears in a cell, about its place and at rest
    marks: Marks  # (1, ...) of a target that appears in a cell
    step: int  # of the labels
    first_index: int  # of the label of the scan's first measurement
    birth_rate: float  # 1/s, if it is learnt and the second table is of it
    is_placed: bool  # the sensor says where targets are; the scan of another changes nothing in the cells


@inlined
def mean_detection(sensor: Sensor, pose: Floats, states: Floats, node_weights: Floats) -> float:
    """Return the sum of weight * P_D over the (num_nodes, state_dim) states of a cell."""
    total = 0.0
    for i in range(states.shape[0]):
        detection = sensor.prob_detection(states[i], pose, sensor.detection_params)
        if not 0.0 <= detection <= 1.0:
            raise ModelError("detection model: probability is not in [0, 1]")
        total += node_weights[i] * detection
    return min(total, 1.0)  # weights sum to 1 up to rounding


@borrowing
def _take_out(sensor: Sensor, pose: Floats, states: Floats, node_weights: Floats, tables: Floats) -> None:
    for c in range(tables.shape[1]):
        missed = 1.0 - mean_detection(sensor, pose, states[c], node_weights)
        for table in range(tables.shape[0]):
            tables[table, c] *= missed


@kernel
def take_out_detected(sensor: Sensor, pose: Floats, states: Floats, node_weights: Floats, tables: Floats) -> Floats:
    """Tables times the mean over each cell of 1 - P_D, shape (num_tables, num_cells).

    states: (num_cells, num_nodes, state_dim) of targets at the nodes of each cell. node_weights: (num_nodes,), sum 1.
    """
    out = tables.copy()
    _take_out(sensor, pose, states, node_weights, out)
    return out


@borrowing
def _spread(row: Floats, shares: Floats, out: Floats) -> None:
    """Distribute each number of a row to its neighbours on both sides (-> out). What leaves the row is lost."""
    for i in range(len(row)):
        out[i] = row[i] * shares[0]
        for offset in range(1, len(shares)):
            if i >= offset:
                out[i] += shares[offset] * row[i - offset]
            if i + offset < len(row):
                out[i] += shares[offset] * row[i + offset]


@kernel
def moved_in_cells(expected: Floats, across: Floats, along: Floats) -> Floats:
    """Expected numbers after a step, shape (num_rows, num_columns). across, along: shares as in `Arrivals`."""
    num_rows, num_columns = expected.shape
    between, moved = np.empty((num_rows, num_columns)), np.empty((num_rows, num_columns))
    column, spread = np.empty(num_rows), np.empty(num_rows)
    for r in range(num_rows):
        _spread(expected[r], across, between[r])
    for c in range(num_columns):
        for r in range(num_rows):
            column[r] = between[r, c]
        _spread(column, along, spread)
        for r in range(num_rows):
            moved[r, c] = spread[r]
    return moved


@kernel
def _predicted_tables(tables: Floats, cells: Cells, motion: Motion, dt: float, arrivals: Arrivals) -> Floats:
    out, total = np.empty_like(tables), cells.entering.sum()
    if len(tables) == 0:
        return out
    survival = np.full(tables.shape[1], arrivals.survival)
    if arrivals.survival < 0.0:
        survival = survival_probabilities(motion, dt, cells.middles)
    for table in range(len(tables)):
        living = (tables[table] * survival).reshape((-1, cells.num_columns))
        moved = moved_in_cells(living, arrivals.across, arrivals.along)
        out[table] = moved.reshape(-1) + arrivals.numbers[table] * cells.entering / total
    return out


@kernel
def predicted_undetected(before: Undetected, motion: Motion, dt: float, arrivals: Arrivals) -> Undetected:
    """Return the undetected targets `dt` seconds later."""
    intensity = stacked_mixtures(predicted_intensity(before.intensity, motion, dt), arrivals.born)
    return Undetected(
        reduce_intensity(intensity, arrivals.max_components),
        _predicted_tables(before.tables, before.cells, motion, dt, arrivals),
        before.cells,
        before.places,
        before.std,
        before.marks,
        before.step,
        before.first_index,
        before.birth_rate,
        before.is_placed,
    )


@inlined
def cell_at(
    x: float, y: float, corner_x: float, corner_y: float, width: float, height: float, num_columns: int, num_cells: int
) -> int:
    """Return the index of the cell of a place, or -1 outside of the region."""
    if num_cells == 0:
        return -1
    column, row = np.floor((x - corner_x) / width), np.floor((y - corner_y) / height)
    if not (0 <= column < num_columns and 0 <= row < num_cells // num_columns):
        return -1
    return int(row) * num_columns + int(column)


@borrowing
def _density_at(place: Floats, cells: Cells, table: Floats) -> float:
    """Return targets per square metre, or 0 outside of the region."""
    corner, size = cells.corner, cells.size
    cell = cell_at(place[0], place[1], corner[0], corner[1], size[0], size[1], cells.num_columns, len(table))
    return float(table[cell] / (size[0] * size[1])) if cell >= 0 else 0.0


@kernel
def intensity_at_places(undetected: Undetected) -> Mixture:
    """Gaussians (num_measurements,) of the targets in the cells about each measurement, or none without tables."""
    num, dim = len(undetected.places) if len(undetected.tables) > 0 else 0, len(undetected.std)
    std, out = undetected.std.copy(), make_components(num, dim, undetected.marks)
    std[:2] *= WIDE
    for j in range(num):
        density = _density_at(undetected.places[j], undetected.cells, undetected.tables[0])
        log_area = math.log(2.0 * math.pi * std[0] * std[1])
        out.log_weights[j] = math.log(density) + log_area if density > 0.0 else -math.inf
        copy_marks(undetected.marks, 0, out.marks, j)
        out.means[j], out.covs[j] = undetected.places[j], 0.0
        for d in range(dim):
            out.covs[j, d, d] = std[d] ** 2
    return out


class Left(NamedTuple):
    """Targets in the cells after a scan."""

    tables: Floats  # (num_tables, num_cells)
    changes: Floats  # (num_tables,) of their sums; the first is the log probability of no detection
    born_shares: Floats  # (num_measurements,) if a second table is of a birth rate: see `_share_born`


@kernel
def left_in_cells(undetected: Undetected, sensor: Sensor, pose: Floats) -> Left:
    """Return the tables after a scan. undetected: at its time."""
    tables, cells = undetected.tables, undetected.cells
    shares = np.empty(len(undetected.places) if len(tables) > 1 else 0)
    for j in range(len(shares)):
        shares[j] = _share_born(undetected, undetected.places[j])
    if len(tables) == 0 or not undetected.is_placed:
        return Left(tables, np.zeros(len(tables)), shares)
    left = take_out_detected(sensor, pose, cells.states, cells.node_weights, tables)
    return Left(left, left.sum(axis=1) - tables.sum(axis=1), shares)


@borrowing
def _share_born(undetected: Undetected, place: Floats) -> float:
    """Share of the intensity at a measurement that comes from targets born after the first scan.

    The others existed initially, come from birth sites, or had a label before. The noise is taken as half of the
    standard deviation of a birth.
    """
    intensity, std, elsewhere = undetected.intensity, undetected.std, 0.0
    for c in range(len(intensity.log_weights)):
        cov = intensity.covs[c]
        x, y = place[0] - intensity.means[c, 0], place[1] - intensity.means[c, 1]
        xx, yy, xy = cov[0, 0] + (0.5 * std[0]) ** 2, cov[1, 1] + (0.5 * std[1]) ** 2, cov[0, 1]
        det = xx * yy - xy * xy
        squared = (x * x * yy - 2.0 * x * y * xy + y * y * xx) / det
        elsewhere += math.exp(intensity.log_weights[c] - 0.5 * squared) / (2.0 * math.pi * math.sqrt(det))
    born = undetected.birth_rate * _density_at(place, undetected.cells, undetected.tables[1])
    total = elsewhere + _density_at(place, undetected.cells, undetected.tables[0])
    return float(born / total) if born > 0.0 else 0.0
