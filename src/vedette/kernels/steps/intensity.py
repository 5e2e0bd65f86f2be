"""What the PHD and CPHD filters share: an intensity is predicted and seen as the one row of a scan.

Its components are the surviving ones followed by the birth sites; its options are to be missed or detected as one of
the gated measurements, and never to be absent.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.association.assignment import Options
from vedette.kernels.association.options import Rows, clutter_levels, list_options
from vedette.kernels.association.truncation import Truncation
from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Floats, Lmb, Mixture, Motion, Sensor, Tracks
from vedette.kernels.gaussian.kalman import make_scratch
from vedette.kernels.gaussian.mixtures import reduce_mixture, require_gaussians
from vedette.kernels.steps.assembly import write_updated
from vedette.kernels.steps.glmb import prepare_rows
from vedette.kernels.steps.lmb import Reduction


class IntensityReport(NamedTuple):
    """log_total: log density of the scan relative to clutter alone. log_clutter, num_raised: as in `StepReport`.
    log_kept: log of the share of the cardinality distribution that trimming left (0 where there is none).
    """

    log_total: float
    log_clutter: float
    num_raised: int
    log_kept: float


@kernel
def predict_intensity(
    prior: Mixture, birth: Lmb, pose: Floats, dt: float, motion: Motion, sensor: Sensor
) -> tuple[Rows, float]:
    """The predicted intensity as one row, survivors before births, and the log of the weight that died.

    The births carry the intensity of the multi-Bernoulli birth: the sum of existence times density over the sites.
    """
    num = len(prior.log_weights)
    offsets = np.zeros(2, np.int64)
    offsets[1] = num
    one_track = Tracks(np.zeros((1, 2), np.int64), offsets, prior.log_weights, prior.means, prior.covs)
    scratch = make_scratch(prior.means.shape[1], len(sensor.angular))
    rows = prepare_rows(one_track, birth, pose, dt, motion, sensor, scratch)
    log_died = rows.log_absent[0]
    all_components = np.zeros(2, np.int64)
    all_components[1] = len(rows.log_weights)
    never_absent = np.full(1, -math.inf)
    one_row = Rows(
        rows.labels[:1], all_components, never_absent, rows.log_weights, rows.means, rows.covs, rows.innovation
    )
    return one_row, log_died


@kernel
def intensity_options(
    rows: Rows, scan: Floats, pose: Floats, sensor: Sensor, truncation: Truncation
) -> tuple[Options, float, int]:
    """The options of the one row, the sum of the log clutter intensities, and how many of them were raised."""
    levels = np.empty(len(scan))
    log_clutter, num_raised = clutter_levels(sensor, scan, pose, truncation.log_clutter_floor, levels)
    return list_options(rows, scan, levels, sensor, truncation.gate), log_clutter, num_raised


@kernel
def corrected_intensity(rows: Rows, options: Options, log_factors: Floats, reduction: Reduction) -> Mixture:
    """The components of every option times the option's factor, reduced; their total weight is kept.

    log_factors: (>= num_options,) log of the factor of each option.
    """
    num_options = options.offsets[1]
    num_components, dim = rows.means.shape
    filled = 0
    for option in range(num_options):
        entry = options.entries[option]
        for i in range(entry, entry + num_components):
            if options.component_log_weights[i] > -math.inf:
                filled += 1
    log_weights, means, covs = np.empty(filled), np.empty((filled, dim)), np.empty((filled, dim, dim))
    start = 0
    for option in range(num_options):
        end = write_updated(0, option, rows, options, start, log_weights, means, covs)
        for c in range(start, end):
            log_weights[c] += log_factors[option]
        start = end
    few_weights, few_means, few_covs = reduce_mixture(
        log_weights, means, covs, reduction.log_min_weight, reduction.merge_distance, reduction.max_components
    )
    require_gaussians(few_means, few_covs)
    return Mixture(few_weights, few_means, few_covs)
