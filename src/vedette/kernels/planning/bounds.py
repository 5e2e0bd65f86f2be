"""Upper bounds on the contribution of each label, by trying the joint actions of the sensors that may see it.

If these are too many, the expected loss -r (q min(tr P+, c^2)^h + (1 - q) min(tr P, c^2)^h) of a label has a bound
whose cost is linear in the number of actions: q is at most 1 - prod_s (1 - max_a q_sa), and as q >= q_s for every
sensor,

    sum_s Y_s / q <= sum_s Y_s / q_s <= sum_s J_s,

where J_s is a matrix that is at least Y_sa / q_sa for each action a, in the order of symmetric matrices; the trace of
the position of (P^-1 + sum_s J_s)^-1 is at most that of any P+.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.gaussian.eigen import diagonalise
from vedette.kernels.gaussian.linalg import cholesky, solve_lower
from vedette.kernels.planning.ascent import label_mean
from vedette.kernels.planning.bernoulli_rows import Table
from vedette.kernels.planning.joint_values import add_rows, spread_row, value_rows
from vedette.kernels.planning.label_values import Valuation, make_value_work


class Choices(NamedTuple):
    """For each label the sensors that may see it, and the entries of each sensor."""

    label_offsets: Ints  # (num_labels + 1,) first sensor of each label
    sensors: Ints  # (num,) a sensor that may see the label
    entry_offsets: Ints  # (num + 1,) first entry of each sensor
    entries: Ints  # distinct entries of the table; -1 for courses that do not reach the label


@kernel
def best_of_labels(
    table: Table, valuation: Valuation, coefficients: Floats, choices: Choices, first: int, last: int, out: Floats
) -> None:
    """Write out[label] = the largest mean value over all joint entries of the label's sensors, for labels `first:last`.

    The sensors choose for each label independently. Labels for which `out` is NaN beforehand are skipped.
    """
    num_samples, size = table.changes.shape[2], table.start.shape[1]
    most = np.max(np.diff(choices.label_offsets))
    rows, at = np.empty((most + 1, size, num_samples)), np.empty(most + 1, np.int64)
    work, values = make_value_work(valuation, num_samples), np.empty((valuation.num, num_samples))
    for label in range(first, last):
        if math.isnan(out[label]):
            continue
        begin, depth = choices.label_offsets[label], choices.label_offsets[label + 1] - choices.label_offsets[label]
        spread_row(table.start[label], rows[0])
        level, best = 0, -math.inf
        at[0] = choices.entry_offsets[begin] if depth > 0 else 0
        # Depth-first search over the sensors' choices; the rows of a level are the sums over the sensors above it.
        while level >= 0:
            if level == depth:
                value_rows(valuation, label, rows[level], work, values)
                best = max(best, label_mean(values, coefficients))
                level -= 1
            elif at[level] == choices.entry_offsets[begin + level + 1]:
                level -= 1
            else:
                entry = choices.entries[at[level]]
                at[level] += 1
                power = table.powers[choices.sensors[begin + level]] if entry >= 0 else 0.0
                add_rows(rows[level], power, table.changes[max(entry, 0)], rows[level + 1])
                level += 1
                if level < depth:
                    at[level] = choices.entry_offsets[begin + level]
        out[label] = best


class _Join(NamedTuple):
    """Working arrays of upper bounds of matrices."""

    factor: Floats  # L of the prior information L L'
    own: Floats  # L^-1 Y L^-T / q of an entry
    joined: Floats  # upper bound of the entries of a sensor
    total: Floats  # identity plus the bounds of all sensors
    root: Floats
    rotated: Floats
    vectors: Floats
    solved: Floats


@inlined
def _whiten(factor: Floats, matrix: Floats, work: Floats, out: Floats) -> None:
    """Write out = L^-1 matrix L^-T, for a symmetric matrix."""
    n = factor.shape[0]
    for j in range(n):
        for i in range(n):
            total = matrix[i, j]
            for k in range(i):
                total -= factor[i, k] * work[k, j]
            work[i, j] = total / factor[i, i]
    for i in range(n):
        for j in range(n):
            total = work[i, j]
            for k in range(j):
                total -= factor[j, k] * out[i, k]
            out[i, j] = total / factor[j, j]


@borrowing
def _join(join: _Join) -> bool:
    """Write joined = R V max(1, D) V'R' - I with I + joined = R R' and R^-1 (I + own) R^-T = V D V': at least both."""
    n, root, rotated = join.own.shape[0], join.root, join.rotated
    for i in range(n):
        join.joined[i, i] += 1.0
        join.own[i, i] += 1.0
    if not cholesky(join.joined, root):
        return False
    _whiten(root, join.own, join.solved, rotated)
    diagonalise(rotated, join.vectors)
    for i in range(n):
        for j in range(n):
            total = 0.0
            for k in range(i + 1):
                total += root[i, k] * join.vectors[k, j]
            join.solved[i, j] = total
    for i in range(n):
        for j in range(n):
            total = -1.0 if i == j else 0.0
            for k in range(n):
                total += join.solved[i, k] * max(1.0, rotated[k, k]) * join.solved[j, k]
            join.joined[i, j] = total
    return True


@borrowing
def _read_entry(table: Table, entry: int, join: _Join) -> float:
    """Write the whitened information of an entry, given detection, into `own`; returns its log (1 - q)."""
    row, at, n = table.changes[entry], 0, join.own.shape[0]
    missed = row[row.shape[0] - 1, 0]
    scale = -1.0 / math.expm1(missed)
    for i in range(n):
        for j in range(i + 1):
            join.rotated[i, j] = scale * row[at, 0]
            join.rotated[j, i] = join.rotated[i, j]
            at += 1
    _whiten(join.factor, join.rotated, join.solved, join.own)
    return float(missed)


@borrowing
def _trace_at_least(join: _Join) -> float:
    """Return the trace of the position's part of L^-T total^-1 L^-1; -inf if `total` is not positive definite."""
    n, trace = join.own.shape[0], 0.0
    if not cholesky(join.total, join.root):
        return -math.inf
    for axis in range(2):
        # |R^-1 L^-1 e|^2 of the unit vector e along the axis.
        column = join.solved[0]
        for i in range(n):
            column[i] = 1.0 if i == axis else 0.0
        solve_lower(join.factor, column, column)
        solve_lower(join.root, column, column)
        for i in range(n):
            trace += column[i] * column[i]
    return trace


@kernel
def loss_reward_bounds(table: Table, valuation: Valuation, choices: Choices, out: Floats) -> None:
    """Write out[label] = an upper bound on the label's term of the expected loss; inf if the arithmetic fails."""
    n, num_labels, last = valuation.references.shape[1], len(table.start), valuation.prior.shape[1]
    square = np.empty((8, n, n))
    join = _Join(square[0], square[1], square[2], square[3], square[4], square[5], square[6], square[7])
    for label in range(num_labels):
        prior, at, missed, valid = valuation.prior[label], 0, 0.0, True
        for i in range(n):
            for j in range(i + 1):
                join.own[i, j] = prior[at]
                join.total[i, j], join.total[j, i] = (1.0, 1.0) if i == j else (0.0, 0.0)
                at += 1
        valid &= cholesky(join.own, join.factor)
        for choice in range(choices.label_offsets[label], choices.label_offsets[label + 1]):
            least, first = 0.0, True
            for place in range(choices.entry_offsets[choice], choices.entry_offsets[choice + 1]):
                entry = choices.entries[place]
                if entry < 0 or not table.changes[entry, last - 1, 0] < 0.0:
                    continue
                least = min(least, _read_entry(table, entry, join))
                if first:
                    join.joined[:, :] = join.own
                else:
                    valid &= _join(join)
                first = False
            missed += least
            if not first:
                for i in range(n):
                    for j in range(n):
                        join.total[i, j] += join.joined[i, j]
        trace = _trace_at_least(join) if valid else -math.inf
        seen = min(max(trace, 0.0) ** valuation.params[1], valuation.own[label, 0])
        weight, detected = valuation.params[2] / (1.0 + math.exp(-prior[last - 2])), -math.expm1(missed)
        out[label] = -weight * (detected * seen + (1.0 - detected) * valuation.own[label, 0])
