"""Share of a hypothesis's joint choices that take no measurement twice. Each sum is shared by all hypotheses."""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.association.assignment import Options
from vedette.kernels.association.clusters import lead_rows, root_of
from vedette.kernels.base.arrays import filled_ints, hashed
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Ints

# A cluster with more contested measurements is only bounded: its exact sum takes 2^measurements numbers per row.
MAX_CONTESTED = 6
# Relative weights below this may have underflowed.
_LEAST = 1e-250


class TotalWork(NamedTuple):
    """Working arrays for the sums over joint choices of hypotheses, and the known shares.

    Rows that share a measurement, directly or through other rows of the scan, are a component. Hypotheses mostly have
    the same rows of a component, for which one sum is enough.
    """

    owners: Ints  # (num_measurements,) the first place that gates each, -1: none
    shared: Ints  # (num_measurements,) 1 if two places gate it
    bits: Ints  # (num_measurements,) number among the contested ones of a cluster, -1: none
    leaders: Ints  # (widest,) union-find over the places of the summed rows
    relative: Floats  # (most options of a row,) weights of one row, relative to its heaviest
    table: Floats  # (2^MAX_CONTESTED,) weight of each set of taken measurements
    components: Ints  # (num_rows,) component of each row of the scan
    firsts: Ints  # (num_rows,) first place of a hypothesis in the component, -1: none
    others: Ints  # (widest,) next place of the same component, -1: none
    members: Ints  # (widest,) rows of one component
    slots: Ints  # hash table: number of a known share, -1: none
    num_known: Ints  # (1,) number of known shares
    ends: Ints  # for each known share, the end of its rows in `rows`
    rows: Ints  # of the known shares
    log_shares: Floats  # the known shares


@kernel
def make_total_work(options: Options, widest: int, num_rows: int) -> TotalWork:
    """Return working arrays. widest: largest number of rows of a hypothesis. num_rows: of all hypotheses together."""
    num, size, most = options.num_measurements, 4, 0
    for row in range(len(options.offsets) - 1):
        most = max(most, options.offsets[row + 1] - options.offsets[row])
    while size < num_rows:
        size *= 2
    return TotalWork(
        filled_ints(num, -1),
        filled_ints(num, 0),
        filled_ints(num, -1),
        np.empty(widest, np.int64),
        np.empty(most),
        np.empty(1 << MAX_CONTESTED),
        _components(options),
        filled_ints(len(options.offsets) - 1, -1),
        np.empty(widest, np.int64),
        np.empty(widest, np.int64),
        filled_ints(size, -1),
        np.zeros(1, np.int64),
        np.empty(num_rows // 2 + 1, np.int64),
        np.empty(num_rows, np.int64),
        np.empty(num_rows // 2 + 1),
    )


@kernel
def _components(options: Options) -> Ints:
    """First of the rows that share a measurement with each row, directly or not, shape (num_rows,)."""
    leaders = np.empty(len(options.offsets) - 1, np.int64)
    lead_rows(options, leaders, np.empty(options.num_measurements, np.int64))
    for row in range(len(leaders)):
        leaders[row] = root_of(leaders, row)
    return leaders


@borrowing
def _link(options: Options, rows: Ints, work: TotalWork) -> bool:
    """Assign places that share a measurement, directly or not, to the first of them. Return False if there are none."""
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
    """Reset the measurements of the rows."""
    for row in rows:
        for option in range(options.offsets[row], options.offsets[row + 1]):
            column = options.columns[option]
            if column >= 0:
                work.owners[column], work.shared[column], work.bits[column] = -1, 0, -1


@inlined
def _number_contested(options: Options, rows: Ints, leader: int, work: TotalWork) -> int:
    """Number the contested measurements of a cluster, and return how many there are."""
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
    """Step of one row in the sum over sets of taken measurements, weights relative to the row's heaviest option."""
    start, stop, table, free = options.offsets[row], options.offsets[row + 1], work.table, 0.0
    for option in range(start, stop):
        column, weight = options.columns[option], math.exp(options.log_weights[option] - options.log_weights[start])
        work.relative[option - start] = weight
        if column < 0 or work.bits[column] < 0:
            free += weight
    # From the largest set down, as each set uses smaller ones that must still hold the sums without this row.
    for mask in range(size - 1, -1, -1):
        weight = free * table[mask]
        for option in range(start, stop):
            column = options.columns[option]
            bit = work.bits[column] if column >= 0 else -1
            if bit >= 0 and (mask >> bit) & 1 == 1:
                weight += work.relative[option - start] * table[mask ^ (1 << bit)]
        table[mask] = weight


@borrowing
def _log_cluster_share(options: Options, rows: Ints, leader: int, log_totals: Floats, work: TotalWork) -> float:
    """Return `log_contested_share` of the rows led by `leader`, or 0 if there are too many contested measurements."""
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
    return scale + math.log(total) - log_bound if total > _LEAST and log_bound > -math.inf else 0.0


@borrowing
def _log_component_share(options: Options, rows: Ints, log_totals: Floats, work: TotalWork) -> float:
    """Return `log_contested_share` of some rows, cluster by cluster."""
    log_share = 0.0
    if _link(options, rows, work):
        for i in range(len(rows)):
            if root_of(work.leaders, i) == i:
                log_share += _log_cluster_share(options, rows, i, log_totals, work)
    _unlink(options, rows, work)
    return log_share


@inlined
def _is_share_of(work: TotalWork, known: int, num: int) -> bool:
    """Return True if a known share belongs to the first `num` rows of `work.members`."""
    start = work.ends[known - 1] if known > 0 else 0
    same = work.ends[known] - start == num
    for i in range(num):
        same = same and work.rows[start + i] == work.members[i]
    return same


@borrowing
def _log_known_share(options: Options, num: int, log_totals: Floats, work: TotalWork) -> float:
    """Return `_log_component_share` of the first `num` rows of `work.members`, computed once for the same rows."""
    key, last = 0, len(work.slots) - 1
    for i in range(num):
        key = hashed(key, work.members[i])
    slot = key & last
    while work.slots[slot] >= 0 and not _is_share_of(work, work.slots[slot], num):
        slot = (slot + 1) & last
    if work.slots[slot] < 0:
        known = work.num_known[0]
        start = work.ends[known - 1] if known > 0 else 0
        work.slots[slot], work.ends[known], work.num_known[0] = known, start + num, known + 1
        for i in range(num):
            work.rows[start + i] = work.members[i]
        work.log_shares[known] = _log_component_share(options, work.members[:num], log_totals, work)
    return work.log_shares[work.slots[slot]]


@borrowing
def log_contested_share(options: Options, rows: Ints, log_totals: Floats, work: TotalWork) -> float:
    """Log of the share, by weight, of a hypothesis's joint choices that take no measurement twice.

    An upper bound of it if a cluster has more than `MAX_CONTESTED` contested measurements. log_totals: of each row.
    """
    log_share = 0.0
    # In reverse, so that the places of a component are in order.
    for i in range(len(rows) - 1, -1, -1):
        component = work.components[rows[i]]
        work.others[i], work.firsts[component] = work.firsts[component], i
    for i in range(len(rows)):
        if work.firsts[work.components[rows[i]]] != i or work.others[i] < 0:
            continue
        num, place = 0, i
        while place >= 0:
            work.members[num] = rows[place]
            num, place = num + 1, work.others[place]
        log_share += _log_known_share(options, num, log_totals, work)
    for row in rows:
        work.firsts[work.components[row]] = -1
    return log_share
