"""Label sets of a GLMB, and parts of densities: some of its hypotheses, some tracks of a table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, TypeAlias, TypeVar

import numpy as np

from vedette.densities.checks import unchecked
from vedette.densities.glmb import GLMB
from vedette.densities.lmb import LMB
from vedette.densities.statistics import existence_probabilities, track_moments
from vedette.densities.tracks import TrackTable
from vedette.kernels.base.types import Ints
from vedette.kernels.labelled.labels import group_by_label_set

Label: TypeAlias = tuple[int, ...]
LabelSet: TypeAlias = tuple[Label, ...]
_Labelled = TypeVar("_Labelled", GLMB, LMB)


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


def places_of(labels: Ints, table: Ints) -> Ints:
    """(num_labels,) place of each label among the distinct labels of a table, -1 where it is none of them."""
    place = {tuple(label): i for i, label in enumerate(table.tolist())}
    return np.array([place.get(tuple(label), -1) for label in labels.tolist()], np.int64)


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


def without_labels(belief: _Labelled, labels: Ints) -> tuple[_Labelled, float]:
    """The belief of the targets that have none of (num, 2) `labels`, and the summed existence of those that do.

    Hypotheses of a GLMB that then hold the same tracks become one.
    """
    if len(labels) == 0:
        return belief, 0.0
    gone = {tuple(label) for label in labels.tolist()}
    known, existence = existence_probabilities(belief)
    dropped = float(
        sum(chance for label, chance in zip(known.tolist(), existence, strict=True) if tuple(label) in gone)
    )
    kept = np.array([tuple(label) not in gone for label in belief.tracks.labels.tolist()], np.bool_)
    if isinstance(belief, LMB):
        places = np.flatnonzero(kept)
        return unchecked(LMB, take_tracks(belief.tracks, places), belief.existence_logit[places]), dropped
    weights: dict[tuple[int, ...], float] = {}
    for hyp, log_weight in enumerate(belief.hyp_log_weights.tolist()):
        tracks = belief.hyp_tracks[belief.hyp_offsets[hyp] : belief.hyp_offsets[hyp + 1]]
        members = tuple(tracks[kept[tracks]].tolist())
        weights[members] = float(np.logaddexp(weights.get(members, -np.inf), log_weight))
    order = sorted(weights, key=lambda members: -weights[members])
    renumbered = np.cumsum(kept) - 1
    return unchecked(
        GLMB,
        take_tracks(belief.tracks, np.flatnonzero(kept)),
        offsets_of([len(members) for members in order]),
        np.array([renumbered[track] for members in order for track in members], np.int64),
        np.array([weights[members] for members in order]),
    ), dropped
