"""The cardinality-balanced multi-Bernoulli filter: one step of Gaussian-mixture Bernoullis (Vo, Vo, Cantoni 2009).

Bernoullis are stored as an LMB with meaningless labels. They are the rows of a scan as those of an LMB are.
"""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.association.assignment import MISSED, Options
from vedette.kernels.association.options import weighed_options
from vedette.kernels.association.predicted import Rows, rows_of_scan
from vedette.kernels.association.truncation import Truncation
from vedette.kernels.base.arrays import group_members
from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Floats, Ints, Lmb, Motion, ScanInput, Sensor, Tracks
from vedette.kernels.gaussian.components import components_between, components_like
from vedette.kernels.gaussian.linalg import log_add
from vedette.kernels.gaussian.mixtures import require_gaussians
from vedette.kernels.gaussian.reduction import MixtureCaps, make_reduction_work
from vedette.kernels.steps.assembly import write_updated
from vedette.kernels.steps.lmb import Reduction, append_reduced, labels_to_keep, weigh_by_existence


class CbMemberReport(NamedTuple):
    """Changes and truncations of a step."""

    num_raised: int  # measurements whose clutter intensity was raised to the floor
    dropped_existence: float  # summed existence of dropped Bernoullis


class Choices(NamedTuple):
    """The options of a scan by measurement."""

    rows: Ints  # (num_options,) row of each option
    missed: Ints  # (num_rows,) option of a missed detection, -1 if there is none
    offsets: Ints  # (num_measurements + 1,) into detections
    detections: Ints  # the detection options of each measurement


@kernel
def list_choices(options: Options, num_measurements: int) -> Choices:
    num_rows = len(options.offsets) - 1
    rows, missed = np.empty(options.offsets[num_rows], np.int64), np.full(num_rows, -1, np.int64)
    for row in range(num_rows):
        for option in range(options.offsets[row], options.offsets[row + 1]):
            rows[option] = row
            if options.columns[option] == MISSED:
                missed[row] = option
    offsets, detections = group_members(options.columns[: options.offsets[num_rows]], num_measurements)
    return Choices(rows, missed, offsets, detections)


@kernel
def existence_logits(rows: Rows, options: Options, choices: Choices) -> Floats:
    """Existence logit of every legacy Bernoulli, one per row, and then of one per measurement, or -inf if none.

    With a = 1 - r, m = r <p, 1 - pD> and o_z = r <p, pD g_z> / kappa(z) of each row, 1 - r <p, pD> is a + m, and
    legacy odds are m / a, those of a measurement (sum of o a / (a + m)^2) / (1 + sum of o m / (a + m)^2): the paper's
    existence probabilities r / (1 - r), with numerator and denominator multiplied out.
    No term is negative, so that nothing cancels.
    """
    num_rows, num_measurements = len(rows.log_absent), len(choices.offsets) - 1
    logits, log_unseen = np.full(num_rows + num_measurements, -math.inf), np.empty(num_rows)
    for row in range(num_rows):
        missed = choices.missed[row]
        if missed >= 0:
            logits[row] = options.log_weights[missed] - rows.log_absent[row]
        log_unseen[row] = log_add(rows.log_absent[row], options.log_weights[missed] if missed >= 0 else -math.inf)
    for j in range(num_measurements):
        present, absent = -math.inf, 0.0
        for i in range(choices.offsets[j], choices.offsets[j + 1]):
            option = choices.detections[i]
            row = choices.rows[option]
            # o / (a + m)^2, the common factor of both sums.
            share = options.log_weights[option] - 2.0 * log_unseen[row]
            present = log_add(present, share + rows.log_absent[row])
            if choices.missed[row] >= 0:
                absent = log_add(absent, share + options.log_weights[choices.missed[row]])
        logits[num_rows + j] = present - absent
    return logits


@kernel
def _possible(logits: Floats) -> Ints:
    """Return the Bernoullis of positive existence."""
    found, num = np.empty(len(logits), np.int64), 0
    for i in range(len(logits)):
        if logits[i] > -math.inf:
            found[num] = i
            num += 1
    return found[:num]


@kernel
def _most_components(sources: Ints, rows: Rows, choices: Choices) -> tuple[int, int]:
    """Return the components of the widest of the kept Bernoullis and of all together, before reduction."""
    num_rows, widest, total = len(rows.log_absent), 0, 0
    for source in sources:
        width = 0
        if source < num_rows:
            width = rows.offsets[source + 1] - rows.offsets[source]
        else:
            for i in range(choices.offsets[source - num_rows], choices.offsets[source - num_rows + 1]):
                row = choices.rows[choices.detections[i]]
                width += rows.offsets[row + 1] - rows.offsets[row]
        widest = max(widest, width)
        total += width
    return widest, total


@kernel
def posterior_mixtures(sources: Ints, rows: Rows, options: Options, choices: Choices, caps: MixtureCaps) -> Tracks:
    """Return the reduced mixture of each kept Bernoulli.

    That is the mixture of a missed row, or of all rows that explain a measurement, weighted by their existence odds.
    """
    num_rows = len(rows.log_absent)
    widest, total = _most_components(sources, rows, choices)
    offsets, labels = np.zeros(len(sources) + 1, np.int64), np.full((len(sources), 2), -1, np.int64)
    out, wide = components_like(rows.components, total), components_like(rows.components, widest)
    work = make_reduction_work(widest, rows.components)
    filled = 0
    for k in range(len(sources)):
        width, source = 0, sources[k]
        if source < num_rows:
            missed = choices.missed[source]
            width = write_updated(source, missed, rows, options, width, wide)
        else:
            for i in range(choices.offsets[source - num_rows], choices.offsets[source - num_rows + 1]):
                option = choices.detections[i]
                row = choices.rows[option]
                end = write_updated(row, option, rows, options, width, wide)
                for c in range(width, end):
                    # r / (1 - r): the odds of a row are its weight over that of its absence.
                    wide.log_weights[c] -= rows.log_absent[row]
                width = end
        filled = append_reduced(wide, width, caps, work, out, filled)
        offsets[k + 1] = filled
    return Tracks(labels, offsets, components_between(out, 0, filled))


@kernel
def _bounded(existence_logit: Floats, most: float) -> tuple[Floats, float]:
    """Return existence logits bounded by `most`, and the expected number of targets removed by this."""
    bounded, lost = existence_logit.copy(), 0.0
    for i in range(len(bounded)):
        if bounded[i] > most:
            lost += 1.0 / (1.0 + math.exp(-bounded[i])) - 1.0 / (1.0 + math.exp(-most))
            bounded[i] = most
    return bounded, lost


@kernel
def step_cb_member(
    prior: Lmb,
    scan: ScanInput,
    motion: Motion,
    sensor: Sensor,
    truncation: Truncation,
    reduction: Reduction,
    max_existence_logit: float,
) -> tuple[Lmb, CbMemberReport]:
    """Predict and update with one scan. max_existence_logit: upper bound on the prior existences."""
    rows = rows_of_scan(prior.tracks, scan, motion, sensor)
    existence_logit, lost = _bounded(prior.existence_logit, max_existence_logit)
    weigh_by_existence(existence_logit, rows)
    options, _, num_raised = weighed_options(rows, scan, sensor, truncation)
    choices = list_choices(options, len(scan.measurements.values))
    logits = existence_logits(rows, options, choices)
    possible = _possible(logits)
    possible_logits = np.empty(len(possible))
    for i in range(len(possible)):
        possible_logits[i] = logits[possible[i]]
    kept, dropped = labels_to_keep(possible_logits, reduction)
    sources, kept_logits = np.empty(len(kept), np.int64), np.empty(len(kept))
    for i in range(len(kept)):
        sources[i], kept_logits[i] = possible[kept[i]], possible_logits[kept[i]]
    tracks = posterior_mixtures(sources, rows, options, choices, reduction.mixture)
    require_gaussians(tracks.components.means, tracks.components.covs)
    return Lmb(tracks, kept_logits), CbMemberReport(num_raised, dropped + lost)
