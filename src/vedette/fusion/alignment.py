"""Marginalised GLMBs, or products of them, group by group on the union of their label sets."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vedette.densities import GLMB, LMB, FactoredGLMB
from vedette.densities.checks import distinct_labels, offsets_of
from vedette.densities.containers import unchecked
from vedette.densities.conversions import as_glmb, reduced_lmb
from vedette.densities.factored import sets_of_factors
from vedette.densities.label_sets import in_label_order, join_factors, possible, take_factors
from vedette.densities.tracks import take_tracks
from vedette.fusion.powers import PowerRule
from vedette.kernels.base.types import Bools, Floats, Ints, Tracks
from vedette.kernels.labelled.stacking import stack_glmbs, stack_tracks


class Aligned(NamedTuple):
    """All sensors on the union of their label sets; a member is a (label set, label).

    set_offsets: (num_sets + 1,) into members. set_of_member: (num_members,). groups: (num_sets,) the group of each set,
    of `num_groups`: densities are products over the groups. labels: (num_members, 2).
    chosen: (num_members, S) place in `tracks`, -1 where the sensor does not know the label. log_weights, held:
    (num_sets, S) weight of the set, and whether it is the sensor's own; otherwise a floor. num_missing_labels: (S,)
    labels that the sensor does not know.
    """

    set_offsets: Ints
    set_of_member: Ints
    groups: Ints
    num_groups: int
    labels: Ints
    chosen: Ints
    tracks: Tracks
    log_weights: Floats
    held: Bools
    num_missing_labels: Ints

    def existence(self, log_weights: Floats) -> Floats:
        """(num_labels, n) existence of each label, in increasing order, under (num_sets, n) weights of the sets."""
        distinct, place = distinct_labels(self.labels)
        existence = np.zeros((len(distinct), log_weights.shape[1]))
        np.add.at(existence, place, np.exp(log_weights)[self.set_of_member])
        return existence


def align(sensors: Sequence[FactoredGLMB], missing_log_weight: float, rule: PowerRule) -> Aligned:
    """Sensors' marginalised GLMBs on the union of their label sets, group by group.

    sensors: with one factor a group, as of `side_by_side`, none with a hypothesis of weight zero. Where a sensor lacks
    a set, its weight is the least of `missing_log_weight` and the weights that it has in the group, and the density of
    each label its marginal density over the sets that it has, reduced by the rule's caps.
    """
    stack, num_groups = stack_glmbs([sensor.as_hypotheses() for sensor in sensors]), sensors[0].num_factors
    group_of = np.concatenate([own.factor_of for own in sensors])
    set_of, first = sets_of_factors(stack, group_of)
    groups = group_of[first]
    sensor_of = np.repeat(np.arange(len(sensors)), [sensor.num_hyps for sensor in sensors])
    hyp_of = np.full((len(first), len(sensors)), -1)
    hyp_of[set_of, sensor_of] = np.arange(len(set_of))
    held = hyp_of >= 0
    floors = np.full((num_groups, len(sensors)), missing_log_weight)
    np.minimum.at(floors, (group_of, sensor_of), stack.hyp_log_weights)
    log_weights = floors[groups]
    log_weights[held] = stack.hyp_log_weights[hyp_of[held]]
    sizes = np.diff(stack.hyp_offsets)[first]
    set_offsets = offsets_of(sizes)
    set_of_member = np.repeat(np.arange(len(first)), sizes)
    place = np.arange(set_offsets[-1]) - set_offsets[set_of_member]
    labels = stack.tracks.labels[stack.hyp_tracks[stack.hyp_offsets[first][set_of_member] + place]]
    chosen = np.full((len(place), len(sensors)), -1)
    own, sensor = np.nonzero(held[set_of_member])
    entry = stack.hyp_offsets[hyp_of[set_of_member[own], sensor]] + place[own]
    chosen[own, sensor] = stack.hyp_tracks[entry]
    tracks = stack.tracks
    num_missing_labels = np.zeros(len(sensors), np.int64)
    for s in np.flatnonzero(~held.all(axis=0)).tolist():
        lacking = np.flatnonzero(~held[set_of_member, s])
        marginal = reduced_lmb(sensors[s], rule.caps).tracks
        places, num_missing_labels[s] = _find_labels(marginal.labels, labels[lacking])
        chosen[lacking, s] = np.where(places >= 0, places + len(tracks.labels), -1)
        tracks = stack_tracks([tracks, marginal])
    own_sets = (set_offsets, set_of_member, groups, num_groups)
    return Aligned(*own_sets, labels, chosen, tracks, log_weights, held, num_missing_labels)


def _find_labels(known: Ints, wanted: Ints) -> tuple[Ints, int]:
    """Place of each wanted label among the known ones or -1, and the number of distinct labels that are not known."""
    distinct, place = distinct_labels(np.concatenate([known, wanted]))
    known_place = np.full(len(distinct), -1)
    known_place[place[: len(known)]] = np.arange(len(known))
    return known_place[place[len(known) :]], int(np.count_nonzero(known_place < 0))


def side_by_side(beliefs: Sequence[FactoredGLMB], max_products: int) -> tuple[list[FactoredGLMB], Floats]:
    """The beliefs with one factor for each of the smallest groups of labels of which no factor spans two.

    Factor g of each has labels of group g alone; where a belief has none of them it is certain that nobody is there.
    Several factors become the heaviest `max_products` of their products. Hypotheses of weight zero are left out. Also
    returns (num_groups,) the log of the product of the weights that were kept.
    """
    joined = join_factors(beliefs)
    log_kept, regrouped = np.zeros(len(joined.alone)), []
    for belief, groups in zip(beliefs, joined.groups, strict=True):
        own, log_own = _one_a_group(possible(belief), groups, len(joined.alone), max_products)
        regrouped.append(own)
        log_kept += log_own
    return regrouped, log_kept


def _one_a_group(belief: FactoredGLMB, groups: Ints, num_groups: int, max_products: int) -> tuple[FactoredGLMB, Floats]:
    """One factor a group, and the logs of the weights kept; groups: of each factor, or -1."""
    order, log_kept = np.argsort(groups, kind="stable"), np.zeros(num_groups)
    ends = np.searchsorted(groups[order], np.arange(num_groups + 1))
    counts = np.diff(ends)
    single, none = np.flatnonzero(counts == 1), np.flatnonzero(counts == 0)
    nobody = FactoredGLMB.of(GLMB.empty(belief.state_dim))
    parts = [take_factors(belief, order[ends[single]]), take_factors(nobody, np.zeros(len(none), np.int64))]
    several = np.flatnonzero(counts > 1)
    for group in several.tolist():
        factors = take_factors(belief, order[ends[group] : ends[group + 1]])
        product, lost = as_glmb(factors, max_hypotheses=max_products)
        with np.errstate(divide="ignore"):
            log_kept[group] = np.log1p(-lost)
        parts.append(FactoredGLMB.of(product))
    place = np.argsort(np.concatenate([single, none, several]))
    return take_factors(FactoredGLMB.product(parts, belief.state_dim), place), log_kept


def tidied(marginalised: FactoredGLMB) -> FactoredGLMB:
    """The factors in the order of their first labels; those of one label as `FactoredGLMB.from_lmb` lays them out.

    marginalised: of which every hypothesis has tracks of its own. Factors without tracks go.
    """
    counts, sizes = np.diff(marginalised.track_offsets), np.diff(marginalised.hyp_offsets)
    factor, log_odds = marginalised.factor_of, np.full((2, marginalised.num_factors), -np.inf)
    alone = counts[factor] == 1
    log_odds[sizes[alone], factor[alone]] = marginalised.hyp_log_weights[alone]
    single = np.flatnonzero(counts == 1)
    tracks = take_tracks(marginalised.tracks, marginalised.track_offsets[single])
    lmb = unchecked(LMB, tracks, log_odds[1, single] - log_odds[0, single])
    others = take_factors(marginalised, np.flatnonzero(counts > 1))
    return in_label_order(FactoredGLMB.product([FactoredGLMB.of(lmb), others], marginalised.state_dim))
