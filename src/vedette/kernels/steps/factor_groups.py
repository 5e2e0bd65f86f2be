"""Groups of linked factors of a belief as small GLMBs: rows, options and prior hypotheses."""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.association.assignment import Options, with_options
from vedette.kernels.association.children import Parents
from vedette.kernels.association.predicted import Rows
from vedette.kernels.association.products import product_of
from vedette.kernels.association.totals import log_row_totals, log_total_bound
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import FactoredGlmb, Floats, Ints
from vedette.kernels.gaussian.linalg import log_add
from vedette.kernels.gaussian.mixtures import descending_order


class Factors(NamedTuple):
    """The factors of a scan: those of the prior, then every possible new label as its own factor."""

    prior: FactoredGlmb
    row_offsets: Ints  # (num_factors + 1,) rows of each
    num_labels: Ints  # (num_factors,)


class Group(NamedTuple):
    """Factors that are updated jointly. Rows are in label order, and rows and columns are numbered within the group."""

    members: Ints  # (num_rows,) of the scan
    labels: Ints  # (num_rows, 2)
    options: Options
    parents: Parents  # products of the factors' hypotheses, heaviest first
    measurements: Ints  # (num_columns,) of the scan
    log_totals: Floats  # (num_rows,) log total weight of each row's options
    log_bound: float  # log total weight of all joint choices if rows could share measurements, cut parents included


@inlined
def is_single(factors: Factors, factor: int) -> bool:
    """Return True if the factor is one row: one track that is present or absent."""
    return bool(factors.row_offsets[factor + 1] - factors.row_offsets[factor] == 1)


@kernel
def factors_of(prior: FactoredGlmb, num_births: int) -> Factors:
    """Return the factors of a scan, with their rows in the order of `rows_of_scan`, then candidates.

    num_births: number of birth sites and candidates.
    """
    num_prior = len(prior.factor_offsets) - 1
    row_offsets, num_labels = np.zeros(num_prior + num_births + 1, np.int64), np.empty(num_prior + num_births, np.int64)
    for factor in range(num_prior):
        row_offsets[factor + 1] = prior.track_offsets[factor + 1]
        num_labels[factor] = _count_labels(prior.tracks.labels, row_offsets[factor], row_offsets[factor + 1])
    for birth in range(num_births):
        row_offsets[num_prior + birth + 1] = row_offsets[num_prior + birth] + 1
        num_labels[num_prior + birth] = 1
    return Factors(prior, row_offsets, num_labels)


@borrowing
def _count_labels(labels: Ints, first: int, last: int) -> int:
    count = 0
    for i in range(first, last):
        is_new = 1
        for j in range(first, i):
            if labels[j, 0] == labels[i, 0] and labels[j, 1] == labels[i, 1]:
                is_new = 0
                break
        count += is_new
    return count


@borrowing
def weigh_singles(prior: FactoredGlmb, rows: Rows) -> None:
    """Apply the existence of single tracks, predicted as certain, from the hypotheses of their factors."""
    for factor in range(len(prior.factor_offsets) - 1):
        if prior.track_offsets[factor + 1] - prior.track_offsets[factor] != 1:
            continue
        log_absent, log_present = -math.inf, -math.inf
        for h in range(prior.factor_offsets[factor], prior.factor_offsets[factor + 1]):
            if prior.hyp_offsets[h + 1] > prior.hyp_offsets[h]:
                log_present = log_add(log_present, prior.hyp_log_weights[h])
            else:
                log_absent = log_add(log_absent, prior.hyp_log_weights[h])
        row = prior.track_offsets[factor]
        # Absent: never present, or died.
        rows.log_absent[row] = log_add(log_absent, log_present + rows.log_absent[row])
        for c in range(rows.offsets[row], rows.offsets[row + 1]):
            rows.components.log_weights[c] += log_present


@kernel
def presence_of_rows(prior: FactoredGlmb, num_rows: int) -> Floats:
    """Probability of each row in its factor, shape (num_rows,), or 1 for a single row (options include absence)."""
    presence = np.ones(num_rows)
    for factor in range(len(prior.factor_offsets) - 1):
        first, last = prior.track_offsets[factor], prior.track_offsets[factor + 1]
        if last - first == 1:
            continue
        for row in range(first, last):
            presence[row] = 0.0
        for h in range(prior.factor_offsets[factor], prior.factor_offsets[factor + 1]):
            weight = math.exp(prior.hyp_log_weights[h])
            for e in range(prior.hyp_offsets[h], prior.hyp_offsets[h + 1]):
                presence[prior.hyp_tracks[e]] += weight
    return presence


@kernel
def groups_of_rows(factors: Factors, leaders: Ints) -> Ints:
    """Group of each row, shape (num_rows,). leaders: (num_factors,) of each factor."""
    group_of = np.empty(factors.row_offsets[len(leaders)], np.int64)
    for factor in range(len(leaders)):
        for row in range(factors.row_offsets[factor], factors.row_offsets[factor + 1]):
            group_of[row] = leaders[factor]
    return group_of


@kernel
def _members(factors: Factors, group: Ints, labels: Ints) -> Ints:
    """Return the rows of a group's factors in label order, versions of a track in the order of the rows."""
    num = 0
    for factor in group:
        num += factors.row_offsets[factor + 1] - factors.row_offsets[factor]
    members, filled = np.empty(num, np.int64), 0
    for factor in group:
        for row in range(factors.row_offsets[factor], factors.row_offsets[factor + 1]):
            slot = filled
            while slot > 0 and (
                labels[members[slot - 1], 0] > labels[row, 0]
                or (labels[members[slot - 1], 0] == labels[row, 0] and labels[members[slot - 1], 1] > labels[row, 1])
            ):
                members[slot] = members[slot - 1]
                slot -= 1
            members[slot] = row
            filled += 1
    return members


@kernel
def _taken_options(options: Options, members: Ints, columns: Ints) -> tuple[Options, Ints]:
    """Return the options of some rows, with columns renumbered, and the measurement of each column.

    columns: (num_measurements,) all -1, before and after. Component entries stay those of all rows.
    """
    num = 0
    for row in members:
        num += options.offsets[row + 1] - options.offsets[row]
    offsets, own = np.zeros(len(members) + 1, np.int64), np.empty(num, np.int64)
    log_weights, entries, measurements = np.empty(num), np.empty(num, np.int64), np.empty(num, np.int64)
    filled, num_columns = 0, 0
    for i in range(len(members)):
        for option in range(options.offsets[members[i]], options.offsets[members[i] + 1]):
            column = options.columns[option]
            if column >= 0 and columns[column] < 0:
                columns[column], measurements[num_columns] = num_columns, column
                num_columns += 1
            own[filled] = columns[column] if column >= 0 else column
            log_weights[filled], entries[filled] = options.log_weights[option], options.entries[option]
            filled += 1
        offsets[i + 1] = filled
    for k in range(num_columns):
        columns[measurements[k]] = -1
    return with_options(options, offsets, own, log_weights, entries, num_columns), measurements[:num_columns]


@kernel
def _parents_of(factors: Factors, factor: int, place: Ints) -> Parents:
    """Return the hypotheses of one factor over the rows of its group, heaviest first.

    place: of each row in the group.
    """
    if is_single(factors, factor):
        # Absence is in the row's weights: both hypotheses become one.
        rows = np.empty(1, np.int64)
        rows[0] = place[factors.row_offsets[factor]]
        offsets = np.zeros(2, np.int64)
        offsets[1] = 1
        return Parents(offsets, rows, np.zeros(1))
    prior = factors.prior
    first, last = prior.factor_offsets[factor], prior.factor_offsets[factor + 1]
    order, filled = descending_order(prior.hyp_log_weights[first:last]), 0
    offsets = np.zeros(last - first + 1, np.int64)
    rows = np.empty(prior.hyp_offsets[last] - prior.hyp_offsets[first], np.int64)
    log_weights = np.empty(last - first)
    for h in range(last - first):
        hyp = first + order[h]
        for e in range(prior.hyp_offsets[hyp], prior.hyp_offsets[hyp + 1]):
            rows[filled] = place[prior.hyp_tracks[e]]
            filled += 1
        offsets[h + 1], log_weights[h] = filled, prior.hyp_log_weights[hyp]
    return Parents(offsets, rows, log_weights)


@kernel
def gather_group(
    factors: Factors, members_of: Ints, labels: Ints, options: Options, max_hypotheses: int, place: Ints, columns: Ints
) -> Group:
    """Return the factors `members_of` as a separate problem.

    labels: (num_rows, 2) of the rows. place: (num_rows,) working array. columns: (num_measurements,) all -1, before and
    after.
    """
    members = _members(factors, members_of, labels)
    own_labels = np.empty((len(members), 2), np.int64)
    for i in range(len(members)):
        row = members[i]
        place[row] = i
        own_labels[i, 0], own_labels[i, 1] = labels[row, 0], labels[row, 1]
    own, measurements = _taken_options(options, members, columns)
    log_totals = log_row_totals(own)
    parents = _parents_of(factors, members_of[0], place)
    log_bound = log_total_bound(log_totals, parents)
    for k in range(1, len(members_of)):
        other = _parents_of(factors, members_of[k], place)
        log_bound += log_total_bound(log_totals, other)
        parents = product_of(parents, other, max_hypotheses)
    return Group(members, own_labels, own, parents, measurements, log_totals, log_bound)
