"""Rewards of joint actions as sums over labels: the changes of the chosen courses are added, label by label.

A label that no chosen course reaches keeps its value without scans, which is taken once.
"""

from __future__ import annotations

import numpy as np

from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.planning.bernoulli_rows import Table
from vedette.kernels.planning.label_values import Valuation, ValueWork, make_value_work, value_label


@inlined
def add_course(table: Table, sensor: int, course: int, sign: float, totals: Floats) -> None:
    """Add, or with sign -1 take away, the changes of a course in totals (num_labels, num_samples, bernoulli_size)."""
    power = sign * table.powers[sensor]
    for entry in range(table.offsets[course], table.offsets[course + 1]):
        label = table.labels[entry]
        for sample in range(totals.shape[1]):
            for k in range(totals.shape[2]):
                totals[label, sample, k] += power * table.changes[entry, sample, k]


@borrowing
def value_rows(valuation: Valuation, label: int, rows: Floats, work: ValueWork, out: Floats) -> None:
    """Values (num_samples, num) of a label's joint rows (num_samples, bernoulli_size)."""
    for sample in range(rows.shape[0]):
        for k in range(rows.shape[1]):
            work.total[k] = rows[sample, k]
        value_label(valuation, label, work, out[sample])


@kernel
def values_without_scans(rows: Floats, valuation: Valuation) -> Floats:
    """(num_labels, num) values of rows (num_labels, bernoulli_size)."""
    work, out = make_value_work(valuation), np.empty((len(rows), valuation.num))
    for label in range(len(rows)):
        value_rows(valuation, label, rows[label : label + 1], work, out[label : label + 1])
    return out


@kernel
def start_totals(table: Table) -> Floats:
    """(num_labels, num_samples, bernoulli_size) joint rows without any scan."""
    num_labels, size = table.start.shape
    totals = np.empty((num_labels, table.changes.shape[1], size))
    for label in range(num_labels):
        for sample in range(totals.shape[1]):
            for k in range(size):
                totals[label, sample, k] = table.start[label, k]
    return totals


@kernel
def joint_values(table: Table, valuation: Valuation, actions: Ints, first: int, last: int, out: Floats) -> None:
    """Sums over labels (num_joint, num_samples, num), of joint actions `first:last`.

    actions: (num_joint, num_sensors) number of the course of each sensor; -1 for a sensor that does not scan.
    """
    totals, unseen = start_totals(table), values_without_scans(table.start, valuation)
    num_labels, num_samples = totals.shape[0], totals.shape[1]
    values, work = np.empty((num_samples, valuation.num)), make_value_work(valuation)
    touched = np.empty(num_labels, np.int64)
    for joint in range(first, last):
        touched[:] = 0
        for s in range(actions.shape[1]):
            if actions[joint, s] >= 0:
                course = table.first_courses[s] + actions[joint, s]
                for entry in range(table.offsets[course], table.offsets[course + 1]):
                    touched[table.labels[entry]] = 1
                add_course(table, s, course, 1.0, totals)
        out[joint] = 0.0
        for label in range(num_labels):
            if touched[label] == 1:
                value_rows(valuation, label, totals[label], work, values)
                totals[label] = table.start[label]
            for sample in range(num_samples):
                for e in range(valuation.num):
                    out[joint, sample, e] += values[sample, e] if touched[label] == 1 else unseen[label, e]


@borrowing
def value_changed(
    table: Table, valuation: Valuation, sensor: int, entry: int, rows: Floats, work: ValueWork, out: Floats
) -> None:
    """Values (num_samples, num) of the label of an entry, with its change added to the joint rows of the others."""
    power = table.powers[sensor]
    for sample in range(rows.shape[0]):
        for k in range(rows.shape[1]):
            work.total[k] = rows[sample, k] + power * table.changes[entry, sample, k]
        value_label(valuation, table.labels[entry], work, out[sample])


@kernel
def line_values(table: Table, valuation: Valuation, chosen: Ints, first: int, last: int, out: Floats) -> None:
    """Sums over labels (num_courses, num_samples, num) of each course of sensors `first:last`, the others as chosen.

    chosen: (num_sensors,) as a row of `joint_values`; of a sensor's own courses its entry is not read. out: of the
    courses of all sensors.
    """
    totals, num_labels = start_totals(table), len(table.start)
    num_samples, num = totals.shape[1], valuation.num
    for s in range(len(chosen)):
        if chosen[s] >= 0:
            add_course(table, s, table.first_courses[s] + chosen[s], 1.0, totals)
    # Put back as they were after each sensor: what is subtracted and added again is not the same to the last bit.
    full = totals.copy()
    work, values = make_value_work(valuation), np.empty((num_labels, num_samples, num))
    whole, rest, before = np.zeros((num_samples, num)), np.empty((num_samples, num)), np.empty_like(values)
    changed, seen = np.empty((num_samples, num)), np.zeros(num_labels, np.int64)
    for label in range(num_labels):
        value_rows(valuation, label, totals[label], work, values[label])
        whole += values[label]
    for s in range(first, last):
        begin, end = table.first_courses[s], table.first_courses[s + 1]
        if chosen[s] >= 0:
            add_course(table, s, begin + chosen[s], -1.0, totals)
        rest[:] = whole
        for entry in range(table.offsets[begin], table.offsets[end]):
            label = table.labels[entry]
            if seen[label] != s + 1:
                seen[label] = s + 1
                value_rows(valuation, label, totals[label], work, before[label])
                rest += before[label] - values[label]
        for course in range(begin, end):
            out[course] = rest
            for entry in range(table.offsets[course], table.offsets[course + 1]):
                label = table.labels[entry]
                value_changed(table, valuation, s, entry, totals[label], work, changed)
                out[course] += changed - before[label]
        for entry in range(table.offsets[begin], table.offsets[end]):
            totals[table.labels[entry]] = full[table.labels[entry]]


@kernel
def alone_values(
    table: Table, valuation: Valuation, bases: Floats, which: Ints, first: int, last: int, out: Floats
) -> None:
    """Sums over labels (num_courses, num_samples, num) of each course of sensors `first:last` by themselves.

    bases: (num_bases, num_labels, bernoulli_size) rows of sensors' own beliefs without scans. which: (num_sensors,)
    those of each sensor. out: of the courses of all sensors.
    """
    num_samples, size, work = table.changes.shape[1], bases.shape[2], make_value_work(valuation)
    value, unseen, taken = np.empty(valuation.num), np.empty((bases.shape[1], valuation.num)), -1
    for s in range(first, last):
        base = bases[which[s]]
        if which[s] != taken:
            unseen, taken = values_without_scans(base, valuation), which[s]
        for course in range(table.first_courses[s], table.first_courses[s + 1]):
            for sample in range(num_samples):
                out[course, sample] = 0.0
                for label in range(len(unseen)):
                    out[course, sample] += unseen[label]
                for entry in range(table.offsets[course], table.offsets[course + 1]):
                    label = table.labels[entry]
                    for k in range(size):
                        work.total[k] = base[label, k] + table.changes[entry, sample, k]
                    value_label(valuation, label, work, value)
                    out[course, sample] += value - unseen[label]
