"""Parallel update of posteriors of one common prediction: single labels, and label sets of labels that interact."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vedette.densities import GLMB, LMB, FactoredGLMB, TrackTable
from vedette.densities.checks import offsets_of
from vedette.densities.containers import for_kernel, unchecked
from vedette.densities.conversions import as_glmb
from vedette.densities.label_sets import JoinedFactors, as_single_factor
from vedette.densities.tracks import place_labels, places_of
from vedette.errors import InputError, NumericalError
from vedette.fusion.base import count_lost
from vedette.fusion.powers import ONE
from vedette.fusion.views import sum_over_sensors
from vedette.internal.probabilities import log_expit, logit
from vedette.kernels.base.types import Bools, Floats, Ints, Mixture, Tracks
from vedette.kernels.gaussian.pooling import pooled_tracks
from vedette.kernels.labelled.groups import group_log_sums
from vedette.kernels.labelled.stacking import stack_tracks


class Posteriors(NamedTuple):
    """The sensors' posteriors on the labels of the prediction."""

    chosen: Ints  # (num_labels, num_sensors) place in `tracks`, -1 where the sensor lacks the label
    tracks: Tracks  # of all sensors
    logits: Floats  # (num_labels, num_sensors)


def posteriors_of(prediction: LMB, beliefs: Sequence[LMB], missing_existence: float) -> Posteriors:
    """Return the aligned posteriors. Raises `InputError` for a label that the prediction lacks."""
    own = known_places(prediction.tracks.labels, [belief.tracks.labels for belief in beliefs])
    starts = offsets_of([belief.tracks.num_tracks for belief in beliefs])[:-1]
    floors = np.minimum(prediction.existence_logit, math.log(missing_existence) - math.log1p(-missing_existence))
    chosen = np.where(own >= 0, own + starts, -1)
    logits = np.concatenate([*(belief.existence_logit for belief in beliefs), np.zeros(1)])  # last: for index -1
    tracks = stack_tracks([belief.tracks.to_kernel() for belief in beliefs])
    return Posteriors(chosen, tracks, np.where(chosen >= 0, logits[chosen], floors[:, None]))


def known_places(prediction: Ints, posteriors: Sequence[Ints]) -> Ints:
    """Place of each label of the prediction in each posterior, shape (num_labels, num_sensors), or -1 if absent.

    Labels are in increasing order. Raises `InputError` if a posterior has a label that the prediction lacks.
    """
    labels, places = place_labels([prediction, *posteriors])
    unknown = (places >= 0) & (places[:, :1] < 0)
    if unknown.any():
        sensor = int(unknown.any(axis=0).argmax())
        label = labels[int(unknown[:, sensor].argmax())].tolist()
        raise InputError(
            f"beliefs[{sensor - 1}]: expected labels of views.prediction, from which it was updated; got {label}"
        )
    return places[:, 1:]


def updated_logs(prior: Floats, posteriors: Floats, weights: Floats) -> Floats:
    """Return prior + sum_s v_s (posterior_s - prior). An infinite value that does not change contributes nothing."""
    base = prior[:, None]
    with np.errstate(invalid="ignore"):
        change = np.where((posteriors == base) | (weights == 0.0), 0.0, posteriors - base)
        return np.asarray(prior + sum_over_sensors(weights * change))


def check_evidence(labels: Ints, logits: Floats) -> None:
    """Raise `NumericalError` if a label is certain in one density and impossible in another."""
    faulty = np.isnan(logits)
    if faulty.any():
        label = labels[int(np.flatnonzero(faulty)[0])].tolist()
        raise NumericalError(
            f"fusion: label {label} is certain to one sensor or the prediction and impossible to another"
        )


class GroupedSets(NamedTuple):
    """Label sets of one group, with the change of their weights by the scans, and the fused positions of their targets.

    A place is a label together with the track of each sensor for it. In most sets a label has the same place.
    """

    labels: Ints  # (num_labels, 2) increasing
    log_weights: Floats  # (num_sets,) of the prediction times the scans' weight ratios, without the places' integrals
    places: Ints  # (num_sets, num_labels) place of each member; -1 if absent
    place_labels: Ints  # (num_places,) into `labels`
    chosen: Ints  # (num_places, num_sensors) track of each sensor, -1 if it adds no information
    num_missing: Ints  # (num_sensors,) labels that a sensor's posterior has dropped
    log_kept: float  # log of the weight of the prediction's sets that were retained


def grouped_sets(
    joined: JoinedFactors, group: int, first_tracks: Ints, weights: Floats, missing_existence: float, max_sets: int
) -> GroupedSets:
    """Return the prediction's sets of a group, each with the weight ratios that the sensors' factors assign to them.

    A factor assigns w_s(I) / w+(I) to a set I of its labels, where w+ is the prediction's weight of I among these
    labels. The ratio is 1 if the posterior is the prediction, however it is factored.

    joined: the prediction, with one Gaussian per label, and the posteriors, marginalised. first_tracks: (S,) place of
    each posterior's first track in the table of all. weights: (S,) exponents of the sensors' ratios. max_sets: largest
    number of the prediction's sets that are kept.
    """
    labels = np.unique(np.concatenate([part.tracks.labels for part in joined.parts(group)]), axis=0)
    product, lost = as_glmb(joined.parts(group)[0], max_hypotheses=max_sets)
    members, prior = _members(product, labels), for_kernel(product.hyp_log_weights)
    log_weights, chosen = prior.copy(), np.full((*members.shape, len(weights)), -1)
    num_missing = np.zeros(len(weights), np.int64)
    for s, power in enumerate(weights.tolist()):
        density, groups = joined.densities[1 + s], joined.groups[1 + s]
        lacking = np.ones(len(labels), np.bool_)
        for factor in np.flatnonzero(groups == group).tolist() if power > 0.0 else ():
            start = first_tracks[s] + density.track_offsets[factor]
            evidence = _FactorEvidence.of(density.factor(factor), labels, members, prior)
            lacking[evidence.columns] = False
            log_weights += power * evidence.log_ratios
            tracks = np.where(evidence.tracks >= 0, evidence.tracks + start, -1)
            chosen[:, evidence.columns, s] = tracks
        for label in np.flatnonzero(lacking & (power > 0.0)).tolist():
            num_missing[s] += 1
            log_weights += power * _dropped_log_ratios(members[:, label], prior, missing_existence)
    rows = np.column_stack([np.nonzero(members)[1], chosen[members]])
    distinct, place = np.unique(rows, axis=0, return_inverse=True)
    places = np.full(members.shape, -1)
    places[members] = place.ravel()
    return GroupedSets(
        labels, log_weights, places, distinct[:, 0], distinct[:, 1:], num_missing, float(np.log1p(-lost))
    )


def _members(glmb: GLMB, labels: Ints) -> Bools:
    """Return True for each label that is a member of each hypothesis, shape (num_hyps, num_labels)."""
    members = np.zeros((glmb.num_hyps, len(labels)), np.bool_)
    hyps = np.repeat(np.arange(glmb.num_hyps), np.diff(glmb.hyp_offsets))
    members[hyps, places_of(glmb.tracks.labels, labels)[glmb.hyp_tracks]] = True
    return members


class _FactorEvidence(NamedTuple):
    """Weight ratios and tracks that one factor of a posterior assigns to each of the prediction's sets."""

    columns: Ints  # (num_own,) its labels
    log_ratios: Floats  # (num_sets,)
    tracks: Ints  # (num_sets, num_own) tracks of the factor; -1 for absent labels, and if it lacks the set

    @classmethod
    def of(cls, factor: GLMB, labels: Ints, members: Bools, prior: Floats) -> "_FactorEvidence":
        own_labels = np.unique(factor.tracks.labels, axis=0)
        columns = places_of(own_labels, labels)
        parts, part_of = np.unique(members[:, columns], axis=0, return_inverse=True)
        before = group_log_sums(prior, part_of.ravel(), len(parts))
        sets = _members(factor, own_labels)
        number = {row.tobytes(): i for i, row in enumerate(parts)}
        known = [(h, number[row.tobytes()]) for h, row in enumerate(sets) if row.tobytes() in number]
        # A set that was cut off weighed at most as much as the lightest retained set, and as much as predicted.
        after = np.minimum(before, factor.hyp_log_weights.min())
        tracks = np.full(parts.shape, -1)
        for h, part in known:
            after[part] = factor.hyp_log_weights[h]
            tracks[part, sets[h]] = factor.hyp_tracks[factor.hyp_offsets[h] : factor.hyp_offsets[h + 1]]
        return cls(columns, (after - before)[part_of.ravel()], tracks[part_of.ravel()])


def _dropped_log_ratios(member: Bools, prior: Floats, missing_existence: float) -> Floats:
    """Log weight ratios (num_sets,) of a posterior that dropped a label: existence is at most `missing_existence`."""
    number = member.astype(np.int64)
    sums = group_log_sums(prior, number, 2)
    log_odds = min(sums[1] - sums[0], logit(missing_existence))
    with np.errstate(invalid="ignore"):  # if one side has no sets
        evidence = log_expit(np.array([-log_odds, log_odds])) - (sums - np.logaddexp(*sums))
    return np.asarray(evidence[number])


def check_single(prediction: FactoredGLMB) -> None:
    """Raise `InputError` unless each label has one track, of one Gaussian."""
    tracks = prediction.tracks
    num_labels = len(np.unique(tracks.labels, axis=0))
    if tracks.num_tracks > num_labels or len(tracks.log_weights) > tracks.num_tracks:
        raise InputError(
            f"views.prediction: expected one Gaussian for each of its {num_labels} labels, the same in all hypotheses, "
            f"as of what a parallel update has fused; got {len(tracks.log_weights)} Gaussians"
        )


def fused_groups(
    groups: Sequence[GroupedSets], log_overlaps: Floats, components: Mixture, max_sets: int
) -> tuple[list[FactoredGLMB], float]:
    """Return one density per group, with one Gaussian per label, and the log of the product of their total weights.

    log_overlaps (num,), components (num of weight 1): of the places of all groups, concatenated.
    """
    fused, log_normaliser, start = [], 0.0, 0
    for group in groups:
        places = np.where(group.places >= 0, group.places + start, -1)
        start += len(group.place_labels)
        log_weights = group.log_weights + np.where(places >= 0, log_overlaps[places], 0.0).sum(axis=1)
        order = np.argsort(-log_weights, kind="stable")[:max_sets]
        total = float(np.logaddexp.reduce(log_weights[order]))
        if not math.isfinite(total):
            raise NumericalError(f"fusion: the sensors contradict each other on the labels {group.labels.tolist()}")
        log_normaliser += total
        fused.append(_group(group.labels, places[order], log_weights[order] - total, components))
    return fused, log_normaliser


def _group(labels: Ints, places: Ints, log_weights: Floats, components: Mixture) -> FactoredGLMB:
    """Return a GLMB of weighted sets in which each label has the Gaussian of the moments of its places."""
    members = places >= 0
    held = np.flatnonzero(members.any(axis=0))
    num, columns = len(held), members[:, held]
    set_of, label_of = np.nonzero(columns)
    order = np.argsort(label_of, kind="stable")
    pool, shares = places[:, held][columns][order], np.exp(log_weights)[set_of[order]]
    count = len(components.log_weights)
    table = Tracks(np.zeros((count, 2), np.int64), np.arange(count + 1), components)
    offsets = offsets_of(np.bincount(label_of, minlength=num))
    tracks = pooled_tracks(table, labels[held], offsets, pool, shares, ONE)
    hyp_offsets = offsets_of(columns.sum(axis=1))
    return as_single_factor(unchecked(GLMB, TrackTable.from_kernel(tracks), hyp_offsets, label_of, log_weights))


def lost_labels(posteriors: Sequence[FactoredGLMB], weights: Floats, fused: FactoredGLMB) -> int:
    """Return the number of labels that a sensor holds as sure and the fused density does not."""
    labels, existence = fused.label_existence()
    surest = np.zeros(len(labels))
    for posterior in [own for own, power in zip(posteriors, weights.tolist(), strict=True) if power > 0.0]:
        known, own = posterior.label_existence()
        places = places_of(known, labels)
        np.maximum.at(surest, places[places >= 0], own[places >= 0])
    return count_lost(surest[:, None], existence)
