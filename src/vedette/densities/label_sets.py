"""Label sets of a GLMB, and parts of densities: some of its hypotheses, some tracks of a table."""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias, TypeVar

import numpy as np

from vedette.densities.checks import distinct_labels, offsets_of, take_runs
from vedette.densities.containers import unchecked
from vedette.densities.factored import FactoredGLMB
from vedette.densities.glmb import GLMB
from vedette.densities.lmb import LMB
from vedette.densities.statistics import existence_probabilities, track_moments
from vedette.densities.tracks import TrackTable
from vedette.kernels.base.types import Bools, Glmb, Ints
from vedette.kernels.gaussian.mixtures import MixtureCaps
from vedette.kernels.labelled.conversions import glmb_to_lmb
from vedette.kernels.labelled.labels import group_by_label_set

Label: TypeAlias = tuple[int, ...]
LabelSet: TypeAlias = tuple[Label, ...]
_Labelled = TypeVar("_Labelled", GLMB, LMB, FactoredGLMB)
WHOLE = MixtureCaps(-math.inf, 0.0, 2**62)  # which leave mixtures as they are


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


def places_of(labels: Ints, table: Ints) -> Ints:
    """(num_labels,) place of each label among the distinct labels of a table, -1 where it is none of them."""
    place = {tuple(label): i for i, label in enumerate(table.tolist())}
    return np.array([place.get(tuple(label), -1) for label in labels.tolist()], np.int64)


def take_tracks(tracks: TrackTable, places: Ints) -> TrackTable:
    """The tracks at `places`, in that order."""
    offsets, components = take_runs(tracks.offsets, places)
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
    offsets, entries = take_runs(belief.hyp_offsets, places)
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


def sets_of_factors(hypotheses: Glmb, factor_of: Ints) -> tuple[Ints, Ints]:
    """As `group_by_label_set`, where hypotheses of different factors (num_hyps,) have different sets."""
    set_of, first = group_by_label_set(hypotheses)
    if (factor_of == factor_of[:1]).all():
        return set_of, first
    numbers = set_of * (factor_of.max() + 1) + factor_of
    _, first, place = np.unique(numbers, return_index=True, return_inverse=True)
    order = np.argsort(first)
    return np.argsort(order)[place], first[order]


def take_factors(density: FactoredGLMB, places: Ints) -> FactoredGLMB:
    """The factors at `places`, in that order."""
    track_offsets, tracks = take_runs(density.track_offsets, places)
    factor_offsets, hyps = take_runs(density.factor_offsets, places)
    hyp_offsets, entries = take_runs(density.hyp_offsets, hyps)
    moved = track_offsets[:-1] - density.track_offsets[places]
    members = np.repeat(moved, hyp_offsets[factor_offsets[1:]] - hyp_offsets[factor_offsets[:-1]])
    return unchecked(
        FactoredGLMB,
        take_tracks(density.tracks, tracks),
        track_offsets,
        hyp_offsets,
        density.hyp_tracks[entries] + members,
        density.hyp_log_weights[hyps],
        factor_offsets,
    )


def in_label_order(density: FactoredGLMB) -> FactoredGLMB:
    """The factors, each of at least one track, in increasing order of their first labels."""
    if density.num_factors == 0:
        return density
    _, place = distinct_labels(density.tracks.labels)
    return take_factors(density, np.argsort(np.minimum.reduceat(place, density.track_offsets[:-1])))


def laid_out(glmb: GLMB) -> FactoredGLMB:
    """A GLMB as one factor; of one label, as `FactoredGLMB.from_lmb` lays it out, of none, no factor at all.

    Nothing is lost: the tracks of one label become one mixture of all their components.
    """
    labels, _ = distinct_labels(glmb.tracks.labels[glmb.hyp_tracks])
    if len(labels) > 1:
        return FactoredGLMB.from_glmb(glmb)
    return FactoredGLMB.from_lmb(LMB.from_kernel(glmb_to_lmb(glmb.to_kernel(), WHOLE)))


def without_labels(belief: _Labelled, labels: Ints) -> tuple[_Labelled, float]:
    """The belief of the targets that have none of (num, 2) `labels`, and the summed existence of those that do.

    Hypotheses of a GLMB that then hold the same tracks become one. Factors of which no label is left go.
    """
    if len(labels) == 0:
        return belief, 0.0
    known, existence = existence_probabilities(belief)
    dropped = float(existence[_are_among(known, labels)].sum())
    kept = ~_are_among(belief.tracks.labels, labels)
    if isinstance(belief, LMB):
        places = np.flatnonzero(kept)
        return unchecked(LMB, take_tracks(belief.tracks, places), belief.existence_logit[places]), dropped
    if isinstance(belief, FactoredGLMB):
        return _factors_without(belief, kept), dropped
    return _glmb_without(belief, kept), dropped


def _are_among(labels: Ints, table: Ints) -> Bools:
    """(num_labels,) whether each label is in a table."""
    distinct, place = distinct_labels(np.concatenate([table, labels]))
    known = np.zeros(len(distinct), np.bool_)
    known[place[: len(table)]] = True
    return known[place[len(table) :]]


def _factors_without(belief: FactoredGLMB, kept: Bools) -> FactoredGLMB:
    counts = np.diff(offsets_of(kept.astype(np.int64))[belief.track_offsets])
    whole, parted = counts == np.diff(belief.track_offsets), []
    for index in np.flatnonzero(~whole & (counts > 0)).tolist():
        tracks = kept[belief.track_offsets[index] : belief.track_offsets[index + 1]]
        parted.append(laid_out(_glmb_without(belief.factor(index), tracks)))
    return FactoredGLMB.product([take_factors(belief, np.flatnonzero(whole & (counts > 0))), *parted], belief.state_dim)


def _glmb_without(belief: GLMB, kept: Bools) -> GLMB:
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
    )
