"""Labels of targets that have left a sensor's view, which nothing it scans can confirm or deny any more."""

from __future__ import annotations

from typing import TypeVar

import numpy as np

from vedette.densities import Labelled, as_lmb, track_moments
from vedette.densities.label_sets import without_labels
from vedette.fusion import Views
from vedette.models import MeasurementBirth

_Labelled = TypeVar("_Labelled", bound=Labelled)


def without_forgotten(
    belief: _Labelled, birth: MeasurementBirth, views: Views, sensor: int, min_detection: float
) -> tuple[_Labelled, float]:
    """A sensor's own belief without the labels that it cannot see and knows too little of, and their summed existence.

    Not seen is a label that the sensor detects with a probability below `min_detection`, on average over its density.
    Known too little is one of which no place is likelier to hold a target than that of a birth at its most: r / sqrt
    det of the covariance of its position is less than `max_existence` / (std_x std_y). Where such a target comes back
    into view, the birth from its first measurement says more of it than the label.

    views: of all sensors; who has just scanned is not asked.
    """
    lmb = as_lmb(belief)
    covs = track_moments(lmb.tracks)[1][:, :2, :2]
    spread = np.sqrt(np.maximum(covs[:, 0, 0] * covs[:, 1, 1] - covs[:, 0, 1] * covs[:, 1, 0], 0.0))
    vague = lmb.existence * birth.std[0] * birth.std[1] < birth.max_existence * spread
    if not vague.any():
        return belief, 0.0
    unseen = views.if_all_scanned().detection_by(sensor, lmb.tracks) < min_detection
    return without_labels(belief, np.ascontiguousarray(lmb.tracks.labels[vague & unseen]))
