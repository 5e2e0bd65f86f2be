"""Label sets of a GLMB, and parts of densities: subsets of their hypotheses, labels or factors."""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple, TypeAlias, TypeVar, cast

import numpy as np

from vedette.densities.checks import distinct_labels, offsets_of, take_runs
from vedette.densities.containers import unchecked
from vedette.densities.factored import FactoredGLMB
from vedette.densities.glmb import GLMB
from vedette.densities.labelled import LMB, LabelledDensity
from vedette.densities.tracks import take_tracks
from vedette.kernels.base.types import Bools, Ints
from vedette.kernels.gaussian.reduction import MixtureCaps
from vedette.kernels.labelled.conversions import glmb_to_lmb
from vedette.kernels.labelled.labels import group_by_label_set

Label: TypeAlias = tuple[int, ...]
LabelSet: TypeAlias = tuple[Label, ...]
_Labelled = TypeVar("_Labelled", bound=LabelledDensity)
WHOLE = MixtureCaps(-math.inf, 0.0, 2**62)  # leaves mixtures unchanged


class LabelSets(NamedTuple):
    """Label sets of a belief in the order of their first hypothesis. groups: (num_hyps,) set of each hypothesis."""

    sets: tuple[LabelSet, ...]
    groups: Ints


def label_sets(belief: LabelledDensity) -> LabelSets:
    """Return the label sets of a GLMB and the set of each hypothesis."""
    hyps, labels = belief.as_hypotheses(), belief.tracks.labels.tolist()
    groups, firsts = group_by_label_set(hyps)
    members = [hyps.hyp_tracks[hyps.hyp_offsets[h] : hyps.hyp_offsets[h + 1]] for h in firsts.tolist()]
    sets = tuple(tuple(tuple(labels[track]) for track in own) for own in members)
    return LabelSets(sets, groups)


def take_hypotheses(belief: GLMB, places: Ints) -> GLMB:
    """Return the hypotheses at `places`, in that order, with only their tracks. Their weights are not normalised."""
    offsets, entries = take_runs(belief.hyp_offsets, places)
    used, renumbered = np.unique(belief.hyp_tracks[entries], return_inverse=True)
    return unchecked(
        GLMB,
        take_tracks(belief.tracks, used),
        offsets,
        np.asarray(renumbered, np.int64),
        belief.hyp_log_weights[places],
    )


def take_factors(density: FactoredGLMB, places: Ints) -> FactoredGLMB:
    """Return the factors at `places`, in that order."""
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
        None,
    )


def in_label_order(density: FactoredGLMB) -> FactoredGLMB:
    """Return the factors, each of at least one track, in increasing order of their first labels."""
    if density.num_factors == 0:
        return density
    _, place = distinct_labels(density.tracks.labels)
    return take_factors(density, np.argsort(np.minimum.reduceat(place, density.track_offsets[:-1])))


def lmb_of_factors(density: FactoredGLMB, factors: Ints) -> LMB:
    """Return factors of one label each, in the form of `FactoredGLMB.of` and in label order, as an LMB."""
    first = density.factor_offsets[factors]
    logits = density.hyp_log_weights[first + 1] - density.hyp_log_weights[first]
    return unchecked(LMB, take_tracks(density.tracks, density.track_offsets[factors]), logits)


def as_single_factor(glmb: GLMB) -> FactoredGLMB:
    """Return a GLMB as one factor.

    With one label it has the form of `FactoredGLMB.of`. With no label there is no factor. Nothing is lost: the
    tracks of one label become one mixture of all their components.
    """
    labels, _ = distinct_labels(glmb.tracks.labels[glmb.hyp_tracks])
    whole = LMB.from_kernel(glmb_to_lmb(glmb.to_kernel(), WHOLE)) if len(labels) < 2 else glmb
    return FactoredGLMB.of(whole)


def without_zero_weights(belief: _Labelled) -> _Labelled:
    """Return the belief without hypotheses of weight zero. A product keeps all tracks."""
    given: Any = belief
    if belief.is_lmb or (kept := given.hyp_log_weights > -math.inf).all():
        return belief
    if not belief.is_product:
        return cast(_Labelled, take_hypotheses(given, np.flatnonzero(kept)))
    offsets, entries = take_runs(given.hyp_offsets, np.flatnonzero(kept))
    return belief.with_fields(
        hyp_offsets=offsets,
        hyp_tracks=given.hyp_tracks[entries],
        hyp_log_weights=given.hyp_log_weights[kept],
        factor_offsets=offsets_of(kept.astype(np.int64))[given.factor_offsets],
    )


def without_labels(belief: _Labelled, labels: Ints) -> tuple[_Labelled, float]:
    """Return the belief of the targets with none of (num, 2) `labels`, and the summed existence of those that have one.

    Hypotheses of a GLMB that then hold the same tracks are merged. Factors without remaining labels are dropped.
    """
    if len(labels) == 0:
        return belief, 0.0
    known, existence = belief.label_existence()
    dropped = float(existence[are_in_table(known, labels)].sum())
    kept = ~are_in_table(belief.tracks.labels, labels)
    given: Any = belief
    if belief.is_lmb:
        return given.take(np.flatnonzero(kept)), dropped
    found: Any = (_factors_without if belief.is_product else _glmb_without)(given, kept)
    return found, dropped


def are_in_table(labels: Ints, table: Ints) -> Bools:
    """Mask (num_labels,), True if a label is in a table."""
    distinct, place = distinct_labels(np.concatenate([table, labels]))
    known = np.zeros(len(distinct), np.bool_)
    known[place[: len(table)]] = True
    return known[place[len(table) :]]


def _factors_without(belief: FactoredGLMB, kept: Bools) -> FactoredGLMB:
    counts = np.diff(offsets_of(kept.astype(np.int64))[belief.track_offsets])
    whole, parted = counts == np.diff(belief.track_offsets), []
    for index in np.flatnonzero(~whole & (counts > 0)).tolist():
        tracks = kept[belief.track_offsets[index] : belief.track_offsets[index + 1]]
        parted.append(as_single_factor(_glmb_without(belief.factor(index), tracks)))
    return FactoredGLMB.product([take_factors(belief, np.flatnonzero(whole & (counts > 0))), *parted], belief.state_dim)


def _glmb_without(belief: GLMB, kept: Bools) -> GLMB:
    fewer = with_replaced_tracks(belief, np.where(kept, np.arange(len(kept)), -1))
    return take_hypotheses(fewer, np.argsort(-fewer.hyp_log_weights, kind="stable"))


def with_replaced_tracks(belief: GLMB, links: Ints) -> GLMB:
    """Return the GLMB with each track replaced by the track in `links` (num_tracks,), or left out if that is -1.

    Both tracks must have the same label. Hypotheses that then hold the same tracks are merged, with the sum of their
    weights, in the order of the first.
    """
    weights: dict[tuple[int, ...], float] = {}
    for hyp, log_weight in enumerate(belief.hyp_log_weights.tolist()):
        tracks = links[belief.hyp_tracks[belief.hyp_offsets[hyp] : belief.hyp_offsets[hyp + 1]]]
        members = tuple(tracks[tracks >= 0].tolist())
        weights[members] = float(np.logaddexp(weights[members], log_weight)) if members in weights else log_weight
    used = np.unique(links[links >= 0])
    entries = np.array([track for members in weights for track in members], np.int64)
    offsets, log_weights = offsets_of([len(members) for members in weights]), np.array(list(weights.values()))
    return unchecked(GLMB, take_tracks(belief.tracks, used), offsets, np.searchsorted(used, entries), log_weights)


class JoinedFactors(NamedTuple):
    """The smallest groups of the factors of several densities such that no two groups share a label.

    Groups are in increasing order of their first labels. Each density is the product of its parts in the groups.
    Factors without labels are in none.
    """

    densities: tuple[FactoredGLMB, ...]  # the densities of the factors
    groups: tuple[Ints, ...]  # for each density, (num_factors,) the group of each factor, or -1
    # (num_groups,) True if all factors in the group are of its only label, in the form of `FactoredGLMB.of`
    alone: Bools

    def lmbs_alone(self) -> list[LMB]:
        """Return for each density the LMB of the labels that are alone in all their factors."""
        found = []
        for density, groups in zip(self.densities, self.groups, strict=True):
            factors = np.argsort(groups, kind="stable")[np.count_nonzero(groups < 0) :]
            found.append(lmb_of_factors(density, factors[self.alone[groups[factors]]]))
        return found

    def parts(self, group: int) -> list[FactoredGLMB]:
        """Return the part of each density in a group."""
        return [
            take_factors(density, np.flatnonzero(groups == group))
            for density, groups in zip(self.densities, self.groups, strict=True)
        ]


def join_factors(densities: Sequence[FactoredGLMB]) -> JoinedFactors:
    """Group the factors of densities of one state dimension, at least one."""
    distinct, place = distinct_labels(np.concatenate([density.tracks.labels for density in densities]))
    firsts = offsets_of([density.tracks.num_tracks for density in densities])
    places = [place[low:high] for low, high in pairwise(firsts.tolist())]
    sizes = [np.diff(density.track_offsets) for density in densities]
    root, before = np.arange(len(distinct)), np.empty(0, np.int64)
    while not np.array_equal(root, before):
        before = root.copy()
        for density, own, counts in zip(densities, places, sizes, strict=True):
            if len(own):
                least = np.minimum.reduceat(root[own], density.track_offsets[:-1][counts > 0])
                np.minimum.at(root, own, np.repeat(least, counts[counts > 0]))
        root = root[root]  # path compression
    _, group_of_label = np.unique(root, return_inverse=True)
    groups = []
    for density, own, counts in zip(densities, places, sizes, strict=True):
        found = np.full(density.num_factors, -1, np.int64)
        found[counts > 0] = group_of_label[own[density.track_offsets[:-1][counts > 0]]]
        groups.append(found)
    alone = np.ones(len(np.unique(root)), np.bool_)
    for density, found in zip(densities, groups, strict=True):
        alone[found[(found >= 0) & ~density.is_bernoulli]] = False
    return JoinedFactors(tuple(densities), tuple(groups), alone)
