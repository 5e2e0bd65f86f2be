"""What each label and each sensor has to do with the reward of one joint action: labels with some of its scans alone.

A label is valued with the scans of the first sensors, of the last ones, of all sensors but one; and with the existence
that all scans give it and the density that it has without them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.base.compile import borrowing, kernel
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.gaussian.integrals import integrate_rows
from vedette.kernels.planning.bernoulli_rows import Table, unscale
from vedette.kernels.planning.joint_values import add_rows, spread_row, values_without_scans
from vedette.kernels.planning.label_values import Valuation, ValueWork, make_value_work, value_label


class Reached(NamedTuple):
    """Of every label the chosen courses in whose reach it is, in the order of the sensors."""

    offsets: Ints  # (num_labels + 1,)
    sensors: Ints  # (num_reached,)
    entries: Ints  # (num_reached,) of the table


class ValueParts(NamedTuple):
    """The values of a joint action, and what the sensors add to them."""

    unseen: Floats  # (num_labels, num) without any scan
    labels: Floats  # (num_labels, num, num_samples) with all scans
    existence: Floats  # (num_labels, num, num_samples) with the existence after all scans, the density before them
    ahead: Floats  # (num_sensors, num, num_samples) what each adds to those before it
    behind: Floats  # (num_sensors, num, num_samples) what each adds to those after it
    last: Floats  # (num_sensors, num, num_samples) what each adds to all others


class _Sums(NamedTuple):
    """Of one label and some samples, which are side by side."""

    ahead: Floats  # (most_reached + 1, bernoulli_size, num) rows with the scans of the first ones, from none to all
    behind: Floats  # (most_reached + 1, bernoulli_size, num) sums of the changes of the last ones, from all to none
    values: Floats  # (2, num of the valuation, num)
    logits: Floats  # (2, num)
    work: ValueWork


def no_value_parts(num_labels: int, num_sensors: int, num_samples: int, num: int) -> ValueParts:
    """Of a joint action that adds nothing, to be filled in."""
    of_labels = np.zeros((2, num_labels, num, num_samples))
    of_sensors = np.zeros((3, num_sensors, num, num_samples))
    return ValueParts(np.zeros((num_labels, num)), *of_labels, *of_sensors)


@kernel
def _make_sums(reached: Reached, valuation: Valuation, num: int) -> _Sums:
    most = 0
    for label in range(len(reached.offsets) - 1):
        most = max(most, reached.offsets[label + 1] - reached.offsets[label])
    rows = np.empty((2, most + 1, valuation.prior.shape[1], num))
    values, logits = np.empty((2, valuation.num, num)), np.empty((2, num))
    return _Sums(rows[0], rows[1], values, logits, make_value_work(valuation, num))


@borrowing
def _value(valuation: Valuation, label: int, rows: Floats, more: Floats, work: ValueWork, out: Floats) -> None:
    add_rows(rows, 1.0, more, work.total)
    value_label(valuation, label, work, out)


@borrowing
def _add_entry(table: Table, reached: Reached, place: int, first: int, rows: Floats, out: Floats) -> None:
    """out = rows and the changes of a reached course, of the samples from `first` on."""
    changes, power = table.changes[reached.entries[place]], table.powers[reached.sensors[place]]
    for k in range(rows.shape[0]):
        for s in range(rows.shape[1]):
            out[k, s] = rows[k, s] + power * changes[k, first + s]


@borrowing
def _add_up(table: Table, reached: Reached, label: int, first: int, sums: _Sums) -> None:
    """Fill the rows of `sums`; nothing is taken away again, so that nothing is left over from rounding."""
    begin = reached.offsets[label]
    num = reached.offsets[label + 1] - begin
    spread_row(table.start[label], sums.ahead[0])
    for k in range(sums.behind.shape[1]):
        for s in range(sums.behind.shape[2]):
            sums.behind[num, k, s] = 0.0
    for i in range(num):
        _add_entry(table, reached, begin + i, first, sums.ahead[i], sums.ahead[i + 1])
    for i in range(num - 1, -1, -1):
        _add_entry(table, reached, begin + i, first, sums.behind[i + 1], sums.behind[i])


@borrowing
def _write_logits(rows: Floats, dim: int, work: ValueWork, out: Floats) -> None:
    """Of the existence that rows stand for; 0 where nobody who counts knows the label."""
    total, size = work.total, rows.shape[0]
    for k in range(size):
        for s in range(rows.shape[1]):
            total[k, s] = rows[k, s]
    unscale(total)
    integrate_rows(total, dim, work.integrals)
    for s in range(rows.shape[1]):
        log = work.integrals.exponents[s] + math.log(work.integrals.factors[s])
        out[s] = rows[size - 2, s] + log if rows[size - 3, s] > 0.0 else 0.0


@borrowing
def _value_existence(valuation: Valuation, label: int, start: Floats, total: Floats, sums: _Sums, out: Floats) -> None:
    """Values with the existence of the rows `total` and the density of the rows `start`."""
    dim, size, work = valuation.references.shape[1], start.shape[0], sums.work
    _write_logits(total, dim, work, sums.logits[0])
    _write_logits(start, dim, work, sums.logits[1])
    for k in range(size):
        for s in range(start.shape[1]):
            work.total[k, s] = start[k, s]
    for s in range(start.shape[1]):
        work.total[size - 2, s] += sums.logits[0, s] - sums.logits[1, s]
    value_label(valuation, label, work, out)


@kernel
def fill_value_parts(
    table: Table, valuation: Valuation, reached: Reached, first: int, last: int, out: ValueParts
) -> None:
    """Fill the samples `first:last` of `out`, which `no_value_parts` made. reached: by the joint action's courses."""
    sums, unseen = _make_sums(reached, valuation, last - first), values_without_scans(table.start, valuation)
    if first == 0:
        out.unseen[:] = unseen
    before, now, work = sums.values[0], sums.values[1], sums.work
    for label in range(len(table.start)):
        begin = reached.offsets[label]
        num = reached.offsets[label + 1] - begin
        out.labels[label, :, first:last] = unseen[label].reshape(-1, 1)
        out.existence[label, :, first:last] = unseen[label].reshape(-1, 1)
        if num == 0:
            continue
        _add_up(table, reached, label, first, sums)
        before[:] = unseen[label].reshape(-1, 1)
        for i in range(num):
            _value(valuation, label, sums.ahead[i + 1], sums.behind[num], work, now)
            out.ahead[reached.sensors[begin + i], :, first:last] += now - before
            before[:] = now
        out.labels[label, :, first:last] = now
        before[:] = unseen[label].reshape(-1, 1)
        for i in range(num - 1, -1, -1):
            _value(valuation, label, sums.ahead[0], sums.behind[i], work, now)
            out.behind[reached.sensors[begin + i], :, first:last] += now - before
            before[:] = now
        for i in range(num):
            _value(valuation, label, sums.ahead[i], sums.behind[i + 1], work, now)
            out.last[reached.sensors[begin + i], :, first:last] += out.labels[label, :, first:last] - now
        _value_existence(valuation, label, sums.ahead[0], sums.ahead[num], sums, now)
        out.existence[label, :, first:last] = now
