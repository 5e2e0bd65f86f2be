"""Where a decision starts: local posteriors cut to their heaviest hypotheses, and the fused density predicted ahead."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np

from vedette.densities import GLMB, LMB, Labelled, TrackTable, marginalise, track_moments
from vedette.densities.containers import for_kernel, unchecked
from vedette.densities.label_sets import take_hypotheses
from vedette.filters.inputs import model_errors
from vedette.kernels.gaussian.linalg import log_sum
from vedette.kernels.planning.prediction import predict_tracks
from vedette.models import MotionModel, constant_survival, kernel_motion

_Labelled = TypeVar("_Labelled", bound=Labelled)

# Over the horizon nobody dies. One model for all decisions, by which what kernels take of a motion is found again.
ALWAYS_SURVIVES = constant_survival(1.0)


def heaviest_hypotheses(belief: GLMB, most: int) -> GLMB:
    """The `most` heaviest hypotheses of positive weight, normalised; of equal weights the first."""
    order = np.argsort(-belief.hyp_log_weights, kind="stable")[:most]
    taken = take_hypotheses(belief, order[belief.hyp_log_weights[order] > -np.inf])
    log_weights = taken.hyp_log_weights - log_sum(for_kernel(taken.hyp_log_weights))
    return unchecked(GLMB, taken.tracks, taken.hyp_offsets, taken.hyp_tracks, log_weights)


def predicted(fused: _Labelled, motion: MotionModel, num_steps: int, period: float) -> _Labelled:
    """The fused density at the end of the horizon, without birth or death (paper, "pseudo-prediction").

    Tracks are first collapsed to one Gaussian each (GLMBs are marginalised), as those of the pseudo-updates are. Label
    sets of weight zero are left out of a GLMB.
    """
    single: Any = fused
    if not isinstance(fused, LMB):
        single = marginalise(single, max_components=1)
    if isinstance(single, GLMB):
        single = take_hypotheses(single, np.flatnonzero(single.hyp_log_weights > -np.inf))
    means, covs = track_moments(single.tracks)
    with model_errors():
        means, covs = predict_tracks(kernel_motion(motion, ALWAYS_SURVIVES), float(period), int(num_steps), means, covs)
    num = single.tracks.num_tracks
    tracks = unchecked(TrackTable, single.tracks.labels, np.arange(num + 1), np.zeros(num), means, covs)
    return unchecked(type(fused), tracks, *single.to_kernel()[1:])
