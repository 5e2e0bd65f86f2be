"""Joint prediction and update of a factored density: every group of linked factors as a small delta-GLMB of its own.

The factors whose claims to measurements meet (`vedette.kernels.association.links`) are multiplied out and take the scan
together, by the kernels of the delta-GLMB; those that nobody contends with are updated alone, a single track as that of
an LMB. Then each group falls into the smallest parts that are independent within a stated L1 error
(`vedette.kernels.labelled.splitting`), and a part of one label becomes one track again, the mixture of its versions.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.association.assignment import ABSENT, Options
from vedette.kernels.association.children import Children
from vedette.kernels.association.links import linked_factors
from vedette.kernels.association.options import weighed_options
from vedette.kernels.association.predicted import Rows, expect_rows, predicted_rows, standing_rows
from vedette.kernels.association.ranked import rank_children
from vedette.kernels.association.truncation import Truncation
from vedette.kernels.base.arrays import filled_ints
from vedette.kernels.base.compile import borrowing, kernel
from vedette.kernels.base.types import FactoredGlmb, Floats, Glmb, Ints, Mixture, Motion, ScanInput, Sensor
from vedette.kernels.gaussian.linalg import log_add, log_sum
from vedette.kernels.gaussian.mixtures import copy_component, require_gaussians
from vedette.kernels.gaussian.scratch import make_scratch
from vedette.kernels.labelled.factor_store import (
    FactorStore,
    append_part,
    append_single,
    make_store,
    next_component,
    stored,
    with_room,
)
from vedette.kernels.labelled.labels import group_members
from vedette.kernels.labelled.splitting import Choices, choices_of, independent_parts
from vedette.kernels.labelled.versions import merge_versions
from vedette.kernels.steps.assembly import assemble
from vedette.kernels.steps.factor_groups import (
    Factors,
    Group,
    factors_of,
    gathered_group,
    is_single,
    left_out_of,
    weigh_singles,
)
from vedette.kernels.steps.glmb import Associated, kept_children
from vedette.kernels.steps.lmb import Reduction, append_reduced, write_mixture

# Places in the sums of a scan.
_TOTAL, _KEPT, _TWICE, _SPLIT, _DROPPED, _CUT, _FULL = range(7)
_NUM_SUMS = 7

# What rounding leaves of nothing, as a share of a weight.
_ROUNDING = 1e-13


class Factoring(NamedTuple):
    """When factors are taken together, and when they are split."""

    max_error: float  # L1 error of one group's split
    least_link: float  # product of two claims to a measurement, up to which they are taken as independent
    max_labels: int  # of a factor, after a scan
    max_together: int  # labels of the factors that take a scan together


class FactoredReport(NamedTuple):
    """What a step found and what it left out."""

    log_total: float  # log of the sum of the kept weights, relative to all measurements being clutter; -inf: none
    log_kept: float  # log of the least share of all weight, within groups, that is kept
    log_clutter: float  # sum of the log clutter intensities of the scan
    num_raised: int  # measurements whose clutter intensity was raised to the floor
    cut: bool  # a ranking stopped at its bound on nodes
    full: bool  # a group has as many hypotheses as it may
    taken_twice: float  # upper bound on the probability that factors of two groups take one measurement
    split_error: float  # summed L1 error of the splits
    dropped_existence: float  # summed existence of dropped labels
    most_labels: int  # of a group


class _Work(NamedTuple):
    """Arrays of a scan to work in."""

    marginals: Floats  # (num_options,) log probability of each option
    wide: Mixture  # of one row over all its options
    place: Ints  # (num_rows,) of a row in its group
    columns: Ints  # (num_measurements,) -1 between groups
    claimed: Floats  # (num_measurements,) expected number of groups that take each
    sums: Floats  # (_NUM_SUMS,)


@kernel
def _make_work(rows: Rows, options: Options) -> _Work:
    widest, dim = 0, rows.means.shape[1]
    for row in range(len(rows.log_absent)):
        num_options = options.offsets[row + 1] - options.offsets[row]
        widest = max(widest, (rows.offsets[row + 1] - rows.offsets[row]) * max(1, num_options))
    return _Work(
        np.empty(options.offsets[-1]),
        Mixture(np.empty(widest), np.empty((widest, dim)), np.empty((widest, dim, dim))),
        np.empty(len(rows.log_absent), np.int64),
        filled_ints(options.num_measurements, -1),
        np.zeros(options.num_measurements),
        np.zeros(_NUM_SUMS),
    )


@kernel
def _append_mixture(
    store: FactorStore, label: Ints, wide: Mixture, width: int, logit: float, reduction: Reduction, sums: Floats
) -> FactorStore:
    """Enter a label as a factor of its own, unless it is too improbable."""
    if logit < reduction.min_existence_logit:
        sums[_DROPPED] += 1.0 / (1.0 + math.exp(-logit))
        return store
    store = with_room(store, 1, width, 2, 1)
    end = append_reduced(wide, width, reduction.mixture, store.components, next_component(store))
    append_single(store, label[0], label[1], end, logit)
    return store


@kernel
def _update_alone(
    row: int, rows: Rows, options: Options, reduction: Reduction, store: FactorStore, work: _Work
) -> FactorStore:
    """A single track that contends with nobody: the update of its Bernoulli is exact."""
    start, stop, marginals = options.offsets[row], options.offsets[row + 1], work.marginals
    log_total, absent, present = log_sum(options.log_weights[start:stop]), -math.inf, -math.inf
    work.sums[_TOTAL] += log_total
    if log_total == -math.inf:
        return store
    for option in range(start, stop):
        column = options.columns[option]
        marginals[option] = options.log_weights[option] - log_total
        if column == ABSENT:
            absent = marginals[option]
        else:
            present = log_add(present, marginals[option])
        if column >= 0:
            claim = math.exp(marginals[option])
            work.sums[_TWICE] += work.claimed[column] * claim
            work.claimed[column] += claim
    width = write_mixture(row, rows, options, marginals, work.wide)
    return _append_mixture(store, rows.labels[row], work.wide, width, present - absent, reduction, work.sums)


@borrowing
def _claim_jointly(group: Group, children: Children, kept: Ints, log_total: float, work: _Work) -> None:
    """Enter the probabilities with which the group takes measurements, after the pairs with earlier groups."""
    columns = group.options.columns
    for child in kept:
        weight = math.exp(children.log_weights[child] - log_total)
        for i in range(children.offsets[child], children.offsets[child + 1]):
            column = columns[children.options[i]]
            if column >= 0:
                work.sums[_TWICE] += weight * work.claimed[group.measurements[column]]
    for child in kept:
        weight = math.exp(children.log_weights[child] - log_total)
        for i in range(children.offsets[child], children.offsets[child + 1]):
            column = columns[children.options[i]]
            if column >= 0:
                work.claimed[group.measurements[column]] += weight


@kernel
def _update_group(group: Group, truncation: Truncation, work: _Work) -> Glmb:
    """The posterior of a group in which some joint choice is possible; without any, the log total becomes -inf."""
    found, sums = Associated(group.rows, group.options, group.parents, 0.0, 0), work.sums
    children, cut = rank_children(group.options, group.parents, truncation.search)
    possible, left, num, best = 0.0, 0.0, children.filled[0], 0.0
    if num > 0:
        best, left = children.log_weights[0], left_out_of(group, children, truncation.search)
    for child in range(num):
        possible += math.exp(children.log_weights[child] - best)
    # A search that ran dry has left nothing out.
    is_covered = num < truncation.search.max_hypotheses and not cut
    children, kept = kept_children(found, children, truncation, is_covered)
    posterior, log_total = assemble(children, kept, group.parents, group.rows, group.options)
    sums[_TOTAL] += log_total
    if num == 0:
        return posterior
    _claim_jointly(group, children, kept, log_total, work)
    total = math.exp(log_total - best)
    gone = possible + left - total
    sums[_KEPT] -= math.log1p(gone / total) if gone > _ROUNDING * total else 0.0
    sums[_CUT] += 1.0 if cut else 0.0
    sums[_FULL] += 1.0 if len(kept) >= truncation.search.max_hypotheses else 0.0
    return posterior


@kernel
def _append_label(
    store: FactorStore, glmb: Glmb, choices: Choices, label: int, reduction: Reduction, sums: Floats
) -> FactorStore:
    """Enter the marginal of one label: the mixture of its versions."""
    tracks, absent = glmb.tracks, -math.inf
    log_versions = np.empty(len(tracks.labels))
    for track in range(len(log_versions)):
        log_versions[track] = -math.inf
    for h in range(len(glmb.hyp_log_weights)):
        track = choices.symbols[h, label]
        if track < 0:
            absent = log_add(absent, glmb.hyp_log_weights[h])
        else:
            log_versions[track] = log_add(log_versions[track], glmb.hyp_log_weights[h])
    num, dim = len(tracks.log_weights), tracks.means.shape[1]
    wide, width = Mixture(np.empty(num), np.empty((num, dim)), np.empty((num, dim, dim))), 0
    for track in range(len(log_versions)):
        if log_versions[track] == -math.inf:
            continue
        for c in range(tracks.offsets[track], tracks.offsets[track + 1]):
            wide.log_weights[width] = log_versions[track] + tracks.log_weights[c]
            copy_component(tracks.means, tracks.covs, c, wide.means, wide.covs, width)
            width += 1
    return _append_mixture(store, choices.labels[label], wide, width, log_sum(log_versions) - absent, reduction, sums)


@kernel
def _append_parts(
    store: FactorStore, glmb: Glmb, factoring: Factoring, reduction: Reduction, sums: Floats
) -> FactorStore:
    """Split the posterior of a group and enter its parts."""
    glmb = merge_versions(glmb, reduction.mixture)
    choices = choices_of(glmb)
    min_existence = 1.0 / (1.0 + math.exp(-reduction.min_existence_logit))
    part_of, error = independent_parts(choices, factoring.max_error, factoring.max_labels, min_existence)
    sums[_SPLIT] += error
    for part in range(len(part_of)):
        size = 0
        for k in range(len(part_of)):
            size += 1 if part_of[k] == part else 0
        if size == 1:
            store = _append_label(store, glmb, choices, part, reduction, sums)
        elif size > 1:
            store = append_part(store, glmb, choices, part_of, part)
    return store


@kernel
def _finish(
    factors: Factors,
    rows: Rows,
    scan: ScanInput,
    sensor: Sensor,
    truncation: Truncation,
    reduction: Reduction,
    factoring: Factoring,
) -> tuple[FactoredGlmb, FactoredReport]:
    """Weigh, link, update and split, once there are rows."""
    weigh_singles(factors, rows)
    options, log_clutter, num_raised = weighed_options(rows, scan, sensor, truncation)
    sizes = factors.num_labels.copy()
    leaders = linked_factors(options, factors.row_offsets, sizes, factoring.least_link, factoring.max_together)
    offsets, members = group_members(leaders, len(leaders))
    work, most_labels = _make_work(rows, options), 0
    store = make_store(len(rows.log_absent), 2 * len(rows.log_weights), rows.means.shape[1])
    for leader in range(len(leaders)):
        together = members[offsets[leader] : offsets[leader + 1]]
        if len(together) == 0 or factors.num_labels[leader] == 0:
            continue
        most_labels = max(most_labels, sizes[leader])
        if len(together) == 1 and is_single(factors, leader):
            store = _update_alone(factors.row_offsets[leader], rows, options, reduction, store, work)
            continue
        most = truncation.search.max_hypotheses
        group = gathered_group(factors, together, rows, options, most, work.place, work.columns)
        posterior = _update_group(group, truncation, work)
        if len(posterior.hyp_log_weights) > 0:
            store = _append_parts(store, posterior, factoring, reduction, work.sums)
    sums, density = work.sums, stored(store)
    require_gaussians(density.tracks.means, density.tracks.covs)
    return density, FactoredReport(
        sums[_TOTAL],
        sums[_KEPT],
        log_clutter,
        num_raised,
        sums[_CUT] > 0.0,
        sums[_FULL] > 0.0,
        min(sums[_TWICE], 1.0),
        sums[_SPLIT],
        sums[_DROPPED],
        most_labels,
    )


@kernel
def step_factored(
    prior: FactoredGlmb,
    scan: ScanInput,
    motion: Motion,
    sensor: Sensor,
    truncation: Truncation,
    reduction: Reduction,
    factoring: Factoring,
) -> tuple[FactoredGlmb, FactoredReport]:
    """One scan."""
    rows = predicted_rows(prior.tracks, scan, motion, sensor)
    factors = factors_of(prior, len(scan.birth.existence_logit))
    return _finish(factors, rows, scan, sensor, truncation, reduction, factoring)


@kernel
def update_factored(
    prior: FactoredGlmb,
    scan: ScanInput,
    sensor: Sensor,
    truncation: Truncation,
    reduction: Reduction,
    factoring: Factoring,
) -> tuple[FactoredGlmb, FactoredReport]:
    """After a scan of the prior's own time; `scan` has no births and no period."""
    rows = standing_rows(prior.tracks, len(sensor.angular))
    expect_rows(sensor, scan.pose, rows, make_scratch(prior.tracks.means.shape[1], len(sensor.angular)))
    return _finish(factors_of(prior, 0), rows, scan, sensor, truncation, reduction, factoring)
