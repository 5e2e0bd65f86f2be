"""Clusters of rows that compete for the same measurements, and working arrays for their marginals."""

from typing import NamedTuple

import numpy as np

from vedette.kernels.association.assignment import Options
from vedette.kernels.association.children import Children, grown_children, make_children
from vedette.kernels.association.search import WIDEST, Search, grown_search, make_search
from vedette.kernels.base.arrays import grown_floats
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Ints


class MarginalWork(NamedTuple):
    """Working arrays for the clusters of a scan and their sums, made once, grown if a cluster needs more."""

    leaders: Ints  # (num_rows,) a row of the same cluster, not after this one; the first row is its own leader
    followers: Ints  # (num_rows,) the next row of the same cluster, -1 for none
    members: Ints  # (num_rows,) rows of the current cluster
    gated_before: Ints  # (num_rows + 1,) number of its measurements that the members before each gate
    owners: Ints  # (num_measurements,) the first row that gates each measurement, or -1
    bits: Ints  # (num_measurements,) number of each measurement within its cluster, or -1
    tables: Floats  # of the exact sum
    needed: Ints  # (1,) required size of `tables` for the last cluster
    search: Search  # of the ranked sum
    children: Children  # of the ranked sum
    single: Ints  # (2,) offsets of the single parent of the ranked sum, with the rows of the cluster
    no_weight: Floats  # (1,) its log weight, 0


@kernel
def make_marginal_work(num_rows: int, num_measurements: int) -> MarginalWork:
    """Return arrays for the clusters of this number of rows and measurements, and for a small exact sum."""
    return MarginalWork(
        np.empty(num_rows, np.int64),
        np.empty(num_rows, np.int64),
        np.empty(num_rows, np.int64),
        np.empty(num_rows + 1, np.int64),
        np.empty(num_measurements, np.int64),
        np.empty(num_measurements, np.int64),
        np.empty(512),
        np.zeros(1, np.int64),
        make_search(0),
        make_children(0, 0),
        np.zeros(2, np.int64),
        np.zeros(1),
    )


@kernel
def grown_marginal_work(work: MarginalWork) -> MarginalWork:
    """Return larger arrays, as required by the last cluster."""
    return MarginalWork(
        work.leaders,
        work.followers,
        work.members,
        work.gated_before,
        work.owners,
        work.bits,
        grown_floats(work.tables, work.needed[0]),
        work.needed,
        grown_search(work.search),
        grown_children(work.children, work.search.sizes[WIDEST]),
        work.single,
        work.no_weight,
    )


@borrowing
def find_clusters(options: Options, work: MarginalWork) -> bool:
    """Assign each row the first row of its cluster as leader. Returns False if no rows share a gated measurement.

    A cluster consists of rows that share gated measurements, directly or not. Writes leaders, followers and owners
    (union-find, the lesser root leads).
    """
    shared = lead_rows(options, work.leaders, work.owners)
    if shared:
        _link_followers(work.leaders, work.followers, len(options.offsets) - 1)
    return shared


@borrowing
def lead_rows(options: Options, leaders: Ints, owners: Ints) -> bool:
    """Write leaders (num_rows,) and owners (num_measurements,) as in `MarginalWork`. Return False if no rows share."""
    shared = False
    for column in range(options.num_measurements):
        owners[column] = -1
    for row in range(len(options.offsets) - 1):
        leaders[row] = row
        for option in range(options.offsets[row], options.offsets[row + 1]):
            column = options.columns[option]
            if column < 0:
                continue
            # The first row that gates a measurement represents all that do: one union per pair is enough.
            if owners[column] < 0:
                owners[column] = row
            else:
                shared = True
                a, b = root_of(leaders, owners[column]), root_of(leaders, row)
                leaders[max(a, b)] = min(a, b)
    return shared


@inlined
def _link_followers(leaders: Ints, followers: Ints, num_rows: int) -> None:
    for row in range(num_rows):
        followers[row] = -1
    # In reverse, each directly after its leader: the result is in order.
    for row in range(num_rows - 1, -1, -1):
        leader = root_of(leaders, row)
        if leader != row:
            followers[row] = followers[leader]
            followers[leader] = row


@inlined
def root_of(leaders: Ints, item: int) -> int:
    """Return the leader of an item in a union-find.

    `leaders` names for each item another one of its set, not after it.
    """
    while leaders[item] != item:
        leaders[item] = leaders[leaders[item]]  # path halving
        item = leaders[item]
    return item


@inlined
def gather_cluster(options: Options, leader: int, work: MarginalWork) -> tuple[int, int]:
    """Write the rows of a cluster and number its measurements, in order, and return the numbers of both."""
    count, num_bits, row = 0, 0, leader
    while row >= 0:
        work.members[count], work.gated_before[count] = row, num_bits
        count += 1
        for option in range(options.offsets[row], options.offsets[row + 1]):
            column = options.columns[option]
            if column >= 0 and work.bits[column] < 0:
                work.bits[column] = num_bits
                num_bits += 1
        row = work.followers[row]
    work.gated_before[count] = num_bits
    return count, num_bits
