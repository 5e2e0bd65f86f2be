"""Where a decision starts: local posteriors cut to their heaviest hypotheses, and the fused density predicted ahead."""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np

from vedette.control.inputs import Belief
from vedette.densities import GLMB, LMB, TrackTable, marginalise, track_moments
from vedette.densities.checks import unchecked
from vedette.filters.inputs import model_errors
from vedette.fusion.tracks import take_tracks
from vedette.kernels.base.types import Ints
from vedette.kernels.gaussian.linalg import log_sum
from vedette.kernels.labelled.labels import group_by_label_set
from vedette.kernels.planning.rewards import predict_tracks
from vedette.models import MotionModel, constant_survival, kernel_motion

Label: TypeAlias = tuple[int, int]
LabelSet: TypeAlias = tuple[Label, ...]


def heaviest_hypotheses(belief: GLMB, most: int) -> GLMB:
    """The `most` heaviest hypotheses of positive weight, normalised; of equal weights the first."""
    order = np.argsort(-belief.hyp_log_weights, kind="stable")[:most]
    taken = take_hypotheses(belief, order[belief.hyp_log_weights[order] > -np.inf])
    log_weights = taken.hyp_log_weights - log_sum(taken.hyp_log_weights)
    return unchecked(GLMB, taken.tracks, taken.hyp_offsets, taken.hyp_tracks, log_weights)


def single_gaussians(tracks: TrackTable) -> TrackTable:
    """The tracks with each mixture replaced by one Gaussian of its moments."""
    num = tracks.num_tracks
    if len(tracks.log_weights) == num:
        return tracks
    return unchecked(TrackTable, tracks.labels, np.arange(num + 1), np.zeros(num), *track_moments(tracks))


def take_hypotheses(belief: GLMB, places: Ints) -> GLMB:
    """The hypotheses at `places`, in that order, with their tracks only; their weights are not normalised."""
    sizes = np.diff(belief.hyp_offsets)[places]
    offsets = offsets_of(sizes)
    entries = np.repeat(belief.hyp_offsets[places] - offsets[:-1], sizes) + np.arange(offsets[-1])
    used, renumbered = np.unique(belief.hyp_tracks[entries], return_inverse=True)
    return unchecked(
        GLMB,
        take_tracks(belief.tracks, used),
        offsets,
        np.asarray(renumbered, np.int64),
        belief.hyp_log_weights[places],
    )


def offsets_of(sizes: list[int] | Ints) -> Ints:
    """(len(sizes) + 1,) offsets of runs of these sizes."""
    return np.concatenate([np.zeros(1, np.int64), np.cumsum(sizes, dtype=np.int64)])


class LabelSets(NamedTuple):
    """Label sets of a belief in the order of their first hypothesis; groups: (num_hyps,) set of each hypothesis."""

    sets: tuple[LabelSet, ...]
    groups: Ints


def label_sets(belief: GLMB) -> LabelSets:
    """The label sets of a GLMB and which of them each hypothesis has."""
    groups, firsts = group_by_label_set(belief.to_kernel())
    labels, offsets = belief.tracks.labels.tolist(), belief.hyp_offsets
    sets = tuple(
        tuple((labels[track][0], labels[track][1]) for track in belief.hyp_tracks[offsets[h] : offsets[h + 1]])
        for h in firsts.tolist()
    )
    return LabelSets(sets, groups)


def single_labels(belief: LMB) -> tuple[LabelSet, ...]:
    """Each label of an LMB as a set of its own."""
    return tuple(((step, site),) for step, site in belief.tracks.labels.tolist())


def predicted(fused: Belief, motion: MotionModel, num_steps: int, period: float) -> Belief:
    """The fused density at the end of the horizon, without birth or death (paper, "pseudo-prediction").

    Tracks are first collapsed to one Gaussian each (a GLMB is marginalised), as those of the pseudo-updates are. Label
    sets of weight zero are left out.
    """
    single = fused
    if isinstance(fused, GLMB):
        marginal = marginalise(fused, max_components=1)
        single = take_hypotheses(marginal, np.flatnonzero(marginal.hyp_log_weights > -np.inf))
    means, covs = track_moments(single.tracks)
    with model_errors():
        means, covs = predict_tracks(
            kernel_motion(motion, constant_survival(1.0)), float(period), int(num_steps), means, covs
        )
    num = single.tracks.num_tracks
    tracks = unchecked(TrackTable, single.tracks.labels, np.arange(num + 1), np.zeros(num), means, covs)
    if isinstance(single, LMB):
        return unchecked(LMB, tracks, single.existence_logit)
    return unchecked(GLMB, tracks, single.hyp_offsets, single.hyp_tracks, single.hyp_log_weights)
