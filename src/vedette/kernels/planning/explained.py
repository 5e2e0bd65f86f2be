"""What each label and each sensor has to do with the reward of one joint action: labels with some of its scans alone.

A label is valued with the scans of the first sensors, of the last ones, of all sensors but one; and with the existence
that all scans give it and the density that it has without them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.gaussian.information import log_integral_of_any
from vedette.kernels.planning.bernoulli_rows import Table, unscale
from vedette.kernels.planning.joint_values import values_without_scans
from vedette.kernels.planning.label_values import Valuation, ValueWork, make_value_work, value_label


class Reached(NamedTuple):
    """Of every label the chosen courses in whose reach it is, in the order of the sensors."""

    offsets: Ints  # (num_labels + 1,)
    sensors: Ints  # (num_reached,)
    entries: Ints  # (num_reached,) of the table


class ValueParts(NamedTuple):
    """The values of a joint action, and what the sensors add to them."""

    unseen: Floats  # (num_labels, num) without any scan
    labels: Floats  # (num_labels, num_samples, num) with all scans
    existence: Floats  # (num_labels, num_samples, num) with the existence after all scans, the density before them
    ahead: Floats  # (num_sensors, num_samples, num) what each adds to those before it
    behind: Floats  # (num_sensors, num_samples, num) what each adds to those after it
    last: Floats  # (num_sensors, num_samples, num) what each adds to all others


class _Sums(NamedTuple):
    ahead: Floats  # (most_reached + 1, bernoulli_size) rows with the scans of the first ones, from none to all
    behind: Floats  # (most_reached + 1, bernoulli_size) sums of the changes of the last ones, from all to none
    values: Floats  # (3, num)
    work: ValueWork


def no_value_parts(num_labels: int, num_sensors: int, num_samples: int, num: int) -> ValueParts:
    """Of a joint action that adds nothing, to be filled in."""
    of_labels = np.zeros((2, num_labels, num_samples, num))
    of_sensors = np.zeros((3, num_sensors, num_samples, num))
    return ValueParts(np.zeros((num_labels, num)), *of_labels, *of_sensors)


@kernel
def _make_sums(reached: Reached, valuation: Valuation) -> _Sums:
    most = 0
    for label in range(len(reached.offsets) - 1):
        most = max(most, reached.offsets[label + 1] - reached.offsets[label])
    size = valuation.prior.shape[1]
    rows = np.empty((2, most + 1, size))
    return _Sums(rows[0], rows[1], np.empty((3, valuation.num)), make_value_work(valuation))


@borrowing
def _value(valuation: Valuation, label: int, row: Floats, more: Floats, work: ValueWork, out: Floats) -> None:
    for k in range(row.shape[0]):
        work.total[k] = row[k] + more[k]
    value_label(valuation, label, work, out)


@inlined
def _add_up(table: Table, reached: Reached, label: int, sample: int, sums: _Sums) -> None:
    """Fill the rows of `sums`; nothing is taken away again, so that nothing is left over from rounding."""
    first, size = reached.offsets[label], table.start.shape[1]
    num = reached.offsets[label + 1] - first
    for k in range(size):
        sums.ahead[0, k] = table.start[label, k]
        sums.behind[num, k] = 0.0
    for i in range(num):
        entry, power = reached.entries[first + i], table.powers[reached.sensors[first + i]]
        for k in range(size):
            sums.ahead[i + 1, k] = sums.ahead[i, k] + power * table.changes[entry, sample, k]
    for i in range(num - 1, -1, -1):
        entry, power = reached.entries[first + i], table.powers[reached.sensors[first + i]]
        for k in range(size):
            sums.behind[i, k] = sums.behind[i + 1, k] + power * table.changes[entry, sample, k]


@inlined
def _logit(row: Floats, dim: int, work: ValueWork) -> float:
    """Of the existence that a row stands for; 0 where nobody who counts knows the label."""
    size = row.shape[0]
    if not row[size - 3] > 0.0:
        return 0.0
    for k in range(size):
        work.total[k] = row[k]
    unscale(work.total)
    for k in range(size - 2):
        work.joint[k] = work.total[k]
    return float(row[size - 2] + log_integral_of_any(work.joint, dim))


@borrowing
def _value_existence(
    valuation: Valuation, label: int, start: Floats, total: Floats, work: ValueWork, out: Floats
) -> None:
    """Value with the existence of the row `total` and the density of the row `start`."""
    dim = valuation.references.shape[1]
    change = _logit(total, dim, work) - _logit(start, dim, work)
    for k in range(start.shape[0]):
        work.total[k] = start[k]
    work.total[start.shape[0] - 2] += change
    value_label(valuation, label, work, out)


@kernel
def fill_value_parts(
    table: Table, valuation: Valuation, reached: Reached, first: int, last: int, out: ValueParts
) -> None:
    """Fill the samples `first:last` of `out`, which `no_value_parts` made. reached: by the joint action's courses."""
    sums, unseen = _make_sums(reached, valuation), values_without_scans(table.start, valuation)
    if first == 0:
        out.unseen[:] = unseen
    before, now, work = sums.values[0], sums.values[1], sums.work
    for label in range(len(table.start)):
        begin = reached.offsets[label]
        num = reached.offsets[label + 1] - begin
        for sample in range(first, last):
            if num == 0:
                out.labels[label, sample] = unseen[label]
                out.existence[label, sample] = unseen[label]
                continue
            _add_up(table, reached, label, sample, sums)
            before[:] = unseen[label]
            for i in range(num):
                _value(valuation, label, sums.ahead[i + 1], sums.behind[num], work, now)
                out.ahead[reached.sensors[begin + i], sample] += now - before
                before[:] = now
            out.labels[label, sample] = now
            before[:] = unseen[label]
            for i in range(num - 1, -1, -1):
                _value(valuation, label, sums.ahead[0], sums.behind[i], work, now)
                out.behind[reached.sensors[begin + i], sample] += now - before
                before[:] = now
            for i in range(num):
                _value(valuation, label, sums.ahead[i], sums.behind[i + 1], work, now)
                out.last[reached.sensors[begin + i], sample] += out.labels[label, sample] - now
            _value_existence(valuation, label, sums.ahead[0], sums.ahead[num], work, out.existence[label, sample])
