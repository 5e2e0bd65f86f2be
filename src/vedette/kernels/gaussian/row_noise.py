"""Noise and likelihood ratios that single measurements bring with them, see `Measurements`.

Each field of `Measurements` is there for all rows of a scan or empty. A component with an infinite variance was not
measured. For it, an update has a variance so large that it has no effect, and the likelihood ratio of the row makes up
for the density of so wide a Gaussian, while clutter has the density of the other components.
"""

import math

import numpy as np

from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Measurements, RowNoise

MISSING = 1e16  # variance of a component that was not measured, SI: far above that of any state
_LOG_RATIO_OF_MISSING = 0.5 * math.log(2.0 * math.pi * MISSING)


@kernel
def bare_measurements(values: Floats) -> Measurements:
    """Return measurements (num, meas_dim) that bring nothing."""
    dim = values.shape[1]
    return Measurements(values, np.empty((0, dim, dim)), np.empty((0, dim, dim)), np.empty(0), np.empty((0, 0)))


@inlined
def first_measurements(measurements: Measurements, num: int) -> Measurements:
    """Return the first rows as views."""
    return Measurements(
        measurements.values[:num],
        measurements.noise[:num],
        measurements.added_noise[:num],
        measurements.log_ratios[:num],
        measurements.class_ratios[:num],
    )


@inlined
def bring_noise(measurements: Measurements) -> bool:
    """Return True if the rows bring noise, so that each needs an update of its own."""
    return len(measurements.noise) + len(measurements.added_noise) > 0


@inlined
def noise_of_row(measurements: Measurements, j: int) -> RowNoise:
    """Return the noise of row `j`, as views."""
    return RowNoise(measurements.noise[j : j + 1], measurements.added_noise[j : j + 1])


@inlined
def no_row_noise(covs: Floats) -> RowNoise:
    """Return the noise of a row that brings none, as views of any (num, meas_dim, meas_dim)."""
    return RowNoise(covs[:0], covs[:0])


@inlined
def replace_noise(row: RowNoise, noise: Floats) -> None:
    """Write a row's own covariance over that of the noise model (m, m), for components that have one, and add to it.

    Components with a noise of their own are uncorrelated with those of the model.
    """
    has_own, is_added = len(row.own) > 0, len(row.added) > 0
    for a in range(noise.shape[0] if has_own or is_added else 0):
        for b in range(a + 1):
            first, second = (row.own[0, a, a], row.own[0, b, b]) if has_own else (0.0, 0.0)
            given = noise[a, b]
            if first == math.inf or second == math.inf:
                given = MISSING if a == b else 0.0
            else:
                if first > 0.0 and second > 0.0:
                    given = row.own[0, a, b]
                elif first > 0.0 or second > 0.0:
                    given = 0.0
                if is_added:
                    given += row.added[0, a, b]
            noise[a, b], noise[b, a] = given, given


@borrowing
def replace_all_noise(measurements: Measurements, covs: Floats) -> None:
    """Write the covariances of the rows over those of the noise model (num, m, m), see `replace_noise`."""
    for j in range(len(covs)):
        replace_noise(noise_of_row(measurements, j), covs[j])


@inlined
def log_likelihood_ratio(measurements: Measurements, j: int) -> float:
    """Return the log likelihood ratio of the features of row `j`, 0 without any, made up for what is missing."""
    total = measurements.log_ratios[j] if len(measurements.log_ratios) > 0 else 0.0
    for a in range(measurements.values.shape[1] if len(measurements.noise) > 0 else 0):
        if measurements.noise[j, a, a] == math.inf:
            total += _LOG_RATIO_OF_MISSING
    return float(total)


@borrowing
def largest_class_ratio(measurements: Measurements, j: int) -> float:
    """Return the largest log likelihood ratio of a class, a bound on the factor of any component, or 0 without any."""
    num = measurements.class_ratios.shape[1]
    largest = -math.inf if num > 0 else 0.0
    for k in range(num):
        largest = max(largest, measurements.class_ratios[j, k])
    return largest


@inlined
def mark_missing(measurements: Measurements, j: int, out: Floats) -> None:
    """Write the values of row `j`, (meas_dim,), with NaN for components that were not measured."""
    for a in range(len(out)):
        is_missing = measurements.noise[j, a, a] == math.inf
        out[a] = math.nan if is_missing else measurements.values[j, a]
