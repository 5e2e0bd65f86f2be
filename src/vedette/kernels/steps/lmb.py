"""Joint prediction and update of an LMB density (Reuter, Vo, Vo, Dietmayer 2014), with exact association marginals.

The update of an LMB is a GLMB. It is projected to the LMB of the same existence probabilities and track moments. Both
are sums over the options of a row weighted by their marginal probabilities, so that the GLMB itself is never listed:

    r+ = sum over the options but absence of P(option),   p+ = sum of P(option) p(x | option) / r+.

A planner runs the same kernels in its own workspace (`vedette.kernels.planning.pseudo_lmb`).
"""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.association.assignment import ABSENT, Options
from vedette.kernels.association.marginals import Association, MarginalSums, option_marginals
from vedette.kernels.association.options import weighed_options
from vedette.kernels.association.predicted import Rows, rows_of_scan
from vedette.kernels.association.truncation import Truncation
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Ints, Lmb, Mixture, Motion, ScanInput, Sensor, Tracks
from vedette.kernels.gaussian.components import components_between, components_like, copy_component
from vedette.kernels.gaussian.linalg import log_add, normalise_logs
from vedette.kernels.gaussian.mixtures import descending_order, require_gaussians
from vedette.kernels.gaussian.reduction import MixtureCaps, ReductionWork, make_reduction_work, reduce_into
from vedette.kernels.steps.assembly import write_updated


class Reduction(NamedTuple):
    """Limits on track mixtures and on the label set."""

    mixture: MixtureCaps  # of each track
    min_existence_logit: float  # labels less probable than this are dropped
    max_labels: int  # largest number of the others


class LmbReport(NamedTuple):
    """Sums and truncations of a step."""

    sums: MarginalSums  # its total is relative to all measurements being clutter
    log_clutter: float  # sum of the log clutter intensities of the scan
    num_raised: int  # measurements whose clutter intensity was raised to the floor
    dropped_existence: float  # summed existence of dropped labels
    cut: bool  # whether a track had more options than a cap allows


@inlined
def _log_presence(logit: float) -> tuple[float, float]:
    """Return log existence and log (1 - existence)."""
    if logit >= 0.0:
        log_existence = -math.log1p(math.exp(-logit))
        # The one of the two near 0 is computed by log1p, and the other one from the difference.
        return log_existence, log_existence - logit
    log_absence = -math.log1p(math.exp(logit))
    return log_absence + logit, log_absence


@borrowing
def weigh_by_existence(existence_logit: Floats, rows: Rows) -> None:
    """Apply the prior existence of the tracks to the first rows, which were predicted as certain."""
    for i in range(len(existence_logit)):
        log_existence, log_absence = _log_presence(existence_logit[i])
        # Absent: never present, or died.
        rows.log_absent[i] = log_add(log_absence, log_existence + rows.log_absent[i])
        for c in range(rows.offsets[i], rows.offsets[i + 1]):
            rows.components.log_weights[c] += log_existence


@borrowing
def fill_existence(options: Options, marginals: Floats, logits: Floats) -> None:
    """Write the posterior existence logit of every row."""
    for row in range(len(options.offsets) - 1):
        present, absent = -math.inf, -math.inf
        for option in range(options.offsets[row], options.offsets[row + 1]):
            if options.columns[option] == ABSENT:
                # The logit uses both sides, never 1 - r: no loss of precision for existence near 1.
                absent = marginals[option]
            else:
                present = log_add(present, marginals[option])
        logits[row] = present - absent


@kernel
def labels_to_keep(logits: Floats, reduction: Reduction) -> tuple[Ints, float]:
    """Return the rows to keep, in label order, and the expected number of targets lost with the others."""
    marks = np.zeros(len(logits), np.int64)
    kept, dropped = 0, 0.0
    for row in descending_order(logits):
        if kept < reduction.max_labels and logits[row] >= reduction.min_existence_logit:
            marks[row] = 1
            kept += 1
        else:
            dropped += 1.0 / (1.0 + math.exp(-logits[row]))
    rows = np.empty(kept, np.int64)
    kept = 0
    for row in range(len(logits)):
        if marks[row] == 1:
            rows[kept] = row
            kept += 1
    return rows, dropped


@kernel
def _most_components(kept: Ints, rows: Rows, options: Options) -> tuple[int, int]:
    """Return the components of the widest row and of all kept rows together, before reduction."""
    widest, total = 0, 0
    for row in kept:
        width = (rows.offsets[row + 1] - rows.offsets[row]) * max(1, options.offsets[row + 1] - options.offsets[row])
        widest = max(widest, width)
        total += width
    return widest, total


@borrowing
def write_mixture(row: int, rows: Rows, options: Options, marginals: Floats, wide: Mixture) -> int:
    """Write a row's components over all its options except absence, weighted by their probabilities.

    Return their number.
    """
    width = 0
    for option in range(options.offsets[row], options.offsets[row + 1]):
        if options.columns[option] == ABSENT or marginals[option] == -math.inf:
            continue
        end = write_updated(row, option, rows, options, width, wide)
        for c in range(width, end):
            wide.log_weights[c] += marginals[option] - options.log_weights[option]
        width = end
    if width == 0:
        # Existence 0: any valid density can be used.
        for c in range(rows.offsets[row], rows.offsets[row + 1]):
            copy_component(rows.components, c, wide, width)
            wide.log_weights[width] = 0.0
            width += 1
    return width


@kernel
def _reduced_tracks(kept: Ints, rows: Rows, options: Options, marginals: Floats, caps: MixtureCaps) -> Tracks:
    """Return each kept row's mixture over its options, reduced."""
    widest, total = _most_components(kept, rows, options)
    labels, offsets = np.empty((len(kept), 2), np.int64), np.zeros(len(kept) + 1, np.int64)
    out, wide = components_like(rows.components, total), components_like(rows.components, widest)
    work = make_reduction_work(widest, rows.components)
    filled = 0
    for i in range(len(kept)):
        row = kept[i]
        labels[i, 0], labels[i, 1] = rows.labels[row, 0], rows.labels[row, 1]
        width = write_mixture(row, rows, options, marginals, wide)
        filled = append_reduced(wide, width, caps, work, out, filled)
        offsets[i + 1] = filled
    return Tracks(labels, offsets, components_between(out, 0, filled))


@borrowing
def append_reduced(wide: Mixture, width: int, caps: MixtureCaps, work: ReductionWork, out: Mixture, filled: int) -> int:
    """Append the first `width` components, reduced and with weights normalised to one, and return the new end."""
    if width == 1 and wide.log_weights[0] > -math.inf:
        # A single component needs no reduction: most births, which have no measurements.
        copy_component(wide, 0, out, filled)
        out.log_weights[filled] = 0.0
        return filled + 1
    end = reduce_into(wide, width, caps, work, out, filled)
    normalise_logs(out.log_weights[filled:end])
    return end


@kernel
def step_lmb(
    prior: Lmb,
    scan: ScanInput,
    motion: Motion,
    sensor: Sensor,
    truncation: Truncation,
    reduction: Reduction,
    association: Association | None,
) -> tuple[Lmb, LmbReport]:
    """Predict and update with one scan.

    scan: its `dt` is 0 at the time of the prior, without births then. association: None for the sums over clusters.
    """
    rows = rows_of_scan(prior.tracks, scan, motion, sensor)
    weigh_by_existence(prior.existence_logit, rows)
    options, log_clutter, num_raised = weighed_options(rows, scan, sensor, truncation)
    marginals, sums = option_marginals(options, truncation.search, association)
    logits = np.empty(len(rows.log_absent))
    fill_existence(options, marginals, logits)
    kept, dropped = labels_to_keep(logits, reduction)
    tracks = _reduced_tracks(kept, rows, options, marginals, reduction.mixture)
    require_gaussians(tracks.components.means, tracks.components.covs)
    kept_logits = np.empty(len(kept))
    for i in range(len(kept)):
        kept_logits[i] = logits[kept[i]]
    return Lmb(tracks, kept_logits), LmbReport(sums, log_clutter, num_raised, dropped, False)
