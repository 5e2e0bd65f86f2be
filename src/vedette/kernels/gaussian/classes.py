"""Class probabilities of Gaussian components: their mean, and their update by the features of a measurement.

The class of a target does not change, and neither its motion nor its detection depends on it. A component is then a
product of a Gaussian and class probabilities, and a measurement with likelihood ratio r(k) of its features for class k
(over those of a false measurement) gives it the factor sum of r(k) p(k), and the probabilities r(k) p(k) over that sum.
"""

from __future__ import annotations

import math

import numpy as np

from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.gaussian.linalg import normalise_logs
from vedette.kernels.gaussian.row_noise import num_class_ratios, row_length


@kernel
def room_for_classes(scan: Floats, meas_dim: int, num_entries: int) -> Floats:
    """Return an array for updated class probabilities, (num_entries, num_classes); 0 classes if the scan has none."""
    return np.empty((num_entries, num_class_ratios(scan.shape[1], meas_dim)))


@inlined
def normalise_classes(log_class_probs: Floats) -> float:
    """Normalise the probabilities of the classes in place; return the log of their sum, 0 without classes.

    All are made equal if the sum is 0: any distribution can be used.
    """
    num = log_class_probs.shape[0]
    if num == 0:
        return 0.0
    log_sum = normalise_logs(log_class_probs)
    if log_sum == -math.inf:
        for k in range(num):
            log_class_probs[k] = -math.log(num)
    return log_sum


@inlined
def update_classes(prior: Floats, measurement: Floats, meas_dim: int, out: Floats) -> float:
    """Write the log class probabilities of a component after a measurement; return the log of its factor.

    prior, out: (num_classes,), as many as the measurement has likelihood ratios of classes.
    """
    first = row_length(meas_dim)
    for k in range(out.shape[0]):
        out[k] = prior[k] + measurement[first + k]
    return normalise_classes(out)


@inlined
def largest_class_ratio(measurement: Floats, meas_dim: int) -> float:
    """Return the largest log likelihood ratio of a class, a bound on the factor of any component; 0 without any."""
    first = row_length(meas_dim)
    if measurement.shape[0] <= first:
        return 0.0
    largest = -math.inf
    for place in range(first, measurement.shape[0]):
        largest = max(largest, measurement[place])
    return largest


@borrowing
def merge_classes(log_class_probs: Floats, chosen: Ints, weights: Floats, count: int, out: Floats) -> None:
    """Write the mean class probabilities of the first `count` of `chosen`, under linear weights, to `out`."""
    total = 0.0
    for i in range(count):
        total += weights[i]
    for k in range(out.shape[0]):
        peak, mean = -math.inf, 0.0
        for i in range(count):
            peak = max(peak, log_class_probs[chosen[i], k])
        if peak > -math.inf:
            for i in range(count):
                share = weights[i] / total if total > 0.0 else 1.0 / count
                mean += share * math.exp(log_class_probs[chosen[i], k] - peak)
        out[k] = peak + math.log(mean) if mean > 0.0 else -math.inf
