"""The cardinality-balanced multi-Bernoulli filter: one step of Gaussian-mixture Bernoullis (Vo, Vo, Cantoni 2009).

Bernoullis are held as an LMB without meaning in its labels; they are the rows of a scan as those of an LMB are.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.association.assignment import MISSED, Options
from vedette.kernels.association.options import Rows, clutter_levels, list_options
from vedette.kernels.association.truncation import Truncation
from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Floats, Ints, Lmb, Motion, Sensor, Tracks
from vedette.kernels.gaussian.kalman import make_scratch
from vedette.kernels.gaussian.linalg import log_add
from vedette.kernels.gaussian.mixtures import require_gaussians
from vedette.kernels.labelled.labels import group_members
from vedette.kernels.steps.assembly import write_updated
from vedette.kernels.steps.glmb import prepare_rows
from vedette.kernels.steps.lmb import Reduction, append_reduced, labels_to_keep, weigh_by_existence


class CbMemberReport(NamedTuple):
    """num_raised: as in `StepReport`. dropped_existence: summed existence of dropped Bernoullis."""

    num_raised: int
    dropped_existence: float


class Choices(NamedTuple):
    """The options of a scan by measurement.

    rows: (num_options,) row of each option. missed: (num_rows,) option of a missed detection, -1 where there is none.
    offsets, detections: the detections as measurement `j` are `detections[offsets[j]:offsets[j + 1]]`.
    """

    rows: Ints
    missed: Ints
    offsets: Ints
    detections: Ints


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
    """Existence logit of every legacy Bernoulli, one a row, and then of one a measurement; -inf where there is none.

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
            share = options.log_weights[option] - 2.0 * log_unseen[row]
            present = log_add(present, share + rows.log_absent[row])
            if choices.missed[row] >= 0:
                absent = log_add(absent, share + options.log_weights[choices.missed[row]])
        logits[num_rows + j] = present - absent
    return logits


@kernel
def _possible(logits: Floats) -> Ints:
    """Which Bernoullis have any existence."""
    found, num = np.empty(len(logits), np.int64), 0
    for i in range(len(logits)):
        if logits[i] > -math.inf:
            found[num] = i
            num += 1
    return found[:num]


@kernel
def _most_components(sources: Ints, rows: Rows, choices: Choices) -> tuple[int, int]:
    """Components of the widest of the kept Bernoullis and of all together, before reduction."""
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
def posterior_mixtures(sources: Ints, rows: Rows, options: Options, choices: Choices, reduction: Reduction) -> Tracks:
    """The reduced mixture of each kept Bernoulli: of the missed row, or of all rows that explain its
    measurement, weighed by the odds of their existence.
    """
    num_rows, dim = len(rows.log_absent), rows.means.shape[1]
    widest, total = _most_components(sources, rows, choices)
    offsets, labels = np.zeros(len(sources) + 1, np.int64), np.full((len(sources), 2), -1, np.int64)
    log_weights, means, covs = np.empty(total), np.empty((total, dim)), np.empty((total, dim, dim))
    wide_weights, wide_means, wide_covs = np.empty(widest), np.empty((widest, dim)), np.empty((widest, dim, dim))
    filled = 0
    for k in range(len(sources)):
        width, source = 0, sources[k]
        if source < num_rows:
            missed = choices.missed[source]
            width = write_updated(source, missed, rows, options, width, wide_weights, wide_means, wide_covs)
        else:
            for i in range(choices.offsets[source - num_rows], choices.offsets[source - num_rows + 1]):
                option = choices.detections[i]
                row = choices.rows[option]
                end = write_updated(row, option, rows, options, width, wide_weights, wide_means, wide_covs)
                for c in range(width, end):
                    wide_weights[c] -= rows.log_absent[row]
                width = end
        filled = append_reduced(
            wide_weights[:width], wide_means[:width], wide_covs[:width], reduction, filled, log_weights, means, covs
        )
        offsets[k + 1] = filled
    return Tracks(labels, offsets, log_weights[:filled], means[:filled], covs[:filled])


@kernel
def _bounded(existence_logit: Floats, most: float) -> tuple[Floats, float]:
    """Existence of at most a logit, and the expected number of targets that this takes away."""
    bounded, lost = existence_logit.copy(), 0.0
    for i in range(len(bounded)):
        if bounded[i] > most:
            lost += 1.0 / (1.0 + math.exp(-bounded[i])) - 1.0 / (1.0 + math.exp(-most))
            bounded[i] = most
    return bounded, lost


@kernel
def step_cb_member(
    prior: Lmb,
    birth: Lmb,
    scan: Floats,
    pose: Floats,
    dt: float,
    motion: Motion,
    sensor: Sensor,
    truncation: Truncation,
    reduction: Reduction,
    max_existence_logit: float,
) -> tuple[Lmb, CbMemberReport]:
    """One scan. max_existence_logit: prior existences are taken as at most this."""
    scratch = make_scratch(prior.tracks.means.shape[1], len(sensor.angular))
    rows = prepare_rows(prior.tracks, birth, pose, dt, motion, sensor, scratch)
    existence_logit, lost = _bounded(prior.existence_logit, max_existence_logit)
    weigh_by_existence(existence_logit, rows)
    levels = np.empty(len(scan))
    _, num_raised = clutter_levels(sensor, scan, pose, truncation.log_clutter_floor, levels)
    options = list_options(rows, scan, levels, sensor, truncation.gate)
    choices = list_choices(options, len(scan))
    logits = existence_logits(rows, options, choices)
    possible = _possible(logits)
    possible_logits = np.empty(len(possible))
    for i in range(len(possible)):
        possible_logits[i] = logits[possible[i]]
    kept, dropped = labels_to_keep(possible_logits, reduction)
    sources, kept_logits = np.empty(len(kept), np.int64), np.empty(len(kept))
    for i in range(len(kept)):
        sources[i], kept_logits[i] = possible[kept[i]], possible_logits[kept[i]]
    tracks = posterior_mixtures(sources, rows, options, choices, reduction)
    require_gaussians(tracks.means, tracks.covs)
    return Lmb(tracks, kept_logits), CbMemberReport(num_raised, dropped + lost)
