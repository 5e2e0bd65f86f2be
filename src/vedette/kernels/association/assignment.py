"""Assignment of the rows (predicted tracks) of a hypothesis to columns (measurements): optimum and dual variables.

Minimise the sum of the costs c[i, o(i)] = -log weight over a choice of one option o(i) per row, with no column taken
twice. Every row lists its options by descending log weight. The column of an option is a measurement, which at most one
row may take, or negative (absent, missed), which any row may take: as if each row had its own column for it.
"""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Ints, Marks

ABSENT = -2
MISSED = -1


class Options(NamedTuple):
    """Options of each row of a scan, heaviest first."""

    offsets: Ints  # (num_rows + 1,) into the options
    columns: Ints  # (num_options,) ABSENT, MISSED or a measurement
    log_weights: Floats  # (num_options,) relative to clutter alone
    entries: Ints  # (num_options,) start of the option's components in the next two, -1 if absent
    component_log_weights: Floats  # (num_entries,) of an option they sum to its weight; -inf outside the gate
    whitened: Floats  # (num_entries, meas_dim) whitened residuals of the components of a detection
    updated: Floats  # (num_entries, state_dim + 1, state_dim) mean, covariance of those that bend or are at an edge
    marks: Marks  # (num_entries, ...) updated, in the columns that measurements of the scan change
    num_measurements: int  # of the scan


def _with_options(
    options: Options, offsets: Ints, columns: Ints, log_weights: Floats, entries: Ints, num_measurements: int
) -> Options:
    """Return other options of the same components."""
    whitened, updated, marks, weights = options.whitened, options.updated, options.marks, options.component_log_weights
    return Options(offsets, columns, log_weights, entries, weights, whitened, updated, marks, num_measurements)


with_options = kernel(_with_options)
borrowed_options = inlined(_with_options)  # for kernels that only borrow arrays


class DualWork(NamedTuple):
    """Working arrays of the assignment solver."""

    row_dual: Floats  # (num_rows,) u
    row_option: Ints  # (num_rows,) chosen option of each row
    row_gap: Floats  # (num_rows,) reduced cost of the second best option, for the ranking search
    column_dual: Floats  # (num_columns,) v <= 0
    column_row: Ints  # (num_columns,) row that holds the column, -1 for none
    slack: Floats  # (num_columns,) least reduced cost from the rows of the alternating tree
    slack_option: Ints  # (num_columns,) option and row of that cost, packed as option * num_rows + row
    visited: Ints  # (num_columns,) 1 where the column is in the tree


@kernel
def make_dual_work(num_rows: int, num_columns: int) -> DualWork:
    return DualWork(
        np.empty(num_rows),
        np.empty(num_rows, np.int64),
        np.empty(num_rows),
        np.empty(num_columns),
        np.empty(num_columns, np.int64),
        np.empty(num_columns),
        np.empty(num_columns, np.int64),
        np.empty(num_columns, np.int64),
    )


@borrowing
def solve_assignment(options: Options, rows: Ints, work: DualWork) -> float:
    """Return the cost (minus the log weight) of the best joint choice, or +inf if none exists.

    Writes the chosen option of each row to `work.row_option` and optimal dual variables u, v <= 0 to `work.row_dual`
    and `work.column_dual`: c - u - v >= 0 for every option, with equality on the optimum (complementary slackness),
    and v = 0 for a column that the optimum leaves unused. Shortest augmenting paths (Jonker and Volgenant 1987).
    """
    total = 0.0
    collision = False
    num_columns = options.num_measurements
    # If the best options of the rows do not collide, each row gets its best option and all v are 0.
    for column in range(num_columns):
        work.column_dual[column] = 0.0
        work.column_row[column] = -1
    for i in range(len(rows)):
        first = options.offsets[rows[i]]
        if first == options.offsets[rows[i] + 1]:
            return math.inf
        work.row_option[i] = first
        work.row_dual[i] = -options.log_weights[first]
        total += work.row_dual[i]
        column = options.columns[first]
        if column >= 0:
            collision = collision or work.column_row[column] >= 0
            work.column_row[column] = i
    if not collision:
        return total
    for column in range(num_columns):
        work.column_row[column] = -1
    for i in range(len(rows)):
        if not _augment(options, rows, i, work):
            return math.inf
    total = 0.0
    for i in range(len(rows)):
        total -= options.log_weights[work.row_option[i]]
    return total


@inlined
def _augment(options: Options, rows: Ints, start: int, work: DualWork) -> bool:
    """Assign row `start` along a shortest alternating path, to a free column or a row's own negative column."""
    num_columns = options.num_measurements
    for column in range(num_columns):
        work.slack[column] = math.inf
        work.visited[column] = 0
    work.row_dual[start] = 0.0
    own_slack, own_option, own_row = math.inf, -1, -1
    row = start
    while True:
        # Dijkstra's algorithm over columns, with reduced costs as lengths: relax the edges of the last row.
        for option in range(options.offsets[rows[row]], options.offsets[rows[row] + 1]):
            column = options.columns[option]
            reduced = -options.log_weights[option] - work.row_dual[row]
            if column < 0:
                if reduced < own_slack:
                    own_slack, own_option, own_row = reduced, option, row
            elif work.visited[column] == 0 and reduced - work.column_dual[column] < work.slack[column]:
                work.slack[column] = reduced - work.column_dual[column]
                # Option and row in one number, so that the path back needs a single array.
                work.slack_option[column] = option * len(rows) + row
        # A row's own column (absent, missed) is always free, so it ends the path like a free measurement.
        best, best_column = own_slack, -1
        for column in range(num_columns):
            if work.visited[column] == 0 and work.slack[column] < best:
                best, best_column = work.slack[column], column
        if best == math.inf:
            return False
        # Duals move along the tree so that reduced costs stay non-negative and the edge just reached becomes tight.
        work.row_dual[start] += best
        for column in range(num_columns):
            if work.visited[column] == 1:
                work.row_dual[work.column_row[column]] += best
                work.column_dual[column] -= best
            else:
                work.slack[column] -= best
        own_slack -= best
        if best_column < 0:
            _flip(options, own_row, own_option, start, len(rows), work)
            return True
        if work.column_row[best_column] < 0:
            packed = work.slack_option[best_column]
            work.column_row[best_column] = packed % len(rows)
            _flip(options, packed % len(rows), packed // len(rows), start, len(rows), work)
            return True
        work.visited[best_column] = 1
        row = work.column_row[best_column]


@inlined
def _flip(options: Options, row: int, option: int, start: int, num_rows: int, work: DualWork) -> None:
    """Give `row` its new option and pass its old column back along the path to `start`."""
    while row != start:
        released = options.columns[work.row_option[row]]
        work.row_option[row] = option
        packed = work.slack_option[released]
        option, row = packed // num_rows, packed % num_rows
        work.column_row[released] = row
    work.row_option[row] = option
