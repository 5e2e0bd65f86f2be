"""Joint prediction and update of a factored density: every group of linked factors as a small delta-GLMB.

Factors that may take the same measurements (`vedette.kernels.association.links`) are multiplied out and updated
jointly, by the kernels of the delta-GLMB. Factors without competition are updated alone, a single track as in an LMB.
Then each group splits into the smallest parts that are independent within a given L1 error
(`vedette.kernels.labelled.splitting`), and a part of one label becomes one track again, the mixture of its versions.
"""

from typing import NamedTuple

import numpy as np

from vedette.kernels.association.alternatives import Alternatives, alternatives_of, log_unclaimed
from vedette.kernels.association.assignment import Options
from vedette.kernels.association.contention import apply_contention
from vedette.kernels.association.first_detections import (
    candidates_of,
    missed_intensity,
    seen_intensity,
)
from vedette.kernels.association.joined_rows import joined_rows
from vedette.kernels.association.links import linked_factors
from vedette.kernels.association.options import weighed_options_at
from vedette.kernels.association.predicted import Rows, rows_of_scan
from vedette.kernels.association.truncation import Truncation
from vedette.kernels.base.arrays import group_members
from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import FactoredGlmb, Floats, Mixture, Motion, ScanInput, Sensor
from vedette.kernels.gaussian.components import stacked_mixtures
from vedette.kernels.gaussian.mixtures import require_gaussians
from vedette.kernels.labelled.factor_store import has_room_for_single, make_store, stored, with_room
from vedette.kernels.steps.factor_groups import (
    factors_of,
    gather_group,
    groups_of_rows,
    is_single,
    presence_of_rows,
    weigh_singles,
)
from vedette.kernels.steps.factor_updates import (
    CUT,
    DROPPED,
    FULL,
    KEPT,
    REDUCED,
    SPLIT,
    TOTAL,
    TWICE,
    Factoring,
    Work,
    append_parts,
    found_faint,
    make_ranking,
    make_work,
    update_alone,
    update_group,
)
from vedette.kernels.steps.faint_labels import Background, add_to_cells, background_of, with_returned
from vedette.kernels.steps.lmb import Reduction
from vedette.kernels.steps.undetected import (
    Arrivals,
    Left,
    Undetected,
    intensity_at_places,
    left_in_cells,
    predicted_undetected,
)


class FactoredReport(NamedTuple):
    """Sums and truncations of a step."""

    log_total: float  # log of the sum of the kept weights, relative to all measurements being clutter; -inf: none
    log_kept: float  # log of the least share of all weight, within groups, that is kept
    log_clutter: float  # sum of the log clutter intensities of the scan
    num_raised: int  # measurements whose clutter intensity was raised to the floor
    cut: bool  # a ranking stopped at its bound on nodes
    full: bool  # a group has the largest allowed number of hypotheses
    taken_twice: float  # upper bound on the probability that factors of two groups take one measurement
    split_error: float  # summed L1 error of the splits
    reduction_error: float  # summed L1 bound of the changes by merged versions and reduced mixtures
    dropped_existence: float  # summed existence of labels that were dropped, and returned to the undetected targets
    most_labels: int  # of a group


class _Associated(NamedTuple):
    """The rows of a scan, candidates last, and the options of each."""

    rows: Rows
    options: Options
    alone: Alternatives  # options of each label, as if labels were independent
    seen: Rows  # the undetected targets
    log_clutter: float  # as in `FactoredReport`
    num_raised: int
    left_out: Floats  # as in `Candidates`
    log_left_out: float  # as in `Candidates`


@kernel
def _associate(
    prior: FactoredGlmb,
    undetected: Undetected,
    scan: ScanInput,
    motion: Motion,
    sensor: Sensor,
    truncation: Truncation,
    least_logit: float,
) -> _Associated:
    """Weigh the options of all tracks and of the labels that the scan may begin. least_logit: of such a label."""
    rows = rows_of_scan(prior.tracks, scan, motion, sensor)
    weigh_singles(prior, rows)
    log_levels = np.empty(len(scan.measurements.values))
    options, log_clutter, num_raised = weighed_options_at(rows, scan, sensor, truncation, log_levels)
    local = intensity_at_places(undetected)
    seen = seen_intensity(stacked_mixtures(undetected.intensity, local), scan, sensor)
    presence = presence_of_rows(prior, len(rows.log_absent) + len(scan.measurements.values))
    alone = alternatives_of(options, rows.labels, presence[: len(rows.log_absent)])
    unclaimed = log_unclaimed(options, alone) if len(seen.log_absent) > 0 else np.zeros(len(scan.measurements.values))
    label = undetected.step, undetected.first_index
    new = candidates_of(
        seen, len(local.log_weights), scan, sensor, log_levels, unclaimed, truncation.gate, least_logit, label
    )
    if len(new.rows.log_absent) > 0:
        rows, options = joined_rows(rows, options, new.rows, new.options)
        alone = alternatives_of(options, rows.labels, presence[: len(rows.log_absent)])
    return _Associated(rows, options, alone, seen, log_clutter, num_raised, new.left_out, new.log_left_out)


@kernel
def _update_groups(
    prior: FactoredGlmb,
    background: Background,
    found: _Associated,
    truncation: Truncation,
    reduction: Reduction,
    factoring: Factoring,
) -> tuple[FactoredGlmb, Work, float, int]:
    """Return the updated factors, with the sums of the scan in the working arrays.

    Also return the log of the factor by which shared measurements lower the total weight, and the labels of the largest
    group.
    """
    rows, options, alone = found.rows, found.options, found.alone
    factors = factors_of(prior, len(rows.log_absent) - len(prior.tracks.labels))
    sizes, most = factors.num_labels.copy(), truncation.search.max_hypotheses
    leaders = linked_factors(options, alone, factors.row_offsets, sizes, factoring.max_cut, factoring.max_together)
    log_twice = apply_contention(options, groups_of_rows(factors, leaders), alone, rows.offsets)
    offsets, members = group_members(leaders, len(leaders))
    work, ranking, most_labels = make_work(rows, options, background), make_ranking(), 0
    widest = len(work.wide.log_weights)
    store = make_store(len(rows.log_absent), 2 * len(rows.components.log_weights), rows.components)
    for leader in range(len(leaders)):
        together = members[offsets[leader] : offsets[leader + 1]]
        if len(together) == 0 or factors.num_labels[leader] == 0:
            continue
        most_labels = max(most_labels, sizes[leader])
        if len(together) == 1 and is_single(factors, leader):
            if not has_room_for_single(store, widest):
                store = with_room(store, 1, 1, widest, 2, 1)
            update_alone(factors.row_offsets[leader], rows, options, reduction, store, work)
            continue
        group = gather_group(factors, together, rows.labels, options, most, work.place, work.columns)
        posterior, ranking = update_group(group, rows, truncation, ranking, work)
        if len(posterior.hyp_log_weights) > 0:
            store = append_parts(store, posterior, factoring, reduction, most, work)
    return stored(store), work, log_twice, most_labels


@kernel
def step_factored(
    prior: FactoredGlmb,
    undetected: Undetected,
    arrivals: Arrivals,
    scan: ScanInput,
    motion: Motion,
    sensor: Sensor,
    truncation: Truncation,
    reduction: Reduction,
    factoring: Factoring,
) -> tuple[FactoredGlmb, Mixture, Left, FactoredReport]:
    """Weigh, link, update and split at one scan.

    Also return the intensity of targets that stay undetected, and the cells.

    undetected: before the scan. arrivals: since then. At the time of the prior, the scan has a `dt` of 0 and no births.
    """
    if scan.dt > 0.0:
        undetected = predicted_undetected(undetected, motion, scan.dt, arrivals)
    found = _associate(prior, undetected, scan, motion, sensor, truncation, reduction.min_existence_logit)
    background = background_of(undetected)
    density, work, log_twice, most_labels = _update_groups(prior, background, found, truncation, reduction, factoring)
    require_gaussians(density.tracks.components.means, density.tracks.components.covs)
    num = len(undetected.intensity.log_weights)
    missed, log_missed = missed_intensity(found.seen, scan, sensor, num, found.left_out)
    left, sums = left_in_cells(undetected, sensor, scan.pose), work.sums
    log_missed += left.changes[0] if len(left.changes) > 0 else 0.0
    add_to_cells(left.tables, background, undetected.places, found.left_out[num:])
    return (
        density,
        with_returned(missed, left.tables, background, found_faint(work)),
        left,
        FactoredReport(
            sums[TOTAL] + log_twice + log_missed + found.log_left_out,
            sums[KEPT],
            found.log_clutter,
            found.num_raised,
            sums[CUT] > 0.0,
            sums[FULL] > 0.0,
            min(sums[TWICE], 1.0),
            sums[SPLIT],
            sums[REDUCED],
            sums[DROPPED],
            most_labels,
        ),
    )
