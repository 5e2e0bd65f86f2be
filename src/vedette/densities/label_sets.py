"""Label sets of a GLMB, and parts of densities: some of its hypotheses, some tracks of a table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from vedette.densities.checks import unchecked
from vedette.densities.glmb import GLMB
from vedette.densities.statistics import track_moments
from vedette.densities.tracks import TrackTable
from vedette.kernels.base.types import Ints
from vedette.kernels.labelled.labels import group_by_label_set

Label: TypeAlias = tuple[int, ...]
LabelSet: TypeAlias = tuple[Label, ...]


class LabelSets(NamedTuple):
    """Label sets of a belief in the order of their first hypothesis; groups: (num_hyps,) set of each hypothesis."""

    sets: tuple[LabelSet, ...]
    groups: Ints


def label_sets(belief: GLMB) -> LabelSets:
    """The label sets of a GLMB and which of them each hypothesis has."""
    groups, firsts = group_by_label_set(belief.to_kernel())
    labels, offsets = belief.tracks.labels.tolist(), belief.hyp_offsets
    sets = tuple(
        tuple(tuple(labels[track]) for track in belief.hyp_tracks[offsets[h] : offsets[h + 1]]) for h in firsts.tolist()
    )
    return LabelSets(sets, groups)


def offsets_of(sizes: Sequence[int] | Ints) -> Ints:
    """(len(sizes) + 1,) offsets of runs of these sizes."""
    return np.concatenate([np.zeros(1, np.int64), np.cumsum(sizes, dtype=np.int64)])


def take_tracks(tracks: TrackTable, places: Ints) -> TrackTable:
    """The tracks at `places`, in that order."""
    sizes = np.diff(tracks.offsets)[places]
    offsets = offsets_of(sizes)
    components = np.repeat(tracks.offsets[places] - offsets[:-1], sizes) + np.arange(offsets[-1])
    return unchecked(
        TrackTable,
        tracks.labels[places],
        offsets,
        tracks.log_weights[components],
        tracks.means[components],
        tracks.covs[components],
    )


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


def single_gaussians(tracks: TrackTable) -> TrackTable:
    """The tracks with each mixture replaced by one Gaussian of its moments."""
    num = tracks.num_tracks
    if len(tracks.log_weights) == num:
        return tracks
    return unchecked(TrackTable, tracks.labels, np.arange(num + 1), np.zeros(num), *track_moments(tracks))
