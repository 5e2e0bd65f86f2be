"""The Gaussian-mixture PHD filter: one step of the intensity of a Poisson density (Vo and Ma 2006)."""

from __future__ import annotations

import math

import numpy as np

from vedette.kernels.association.assignment import MISSED
from vedette.kernels.association.options import weighed_options
from vedette.kernels.association.truncation import Truncation
from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Mixture, Motion, ScanInput, Sensor
from vedette.kernels.gaussian.linalg import log_add
from vedette.kernels.gaussian.mixtures import MixtureCaps
from vedette.kernels.steps.intensity import IntensityReport, corrected_intensity, predict_intensity


@kernel
def step_phd(
    prior: Mixture, scan: ScanInput, motion: Motion, sensor: Sensor, truncation: Truncation, caps: MixtureCaps
) -> tuple[Mixture, IntensityReport]:
    """One scan (Vo and Ma 2006, Propositions 1 and 2): a measurement shares one unit between targets and clutter."""
    rows, _ = predict_intensity(prior, scan, motion, sensor)
    options, log_clutter, num_raised = weighed_options(rows, scan, sensor, truncation)
    num_options = options.offsets[1]
    log_factors = np.zeros(num_options)
    log_total = 0.0
    for option in range(num_options):
        if options.columns[option] != MISSED:
            # Vo and Ma 2006: each detection's weight over kappa(z) + all weights, here relative to kappa.
            log_factors[option] = -log_add(0.0, options.log_weights[option])
            log_total -= log_factors[option]
    for c in range(len(rows.log_weights)):
        log_total -= math.exp(rows.log_weights[c]) * rows.innovation.prob_detection[c]
    posterior = corrected_intensity(rows, options, log_factors, caps)
    return posterior, IntensityReport(log_total, log_clutter, num_raised, 0.0)
