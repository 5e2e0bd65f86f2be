"""The Gaussian-mixture PHD filter: one step of the intensity of a Poisson density (Vo and Ma 2006)."""

from __future__ import annotations

import math

import numpy as np

from vedette.kernels.association.assignment import MISSED
from vedette.kernels.association.truncation import Truncation
from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Floats, Lmb, Mixture, Motion, Sensor
from vedette.kernels.gaussian.linalg import log_add
from vedette.kernels.steps.intensity import IntensityReport, corrected_intensity, intensity_options, predict_intensity
from vedette.kernels.steps.lmb import Reduction


@kernel
def step_phd(
    prior: Mixture,
    birth: Lmb,
    scan: Floats,
    pose: Floats,
    dt: float,
    motion: Motion,
    sensor: Sensor,
    truncation: Truncation,
    reduction: Reduction,
) -> tuple[Mixture, IntensityReport]:
    """One scan (Vo and Ma 2006, Propositions 1 and 2): a measurement shares one unit between targets and clutter."""
    rows, _ = predict_intensity(prior, birth, pose, dt, motion, sensor)
    options, log_clutter, num_raised = intensity_options(rows, scan, pose, sensor, truncation)
    num_options = options.offsets[1]
    log_factors = np.zeros(num_options)
    log_total = 0.0
    for option in range(num_options):
        if options.columns[option] != MISSED:
            log_factors[option] = -log_add(0.0, options.log_weights[option])
            log_total -= log_factors[option]
    for c in range(len(rows.log_weights)):
        log_total -= math.exp(rows.log_weights[c]) * rows.innovation.prob_detection[c]
    posterior = corrected_intensity(rows, options, log_factors, reduction)
    return posterior, IntensityReport(log_total, log_clutter, num_raised, 0.0)
