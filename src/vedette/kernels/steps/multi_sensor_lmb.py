"""LMB of the exact posterior's existences and densities, from the combinations of all tracks at all sensors."""

import math

import numpy as np

from vedette.kernels.association.marginals import MarginalSums
from vedette.kernels.association.predicted import Rows
from vedette.kernels.association.truncation import Truncation
from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Floats, Ints, Lmb, ScanInput, Sensor, Tracks
from vedette.kernels.gaussian.components import components_between, components_like, copy_component
from vedette.kernels.gaussian.linalg import log_add, log_sum
from vedette.kernels.gaussian.mixtures import require_gaussians
from vedette.kernels.gaussian.reduction import MixtureCaps, make_reduction_work
from vedette.kernels.steps.lmb import LmbReport, Reduction, append_reduced, labels_to_keep
from vedette.kernels.steps.multi_sensor_choices import Choices
from vedette.kernels.steps.multi_sensor_combinations import Combinations, extend_combinations
from vedette.kernels.steps.multi_sensor_marginals import StateCaps, choice_marginals

_LEAST_LOGIT = -1e300  # of a positive existence


@kernel
def _likely_choices(combinations: Combinations, log_least_odds: float) -> tuple[Choices, Ints, float]:
    """Return the choices of every track, without measured ones that are surely less probable than a bound.

    For each joint choice with a combination of weight w, there is one with a combination of weight v in which the track
    takes no measurement, so the probability of the former is at most w / (v + w). Also returns the combination of each
    choice, and the log of a lower bound on the retained share of weight.
    """
    rows, num_tracks, num = combinations.rows, len(combinations.log_absent), len(combinations.tracks)
    log_weights, log_free, log_kept = np.empty(num), combinations.log_absent.copy(), 0.0
    for i in range(num):
        log_weights[i] = log_sum(rows.components.log_weights[rows.offsets[i] : rows.offsets[i + 1]])
        if combinations.columns[i].max() < 0:
            log_free[combinations.tracks[i]] = log_add(log_free[combinations.tracks[i]], log_weights[i])
    offsets, kept, count = np.zeros(num_tracks + 1, np.int64), np.empty(num, np.int64), 0
    for i in range(num):
        odds = log_weights[i] - log_free[combinations.tracks[i]]
        if combinations.columns[i].max() >= 0 and odds < log_least_odds:
            log_kept -= log_add(0.0, odds)
            continue
        kept[count], log_weights[count] = i, log_weights[i]
        offsets[combinations.tracks[i] + 1] += 1
        count += 1
    columns = np.empty((count, combinations.columns.shape[1]), np.int64)
    for choice in range(count):
        columns[choice] = combinations.columns[kept[choice]]
    for track in range(num_tracks):
        offsets[track + 1] += offsets[track]
    return Choices(offsets, columns, log_weights[:count], combinations.log_absent), kept[:count], log_kept


@kernel
def _logits(choices: Choices, marginals: Floats, absent: Floats) -> Floats:
    """Return the log odds of each track's existence, or -inf if it cannot exist."""
    logits = np.empty(len(absent))
    for track in range(len(absent)):
        present = -math.inf
        for choice in range(choices.offsets[track], choices.offsets[track + 1]):
            present = log_add(present, marginals[choice])
        logits[track] = present - absent[track] if present > -math.inf else -math.inf
    return logits


@kernel
def _widths(chosen: Ints, rows: Rows, choices: Choices, sources: Ints) -> tuple[int, int]:
    """Return the largest number of components of a chosen track, and the number of all chosen tracks together."""
    widest, total = 0, 0
    for track in chosen:
        width = 0
        for source in sources[choices.offsets[track] : choices.offsets[track + 1]]:
            width += rows.offsets[source + 1] - rows.offsets[source]
        widest, total = max(widest, width), total + width
    return widest, total


@kernel
def _reduced_tracks(
    chosen: Ints, rows: Rows, choices: Choices, sources: Ints, marginals: Floats, caps: MixtureCaps
) -> Tracks:
    """Return each chosen track's mixture over its combinations, reduced."""
    components = rows.components
    widest, total = _widths(chosen, rows, choices, sources)
    labels, offsets = np.empty((len(chosen), 2), np.int64), np.zeros(len(chosen) + 1, np.int64)
    out, wide = components_like(components, total), components_like(components, widest)
    work = make_reduction_work(widest, components)
    filled = 0
    for i in range(len(chosen)):
        width = 0
        for choice in range(choices.offsets[chosen[i]], choices.offsets[chosen[i] + 1]):
            source = sources[choice]
            labels[i, 0], labels[i, 1] = rows.labels[source, 0], rows.labels[source, 1]
            for c in range(rows.offsets[source], rows.offsets[source + 1]):
                weight = components.log_weights[c] + marginals[choice] - choices.log_weights[choice]
                if weight > -math.inf:
                    copy_component(components, c, wide, width)
                    wide.log_weights[width] = weight
                    width += 1
        filled = append_reduced(wide, width, caps, work, out, filled)
        offsets[i + 1] = filled
    return Tracks(labels, offsets, components_between(out, 0, filled))


@kernel
def lmb_of_combinations(
    combinations: Combinations, num_columns: int, truncation: Truncation, reduction: Reduction
) -> tuple[Lmb, LmbReport]:
    """Associate, marginalise and reduce the combinations. The caller accounts for clutter.

    num_columns: number of measurements of all sensors. A track that cannot exist has no density, and is always dropped.
    """
    reduction = Reduction(reduction.mixture, max(reduction.min_existence_logit, _LEAST_LOGIT), reduction.max_labels)
    choices, sources, log_kept = _likely_choices(combinations, reduction.min_existence_logit)
    marginals, absent = np.empty(len(sources)), np.empty(len(choices.log_absent))
    caps = StateCaps(truncation.search.max_hypotheses, truncation.search.max_log_gap)
    log_total, num_inexact, log_summed = choice_marginals(choices, num_columns, caps, marginals, absent)
    logits = _logits(choices, marginals, absent)
    chosen, dropped = labels_to_keep(logits, reduction)
    tracks = _reduced_tracks(chosen, combinations.rows, choices, sources, marginals, reduction.mixture)
    require_gaussians(tracks.components.means, tracks.components.covs)
    chosen_logits = np.empty(len(chosen))
    for i in range(len(chosen)):
        chosen_logits[i] = logits[chosen[i]]
    sums = MarginalSums(log_total, num_inexact, log_kept + log_summed)
    return Lmb(tracks, chosen_logits), LmbReport(sums, 0.0, 0, dropped, False)


@kernel
def update_lmb(
    combinations: Combinations, scan: ScanInput, sensor: Sensor, truncation: Truncation, reduction: Reduction
) -> tuple[Lmb, LmbReport]:
    """Return the LMB after one sensor's scan. `combinations` are those before the scan, at its time."""
    taken, seen = extend_combinations(combinations, 0, 0, scan, sensor, truncation)
    posterior, report = lmb_of_combinations(taken, len(scan.measurements.values), truncation, reduction)
    sums = MarginalSums(report.sums.log_total, report.sums.num_ranked, report.sums.log_kept + seen.log_kept)
    cut = seen.log_kept < 0.0
    return posterior, LmbReport(sums, seen.log_clutter, seen.num_raised, report.dropped_existence, cut)
