"""Update of the factors of one group at a scan, and its split into independent parts."""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.association.assignment import ABSENT, Options
from vedette.kernels.association.children import Children, make_children
from vedette.kernels.association.predicted import Rows
from vedette.kernels.association.ranked import Ranking, ranked
from vedette.kernels.association.search import make_search
from vedette.kernels.association.totals import ROUNDING, log_heaviest_left, log_weight_bound
from vedette.kernels.association.truncation import Truncation
from vedette.kernels.base.arrays import filled_ints
from vedette.kernels.base.compile import borrowing, kernel
from vedette.kernels.base.types import Floats, Glmb, Ints, Mixture
from vedette.kernels.gaussian.components import components_between, components_like, copy_component, merge_all
from vedette.kernels.gaussian.distances import reduction_bound
from vedette.kernels.gaussian.linalg import log_add, log_or_minus_inf, log_sum
from vedette.kernels.gaussian.reduction import MixtureCaps, ReductionWork, make_reduction_work
from vedette.kernels.labelled.established_labels import with_established_labels
from vedette.kernels.labelled.factor_store import FactorStore, append_part, append_single, next_component, with_room
from vedette.kernels.labelled.splitting import Choices, choices_of, independent_parts
from vedette.kernels.labelled.track_merging import merge_versions
from vedette.kernels.steps.assembly import assemble
from vedette.kernels.steps.factor_groups import Group
from vedette.kernels.steps.faint_labels import Background, outweighs_undetected
from vedette.kernels.steps.glmb import kept_children
from vedette.kernels.steps.lmb import Reduction, append_reduced, write_mixture

# Indices of the sums of a scan; see `FactoredReport`.
TOTAL, KEPT, TWICE, SPLIT, DROPPED, CUT, FULL, REDUCED = range(8)
_NUM_SUMS = 8

# A component of a label that is alone is dropped if its expected number of targets is below _WORTH times the least
# share of a component, and it has less than _FAINT_SHARE (log) of its label.
_WORTH, _FAINT_SHARE = 10.0, math.log(0.1)

# A posterior is condensed if the hypotheses beyond the share _KEPT_APART of the longest list weigh more than
# _MOST_BEHIND: the next scan has many times as many, and most of those cut off hold more targets than those kept. The
# L1 error up to which versions of labels are merged then grows by _GROWTH, until it is above `Factoring.max_merging`.
# If that is not enough, the posterior is split up to that error.
_KEPT_APART, _MOST_BEHIND, _GROWTH = 0.25, 0.05, 3.0


class Factoring(NamedTuple):
    """Criteria for joint updates of factors, and for splits."""

    max_error: float  # L1 error of one group's split
    max_cut: float  # sum over pairs of factors, at each measurement, of the products of cut probabilities
    max_labels: int  # of a factor, after a scan
    max_together: int  # labels of the factors that are updated jointly
    max_merging: float  # L1 error up to which a posterior with too many hypotheses is condensed and split; 0: cut


class Work(NamedTuple):
    """Working arrays of a scan."""

    marginals: Floats  # (num_options,) log probability of each option
    wide: Mixture  # of one row over all its options
    place: Ints  # (num_rows,) of a row in its group
    columns: Ints  # (num_measurements,) -1 between groups
    claimed: Floats  # (num_measurements,) expected number of groups that take each
    sums: Floats  # (_NUM_SUMS,)
    reducing: ReductionWork  # for the number of components of `wide`
    background: Background  # undetected targets before the scan
    faint: Mixture  # one Gaussian of each dropped label, weighted by its existence
    num_faint: Ints  # (1,) their number


@kernel
def make_work(rows: Rows, options: Options, background: Background) -> Work:
    widest = 0
    for row in range(len(rows.log_absent)):
        num_options = options.offsets[row + 1] - options.offsets[row]
        widest = max(widest, (rows.offsets[row + 1] - rows.offsets[row]) * max(1, num_options))
    return Work(
        np.empty(options.offsets[-1]),
        components_like(rows.components, widest),
        np.empty(len(rows.log_absent), np.int64),
        filled_ints(options.num_measurements, -1),
        np.zeros(options.num_measurements),
        np.zeros(_NUM_SUMS),
        make_reduction_work(widest, rows.components),
        background,
        components_like(rows.components, len(rows.log_absent)),
        np.zeros(1, np.int64),
    )


@kernel
def found_faint(work: Work) -> Mixture:
    """Return the dropped labels as an intensity."""
    return components_between(work.faint, 0, work.num_faint[0])


@borrowing
def _append_mixture(
    store: FactorStore,
    label: Ints,
    wide: Mixture,
    width: int,
    logit: float,
    reduction: Reduction,
    reducing: ReductionWork,
    work: Work,
) -> None:
    """Append a label as a factor, unless it is improbable and without effect on what later detections mean.

    The store must have room. reducing: working arrays.
    """
    existence = 1.0 / (1.0 + math.exp(-logit))
    start, caps = next_component(store), reduction.mixture
    if logit < reduction.min_existence_logit:
        k, faint = work.num_faint[0], work.faint
        merge_all(wide, width, reducing.near, reducing.weights, 0.0, faint, k)
        if not outweighs_undetected(existence, faint.means[k], faint.covs[k], work.background):
            faint.log_weights[k] = log_or_minus_inf(existence)
            work.sums[DROPPED] += existence
            work.num_faint[0] += 1
            return
    # An improbable label keeps few components, to save time.
    log_least = min(_FAINT_SHARE, caps.log_min_weight + math.log(_WORTH / existence))
    caps = MixtureCaps(log_least, caps.merge_distance, caps.max_components)
    end = append_reduced(wide, width, caps, reducing, store.components, start)
    work.sums[REDUCED] += existence * reduction_bound(wide, width, store.components, start, end, reducing)
    append_single(store, label[0], label[1], end, logit)


@borrowing
def update_alone(row: int, rows: Rows, options: Options, reduction: Reduction, store: FactorStore, work: Work) -> None:
    """Append the exact update of a single track whose measurements no group shares. The store must have room."""
    start, stop, marginals = options.offsets[row], options.offsets[row + 1], work.marginals
    log_total, absent, present = log_sum(options.log_weights[start:stop]), -math.inf, -math.inf
    work.sums[TOTAL] += log_total
    if log_total == -math.inf:
        return
    for option in range(start, stop):
        column = options.columns[option]
        marginals[option] = options.log_weights[option] - log_total
        if column == ABSENT:
            absent = marginals[option]
        else:
            present = log_add(present, marginals[option])
        if column >= 0:
            claim = math.exp(marginals[option])
            work.sums[TWICE] += work.claimed[column] * claim
            work.claimed[column] += claim
    width = write_mixture(row, rows, options, marginals, work.wide)
    _append_mixture(store, rows.labels[row], work.wide, width, present - absent, reduction, work.reducing, work)


@borrowing
def _claim_jointly(group: Group, children: Children, kept: Ints, log_total: float, work: Work) -> None:
    """Add the probabilities with which the group takes measurements, after the pairs with earlier groups."""
    columns = group.options.columns
    for child in kept:
        weight = math.exp(children.log_weights[child] - log_total)
        for i in range(children.offsets[child], children.offsets[child + 1]):
            column = columns[children.options[i]]
            if column >= 0:
                work.sums[TWICE] += weight * work.claimed[group.measurements[column]]
    for child in kept:
        weight = math.exp(children.log_weights[child] - log_total)
        for i in range(children.offsets[child], children.offsets[child + 1]):
            column = columns[children.options[i]]
            if column >= 0:
                work.claimed[group.measurements[column]] += weight


@kernel
def make_ranking() -> Ranking:
    """Return empty working arrays, which the groups of a scan share."""
    return Ranking(make_search(0), make_children(0, 0))


@kernel
def update_group(
    group: Group, rows: Rows, truncation: Truncation, ranking: Ranking, work: Work
) -> tuple[Glmb, Ranking]:
    """Return the posterior of a group, empty with a log total of -inf if no joint choice was found, and its ranking.

    rows: of the scan.
    """
    options, parents, sums = group.options, group.parents, work.sums
    ranking, cut = ranked(options, parents, truncation.search, ranking)
    children = ranking.children
    log_next = log_heaviest_left(children, truncation.search, cut)
    log_bound = log_weight_bound(options, parents, children, group.log_totals, log_next, group.log_bound)
    # An exhausted search has left nothing out.
    is_covered = children.filled[0] < truncation.search.max_hypotheses and not cut
    children, kept = kept_children(group.labels, options, parents, children, truncation, is_covered)
    posterior, log_total, _ = assemble(children, kept, parents, group.members, rows, options)
    sums[TOTAL] += log_total
    sums[CUT] += 1.0 if cut else 0.0
    if len(kept) == 0:
        return posterior, ranking
    _claim_jointly(group, children, kept, log_total, work)
    sums[KEPT] -= log_bound - log_total if log_bound - log_total > ROUNDING else 0.0
    sums[FULL] += 1.0 if len(kept) >= truncation.search.max_hypotheses else 0.0
    return posterior, ranking


@kernel
def _append_label(
    store: FactorStore, glmb: Glmb, choices: Choices, label: int, reduction: Reduction, work: Work
) -> None:
    """Append the marginal of one label, the mixture of its versions. The store must have room."""
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
    components = tracks.components
    num = len(components.log_weights)
    wide, width, reducing = components_like(components, num), 0, make_reduction_work(num, components)
    for track in range(len(log_versions)):
        if log_versions[track] == -math.inf:
            continue
        for c in range(tracks.offsets[track], tracks.offsets[track + 1]):
            copy_component(components, c, wide, width)
            wide.log_weights[width] += log_versions[track]
            width += 1
    logit = log_sum(log_versions) - absent
    _append_mixture(store, choices.labels[label], wide, width, logit, reduction, reducing, work)


@kernel
def _is_crowded(choices: Choices, most: int) -> bool:
    """Return True if a list of at most `most` hypotheses is too short for the next scan."""
    return bool(choices.weights[int(_KEPT_APART * most) :].sum() > _MOST_BEHIND)


@kernel
def _merged(glmb: Glmb, reduction: Reduction, factoring: Factoring, most: int) -> tuple[Glmb, Choices, float]:
    """Return the posterior with merged labels and versions of targets, its choices, and a bound on its L1 change.

    most: largest number of hypotheses of a group.
    """
    caps, choices, renaming_error, max_error = reduction.mixture, choices_of(glmb), 0.0, factoring.max_error
    if reduction.min_existence_logit > -math.inf:  # a prediction keeps all labels
        glmb, choices, renaming_error = with_established_labels(glmb, choices, max_error)
    glmb, choices, total = merge_versions(glmb, choices, caps, max_error)
    total += renaming_error
    while 0.0 < max_error < factoring.max_merging and _is_crowded(choices, most):
        max_error *= _GROWTH
        glmb, choices, error = merge_versions(glmb, choices, caps, max_error)
        total += error
    return glmb, choices, total


@kernel
def append_parts(
    store: FactorStore, glmb: Glmb, factoring: Factoring, reduction: Reduction, most: int, work: Work
) -> FactorStore:
    """Split the posterior of a group and append its parts. most: largest number of hypotheses of the group."""
    glmb, choices, merging_error = _merged(glmb, reduction, factoring, most)
    max_error = factoring.max_error
    if 0.0 < max_error < factoring.max_merging and _is_crowded(choices, most):
        max_error = factoring.max_merging
    min_existence = 1.0 / (1.0 + math.exp(-reduction.min_existence_logit))
    part_of, error = independent_parts(choices, max_error, factoring.max_labels, min_existence)
    work.sums[SPLIT] += error
    work.sums[REDUCED] += merging_error
    num, num_labels, tracks = len(choices.weights), len(part_of), glmb.tracks
    entries = (num + 1) * num_labels
    store = with_room(
        store, num_labels, len(tracks.labels), len(tracks.components.log_weights), entries + num_labels, entries
    )
    for part in range(num_labels):
        size = 0
        for k in range(len(part_of)):
            size += 1 if part_of[k] == part else 0
        if size == 1:
            _append_label(store, glmb, choices, part, reduction, work)
        elif size > 1:
            append_part(store, glmb, choices, part_of, part)
    return store
