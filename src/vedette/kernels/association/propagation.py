"""Association marginals by loopy belief propagation (Williams and Lau 2014), exact on graphs without loops.

Rows and measurements exchange messages along the possible detections. With the weight w_ij of row i detected as
measurement j, and w_i0 of all its options without detection,

    nu_ij = w_ij / (w_i0 + sum over j' but j of w_ij' mu_ij'),    mu_ij = 1 / (1 + sum over i' but i of nu_i'j),

until mu converges. Then P(i is j) is proportional to w_ij mu_ij, and P(i is not detected) to w_i0. The cost of a sweep
is the number of options, however many rows compete. The iteration always converges, to a unique fixed point.
"""

import math

import numpy as np

from vedette.kernels.base.compile import inlined, kernel
from vedette.kernels.base.types import Floats, Ints


@inlined
def _sum_of_others(own: float, largest: float, rest: float, is_largest: bool) -> float:
    """Sum of non-negative terms except one, from the largest and the sum of the rest. Any of them may be infinite."""
    if is_largest:
        return rest
    # Subtracted before the largest is added: a small sum is not lost next to a large term outside it.
    return largest if own == math.inf else max(rest - own, 0.0) + largest


@inlined
def _send_to_measurements(
    offsets: Ints, columns: Ints, weights: Floats, free: Floats, to_row: Floats, to_column: Floats
) -> None:
    """Write nu of every detection into `to_column`."""
    for row in range(len(offsets) - 1):
        largest, rest, heaviest = 0.0, 0.0, -1
        for option in range(offsets[row], offsets[row + 1]):
            term = weights[option] * to_row[option]
            if columns[option] >= 0:
                rest += min(term, largest)
                if term > largest:
                    largest, heaviest = term, option
        for option in range(offsets[row], offsets[row + 1]):
            if columns[option] >= 0:
                own = weights[option] * to_row[option]
                others = free[row] + _sum_of_others(own, largest, rest, option == heaviest)
                if weights[option] == 0.0:
                    to_column[option] = 0.0
                else:
                    to_column[option] = math.inf if others == 0.0 else weights[option] / others


@inlined
def _add_up(columns: Ints, to_column: Floats, largest: Floats, rest: Floats, heaviest: Ints) -> None:
    """Write the largest nu of every measurement, its option, and the sum of all others."""
    for column in range(len(largest)):
        largest[column], rest[column], heaviest[column] = 0.0, 0.0, -1
    for option in range(len(columns)):
        column = columns[option]
        if column >= 0:
            rest[column] += min(to_column[option], largest[column])
            if to_column[option] > largest[column]:
                largest[column], heaviest[column] = to_column[option], option


@inlined
def _send_to_rows(
    columns: Ints, to_column: Floats, largest: Floats, rest: Floats, heaviest: Ints, to_row: Floats
) -> float:
    """Write mu of every detection into `to_row`, and return the largest relative change."""
    change = 0.0
    for option in range(len(columns)):
        column = columns[option]
        if column < 0:
            continue
        others = _sum_of_others(to_column[option], largest[column], rest[column], heaviest[column] == option)
        message = 1.0 / (1.0 + others)
        change = max(change, abs(message - to_row[option]) / max(message, to_row[option], 1e-300))
        to_row[option] = message
    return change


@inlined
def _conclude(
    offsets: Ints, columns: Ints, log_weights: Floats, weights: Floats, free: Floats, to_row: Floats, out: Floats
) -> float:
    """Write the log marginals, and return the rows' part of the log total weight, -inf if a row has no option."""
    log_total = 0.0
    for row in range(len(offsets) - 1):
        start, stop = offsets[row], offsets[row + 1]
        total = free[row]
        for option in range(start, stop):
            if columns[option] >= 0:
                total += weights[option] * to_row[option]
        if not total > 0.0:
            return -math.inf
        for option in range(start, stop):
            out[option] = log_weights[option] - log_weights[start] - math.log(total)
            if columns[option] >= 0:
                out[option] += math.log(to_row[option]) if to_row[option] > 0.0 else -math.inf
        log_total += log_weights[start] + math.log(total)
    return log_total


@kernel
def propagate_beliefs(
    offsets: Ints, columns: Ints, log_weights: Floats, max_sweeps: int, tolerance: float, out: Floats
) -> float:
    """Write the log marginal of every option. Return the log total weight in Bethe's approximation, -inf if impossible.

    Options as in `vedette.kernels.association.assignment.Options`. Stops after `max_sweeps`, or when no mu changes by
    more than `tolerance` of itself.

    Z = prod over rows of (w_i0 + sum of w_ij mu_ij) times prod over measurements of (1 + sum of nu_ij), over the
    product over detections of (1 + mu_ij nu_ij) (Vontobel 2013).
    """
    num, num_columns, num_rows = len(columns), 0, len(offsets) - 1
    for option in range(num):
        num_columns = max(num_columns, columns[option] + 1)
    weights, free, to_row, to_column = np.empty(num), np.zeros(num_rows), np.ones(num), np.zeros(num)
    for row in range(num_rows):
        if offsets[row] == offsets[row + 1] or log_weights[offsets[row]] == -math.inf:
            return -math.inf
        for option in range(offsets[row], offsets[row + 1]):
            weights[option] = math.exp(log_weights[option] - log_weights[offsets[row]])
            if columns[option] < 0:
                free[row] += weights[option]
    largest, rest, heaviest = np.empty(num_columns), np.empty(num_columns), np.empty(num_columns, np.int64)
    for _ in range(max_sweeps):
        _send_to_measurements(offsets, columns, weights, free, to_row, to_column)
        _add_up(columns, to_column, largest, rest, heaviest)
        if _send_to_rows(columns, to_column, largest, rest, heaviest, to_row) <= tolerance:
            break
    log_total = _conclude(offsets, columns, log_weights, weights, free, to_row, out)
    if log_total == -math.inf:
        return log_total
    for column in range(num_columns):
        log_total += math.log1p(rest[column])  # (1 + sum of nu) over (1 + mu nu) of the largest
    for option in range(num):
        if columns[option] >= 0 and heaviest[columns[option]] != option:
            log_total -= math.log1p(to_row[option] * to_column[option])
    return log_total
