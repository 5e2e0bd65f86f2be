"""Where a decision starts: local posteriors cut to what a planner asks, and the fused density predicted ahead.

A filter keeps a density for each label of each hypothesis. What one hypothesis says of a label differs from what
another says by how they explain other labels' measurements, which is often nothing to speak of: of the 26 tracks that
ten label sets of `paper-a` hold under an M-delta-GLMB, each label's are within 1e-3 nats of one another. A planner that
predicts and updates all of them does the same work six times.
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np

from vedette.densities import GLMB, Labelled, track_moments
from vedette.densities.containers import for_kernel
from vedette.densities.conversions import collapsed
from vedette.densities.label_sets import possible, relinked, take_hypotheses
from vedette.densities.tracks import gaussian_tracks
from vedette.filters.inputs import model_errors
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.gaussian.linalg import log_sum
from vedette.kernels.planning.reach import predict_paths
from vedette.models import MotionModel, constant_survival, kernel_motion

_Labelled = TypeVar("_Labelled", bound=Labelled)

# Over the horizon nobody dies. One model for all decisions, by which what kernels take of a motion is found again.
ALWAYS_SURVIVES = constant_survival(1.0)


def heaviest_hypotheses(belief: GLMB, most: int) -> GLMB:
    """The `most` heaviest hypotheses of positive weight, normalised; of equal weights the first."""
    order = np.argsort(-belief.hyp_log_weights, kind="stable")[:most]
    taken = take_hypotheses(belief, order[belief.hyp_log_weights[order] > -np.inf])
    log_weights = taken.hyp_log_weights - log_sum(for_kernel(taken.hyp_log_weights))
    return taken.with_fields(hyp_log_weights=log_weights)


def predicted(fused: _Labelled, motion: MotionModel, num_steps: int, period: float) -> _Labelled:
    """The fused density at the end of the horizon, without birth or death (paper, "pseudo-prediction").

    Tracks are first collapsed to one Gaussian each (GLMBs are marginalised), as those of the pseudo-updates are. Label
    sets of weight zero are left out of a GLMB.
    """
    single = possible(collapsed(fused))
    means, covs = track_moments(single.tracks)
    with model_errors():
        paths = predict_paths(kernel_motion(motion, ALWAYS_SURVIVES), float(period), int(num_steps), means, covs)
    means, covs = (np.ascontiguousarray(own[:, -1]) for own in paths)
    return single.with_fields(tracks=gaussian_tracks(single.tracks.labels, means, covs))


def share_versions(belief: GLMB, most: float) -> GLMB:
    """The belief with tracks of one label replaced by one from which they diverge by at most `most` nats.

    belief: of one Gaussian a track, its hypotheses heaviest first. The tracks of heavier hypotheses stay, and lighter
    ones' go to the first of them that is near enough. Hypotheses that then hold the same tracks become one, of the sum
    of their weights. most: 0 leaves everything as it is.
    """
    if most == 0.0 or len(belief.hyp_tracks) == 0:
        return belief
    return relinked(belief, _leaders(belief, _divergences(belief.tracks.means, belief.tracks.covs), most))


def _divergences(means: Floats, covs: Floats) -> Floats:
    """(num, num) Kullback-Leibler divergence of Gaussian i from Gaussian j, in nats."""
    precisions, log_dets = np.linalg.inv(covs), np.linalg.slogdet(covs)[1]
    offsets = means[:, np.newaxis] - means
    traces = np.einsum("iab,jba->ij", covs, precisions)
    squares = np.einsum("ija,jab,ijb->ij", offsets, precisions, offsets, optimize=True)
    return np.asarray(0.5 * (traces + squares - means.shape[1] + log_dets - log_dets[:, np.newaxis]))


def _leaders(belief: GLMB, divergences: Floats, most: float) -> Ints:
    """(num_tracks,) the track that each is replaced by; its own number where it stays, or where nobody holds it."""
    labels, leaders = belief.tracks.labels.tolist(), np.arange(belief.tracks.num_tracks)
    known: dict[tuple[int, ...], list[int]] = {}
    for track in dict.fromkeys(belief.hyp_tracks.tolist()):
        own = known.setdefault(tuple(labels[track]), [])
        near = [leader for leader in own if divergences[track, leader] <= most]
        if near:
            leaders[track] = near[0]
        else:
            own.append(track)
    return leaders
