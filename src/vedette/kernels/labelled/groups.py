"""Group-wise sums of weights given as logs."""

import math

import numpy as np

from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Floats, Ints


@kernel
def group_log_sums(values: Floats, group_of: Ints, num_groups: int) -> Floats:
    """Log-sum-exp of the values of each group, shape (num_groups,), or -inf for an empty group."""
    peaks, totals = np.full(num_groups, -math.inf), np.zeros(num_groups)
    for i in range(len(values)):
        peaks[group_of[i]] = max(peaks[group_of[i]], values[i])
    for i in range(len(values)):
        if values[i] > -math.inf:
            totals[group_of[i]] += math.exp(values[i] - peaks[group_of[i]])
    for group in range(num_groups):
        if peaks[group] > -math.inf:
            peaks[group] += math.log(totals[group])
    return peaks
