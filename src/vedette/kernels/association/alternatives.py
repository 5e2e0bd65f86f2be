"""Options of each label of a belief at a scan, combined over its versions, with labels treated as independent.

A label with the rows v of probability p_v takes measurement j, if no other label competes for it, with probability

    sum over v of p_v w_vj / (1 - sum over v of p_v (1 - sum over options o of w_vo)),

where w_vo are the weights of the options of a row. Versions of a label exclude each other. Exclusions between labels of
one factor are ignored.
"""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.association.assignment import Options
from vedette.kernels.base.arrays import filled_ints
from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Floats, Ints

LEAST_MISSED = 1e-12  # least probability that a measurement is not taken, for finite odds and logs
_LEAST_PEAK = -700.0  # log weight; ratios to it are finite


class Alternatives(NamedTuple):
    """Detections of each label, and the weight of all its other options, on one scale per label."""

    rows: Ints  # (num_labels + 1,) rows of each label, its versions
    offsets: Ints  # (num_labels + 1,) detections of each label, into the next two
    options: Ints  # (num_detections,) an option that takes the measurement, of one of the versions
    weights: Floats  # (num_detections,) summed over all versions
    undetected: Floats  # (num_labels,) of all other options: missed, dead, or absent


@kernel
def alternatives_of(options: Options, labels: Ints, presence: Floats) -> Alternatives:
    """Return the options of the labels.

    labels: (num_rows, 2) of the rows. Versions of a label are adjacent. presence: (num_rows,) probability of each row
    in its factor, or 1 if absence is one of its options.
    """
    num_rows, num_options = len(labels), options.offsets[-1]
    rows, offsets, undetected = np.zeros(num_rows + 1, np.int64), np.zeros(num_rows + 1, np.int64), np.empty(num_rows)
    examples, weights = np.empty(num_options, np.int64), np.empty(num_options)
    place = filled_ints(options.num_measurements, -1)
    first, filled, num_labels = 0, 0, 0
    while first < num_rows:
        last, there, peak = first, 0.0, _LEAST_PEAK
        while last < num_rows and labels[last, 0] == labels[first, 0] and labels[last, 1] == labels[first, 1]:
            there += presence[last]
            if options.offsets[last + 1] > options.offsets[last]:
                peak = max(peak, options.log_weights[options.offsets[last]])
            last += 1
        rest = max(0.0, 1.0 - there) * math.exp(-peak)
        for row in range(first, last):
            for option in range(options.offsets[row], options.offsets[row + 1]):
                weight, j = presence[row] * math.exp(options.log_weights[option] - peak), options.columns[option]
                if j < 0:
                    rest += weight
                elif weight > 0.0:
                    if place[j] < offsets[num_labels]:
                        place[j], examples[filled], weights[filled] = filled, option, 0.0
                        filled += 1
                    weights[place[j]] += weight
        undetected[num_labels] = rest
        num_labels += 1
        rows[num_labels], offsets[num_labels] = last, filled
        first = last
    ends = num_labels + 1
    return Alternatives(rows[:ends], offsets[:ends], examples[:filled], weights[:filled], undetected[:num_labels])


@kernel
def log_unclaimed(options: Options, alone: Alternatives) -> Floats:
    """Log probability that no track takes each measurement, shape (num_measurements,)."""
    unclaimed = np.zeros(options.num_measurements)
    for label in range(len(alone.undetected)):
        first, last = alone.offsets[label], alone.offsets[label + 1]
        total = alone.undetected[label] + alone.weights[first:last].sum()
        for i in range(first, last):
            missed = max(LEAST_MISSED, 1.0 - alone.weights[i] / total)
            unclaimed[options.columns[alone.options[i]]] += math.log(missed)
    return unclaimed
