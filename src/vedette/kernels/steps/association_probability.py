"""Probability that existing tracks explain each measurement, so that births can use the others."""

import math

import numpy as np

from vedette.kernels.association.options import weighed_options
from vedette.kernels.association.predicted import standing_rows_of_scan
from vedette.kernels.association.truncation import Truncation
from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Floats, Lmb, ScanInput, Sensor
from vedette.kernels.steps.field_of_view import in_view, marked
from vedette.kernels.steps.lmb import weigh_by_existence


@kernel
def prob_explained(belief: Lmb, scan: ScanInput, sensor: Sensor, truncation: Truncation) -> Floats:
    """Probability that each measurement is of a track, without competition between tracks, shape (num_measurements,).

    sum over labels of r <p, p_D g(z | .)> / (kappa(z) + the same sum).
    """
    seen = marked(belief, in_view(belief.tracks, scan, sensor, truncation))
    rows = standing_rows_of_scan(seen.tracks, scan, sensor)
    weigh_by_existence(seen.existence_logit, rows)
    options, _, _ = weighed_options(rows, scan, sensor, truncation)
    odds = np.zeros(len(scan.measurements.values))
    for option in range(options.offsets[-1]):
        if options.columns[option] >= 0:
            odds[options.columns[option]] += math.exp(options.log_weights[option])
    for j in range(len(odds)):
        odds[j] = odds[j] / (1.0 + odds[j]) if odds[j] < math.inf else 1.0
    return odds
