"""Rewards of joint actions as sums over labels: the changes of the chosen courses are added, label by label.

A label that no chosen course reaches keeps its value without scans, which is computed once.
"""

import math

import numpy as np

from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Bools, Floats, Ints
from vedette.kernels.gaussian.integrals import integrate_rows, make_integrals
from vedette.kernels.planning.bernoulli_rows import Table, normalise_powers
from vedette.kernels.planning.label_values import Valuation, ValueWork, make_value_work, value_label


@inlined
def add_rows(rows: Floats, power: float, changes: Floats, out: Floats) -> None:
    """Write out = rows + power * changes, each (bernoulli_size, num_samples). `out` may be `rows`."""
    if rows.shape[1] == 1:  # one sample, as for the expected loss: no inner loop
        for k in range(rows.shape[0]):
            out[k, 0] = rows[k, 0] + power * changes[k, 0]
        return
    for k in range(rows.shape[0]):
        given, added, entries = rows[k], changes[k], out[k]
        for sample in range(rows.shape[1]):
            entries[sample] = given[sample] + power * added[sample]


@inlined
def spread_row(row: Floats, out: Floats) -> None:
    """Write out (bernoulli_size, num_samples) = the same row (bernoulli_size,) for all samples."""
    for k in range(out.shape[0]):
        for sample in range(out.shape[1]):
            out[k, sample] = row[k]


@borrowing
def add_course(table: Table, sensor: int, course: int, share: float, totals: Floats) -> None:
    """Add a share of the changes of a course, or subtract them with share -1.

    totals: (num_labels, bernoulli_size, num_samples), changed in place.
    """
    power = share * table.powers[sensor]
    for entry in range(table.offsets[course], table.offsets[course + 1]):
        total = totals[table.labels[entry]]
        add_rows(total, power, table.changes[entry], total)


@borrowing
def value_rows(valuation: Valuation, label: int, rows: Floats, work: ValueWork, out: Floats) -> None:
    """Write values (num, num_samples) of a label's joint rows (bernoulli_size, num_samples)."""
    for k in range(rows.shape[0]):
        for sample in range(rows.shape[1]):
            work.total[k, sample] = rows[k, sample]
    value_label(valuation, label, work, out)


@kernel
def label_values(rows: Floats, valuation: Valuation) -> Floats:
    """Return values (num_labels, num, num_samples) of rows (num_labels, bernoulli_size, num_samples)."""
    num_labels, _, num_samples = rows.shape
    work, out = make_value_work(valuation, num_samples), np.empty((num_labels, valuation.num, num_samples))
    for label in range(num_labels):
        value_rows(valuation, label, rows[label], work, out[label])
    return out


@kernel
def values_without_scans(rows: Floats, valuation: Valuation) -> Floats:
    """Return values (num_labels, num) of rows (num_labels, bernoulli_size)."""
    return label_values(rows.reshape((rows.shape[0], rows.shape[1], 1)), valuation)[:, :, 0].copy()


@kernel
def existence_logits(rows: Floats, dim: int) -> Floats:
    """Return existence logits (num_labels, num_samples) of rows, or 0 if no sensor of positive power has the label."""
    num_labels, size, num_samples = rows.shape
    out, integrals = np.zeros((num_labels, num_samples)), make_integrals(num_samples)
    for label in range(num_labels):
        total = rows[label].copy()
        normalise_powers(total)
        integrate_rows(total, dim, integrals)
        for s in range(num_samples):
            if total[size - 3, s] > 0.0:
                out[label, s] = total[size - 2, s] + integrals.exponents[s] + math.log(integrals.factors[s])
    return out


@kernel
def start_totals(table: Table) -> Floats:
    """Return joint rows (num_labels, bernoulli_size, num_samples) without any scan."""
    num_labels, size = table.start.shape
    totals = np.empty((num_labels, size, table.changes.shape[2]))
    for label in range(num_labels):
        spread_row(table.start[label], totals[label])
    return totals


@inlined
def _start_again(table: Table, course: int, totals: Floats, stale: Bools) -> None:
    """Reset the rows of the labels in reach of a course, whose scans differ from the joint action before."""
    for entry in range(table.offsets[course], table.offsets[course + 1]):
        label = table.labels[entry]
        if not stale[label]:
            stale[label] = True
            spread_row(table.start[label], totals[label])


@borrowing
def _gather(table: Table, actions: Ints, stale: Bools, touched: Bools, totals: Floats) -> None:
    """Add the changes by a joint action (num_sensors,) to stale labels, and mark the labels that it reaches."""
    touched[:] = False
    for s in range(len(actions)):
        if actions[s] >= 0:
            course = table.first_courses[s] + actions[s]
            for entry in range(table.offsets[course], table.offsets[course + 1]):
                label = table.labels[entry]
                touched[label] = True
                if stale[label]:
                    add_rows(totals[label], table.powers[s], table.changes[entry], totals[label])


@kernel
def joint_values(table: Table, valuation: Valuation, actions: Ints, first: int, last: int, out: Floats) -> None:
    """Write sums over labels (num_joint, num, num_samples) of joint actions `first:last`.

    actions: (num_joint, num_sensors) index of the course of each sensor, or -1 for a sensor that does not scan. A label
    whose scans are those of the joint action before keeps its values, so joint actions that differ in one sensor cost
    only what that sensor can reach.
    """
    totals, unseen = start_totals(table), values_without_scans(table.start, valuation)
    num_labels, num_samples = totals.shape[0], totals.shape[2]
    values, work = np.empty((num_labels, valuation.num, num_samples)), make_value_work(valuation, num_samples)
    stale, touched = np.ones(num_labels, np.bool_), np.empty(num_labels, np.bool_)
    for joint in range(first, last):
        for s in range(actions.shape[1]):
            before = actions[joint - 1, s] if joint > first else -1
            if actions[joint, s] != before:
                if before >= 0:
                    _start_again(table, table.first_courses[s] + before, totals, stale)
                if actions[joint, s] >= 0:
                    _start_again(table, table.first_courses[s] + actions[joint, s], totals, stale)
        _gather(table, actions[joint], stale, touched, totals)
        out[joint] = 0.0
        for label in range(num_labels):
            if stale[label]:
                stale[label] = False
                if touched[label]:
                    value_rows(valuation, label, totals[label], work, values[label])
                else:
                    values[label] = unseen[label].reshape(-1, 1)
            out[joint] += values[label]


@inlined
def value_changed(
    table: Table, valuation: Valuation, sensor: int, entry: int, rows: Floats, work: ValueWork, out: Floats
) -> None:
    """Write values (num, num_samples) of an entry's label, with its change added to the others' joint rows."""
    add_rows(rows, table.powers[sensor], table.changes[entry], work.total)
    value_label(valuation, table.labels[entry], work, out)


@kernel
def line_values(table: Table, valuation: Valuation, chosen: Ints, first: int, last: int, out: Floats) -> None:
    """Write sums over labels (num_courses, num, num_samples) of each course of sensors `first:last`, others as chosen.

    chosen: (num_sensors,) as a row of `joint_values`. For a sensor's own courses its entry is not read. out: for the
    courses of all sensors.
    """
    totals, num_labels = start_totals(table), len(table.start)
    num_samples, num = totals.shape[2], valuation.num
    for s in range(len(chosen)):
        if chosen[s] >= 0:
            add_course(table, s, table.first_courses[s] + chosen[s], 1.0, totals)
    # Restored by copying after each sensor: subtracting and adding again is not exact to the last bit.
    full = totals.copy()
    work, values = make_value_work(valuation, num_samples), np.empty((num_labels, num, num_samples))
    whole, rest, before = np.zeros((num, num_samples)), np.empty((num, num_samples)), np.empty_like(values)
    changed, seen = np.empty((num, num_samples)), np.zeros(num_labels, np.int64)
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
    """Write sums over labels (num_courses, num, num_samples) of each course of sensors `first:last` alone.

    bases: (num_bases, num_labels, bernoulli_size) rows of sensors' own beliefs without scans. which: (num_sensors,)
    index of each sensor's base. out: for the courses of all sensors.
    """
    num_samples, work = table.changes.shape[2], make_value_work(valuation, table.changes.shape[2])
    values, unseen, taken = np.empty((valuation.num, num_samples)), np.empty((bases.shape[1], valuation.num)), -1
    for s in range(first, last):
        base = bases[which[s]]
        if which[s] != taken:
            unseen, taken = values_without_scans(base, valuation), which[s]
        for course in range(table.first_courses[s], table.first_courses[s + 1]):
            for e in range(valuation.num):
                out[course, e] = np.sum(unseen[:, e])
            for entry in range(table.offsets[course], table.offsets[course + 1]):
                label = table.labels[entry]
                spread_row(base[label], work.total)
                add_rows(work.total, 1.0, table.changes[entry], work.total)
                value_label(valuation, label, work, values)
                for e in range(valuation.num):
                    for sample in range(num_samples):
                        out[course, e, sample] += values[e, sample] - unseen[label, e]
