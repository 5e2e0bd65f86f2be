"""Coordinate ascent on rewards that are sums over labels. A line costs only what its sensor can reach."""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Bools, Floats, Ints
from vedette.kernels.planning.bernoulli_rows import Table
from vedette.kernels.planning.joint_values import add_course, start_totals, value_changed, value_rows
from vedette.kernels.planning.label_values import Valuation, ValueWork, make_value_work

# Of equal courses the present one is kept, so that rounding cannot make an ascent cycle.
_SAME = 1e-9


class Cells(NamedTuple):
    """The cells of undetected targets that each course sees, and the value of each cell."""

    offsets: Ints  # (num_courses + 1,) first entry of each course
    cells: Ints  # (num_entries,)
    log_miss: Floats  # (num_entries,) log of the mean of 1 - P_D over the course
    worth: Floats  # (num_cells,) expected number of targets times the value of one


class Allowed(NamedTuple):
    """The courses that may be taken."""

    single: Bools  # (num_courses,)
    together: Bools  # (num_courses, num_courses) compatible courses; (0, 0) if all are
    on: Bools  # (num_courses,) courses that count towards the limit `most`
    most: int  # maximum number of sensors on courses that count


class Ascent(NamedTuple):
    """The present state of an ascent, updated in place."""

    chosen: Ints  # (num_sensors,) index of the course of each sensor
    totals: Floats  # (num_labels, bernoulli_size, num_samples) joint rows
    cell_totals: Floats  # (num_cells,) sums of log_miss


class Known(NamedTuple):
    """Gains of labels on the courses of each sensor, which hold until another sensor's scans of the label change."""

    gains: Floats  # (num_entries,)
    changed: Ints  # (num_labels,) last line that changed the scans of each label
    lines: Ints  # (num_sensors,) last line of each sensor; -1 at the start


class Trace(NamedTuple):
    """The evaluations of an ascent."""

    evaluations: Ints  # (num_lines + 1,) joint actions evaluated by the end of each line; 1 at the start
    best: Floats  # (num_lines + 1,) the reward reached by then


@borrowing
def label_mean(values: Floats, coefficients: Floats) -> float:
    """Return the mean over samples of the weighted sum of values (num, num_samples)."""
    total = 0.0
    for sample in range(values.shape[1]):
        weighted = 0.0
        for e in range(values.shape[0]):
            weighted += coefficients[e] * values[e, sample]
        total += weighted
    return total / values.shape[1]


@inlined
def _found(cells: Cells, course: int, totals: Floats) -> float:
    """Return the value of the undetected targets that only this course finds."""
    total = 0.0
    for entry in range(cells.offsets[course], cells.offsets[course + 1]):
        cell = cells.cells[entry]
        total -= cells.worth[cell] * math.exp(totals[cell]) * math.expm1(cells.log_miss[entry])
    return total


@inlined
def _is_allowed(table: Table, allowed: Allowed, chosen: Ints, sensor: int, course: int) -> bool:
    if not allowed.single[course]:
        return False
    if allowed.together.shape[0] > 0:
        for s in range(chosen.shape[0]):
            if s != sensor and not allowed.together[course, table.first_courses[s] + chosen[s]]:
                return False
    if not allowed.on[course]:
        return True
    num = 1
    for s in range(chosen.shape[0]):
        if s != sensor and allowed.on[table.first_courses[s] + chosen[s]]:
            num += 1
    return num <= allowed.most


@borrowing
def _line(
    table: Table,
    valuation: Valuation,
    coefficients: Floats,
    cells: Cells,
    prices: Floats,
    sensor: int,
    at: Ascent,
    before: Floats,
    values: Floats,
    work: ValueWork,
    known: Known,
    gains: Floats,
) -> None:
    """Write the gain of each course of a sensor over not scanning, with the joint rows `at` of the others."""
    first, last, line = table.first_courses[sensor], table.first_courses[sensor + 1], known.lines[sensor]
    for entry in range(table.offsets[first], table.offsets[last]):
        before[table.labels[entry]] = math.inf
    for course in range(first, last):
        gain = _found(cells, course, at.cell_totals) - prices[course]
        for entry in range(table.offsets[course], table.offsets[course + 1]):
            label = table.labels[entry]
            if known.changed[label] > line:
                if before[label] == math.inf:
                    value_rows(valuation, label, at.totals[label], work, values)
                    before[label] = label_mean(values, coefficients)
                value_changed(table, valuation, sensor, entry, at.totals[label], work, values)
                known.gains[entry] = label_mean(values, coefficients) - before[label]
            gain += known.gains[entry]
        gains[course - first] = gain


@inlined
def add_scans(table: Table, cells: Cells, sensor: int, course: int, share: float, at: Ascent) -> None:
    """Add a share of the scans of a course of a sensor, or subtract them with share -1."""
    add_course(table, sensor, course, share, at.totals)
    for entry in range(cells.offsets[course], cells.offsets[course + 1]):
        at.cell_totals[cells.cells[entry]] += share * cells.log_miss[entry]


@borrowing
def _best(table: Table, allowed: Allowed, chosen: Ints, sensor: int, gains: Floats, reward: float) -> int:
    """Return the best allowed course of a line: the present one if no other is better, else the first of equal ones."""
    first, num = table.first_courses[sensor], table.first_courses[sensor + 1] - table.first_courses[sensor]
    best = -math.inf
    for a in range(num):
        if gains[a] > best and _is_allowed(table, allowed, chosen, sensor, first + a):
            best = gains[a]
    margin, present = _SAME * max(1.0, abs(reward)), chosen[sensor]
    if best == -math.inf or (
        gains[present] >= best - margin and _is_allowed(table, allowed, chosen, sensor, first + present)
    ):
        return present
    for a in range(num):
        if gains[a] >= best - margin and _is_allowed(table, allowed, chosen, sensor, first + a):
            return a
    return present


@kernel
def _start(
    table: Table, valuation: Valuation, coefficients: Floats, cells: Cells, prices: Floats, chosen: Ints
) -> tuple[Ascent, float]:
    """Return the start of the ascent, and its mean reward."""
    num_labels, num_samples = len(table.start), table.changes.shape[2]
    at, price = Ascent(chosen.copy(), start_totals(table), np.zeros(len(cells.worth))), 0.0
    for s in range(len(chosen)):
        add_scans(table, cells, s, table.first_courses[s] + chosen[s], 1.0, at)
        price += prices[table.first_courses[s] + chosen[s]]
    work, values = make_value_work(valuation, num_samples), np.empty((valuation.num, num_samples))
    reward = np.sum(cells.worth * -np.expm1(at.cell_totals)) - price
    for label in range(num_labels):
        value_rows(valuation, label, at.totals[label], work, values)
        reward += label_mean(values, coefficients)
    return at, reward


@kernel
def ascend(
    table: Table,
    valuation: Valuation,
    coefficients: Floats,
    cells: Cells,
    prices: Floats,
    allowed: Allowed,
    start: Ints,
    max_lines: int,
) -> tuple[Ints, float, Trace]:
    """Run one ascent from a joint action: one sensor after the other, until none alone can improve the reward.

    coefficients: (num,) of a label's numbers in the reward. prices: (num_courses,) of each course. max_lines: limit
    that no known ascent has reached. Returns the joint action, its mean reward, and the trace.
    """
    at, reward = _start(table, valuation, coefficients, cells, prices, start)
    num_samples = table.changes.shape[2]
    work, values = make_value_work(valuation, num_samples), np.empty((valuation.num, num_samples))
    before, gains = np.empty(len(table.start)), np.empty(np.max(np.diff(table.first_courses)))
    num_sensors, settled, sensor, line = len(start), 0, 0, 0
    known = Known(np.empty(len(table.labels)), np.zeros(len(table.start), np.int64), np.full(num_sensors, -1))
    evaluations, best = np.ones(max_lines + 1, np.int64), np.full(max_lines + 1, reward)
    while settled < num_sensors and line < max_lines:
        first, present = table.first_courses[sensor], at.chosen[sensor]
        add_scans(table, cells, sensor, first + present, -1.0, at)
        _line(table, valuation, coefficients, cells, prices, sensor, at, before, values, work, known, gains)
        chosen = _best(table, allowed, at.chosen, sensor, gains, reward)
        reward += gains[chosen] - gains[present]
        at.chosen[sensor] = chosen
        add_scans(table, cells, sensor, first + chosen, 1.0, at)
        line += 1
        known.lines[sensor], settled = line, settled + 1
        if chosen != present:
            settled = 1
            for course in (first + present, first + chosen):
                known.changed[table.labels[table.offsets[course] : table.offsets[course + 1]]] = line
        evaluations[line] = evaluations[line - 1] + table.first_courses[sensor + 1] - first - 1
        best[line] = reward
        sensor = (sensor + 1) % num_sensors
    return at.chosen, reward, Trace(evaluations[: line + 1], best[: line + 1])
