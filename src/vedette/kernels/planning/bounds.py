"""Upper bounds on rewards: of each label by trying its joint actions, and of the expected loss by relaxation.

The expected loss of a label is r (q e(P+) + (1 - q) e(P)), with e(P) = min(tr P, c^2)^h of the position's covariance,
P+^-1 = P^-1 + J / q and q = 1 - exp(m). The information J and the log probability m of missing the label are sums over
sensors. 1 / tr P is concave in P^-1, so a decreasing convex function of it is convex in P^-1; q e(P^-1 + J / q), its
perspective, is convex in q and J (Boyd and Vandenberghe 2004, section 3.2). As the loss decreases with q, and q is
concave in m, it is convex in the sums, if e is replaced by the largest convex function of 1 / tr P that is not above
e: a straight line where the cutoff matters.

A convex loss is nowhere below its tangents. A tangent is itself a sum over sensors, whose least value has each
sensor on its own best course; undetected targets, 1 - exp(sum), are treated alike. Steps of Frank and Wolfe (1956)
from the mean of all courses towards these courses improve the tangent (sensor selection: Joshi and Boyd 2009).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.gaussian.linalg import cholesky, inverse_from_factor
from vedette.kernels.planning.ascent import Ascent, Cells, add_scans, label_mean
from vedette.kernels.planning.bernoulli_rows import Table
from vedette.kernels.planning.joint_values import (
    add_rows,
    spread_row,
    start_totals,
    value_rows,
    values_without_scans,
)
from vedette.kernels.planning.label_values import Valuation, make_value_work

# Tangents that are tried: 40 instead of 20 lower the bound by less than half a per cent of the loss.
_NUM_TANGENTS = 20

# Halvings of the interval that contains the end of the straight line.
_NUM_HALVINGS = 10

# Relative rounding error of information.
_SAME = 1e-9


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

    The sensors choose for each label independently. Labels for which `out` is inf beforehand are skipped.
    """
    num_samples, size = table.changes.shape[2], table.start.shape[1]
    most = np.max(np.diff(choices.label_offsets))
    rows, at = np.empty((most + 1, size, num_samples)), np.empty(most + 1, np.int64)
    work, values = make_value_work(valuation, num_samples), np.empty((valuation.num, num_samples))
    for label in range(first, last):
        if out[label] == math.inf:
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


class _Work(NamedTuple):
    """Working arrays of the tangent of one label."""

    information: Floats  # (state_dim, state_dim)
    factor: Floats  # (state_dim, state_dim)
    cov: Floats  # (state_dim, state_dim)


@borrowing
def _end_of_line(valuation: Valuation, start: Floats, label: int) -> float:
    """Return the 1 / tr P at which the straight line from the cutoff meets the loss as a tangent.

    The line begins at the prediction, if `start` has no other information, else at 0. Slightly later ends are valid.
    """
    square, half, prior = valuation.params[0], valuation.params[1], valuation.prior[label]
    begin = 1.0 / (valuation.covs[label, 0, 0] + valuation.covs[label, 1, 1])
    dim = valuation.covs.shape[1]
    for k in range(dim * (dim + 1) // 2):
        if abs(start[k] - start[len(start) - 3] * prior[k]) > _SAME * abs(prior[k]):
            begin = 0.0
    if begin * square >= 1.0:
        return begin
    low, high = max(begin, 1.0 / square), (1.0 + half) ** (1.0 / half) / square
    for _ in range(_NUM_HALVINGS):
        middle = 0.5 * (low + high)
        if middle**-half * (1.0 + half - half * begin / middle) > square**half:
            low = middle
        else:
            high = middle
    return high


@borrowing
def _tangent(
    valuation: Valuation, start: Floats, label: int, unseen: float, end: float, total: Floats, work: _Work, out: Floats
) -> float:
    """Write the slopes (bernoulli_size,) of a label's term in its sums, at `total` (bernoulli_size, 1); returns the tangent at `start`.

    unseen: the label's term without scans. end: see `_end_of_line`. inf if the arithmetic fails.
    """
    n, last, prior, half, at = work.cov.shape[0], len(out) - 1, valuation.prior[label], valuation.params[1], 0
    out[:] = 0.0
    detected, power = -math.expm1(total[last, 0]), start[last - 2]
    if not (detected > 0.0 and power > 0.0):
        return unseen
    for i in range(n):
        for j in range(i + 1):
            work.information[i, j] = prior[at] + (total[at, 0] / power - prior[at]) / detected
            at += 1
    if not cholesky(work.information, work.factor):
        return math.inf
    inverse_from_factor(work.factor, work.cov)
    inverse = 1.0 / (work.cov[0, 0] + work.cov[1, 1])
    touched = max(inverse, end)
    slope = -half * touched ** (-half - 1.0)
    weight = -valuation.params[2] / (1.0 + math.exp(-prior[last - 1]))
    seen, change, gained, at = weight * (touched**-half + slope * (inverse - touched)), 0.0, 0.0, 0
    for i in range(n):
        for j in range(i + 1):
            own = work.cov[i, 0] * work.cov[j, 0] + work.cov[i, 1] * work.cov[j, 1]
            own *= weight * slope * inverse * inverse * (1.0 if i == j else 2.0)
            gained += own * (total[at, 0] / power - prior[at])
            out[at] = own / power
            change += out[at] * (total[at, 0] - start[at])
            at += 1
    out[last] = -(1.0 - detected) * (seen - gained / detected - unseen)
    change += out[last] * (total[last, 0] - start[last])
    return detected * seen + (1.0 - detected) * unseen - change


@inlined
def _slope_of_course(
    table: Table, cells: Cells, sensor: int, course: int, num: int, slopes: Floats, of_cells: Floats
) -> float:
    """Return the change of the tangent by a course. num: numbers of an information matrix."""
    last, total = slopes.shape[1] - 1, 0.0
    for entry in range(table.offsets[course], table.offsets[course + 1]):
        own, change = slopes[table.labels[entry]], table.changes[entry]
        total += own[last] * change[last, 0]
        for k in range(num):
            total += own[k] * change[k, 0]
    total *= table.powers[sensor]
    for entry in range(cells.offsets[course], cells.offsets[course + 1]):
        total += of_cells[cells.cells[entry]] * cells.log_miss[entry]
    return total


@borrowing
def _best_courses(
    table: Table, cells: Cells, prices: Floats, num: int, slopes: Floats, of_cells: Floats, best: Ints
) -> float:
    """Write the course of each sensor that is best by the tangent; returns the sum of their changes less prices."""
    total = 0.0
    for s in range(len(best)):
        most = -math.inf
        for course in range(table.first_courses[s], table.first_courses[s + 1]):
            gain = _slope_of_course(table, cells, s, course, num, slopes, of_cells) - prices[course]
            if gain > most:
                most, best[s] = gain, course
        total += most
    return total


@kernel
def relaxed_bound(table: Table, valuation: Valuation, cells: Cells, prices: Floats) -> float:
    """Return an upper bound on the expected loss, as a reward, of all joint actions; inf if the arithmetic fails."""
    (num_labels, size), num_sensors, n = table.start.shape, len(table.powers), valuation.covs.shape[1]
    at = Ascent(np.zeros(num_sensors, np.int64), start_totals(table), np.zeros(len(cells.worth)))
    for s in range(num_sensors):
        begin, end = table.first_courses[s], table.first_courses[s + 1]
        for course in range(begin, end):
            add_scans(table, cells, s, course, 1.0 / (end - begin), at)
    work = _Work(np.empty((n, n)), np.empty((n, n)), np.empty((n, n)))
    unseen, slopes = values_without_scans(table.start, valuation), np.empty((num_labels, size))
    ends, least = np.empty(num_labels), math.inf
    for label in range(num_labels):
        ends[label] = _end_of_line(valuation, table.start[label], label)
    for step in range(_NUM_TANGENTS):
        bound = 0.0
        for label in range(num_labels):
            start, total, own = table.start[label], at.totals[label], slopes[label]
            bound += _tangent(valuation, start, label, unseen[label, 0], ends[label], total, work, own)
        of_cells = -cells.worth * np.exp(at.cell_totals)
        bound += np.sum(cells.worth + of_cells - of_cells * at.cell_totals)
        bound += _best_courses(table, cells, prices, n * (n + 1) // 2, slopes, of_cells, at.chosen)
        least, share = min(least, bound), 2.0 / (step + 4.0)
        for label in range(num_labels):
            for k in range(size):
                at.totals[label, k, 0] += share * (table.start[label, k] - at.totals[label, k, 0])
        at.cell_totals[:] = (1.0 - share) * at.cell_totals
        for s in range(num_sensors):
            add_scans(table, cells, s, at.chosen[s], share, at)
    return least
