"""Bernoullis as additive rows of numbers: the information of several sensors' scans about a label is the sum of rows.

A Bernoulli of existence r and Gaussian density p, raised to a power, as a function of u = x - reference, has the
*Bernoulli row*

    information row of p (`vedette.kernels.gaussian.information`), then logit r, then log (1 - q):
    bernoulli_size(dim) = row_size(dim) + 2 numbers,

where q is the probability that the label was detected at all. Rows of independent evidence add, GCI scales rows by its
weights and adds them, and the existence of a sum is its logit plus the log integral of its information row: the
Bernoulli family is exponential. A *change* is the row after scans minus the row without scans.
"""

import math
from typing import NamedTuple

from vedette.kernels.base.compile import borrowing, inlined
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.gaussian.information import row_size

# Logit of certain and impossible targets, whose exponential is still finite.
ALL_BUT_CERTAIN = 700.0

# Lower limit of the probability of missing a target, so that no detection is certain.
LEAST_MISS = 1e-12

_SAME_POWER = 1e-12


class Table(NamedTuple):
    """The changes of a decision: for every course of every sensor, the labels in reach and their changes."""

    first_courses: Ints  # (num_sensors + 1,) first course of each sensor
    offsets: Ints  # (num_courses + 1,) first entry of each course
    labels: Ints  # (num_entries,) increasing within a course
    changes: Floats  # (num_entries, bernoulli_size, num_samples): samples side by side
    start: Floats  # (num_labels, bernoulli_size) rows of the joint density without any scan
    powers: Floats  # (num_sensors,) exponents of the sensors' densities


@borrowing
def bernoulli_size(dim: int) -> int:
    """Return the length of the Bernoulli row of a state of `dim` components."""
    return row_size(dim) + 2


@inlined
def log_miss(detection: float) -> float:
    """Return log (1 - P_D), at least that of `LEAST_MISS`."""
    return math.log(max(1.0 - detection, LEAST_MISS))


@inlined
def normalise_powers(rows: Floats) -> None:
    """Rescale rows whose powers do not sum to one, because some sensors do not have the label.

    rows: (bernoulli_size, num_samples).
    """
    powers = rows[rows.shape[0] - 3]
    for sample in range(rows.shape[1]):
        power = powers[sample]
        if abs(power - 1.0) > _SAME_POWER and power > 0.0:
            scale = 1.0 / power
            for k in range(rows.shape[0] - 2):
                rows[k, sample] *= scale
