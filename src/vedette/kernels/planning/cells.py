"""The cells of a grid that a sensor sees on each of its courses."""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.base.arrays import grown_floats, grown_ints
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Bools, Floats, Ints, Sensor
from vedette.kernels.steps.undetected import mean_detection


class _Cells(NamedTuple):
    """A grid as the nodes of its cells."""

    states: Floats  # (num_cells, num_nodes, state_dim) targets at the nodes of each cell
    node_weights: Floats  # (num_nodes,) weights of the mean over a cell
    bounds: Floats  # (num_cells, 4) least and greatest x, least and greatest y of its nodes


@borrowing
def _write_bounds(states: Floats, bounds: Floats) -> None:
    """Write `_Cells.bounds` of the nodes."""
    for c in range(len(states)):
        bounds[c, 0], bounds[c, 1] = states[c, 0, 0], states[c, 0, 0]
        bounds[c, 2], bounds[c, 3] = states[c, 0, 1], states[c, 0, 1]
        for i in range(1, states.shape[1]):
            bounds[c, 0], bounds[c, 1] = min(bounds[c, 0], states[c, i, 0]), max(bounds[c, 1], states[c, i, 0])
            bounds[c, 2], bounds[c, 3] = min(bounds[c, 2], states[c, i, 1]), max(bounds[c, 3], states[c, i, 1])


@inlined
def _out_of_reach(bounds: Floats, c: int, pose: Floats, reach: float) -> bool:
    """Return True if all nodes of a cell are farther than `reach`."""
    dx = max(bounds[c, 0] - pose[0], pose[0] - bounds[c, 1], 0.0)
    dy = max(bounds[c, 2] - pose[1], pose[1] - bounds[c, 3], 0.0)
    return dx * dx + dy * dy > reach * reach


@borrowing
def _write_view(
    sensor: Sensor,
    course: Floats,
    scans: Bools,
    grid: _Cells,
    least: float,
    reach: float,
    cells: Ints,
    log_miss: Floats,
) -> int:
    """Write the cells in view on one course, with their values as in `cells_in_view`, and return their number."""
    count = 0
    for c in range(len(grid.states)):
        most, total = 0.0, 0.0
        for h in range(len(course)):
            if not scans[h] or _out_of_reach(grid.bounds, c, course[h], reach):
                continue
            detection = mean_detection(sensor, course[h], grid.states[c], grid.node_weights)
            most = max(most, detection)
            total += math.log1p(-detection) if detection < 1.0 else -math.inf
        if most >= least:
            cells[count], log_miss[count] = c, total
            count += 1
    return count


@kernel
def cells_in_view(
    sensor: Sensor, courses: Floats, scans: Bools, states: Floats, node_weights: Floats, least: float, reach: float
) -> tuple[Ints, Ints, Floats]:
    """Return for each course the cells that it sees, and the log probability of missing a target in them throughout.

    P_D of a cell is the mean over its nodes. A cell is seen if that is at least `least` at some time.

    Args:
        sensor: the sensor in kernel form.
        courses: (num_courses, num_times, pose_dim) poses.
        scans: (num_courses, num_times) whether it scans at each pose.
        states: (num_cells, num_nodes, state_dim) targets at the nodes of each cell.
        node_weights: (num_nodes,) weights of the mean, sum 1.
        least: minimum detection probability of a cell that is seen. With 0 all are.
        reach: m. P_D is known to be 0 at nodes farther than this, so it is not evaluated there. inf: not known.

    Returns:
        entry_offsets (num_courses + 1,), and for each entry the cell, increasing within a course, and the sum of log(1
            - P_D) over all times of the course, which is -inf if a detection is certain.
    """
    num_cells, count = len(states), 0
    grid = _Cells(states, node_weights, np.empty((num_cells, 4)))
    _write_bounds(states, grid.bounds)
    entry_offsets = np.empty(len(courses) + 1, np.int64)
    cells, log_miss = np.empty(num_cells, np.int64), np.empty(num_cells)
    entry_offsets[0] = 0
    for course in range(len(courses)):
        cells, log_miss = grown_ints(cells, count + num_cells), grown_floats(log_miss, count + num_cells)
        poses, found, missed = courses[course], cells[count:], log_miss[count:]
        count += _write_view(sensor, poses, scans[course], grid, least, reach, found, missed)
        entry_offsets[course + 1] = count
    return entry_offsets, cells[:count].copy(), log_miss[:count].copy()
