"""Noise and likelihood ratio that single measurements bring with them.

The rows of such a scan are longer than a measurement of m components: behind these stand the lower triangle of the
covariance of the row's noise, row by row, and the log likelihood ratio of its features (target over clutter), such as
a signal-to-noise ratio. If targets have classes, one further log likelihood ratio for each class may follow, of
features that differ between them.

A variance of 0 leaves the component to the sensor's noise model. One below 0 is minus a variance that is added to that
of the noise model, such as the error of the sensor's own pose. With a variance of `MISSING` a component was not
measured. The likelihood ratio then makes up for the density of so wide a Gaussian, and clutter has the density of the
other components.
"""

from __future__ import annotations

import math

from vedette.kernels.base.compile import inlined
from vedette.kernels.base.types import Floats

MISSING = 1e16  # variance of a component that was not measured, SI: far above that of any state


@inlined
def row_length(meas_dim: int) -> int:
    """Return the length of a row with noise and likelihood ratio, without ratios of classes."""
    return int(meas_dim + meas_dim * (meas_dim + 1) // 2 + 1)


@inlined
def largest_class_ratio(measurement: Floats, meas_dim: int) -> float:
    """Return the largest log likelihood ratio of a class, a bound on the factor of any component, or 0 without any."""
    first = row_length(meas_dim)
    largest = -math.inf if measurement.shape[0] > first else 0.0
    for place in range(first, measurement.shape[0]):
        largest = max(largest, measurement[place])
    return largest


@inlined
def num_class_ratios(length: int, meas_dim: int) -> int:
    """Return the number of likelihood ratios of classes in a row of this length."""
    return max(length - row_length(meas_dim), 0)


@inlined
def has_own_noise(measurement: Floats, meas_dim: int) -> bool:
    """Return True if a row of a scan, of any length, brings its noise."""
    return measurement.shape[0] > meas_dim


@inlined
def place_of_variance(component: int, meas_dim: int) -> int:
    """Return the place of the variance of a component in a row."""
    return meas_dim + component * (component + 1) // 2 + component


@inlined
def is_missing(measurement: Floats, component: int, meas_dim: int) -> bool:
    """Return True if a component of a row of any length was not measured."""
    return measurement.shape[0] > meas_dim and measurement[place_of_variance(component, meas_dim)] >= MISSING


@inlined
def replace_noise(measurement: Floats, noise: Floats) -> None:
    """Write a measurement's own covariance over that of the noise model (m, m), for the components that have one.

    Components with a noise of their own are uncorrelated with those of the model. Variances below 0 are added.
    """
    m = noise.shape[0]
    if not has_own_noise(measurement, m):
        return
    for a in range(m):
        for b in range(a + 1):
            own, also = measurement[place_of_variance(a, m)], measurement[place_of_variance(b, m)]
            given = measurement[place_of_variance(a, m) - a + b]
            if own < 0.0 and also < 0.0:
                given = noise[a, b] + (abs(given) if a == b else given)
            elif own <= 0.0 and also <= 0.0:
                given = noise[a, b]
            elif own == 0.0 or also == 0.0:
                given = 0.0
            noise[a, b], noise[b, a] = given, given


@inlined
def log_likelihood_ratio(measurement: Floats, meas_dim: int) -> float:
    """Return the log likelihood ratio of a measurement's features, or 0 without any."""
    return measurement[row_length(meas_dim) - 1] if has_own_noise(measurement, meas_dim) else 0.0
