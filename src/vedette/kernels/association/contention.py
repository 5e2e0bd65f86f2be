"""Measurements that several groups of factors may take: the share of each that other groups leave to a group.

For a group, the others are one more source of measurements, next to clutter: if group g takes measurement j with odds
o_g(j), the weight of a row of group h that takes j is multiplied by

    mu_h(j) = 1 / (1 + sum over g != h of o_g(j)).

The odds depend on the shares of the other measurements of a group, so both are iterated: belief propagation over groups
and measurements (Williams and Lau 2014). If groups and measurements form no cycle, each group then has its exact
marginals. Only the mutual exclusion of groups is lost. With marginals a_g(j), two groups that meet at one measurement
then have an L1 error of 4 a_1(j) a_2(j), and more groups at most this summed over pairs.
"""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.association.alternatives import LEAST_MISSED, Alternatives
from vedette.kernels.association.assignment import Options
from vedette.kernels.association.options import sort_row
from vedette.kernels.base.arrays import filled_ints, group_members
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Ints

_MOST_ROUNDS = 50
_SETTLED = 1e-6  # change of a message below which the iteration has converged


class Meetings(NamedTuple):
    """Pairs of a group and a measurement that another group may also take."""

    of_option: Ints  # (num_options,) the meeting of an option, -1 if no other group may take its measurement
    measurements: Ints  # (num_meetings,)
    messages: Floats  # (num_meetings,) mu


@kernel
def _meetings(options: Options, group_of: Ints) -> Meetings:
    """Find the measurements that several groups may take. group_of: (num_rows,)."""
    num, num_options = options.num_measurements, options.offsets[-1]
    owner, is_contested = filled_ints(num, -1), filled_ints(num, 0)
    for row in range(len(group_of)):
        for option in range(options.offsets[row], options.offsets[row + 1]):
            j = options.columns[option]
            if j >= 0:
                if owner[j] >= 0 and owner[j] != group_of[row]:
                    is_contested[j] = 1
                owner[j] = group_of[row]
    of_option, measurements, filled = filled_ints(num_options, -1), np.empty(num_options, np.int64), 0
    place, group_at = filled_ints(num, -1), filled_ints(num, -1)
    offsets, rows = group_members(group_of, len(group_of))
    for group in range(len(group_of)):
        for i in range(offsets[group], offsets[group + 1]):
            for option in range(options.offsets[rows[i]], options.offsets[rows[i] + 1]):
                j = options.columns[option]
                if j < 0 or is_contested[j] == 0:
                    continue
                if group_at[j] != group:
                    group_at[j], place[j], measurements[filled] = group, filled, j
                    filled += 1
                of_option[option] = place[j]
    return Meetings(of_option, measurements[:filled].copy(), np.ones(filled))


@borrowing
def _write_odds(alone: Alternatives, meetings: Meetings, odds: Floats) -> None:
    """Write the odds that each group takes each measurement without competition, shape (num_meetings,)."""
    for meeting in range(len(odds)):
        odds[meeting] = 1.0
    for label in range(len(alone.undetected)):
        first, last, total = alone.offsets[label], alone.offsets[label + 1], alone.undetected[label]
        for i in range(first, last):
            meeting = meetings.of_option[alone.options[i]]
            total += alone.weights[i] * (meetings.messages[meeting] if meeting >= 0 else 1.0)
        for i in range(first, last):
            meeting, weight = meetings.of_option[alone.options[i]], alone.weights[i]
            if meeting >= 0:
                others = max(0.0, total - meetings.messages[meeting] * weight)
                odds[meeting] *= 1.0 - weight / (others + weight)
    for meeting in range(len(odds)):
        missed = max(LEAST_MISSED, odds[meeting])
        odds[meeting] = (1.0 - missed) / missed


@borrowing
def _renew(meetings: Meetings, odds: Floats, totals: Floats) -> float:
    """Write the messages for the odds, and return the largest change. totals: (num_measurements,) summed odds."""
    change = 0.0
    for j in range(len(totals)):
        totals[j] = 0.0
    for meeting in range(len(odds)):
        totals[meetings.measurements[meeting]] += odds[meeting]
    for meeting in range(len(odds)):
        others = max(0.0, totals[meetings.measurements[meeting]] - odds[meeting])
        message = 1.0 / (1.0 + others)
        change = max(change, abs(message - meetings.messages[meeting]))
        meetings.messages[meeting] = message
    return change


@inlined
def _log_counted_twice(meetings: Meetings, totals: Floats) -> float:
    """Log of the factor missing in the product of the groups' total weights (Bethe's approximation, exact on trees).

    For a measurement with n groups it is product of 1 / mu_g over (1 + sum of odds)^(n - 1).
    """
    log_weight = 0.0
    for meeting in range(len(meetings.messages)):
        total = totals[meetings.measurements[meeting]]
        log_weight -= math.log(meetings.messages[meeting]) + math.log1p(total)
    for j in range(len(totals)):
        log_weight += math.log1p(totals[j]) if totals[j] > 0.0 else 0.0
    return log_weight


@borrowing
def _weigh(options: Options, components: Ints, meetings: Meetings) -> None:
    """Multiply the weights of options by the messages, and sort rows again, heaviest first."""
    columns, log_weights, entries = options.columns, options.log_weights, options.entries
    for row in range(len(components) - 1):
        start, stop = options.offsets[row], options.offsets[row + 1]
        for option in range(start, stop):
            meeting = meetings.of_option[option]
            if meeting < 0:
                continue
            shift = math.log(meetings.messages[meeting])
            log_weights[option] += shift
            for entry in range(entries[option], entries[option] + components[row + 1] - components[row]):
                options.component_log_weights[entry] += shift
        sort_row(start, stop, columns, log_weights, entries)


@kernel
def apply_contention(options: Options, group_of: Ints, alone: Alternatives, components: Ints) -> float:
    """Multiply the options of rows by the shares of their measurements that other groups leave.

    Args:
        options: written. Rows stay in order, heaviest option first.
        group_of: (num_rows,) group of each row.
        alone: of the same options.
        components: (num_rows + 1,) offsets of the components of each row.

    Returns:
        The log of the factor by which the product of the groups' total weights is then too small.
    """
    meetings = _meetings(options, group_of)
    num = len(meetings.messages)
    if num == 0:
        return 0.0
    odds, totals = np.empty(num), np.empty(options.num_measurements)
    for _ in range(_MOST_ROUNDS):
        _write_odds(alone, meetings, odds)
        if _renew(meetings, odds, totals) < _SETTLED:
            break
    _weigh(options, components, meetings)
    return _log_counted_twice(meetings, totals)
