"""LMB posteriors on the labels of their common prediction, and what they say of existences."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vedette.densities import LMB
from vedette.densities.label_sets import places_of
from vedette.errors import InputError, NumericalError
from vedette.fusion.base import FusionLimits, power_rule
from vedette.fusion.lmbs import sum_over_sensors
from vedette.fusion.tracks import reduced_tracks
from vedette.kernels.base.types import Floats, Ints, Tracks
from vedette.kernels.labelled.stacking import stack_tracks


class Posteriors(NamedTuple):
    """The sensors' posteriors on the labels of the prediction."""

    chosen: Ints  # (num_labels, num_sensors) place in `tracks`, -1 where the sensor lacks the label
    tracks: Tracks  # of all sensors
    logits: Floats  # (num_labels, num_sensors)


def single_tracks(belief: LMB) -> Tracks:
    """The tracks, each of one Gaussian."""
    tracks = belief.tracks.to_kernel()
    return reduced_tracks(tracks, power_rule("moment_matched", FusionLimits(), belief.state_dim))


def posteriors_of(prediction: LMB, beliefs: Sequence[LMB], missing_existence: float) -> Posteriors:
    """The posteriors aligned. Raises `InputError` for a label that the prediction lacks."""
    shape = prediction.tracks.num_tracks, len(beliefs)
    floor = math.log(missing_existence) - math.log1p(-missing_existence)
    logits = np.minimum(prediction.existence_logit, floor)[:, None].repeat(len(beliefs), axis=1)
    chosen, start = np.full(shape, -1), 0
    for s, belief in enumerate(beliefs):
        own = places_of(belief.tracks.labels, prediction.tracks.labels)
        if (own < 0).any():
            raise unknown_label(s, belief.tracks.labels[int(np.argmax(own < 0))])
        chosen[own, s] = start + np.arange(len(own))
        logits[own, s] = belief.existence_logit
        start += len(own)
    return Posteriors(chosen, stack_tracks([belief.tracks.to_kernel() for belief in beliefs]), logits)


def unknown_label(sensor: int, label: Ints) -> InputError:
    """The error of a posterior with a label that the prediction lacks."""
    return InputError(
        f"beliefs[{sensor}]: expected labels of views.prediction, from which it was updated; got {label.tolist()}"
    )


def updated_logs(prior: Floats, posteriors: Floats, weights: Floats) -> Floats:
    """prior + sum_s v_s (posterior_s - prior), where what is infinite and stays so adds nothing."""
    base = prior[:, None]
    with np.errstate(invalid="ignore"):
        change = np.where((posteriors == base) | (weights == 0.0), 0.0, posteriors - base)
        return np.asarray(prior + sum_over_sensors(weights * change))


def check_evidence(labels: Ints, logits: Floats) -> None:
    """Raise `NumericalError` where a label is certain to one and impossible to another."""
    faulty = np.isnan(logits)
    if faulty.any():
        label = labels[int(np.flatnonzero(faulty)[0])].tolist()
        raise NumericalError(
            f"fusion: label {label} is certain to one sensor or the prediction and impossible to another"
        )
