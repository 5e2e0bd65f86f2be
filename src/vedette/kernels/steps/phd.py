"""The Gaussian-mixture PHD filter (Vo and Ma 2006), and the parts that it shares with the CPHD filter.

An intensity is predicted and updated as the single row of a scan: its components are the surviving ones followed by the
birth sites. Its options are a miss or a detection as one of the gated measurements, and never absence.
"""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.association.assignment import MISSED, Options
from vedette.kernels.association.options import weighed_options
from vedette.kernels.association.predicted import Rows, rows_of_scan
from vedette.kernels.association.truncation import Truncation
from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Floats, Mixture, Motion, ScanInput, Sensor, Tracks
from vedette.kernels.gaussian.components import components_like
from vedette.kernels.gaussian.linalg import log_add
from vedette.kernels.gaussian.mixtures import require_gaussians
from vedette.kernels.gaussian.reduction import MixtureCaps, reduce_mixture
from vedette.kernels.steps.assembly import write_updated


class IntensityReport(NamedTuple):
    """Sums and truncations of a step."""

    log_total: float  # log density of the scan relative to clutter alone
    log_clutter: float  # sum of the log clutter intensities of the scan
    num_raised: int  # measurements whose clutter intensity was raised to the floor
    log_kept: float  # log of the share of the cardinality distribution that trimming retains, 0 without trimming


@kernel
def predict_intensity(prior: Mixture, scan: ScanInput, motion: Motion, sensor: Sensor) -> tuple[Rows, float, int]:
    """Return the predicted intensity as one row, survivors before births.

    Also return the log of the weight that died, and the number of components of survivors.
    The births carry the intensity of the multi-Bernoulli birth: the sum of existence times density over the sites.
    """
    num = len(prior.log_weights)
    offsets = np.zeros(2, np.int64)
    offsets[1] = num
    one_track = Tracks(np.zeros((1, 2), np.int64), offsets, prior)
    rows = rows_of_scan(one_track, scan, motion, sensor)
    log_died, num_surviving = rows.log_absent[0], rows.offsets[1]
    all_components = np.zeros(2, np.int64)
    all_components[1] = len(rows.components.log_weights)
    never_absent = np.full(1, -math.inf)
    one_row = Rows(rows.labels[:1], all_components, never_absent, rows.components, rows.innovation)
    return one_row, log_died, num_surviving


@kernel
def corrected_intensity(rows: Rows, options: Options, log_factors: Floats, caps: MixtureCaps) -> Mixture:
    """Return the components of every option times the option's factor, reduced. Their total weight is preserved.

    log_factors: (>= num_options,) log of the factor of each option.
    """
    num_options = options.offsets[1]
    num_components = len(rows.components.log_weights)
    filled = 0
    for option in range(num_options):
        entry = options.entries[option]
        for i in range(entry, entry + num_components):
            if options.component_log_weights[i] > -math.inf:
                filled += 1
    wide, start = components_like(rows.components, filled), 0
    for option in range(num_options):
        end = write_updated(0, option, rows, options, start, wide)
        for c in range(start, end):
            wide.log_weights[c] += log_factors[option]
        start = end
    few = reduce_mixture(wide, caps)
    require_gaussians(few.means, few.covs)
    return few


@kernel
def step_phd(
    prior: Mixture, scan: ScanInput, motion: Motion, sensor: Sensor, truncation: Truncation, caps: MixtureCaps
) -> tuple[Mixture, IntensityReport]:
    """Predict and update with one scan (Vo and Ma 2006, Propositions 1 and 2).

    Each measurement distributes one unit among targets and clutter.
    """
    rows, _, _ = predict_intensity(prior, scan, motion, sensor)
    options, log_clutter, num_raised = weighed_options(rows, scan, sensor, truncation)
    num_options = options.offsets[1]
    log_factors = np.zeros(num_options)
    log_total = 0.0
    for option in range(num_options):
        if options.columns[option] != MISSED:
            # Vo and Ma 2006: each detection's weight over kappa(z) + all weights, here relative to kappa.
            log_factors[option] = -log_add(0.0, options.log_weights[option])
            log_total -= log_factors[option]
    predicted = rows.components.log_weights
    for c in range(len(predicted)):
        log_total -= math.exp(predicted[c]) * rows.innovation.prob_detection[c]
    posterior = corrected_intensity(rows, options, log_factors, caps)
    return posterior, IntensityReport(log_total, log_clutter, num_raised, 0.0)
