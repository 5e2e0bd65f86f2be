"""How much all joint choices of a scan weigh, those that were not found included."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.association.assignment import Options
from vedette.kernels.association.children import Children, Parents
from vedette.kernels.association.clusters import root_of
from vedette.kernels.association.search import SearchCaps
from vedette.kernels.base.arrays import filled_ints
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.gaussian.linalg import log_sum

# A cluster with more contested measurements is bounded: its exact sum takes 2^measurements numbers a row.
MAX_CONTESTED = 6
# Logs of weights that a double holds beside others.
_MOST_LOG = 600.0
# Relative weight that rounding leaves of nothing, and between the logs of equal weights.
ROUNDING = 1e-12
# Relative weights below this may have underflowed.
_LEAST = 1e-250


class TotalWork(NamedTuple):
    """Arrays in which the weight of one parent's joint choices is summed."""

    owners: Ints  # (num_measurements,) the first place that gates each, -1: none
    shared: Ints  # (num_measurements,) 1 where two places gate it
    bits: Ints  # (num_measurements,) number among the contested ones of a cluster, -1: none
    leaders: Ints  # (widest,) union-find over the places of a parent's rows
    relative: Floats  # (num_options,) weight relative to the heaviest of its row
    table: Floats  # (2^MAX_CONTESTED,) weight of each set of taken measurements


@kernel
def log_row_totals(options: Options) -> Floats:
    """(num_rows,) log total weight of each row's options."""
    totals = np.empty(len(options.offsets) - 1)
    for row in range(len(totals)):
        totals[row] = log_sum(options.log_weights[options.offsets[row] : options.offsets[row + 1]])
    return totals


@kernel
def log_total_bound(log_totals: Floats, parents: Parents) -> float:
    """Log total weight of all joint choices if rows could share measurements: an upper bound on the true total.

    log_totals: of the rows, as of `log_row_totals`.
    """
    bounds = np.empty(len(parents.log_weights))
    for parent in range(len(bounds)):
        bounds[parent] = parents.log_weights[parent]
        for i in range(parents.offsets[parent], parents.offsets[parent + 1]):
            bounds[parent] += log_totals[parents.rows[i]]
    return log_sum(bounds)


@kernel
def _make_total_work(options: Options, num_rows: int) -> TotalWork:
    """num_rows: of the widest parent."""
    relative, num = np.empty(options.offsets[-1]), options.num_measurements
    for row in range(len(options.offsets) - 1):
        for option in range(options.offsets[row], options.offsets[row + 1]):
            relative[option] = math.exp(options.log_weights[option] - options.log_weights[options.offsets[row]])
    return TotalWork(
        filled_ints(num, -1),
        filled_ints(num, 0),
        filled_ints(num, -1),
        np.empty(num_rows, np.int64),
        relative,
        np.empty(1 << MAX_CONTESTED),
    )


@borrowing
def _link(options: Options, rows: Ints, work: TotalWork) -> bool:
    """Lead the places that share a measurement, directly or not, to the first of them; false where none does."""
    found = False
    for i in range(len(rows)):
        work.leaders[i] = i
        for option in range(options.offsets[rows[i]], options.offsets[rows[i] + 1]):
            column = options.columns[option]
            if column < 0:
                continue
            if work.owners[column] < 0:
                work.owners[column] = i
            else:
                work.shared[column], found = 1, True
                a, b = root_of(work.leaders, work.owners[column]), root_of(work.leaders, i)
                work.leaders[max(a, b)] = min(a, b)
    return found


@borrowing
def _unlink(options: Options, rows: Ints, work: TotalWork) -> None:
    """Forget the measurements of a parent's rows."""
    for row in rows:
        for option in range(options.offsets[row], options.offsets[row + 1]):
            column = options.columns[option]
            if column >= 0:
                work.owners[column], work.shared[column], work.bits[column] = -1, 0, -1


@inlined
def _number_contested(options: Options, rows: Ints, leader: int, work: TotalWork) -> int:
    """Number the contested measurements of a cluster; how many there are."""
    num = 0
    for i in range(leader, len(rows)):
        if root_of(work.leaders, i) != leader:
            continue
        for option in range(options.offsets[rows[i]], options.offsets[rows[i] + 1]):
            column = options.columns[option]
            if column >= 0 and work.shared[column] == 1 and work.bits[column] < 0:
                work.bits[column] = num
                num += 1
    return num


@borrowing
def _take_row(options: Options, row: int, work: TotalWork, size: int) -> None:
    """One row's step of the sum over sets of taken measurements; weights relative to the row's heaviest option."""
    start, stop, table, free = options.offsets[row], options.offsets[row + 1], work.table, 0.0
    for option in range(start, stop):
        column = options.columns[option]
        if column < 0 or work.bits[column] < 0:
            free += work.relative[option]
    # From the largest set on: what is read has not been overwritten.
    for mask in range(size - 1, -1, -1):
        weight = free * table[mask]
        for option in range(start, stop):
            column = options.columns[option]
            bit = work.bits[column] if column >= 0 else -1
            if bit >= 0 and (mask >> bit) & 1 == 1:
                weight += work.relative[option] * table[mask ^ (1 << bit)]
        table[mask] = weight


@borrowing
def _log_cluster_total(options: Options, rows: Ints, leader: int, log_totals: Floats, work: TotalWork) -> float:
    """Log total weight of the joint choices of the rows led by `leader`; bounded where too much is contested."""
    size = 1 << min(_number_contested(options, rows, leader, work), MAX_CONTESTED + 1)
    log_bound, scale, is_exact = 0.0, 0.0, size <= len(work.table)
    if is_exact:
        work.table[:size] = 0.0
        work.table[0] = 1.0
    for i in range(leader, len(rows)):
        if root_of(work.leaders, i) != leader:
            continue
        log_bound += log_totals[rows[i]]
        if is_exact and log_bound > -math.inf:
            scale += options.log_weights[options.offsets[rows[i]]]
            _take_row(options, rows[i], work, size)
    total = 0.0
    if is_exact:
        for mask in range(size):
            total += work.table[mask]
    return scale + math.log(total) if total > _LEAST and log_bound > -math.inf else log_bound


@borrowing
def _log_parent_total(options: Options, rows: Ints, log_totals: Floats, work: TotalWork) -> float:
    """Log total weight of the joint choices of the rows of a parent, in which no measurement is taken twice."""
    total = 0.0
    if not _link(options, rows, work):
        for row in rows:
            total += log_totals[row]
    else:
        for i in range(len(rows)):
            if root_of(work.leaders, i) == i:
                total += _log_cluster_total(options, rows, i, log_totals, work)
    _unlink(options, rows, work)
    return total


@inlined
def log_heaviest_left(children: Children, caps: SearchCaps, cut: bool) -> float:
    """Log of a weight that no joint choice left out by the ranking exceeds, -inf where there are none.

    children: as ranked, heaviest first. cut: whether ranking stopped at its bound on nodes.
    """
    num = children.filled[0]
    if num == 0:
        return math.inf
    is_stopped = cut or num >= caps.max_hypotheses
    return children.log_weights[num - 1] if is_stopped else children.log_weights[0] - caps.max_log_gap


@kernel
def log_weight_bound(
    options: Options, parents: Parents, children: Children, log_next: float, log_bound: float
) -> float:
    """Log of an upper bound on the weight of all joint choices, those that were found included.

    Equal to that weight where no cluster of a parent has more than `MAX_CONTESTED` contested measurements, and where
    the search has left nothing out.

    Args:
        options, parents: of the scan.
        children: those that were found, each once.
        log_next: no choice left out is heavier than this; -inf: none is left out; inf: not known.
        log_bound: as of `log_total_bound`, of all parents, those that were cut before included.
    """
    num, best = children.filled[0], -math.inf
    for child in range(num):
        best = max(best, children.log_weights[child])
    if num == 0 or log_bound - best > _MOST_LOG:
        return log_bound
    found, in_all, of_parents, left = np.zeros(len(parents.log_weights)), 0.0, 0.0, 0.0
    for child in range(num):
        weight = math.exp(children.log_weights[child] - best)
        found[children.parents[child]] += weight
        in_all += weight
    log_totals, widest = log_row_totals(options), 0
    for parent in range(len(found)):
        widest = max(widest, parents.offsets[parent + 1] - parents.offsets[parent])
    work = _make_total_work(options, widest)
    for parent in range(len(found)):
        rows, log_count = parents.rows[parents.offsets[parent] : parents.offsets[parent + 1]], 0.0
        log_all = parents.log_weights[parent]
        for row in rows:
            log_all += log_totals[row]
            log_count += math.log(max(1, options.offsets[row + 1] - options.offsets[row]))
        weight = math.exp(log_all - best)
        of_parents += weight
        few = min(math.exp(min(log_count + log_next - best, _MOST_LOG)), weight - found[parent])
        # What could be left at most is not worth an exact sum where it is so little.
        if few > ROUNDING * in_all / len(found):
            weight = math.exp(parents.log_weights[parent] + _log_parent_total(options, rows, log_totals, work) - best)
            less = weight - found[parent]
            few = min(less, few) if less > ROUNDING * weight else 0.0
        left += max(few, 0.0)
    before = math.exp(log_bound - best) - of_parents
    left += before if before > ROUNDING * of_parents else 0.0
    return min(log_bound, best + math.log(in_all + left))
