"""Upper bounds on rewards: of each label by trying its joint actions, and of the expected loss by relaxation.

The expected loss of a label is r (q e(P+) + (1 - q) e(P)), with e(P) = min(tr P, c^2)^h of the position's covariance,
P+^-1 = P^-1 + J / q and q = 1 - exp(m). The information J and the log probability m of missing the label are sums over
sensors. 1 / tr P is concave in P^-1, so a decreasing convex function of it is convex in P^-1, and q e(P^-1 + J / q),
its perspective, is convex in q and J (Boyd and Vandenberghe 2004, section 3.2). As the loss decreases with q, and q is
concave in m, it is convex in the sums, if e is replaced by the largest convex function of 1 / tr P that is not above
e: a straight line where the cutoff matters.

A convex loss is nowhere below its tangents. A tangent is itself a sum over sensors, whose least value has each
sensor on its own best course. Undetected targets, 1 - exp(sum), are treated alike. Steps of Frank and Wolfe (1956)
from the mean of all courses towards these courses improve the tangent (sensor selection: Joshi and Boyd 2009).
"""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.base.compile import borrowing, kernel
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.gaussian.linalg import cholesky, inverse_from_factor
from vedette.kernels.planning.ascent import Ascent, Cells, add_scans, label_mean
from vedette.kernels.planning.bernoulli_rows import Table
from vedette.kernels.planning.joint_values import add_rows, spread_row, start_totals, value_rows, values_without_scans
from vedette.kernels.planning.label_values import Valuation, ValueWork, make_value_work

# Tangents that are tried: 20 instead of 12 lower the bound by at most 1.3 % of the loss (decision 9).
_NUM_TANGENTS = 12


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


@borrowing
def _tangent(
    valuation: Valuation, label: int, unseen: float, start: Floats, total: Floats, work: ValueWork, slopes: Floats
) -> float:
    """Write the slopes (bernoulli_size,) of a label's term in its sums. Returns the value of the tangent at `start`.

    unseen: the term without scans. total: (bernoulli_size, 1) where it is touched. inf if the arithmetic fails.
    """
    cov, last, prior, half, at = work.cov, len(slopes) - 1, valuation.prior[label], valuation.params[1], 0
    slopes[:] = 0.0
    detected, power = -math.expm1(total[last, 0]), start[last - 2]
    if not (detected > 0.0 and power > 0.0):
        return unseen
    for i in range(len(cov)):
        for j in range(i + 1):
            cov[i, j] = prior[at] + (total[at, 0] / power - prior[at]) / detected
            at += 1
    if not cholesky(cov, work.factor):
        return math.inf
    inverse_from_factor(work.factor, cov)
    # Up to `end` the straight line that begins at 1 / tr P = 0 with the cutoff, and ends as a tangent.
    inverse, end = 1.0 / (cov[0, 0] + cov[1, 1]), (1.0 + half) ** (1.0 / half) / valuation.params[0]
    near, weight = max(inverse, end), -valuation.params[2] / (1.0 + math.exp(-prior[last - 1]))
    slope = -half * weight * near ** (-half - 1.0)
    seen, change, gained, at = weight * near**-half + slope * (inverse - near), 0.0, 0.0, 0
    for i in range(len(cov)):
        for j in range(i + 1):
            own = slope * inverse * inverse * (cov[i, 0] * cov[j, 0] + cov[i, 1] * cov[j, 1])
            own *= 1.0 if i == j else 2.0
            gained += own * (total[at, 0] / power - prior[at])
            slopes[at] = own / power
            change += slopes[at] * (total[at, 0] - start[at])
            at += 1
    slopes[last] = -(1.0 - detected) * (seen - gained / detected - unseen)
    change += slopes[last] * (total[last, 0] - start[last])
    return detected * seen + (1.0 - detected) * unseen - change


@borrowing
def _best_by_tangent(
    table: Table, cells: Cells, prices: Floats, slopes: Floats, cell_slopes: Floats, num: int, best: Ints
) -> float:
    """Write the course of each sensor that is best by the tangent. Returns the sum of their changes less prices.

    num: numbers of an information matrix.
    """
    total, last = 0.0, slopes.shape[1] - 1
    for s in range(len(best)):
        most = -math.inf
        for course in range(table.first_courses[s], table.first_courses[s + 1]):
            gain = 0.0
            for entry in range(table.offsets[course], table.offsets[course + 1]):
                own, change = slopes[table.labels[entry]], table.changes[entry]
                gain += own[last] * change[last, 0]
                for k in range(num):
                    gain += own[k] * change[k, 0]
            gain = table.powers[s] * gain - prices[course]
            for entry in range(cells.offsets[course], cells.offsets[course + 1]):
                gain += cell_slopes[cells.cells[entry]] * cells.log_miss[entry]
            if gain > most:
                most, best[s] = gain, course - table.first_courses[s]
        total += most
    return total


@kernel
def relaxed_bound(table: Table, valuation: Valuation, cells: Cells, prices: Floats) -> float:
    """Return an upper bound on the expected loss, as a reward, of all joint actions, or inf if the arithmetic fails."""
    firsts, num_labels, dim, least = table.first_courses, len(table.start), valuation.covs.shape[1], math.inf
    at = Ascent(np.zeros(len(table.powers), np.int64), start_totals(table), np.zeros(len(cells.worth)))
    for s in range(len(at.chosen)):
        for course in range(firsts[s], firsts[s + 1]):
            add_scans(table, cells, s, course, 1.0 / (firsts[s + 1] - firsts[s]), at)
    unseen, slopes = values_without_scans(table.start, valuation), np.empty(table.start.shape)
    work = make_value_work(valuation, 1)
    for step in range(_NUM_TANGENTS):
        bound, share = 0.0, 2.0 / (step + 4.0)
        for label in range(num_labels):
            start, total = table.start[label], at.totals[label]
            bound += _tangent(valuation, label, unseen[label, 0], start, total, work, slopes[label])
            for k in range(len(start)):
                total[k, 0] += share * (start[k] - total[k, 0])
        cell_slopes = -cells.worth * np.exp(at.cell_totals)
        bound += np.sum(cells.worth + cell_slopes - cell_slopes * at.cell_totals)
        bound += _best_by_tangent(table, cells, prices, slopes, cell_slopes, dim * (dim + 1) // 2, at.chosen)
        least = min(least, bound)
        at.cell_totals[:] = (1.0 - share) * at.cell_totals
        for s in range(len(at.chosen)):
            add_scans(table, cells, s, firsts[s] + at.chosen[s], share, at)
    return least
