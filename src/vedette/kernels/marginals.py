"""Marginal probability of every option of every row, by clusters of rows that contend for the same measurements.

Within a cluster the sum over all joint choices is exact: a forward-backward pass over the rows whose state is the set
of measurements already taken. A cluster too large for that is summed over its heaviest joint choices, in exact order.
"""

from __future__ import annotations

import math

import numpy as np

from vedette.kernels.arrays import filled_ints
from vedette.kernels.assignment import Options
from vedette.kernels.compile import kernel
from vedette.kernels.ranked import Parents, rank_children
from vedette.kernels.types import Floats, Ints

MAX_EXACT_MEASUREMENTS = 12


@kernel
def _clusters(options: Options, num_columns: int) -> tuple[Ints, int]:
    """Number of the cluster of each row; rows that share a gated measurement, directly or not, are together."""
    num_rows = len(options.offsets) - 1
    leader = np.empty(num_rows, np.int64)
    owner = filled_ints(num_columns, -1)
    for row in range(num_rows):
        leader[row] = row
        for option in range(options.offsets[row], options.offsets[row + 1]):
            column = options.columns[option]
            if column < 0:
                continue
            if owner[column] < 0:
                owner[column] = row
            else:
                a, b = _root(leader, owner[column]), _root(leader, row)
                leader[max(a, b)] = min(a, b)
    cluster = np.empty(num_rows, np.int64)
    num_clusters = 0
    for row in range(num_rows):
        root = _root(leader, row)
        if root == row:
            cluster[row] = num_clusters
            num_clusters += 1
        else:
            cluster[row] = cluster[root]
    return cluster, num_clusters


@kernel
def _root(leader: Ints, row: int) -> int:
    while leader[row] != row:
        row = leader[row]
    return row


@kernel
def _single_row(options: Options, row: int, out: Floats) -> float:
    start, stop = options.offsets[row], options.offsets[row + 1]
    if start == stop:
        return -math.inf
    peak, total = options.log_weights[start], 0.0
    for option in range(start, stop):
        total += math.exp(options.log_weights[option] - peak)
    log_total = peak + math.log(total)
    for option in range(start, stop):
        out[option] = options.log_weights[option] - log_total
    return log_total


@kernel
def _transfer(options: Options, row: int, bit_of: Ints, source: Floats, target: Floats, forward: bool) -> None:
    """One row's step of the pass over sets of taken measurements; weights relative to the row's heaviest option."""
    for mask in range(len(target)):
        target[mask] = 0.0
    start = options.offsets[row]
    for option in range(start, options.offsets[row + 1]):
        weight = math.exp(options.log_weights[option] - options.log_weights[start])
        column = options.columns[option]
        bit = 1 << bit_of[column] if column >= 0 else 0
        for mask in range(len(source)):
            if mask & bit == 0:
                if forward:
                    target[mask | bit] += weight * source[mask]
                else:
                    target[mask] += weight * source[mask | bit]


@kernel
def _exact_cluster(options: Options, rows: Ints, bit_of: Ints, num_bits: int, out: Floats) -> float:
    """Marginals of a cluster by forward-backward; returns its log total weight, -inf if that underflows."""
    num, size = len(rows), 1 << num_bits
    forward, backward = np.empty((num + 1, size)), np.empty((num + 1, size))
    for mask in range(size):
        forward[0, mask] = 1.0 if mask == 0 else 0.0
        backward[num, mask] = 1.0
    scale = 0.0
    for i in range(num):
        if options.offsets[rows[i]] == options.offsets[rows[i] + 1]:
            return -math.inf
        scale += options.log_weights[options.offsets[rows[i]]]
        _transfer(options, rows[i], bit_of, forward[i], forward[i + 1], True)
    for i in range(num - 1, -1, -1):
        _transfer(options, rows[i], bit_of, backward[i + 1], backward[i], False)
    total = backward[0, 0]
    if not total > 1e-250:
        return -math.inf
    for i in range(num):
        start = options.offsets[rows[i]]
        for option in range(start, options.offsets[rows[i] + 1]):
            column = options.columns[option]
            bit = 1 << bit_of[column] if column >= 0 else 0
            joint = 0.0
            for mask in range(size):
                if mask & bit == 0:
                    joint += forward[i, mask] * backward[i + 1, mask | bit]
            log_joint = math.log(joint / total) if joint > 0.0 else -math.inf
            out[option] = options.log_weights[option] - options.log_weights[start] + log_joint
    return scale + math.log(total)


@kernel
def _ranked_cluster(
    options: Options, rows: Ints, num_columns: int, max_choices: int, max_log_gap: float, max_nodes: int, out: Floats
) -> float:
    """Marginals of a cluster over its heaviest joint choices; returns their log total weight."""
    offsets = np.zeros(2, np.int64)
    offsets[1] = len(rows)
    parents = Parents(offsets, rows, np.zeros(1), np.empty(0, np.int64))
    children, _ = rank_children(options, parents, num_columns, max_choices, max_log_gap, max_nodes)
    for row in rows:
        for option in range(options.offsets[row], options.offsets[row + 1]):
            out[option] = 0.0
    if len(children.log_weights) == 0:
        return -math.inf
    peak, total = children.log_weights[0], 0.0
    for child in range(len(children.log_weights)):
        weight = math.exp(children.log_weights[child] - peak)
        total += weight
        for i in range(children.offsets[child], children.offsets[child + 1]):
            out[children.options[i]] += weight
    for row in rows:
        for option in range(options.offsets[row], options.offsets[row + 1]):
            out[option] = math.log(out[option] / total) if out[option] > 0.0 else -math.inf
    return peak + math.log(total)


@kernel
def option_marginals(
    options: Options, num_columns: int, max_choices: int, max_log_gap: float, max_nodes: int, out: Floats
) -> tuple[float, int]:
    """Log marginal probability of each option in `out`. Returns the log total weight of all joint choices and the
    number of clusters that were summed over their `max_choices` heaviest choices only. The total is -inf if none is
    possible.
    """
    num_rows = len(options.offsets) - 1
    cluster, num_clusters = _clusters(options, num_columns)
    sizes = filled_ints(num_clusters, 0)
    for row in range(num_rows):
        sizes[cluster[row]] += 1
    log_total, num_ranked = 0.0, 0
    bit_of = filled_ints(num_columns, -1)
    members = np.empty(num_rows, np.int64)
    for row in range(num_rows):
        if sizes[cluster[row]] == 1:
            log_total += _single_row(options, row, out)
    for c in range(num_clusters):
        if sizes[c] == 1:
            continue
        count, num_bits = 0, 0
        for row in range(num_rows):
            if cluster[row] != c:
                continue
            members[count] = row
            count += 1
            for option in range(options.offsets[row], options.offsets[row + 1]):
                column = options.columns[option]
                if column >= 0 and bit_of[column] < 0:
                    bit_of[column] = num_bits
                    num_bits += 1
        total = -math.inf
        if num_bits <= MAX_EXACT_MEASUREMENTS:
            total = _exact_cluster(options, members[:count], bit_of, num_bits, out)
        if total == -math.inf:
            total = _ranked_cluster(options, members[:count], num_columns, max_choices, max_log_gap, max_nodes, out)
            num_ranked += 1
        log_total += total
    return log_total, num_ranked
