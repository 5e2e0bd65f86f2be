"""Marginal probability of every option of every row, by clusters of rows that compete for the same measurements.

An LMB filter needs these marginals. An `Association` is another source of them. Within a cluster the sum over all joint
choices is exact: a forward-backward pass over the rows whose state is the set of measurements already taken. A cluster
too large for that is summed over its heaviest joint choices, in exact order. The rest is bounded, and no row becomes
certain because a choice was left out (`vedette.kernels.association.truncation_bound`).
"""

import math
from typing import Any, NamedTuple

import numpy as np

from vedette.errors import ModelError
from vedette.kernels.association.assignment import Options
from vedette.kernels.association.children import Parents
from vedette.kernels.association.clusters import (
    MarginalWork,
    find_clusters,
    gather_cluster,
    grown_marginal_work,
    make_marginal_work,
)
from vedette.kernels.association.ranked import run_search
from vedette.kernels.association.search import HEAP, SearchCaps
from vedette.kernels.association.search_start import size_search, start_search
from vedette.kernels.association.truncation_bound import has_closed_side, log_left_out_bound, open_sides
from vedette.kernels.base.bundle_types import typed_by_fields
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.gaussian.linalg import log_add

MAX_EXACT_MEASUREMENTS = 12


class MarginalSums(NamedTuple):
    """Sums over joint choices from which the marginals of a scan were computed."""

    log_total: float  # log total weight of all summed joint choices; -inf if none is possible
    num_ranked: int  # clusters summed over their heaviest choices only
    log_kept: float  # log of the least share of all weight that is in the sum; 0 without such clusters, NaN: unknown


@typed_by_fields
class Association(NamedTuple):
    """Another source of the marginals, in place of the sums over clusters."""

    marginals: Any  # see `vedette.models.model_function`, kind `association_marginals`
    params: Floats


# Allowed deviation of the sum of a row's probabilities from 1.
SUM_TOLERANCE = 1e-6


@inlined
def _custom_marginals(options: Options, association: Association, out: Floats) -> MarginalSums:
    """Return the marginals of `association`, after a check that they are distributions."""
    offsets, num = options.offsets, options.offsets[-1]
    columns, log_weights = options.columns[:num], options.log_weights[:num]
    log_total = association.marginals(offsets, columns, log_weights, association.params, out[:num])
    if log_total == -math.inf:
        return MarginalSums(log_total, 0, math.nan)
    for row in range(len(offsets) - 1):
        total = 0.0
        for option in range(offsets[row], offsets[row + 1]):
            total += math.exp(out[option])
        if not abs(total - 1.0) <= SUM_TOLERANCE:
            raise ModelError("association_marginals function: the probabilities of a row's options do not sum to 1")
    return MarginalSums(log_total, 0, math.nan)


@inlined
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


@borrowing
def _transfer(options: Options, row: int, bit_of: Ints, source: Floats, target: Floats, forward: bool) -> None:
    """Step of one row in the pass over sets of taken measurements, with weights relative to the row's heaviest option.

    source, target: in the forward pass the sets over the measurements gated before the row, and with those it gates,
    and in the backward pass the other way round.
    """
    for mask in range(len(target)):
        target[mask] = 0.0
    start, num_before = options.offsets[row], min(len(source), len(target))
    for option in range(start, options.offsets[row + 1]):
        weight = math.exp(options.log_weights[option] - options.log_weights[start])
        column = options.columns[option]
        bit = 1 << bit_of[column] if column >= 0 else 0
        for mask in range(num_before):
            if mask & bit == 0:
                if forward:
                    target[mask | bit] += weight * source[mask]
                else:
                    target[mask] += weight * source[mask | bit]


@borrowing
def _exact_cluster(
    options: Options, rows: Ints, bit_of: Ints, gated_before: Ints, tables: Floats, out: Floats
) -> float:
    """Compute marginals of a cluster by forward-backward, and return its log total weight, -inf if that underflows.

    Before a row, only measurements gated by rows before it can be taken, the first `gated_before` ones.
    """
    num, size = len(rows), 1 << gated_before[len(rows)]
    backwards = (num + 1) * size
    for mask in range(size):
        tables[backwards + num * size + mask] = 1.0
    tables[0], scale = 1.0, 0.0
    for i in range(num):
        if options.offsets[rows[i]] == options.offsets[rows[i] + 1]:
            return -math.inf
        scale += options.log_weights[options.offsets[rows[i]]]
        before, after, at = 1 << gated_before[i], 1 << gated_before[i + 1], i * size
        _transfer(options, rows[i], bit_of, tables[at : at + before], tables[at + size : at + size + after], True)
    # Backwards: total weight of the later rows once a set of measurements is taken.
    for i in range(num - 1, -1, -1):
        before, after, at = 1 << gated_before[i], 1 << gated_before[i + 1], backwards + i * size
        _transfer(options, rows[i], bit_of, tables[at + size : at + size + after], tables[at : at + before], False)
    total = tables[backwards]
    # Relative weights have underflowed: the caller ranks the cluster's joint choices in logs instead.
    if not total > 1e-250:
        return -math.inf
    for i in range(num):
        start = options.offsets[rows[i]]
        for option in range(start, options.offsets[rows[i] + 1]):
            column = options.columns[option]
            bit = 1 << bit_of[column] if column >= 0 else 0
            # P(option) is proportional to the sum over sets of forward(before) weight(option) backward(after).
            joint = 0.0
            for mask in range(1 << gated_before[i]):
                if mask & bit == 0:
                    joint += tables[i * size + mask] * tables[backwards + (i + 1) * size + (mask | bit)]
            log_joint = math.log(joint / total) if joint > 0.0 else -math.inf
            out[option] = options.log_weights[option] - options.log_weights[start] + log_joint
    return scale + math.log(total)


@borrowing
def _ranked_cluster(
    options: Options, rows: Ints, caps: SearchCaps, work: MarginalWork, out: Floats
) -> tuple[float, float, bool]:
    """Compute marginals of a cluster over its heaviest joint choices.

    Returns the log of their total weight, the log of a lower bound on their share of all weight, and False if there was
    not enough room.
    """
    work.single[1] = len(rows)
    parents, children = Parents(work.single, rows, work.no_weight), work.children
    if not start_search(options, parents, work.search, children):
        return 0.0, 0.0, False
    if not run_search(options, parents, caps, work.search, children):
        return 0.0, 0.0, False
    for row in rows:
        for option in range(options.offsets[row], options.offsets[row + 1]):
            out[option] = 0.0
    if children.filled[0] == 0:
        return -math.inf, 0.0, True
    peak, total = children.log_weights[0], 0.0
    for child in range(children.filled[0]):
        weight = math.exp(children.log_weights[child] - peak)
        total += weight
        for i in range(children.offsets[child], children.offsets[child + 1]):
            out[children.options[i]] += weight
    for row in rows:
        for option in range(options.offsets[row], options.offsets[row + 1]):
            out[option] = math.log(out[option] / total) if out[option] > 0.0 else -math.inf
    log_total = peak + math.log(total)
    # No choice left out is heavier than the best waiting one, or than the gap at which the search stops.
    log_next = peak - caps.max_log_gap
    if work.search.sizes[HEAP] > 0:
        log_next = max(log_next, -work.search.heap_bounds[0])
    log_left_out = log_left_out_bound(options, rows, log_total, log_next, work.search.work)
    open_sides(options, rows, log_total, work.search.work, out)
    return log_total, -log_add(0.0, log_left_out - log_total), True


@borrowing
def _open_exact(options: Options, rows: Ints, log_total: float, work: MarginalWork, out: Floats) -> bool:
    """Apply `open_sides` if the exact sum has lost a side to underflow. Return False if there is not enough room."""
    if not has_closed_side(options, rows, out):
        return True
    work.single[1] = len(rows)
    if not size_search(options, Parents(work.single, rows, work.no_weight), work.search):
        return False
    open_sides(options, rows, log_total, work.search.work, out)
    return True


@inlined
def fill_marginals(
    options: Options, caps: SearchCaps, association: Association | None, work: MarginalWork, out: Floats
) -> tuple[MarginalSums, bool]:
    """Write the log marginal probability of each option into `out`, and return False if `work` must be grown for that.

    If clusters were ranked, 1 minus the retained share of all weight bounds the error of each marginal.
    Inlined because `work` is a large bundle, of which the usual small clusters need little.
    """
    if association is not None:
        return _custom_marginals(options, association, out), True
    log_total, num_ranked, log_kept = 0.0, 0, 0.0
    if not find_clusters(options, work):
        for row in range(len(options.offsets) - 1):
            log_total += _single_row(options, row, out)
        return MarginalSums(log_total, num_ranked, log_kept), True
    for column in range(options.num_measurements):
        work.bits[column] = -1
    for leader in range(len(options.offsets) - 1):
        if work.leaders[leader] != leader:
            continue
        count, num_bits = gather_cluster(options, leader, work)
        if count == 1:
            log_total += _single_row(options, leader, out)
            continue
        total, rows = -math.inf, work.members[:count]
        # 2^measurements states per row: beyond a dozen, ranking is cheaper.
        if num_bits <= MAX_EXACT_MEASUREMENTS:
            work.needed[0] = 2 * (count + 1) << num_bits
            if work.needed[0] > len(work.tables):
                return MarginalSums(0.0, 0, 0.0), False
            total = _exact_cluster(options, rows, work.bits, work.gated_before[: count + 1], work.tables, out)
        if total > -math.inf:
            has_room = _open_exact(options, rows, total, work, out)
        else:
            num_ranked += 1
            total, log_share, has_room = _ranked_cluster(options, rows, caps, work, out)
            log_kept += log_share
        if not has_room:
            return MarginalSums(0.0, 0, 0.0), False
        log_total += total
    return MarginalSums(log_total, num_ranked, log_kept), True


@kernel
def option_marginals(
    options: Options, caps: SearchCaps, association: Association | None
) -> tuple[Floats, MarginalSums]:
    """Return the result of `fill_marginals` in new arrays."""
    marginals = np.empty(options.offsets[-1])
    work = make_marginal_work(len(options.offsets) - 1, options.num_measurements)
    while True:
        sums, has_room = fill_marginals(options, caps, association, work, marginals)
        if has_room:
            return marginals, sums
        work = grown_marginal_work(work)
