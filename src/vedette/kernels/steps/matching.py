"""Moment matching: one Gaussian of the moments of a row's mixture over its options."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.association.assignment import ABSENT, MISSED, Options
from vedette.kernels.association.predicted import Rows
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.gaussian.innovation import update_mean

# Source of the covariance of a mixture component: the rows, their innovation, or the entries of the options.
PREDICTED = 0
UPDATED = 1
RELINEARISED = 2


class MixtureRoom(NamedTuple):
    """Working arrays for the components of one row's mixture, an entry for each option and component."""

    weights: Floats  # (num_entries,) linear, relative to the likeliest option
    means: Floats  # (num_entries, state_dim), then their deviations from the mean of the mixture
    sources: Ints  # (num_entries,) three times the place of the covariance, and PREDICTED, UPDATED or RELINEARISED


@kernel
def make_mixture(num_entries: int, state_dim: int) -> MixtureRoom:
    """Return arrays for this number of components."""
    return MixtureRoom(np.empty(num_entries), np.empty((num_entries, state_dim)), np.empty(num_entries, np.int64))


@inlined
def _gather(row: int, rows: Rows, options: Options, marginals: Floats, out: MixtureRoom) -> int:
    """Write weights and updated means of the components that may be present, and return their number."""
    first, last, count, peak = rows.offsets[row], rows.offsets[row + 1], 0, -math.inf
    for option in range(options.offsets[row], options.offsets[row + 1]):
        if options.columns[option] != ABSENT:
            peak = max(peak, marginals[option])
    for option in range(options.offsets[row], options.offsets[row + 1]):
        if options.columns[option] == ABSENT or marginals[option] == -math.inf:
            continue
        entry, detected = options.entries[option], options.columns[option] != MISSED
        scale = math.exp(marginals[option] - peak)
        for c in range(first, last):
            at = entry + c - first
            log_weight = options.component_log_weights[at] - options.log_weights[option]
            if log_weight == -math.inf:
                continue
            # The option's marginal, divided among its components; a single Gaussian needs no exponential.
            out.weights[count] = scale if log_weight == 0.0 else scale * math.exp(log_weight)
            if rows.innovation.bends[c] if detected else rows.innovation.at_edge[c]:
                out.sources[count] = 3 * at + RELINEARISED
                for i in range(out.means.shape[1]):
                    out.means[count, i] = options.updated[at, 0, i]
            elif detected:
                out.sources[count] = 3 * c + UPDATED
                update_mean(rows.innovation, c, options.whitened[at], rows.components.means[c], out.means[count])
            else:
                out.sources[count] = 3 * c + PREDICTED
                for i in range(out.means.shape[1]):
                    out.means[count, i] = rows.components.means[c, i]
            count += 1
    return count


@inlined
def _gather_predicted(row: int, rows: Rows, out: MixtureRoom) -> int:
    """Write the components as predicted, all with the same weight, and return their number."""
    first, last = rows.offsets[row], rows.offsets[row + 1]
    for c in range(first, last):
        out.weights[c - first], out.sources[c - first] = 1.0, 3 * c + PREDICTED
        for i in range(out.means.shape[1]):
            out.means[c - first, i] = rows.components.means[c, i]
    return last - first


@inlined
def _moments(
    count: int, rows: Rows, options: Options, mixture: MixtureRoom, out_mean: Floats, out_cov: Floats, n: int
) -> None:
    """Write the mean and covariance of the first `count` components. Their means become deviations from the mean."""
    weights, means, sources = mixture.weights, mixture.means, mixture.sources
    total = 0.0
    for k in range(count):
        total += weights[k]
    for i in range(n):
        moment = 0.0
        for k in range(count):
            moment += weights[k] * means[k, i]
        out_mean[i] = moment / total
        for k in range(count):
            means[k, i] -= out_mean[i]
        for j in range(i + 1):
            out_cov[i, j] = 0.0
    # All detections of a component that does not bend share one posterior covariance: only means were gathered.
    for k in range(count):
        c, share = sources[k] // 3, weights[k] / total
        if sources[k] % 3 == RELINEARISED:
            for i in range(n):
                for j in range(i + 1):
                    out_cov[i, j] += share * (options.updated[c, 1 + i, j] + means[k, i] * means[k, j])
        elif sources[k] % 3 == UPDATED:
            for i in range(n):
                for j in range(i + 1):
                    out_cov[i, j] += share * (rows.innovation.covs[c, i, j] + means[k, i] * means[k, j])
        else:
            for i in range(n):
                for j in range(i + 1):
                    out_cov[i, j] += share * (rows.components.covs[c, i, j] + means[k, i] * means[k, j])
    for i in range(n):
        for j in range(i):
            out_cov[j, i] = out_cov[i, j]


@borrowing
def match_rows(
    chosen: Ints, rows: Rows, options: Options, marginals: Floats, mixture: MixtureRoom, means: Floats, covs: Floats
) -> None:
    """Write the mean and covariance of the mixture of each chosen row, given presence, over its options and components.

    marginals: log probability of each option. mixture: working arrays. means, covs: (len(chosen), ...) the result. A
    row that cannot be present keeps its predicted moments.
    """
    for k in range(len(chosen)):
        count = _gather(chosen[k], rows, options, marginals, mixture)
        if count == 0:
            count = _gather_predicted(chosen[k], rows, mixture)
        # The compiler unrolls loops of constant size.
        if means.shape[1] == 4:
            _moments(count, rows, options, mixture, means[k], covs[k], 4)
        else:
            _moments(count, rows, options, mixture, means[k], covs[k], means.shape[1])
