"""Pseudo-posteriors of one sensor on the label sets that a decision compares, with stand-ins for those that it lacks.

The same stand-ins as `vedette.fusion` uses, for all cases of the sensor at once.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vedette.control.inputs import Belief
from vedette.control.priors import Label, LabelSet, label_sets, offsets_of, single_labels, take_hypotheses
from vedette.control.pseudo import PseudoPosteriors
from vedette.densities import GLMB, LMB
from vedette.densities.checks import unchecked
from vedette.fusion.tracks import take_tracks
from vedette.kernels.base.types import Bools, Floats, Ints
from vedette.kernels.planning.rewards import fill_missing


class Layout(NamedTuple):
    """The label sets (of an LMB: labels) that the prediction and some sensor have, in the order of the prediction's.

    set_offsets: (num_sets + 1,) into members, which are (label set, label). references: (num_members, state_dim)
    predicted mean of each member. prediction: on these sets only, not renormalised.
    """

    sets: tuple[LabelSet, ...]
    set_offsets: Ints
    references: Floats
    prediction: Belief


def common_layout(prediction: Belief, posteriors: Sequence[PseudoPosteriors]) -> Layout:
    """The layout of a marginalised prediction of one Gaussian a track and no set of weight zero."""
    known = {labels for own in posteriors for labels in own.sets}
    sets = label_sets(prediction).sets if isinstance(prediction, GLMB) else single_labels(prediction)
    places = np.array([i for i, labels in enumerate(sets) if labels in known], np.int64)
    common: Belief
    if isinstance(prediction, GLMB):
        common = take_hypotheses(prediction, places)
    else:
        common = unchecked(LMB, take_tracks(prediction.tracks, places), prediction.existence_logit[places])
    members = common.hyp_tracks if isinstance(common, GLMB) else np.arange(len(places))
    chosen = tuple(sets[i] for i in places.tolist())
    references = np.ascontiguousarray(common.tracks.means[members])
    return Layout(chosen, offsets_of([len(labels) for labels in chosen]), references, common)


class Laid(NamedTuple):
    """Cases of one sensor on the sets of a layout, before the fusion weight is applied.

    log_weights: (num_cases, num_sets), of an LMB the existence logit. means, covs: (num_cases, num_members, ...).
    held: (num_sets,) false where a stand-in is put. known: (num_members,) 1 where the sensor knows the label.
    """

    log_weights: Floats
    means: Floats
    covs: Floats
    held: Bools
    known: Ints


def lay_out(own: PseudoPosteriors, layout: Layout, floor: float) -> Laid:
    """Put the sensor's sets in their common places and stand-ins in those that it lacks.

    floor: log weight (of an LMB: logit) of a stand-in, unless the sensor has a lighter set.
    """
    common = set(layout.sets)
    held = np.array([labels in own.sets for labels in layout.sets], np.bool_)
    if held.all():
        everything = np.ones(len(layout.references), np.int64)
        return Laid(*_gather(own, layout.sets), held, everything)
    # The stand-ins draw on all the sensor's sets, also those that the prediction lacks: they follow the common ones.
    sets = (*layout.sets, *(labels for labels in own.sets if labels not in common))
    log_weights, means, covs = _gather(own, sets)
    num_sets, num_members = len(layout.sets), len(layout.references)
    if own.is_lmb:
        least = np.minimum(floor, log_weights.min(axis=1, where=np.isfinite(log_weights), initial=math.inf))
        log_weights[:, :num_sets][:, ~held] = least[:, np.newaxis]
        known = np.repeat(held, np.diff(layout.set_offsets)).astype(np.int64)
    else:
        known = _fill(log_weights, means, covs, sets, held, num_members, floor)
    contiguous = np.ascontiguousarray
    return Laid(
        contiguous(log_weights[:, :num_sets]),
        contiguous(means[:, :num_members]),
        contiguous(covs[:, :num_members]),
        held,
        known,
    )


def _gather(own: PseudoPosteriors, sets: Sequence[LabelSet]) -> tuple[Floats, Floats, Floats]:
    """Log weights (-inf), means and covariances (0) of these label sets, where the sensor lacks one as in brackets."""
    place = {labels: i for i, labels in enumerate(own.sets)}
    starts, own_starts = offsets_of([len(labels) for labels in sets]), offsets_of([len(labels) for labels in own.sets])
    pairs = [(i, place[labels]) for i, labels in enumerate(sets) if labels in place]
    if len(pairs) == len(sets) == len(own.sets) and all(i == source for i, source in pairs):
        return own.log_weights, own.means, own.covs
    to = [m for i, _ in pairs for m in range(starts[i], starts[i + 1])]
    source = [m for _, i in pairs for m in range(own_starts[i], own_starts[i + 1])]
    num_cases, num_members, dim = len(own.log_weights), int(starts[-1]), own.means.shape[2]
    log_weights = np.full((num_cases, len(sets)), -math.inf)
    means, covs = np.zeros((num_cases, num_members, dim)), np.zeros((num_cases, num_members, dim, dim))
    log_weights[:, [i for i, _ in pairs]] = own.log_weights[:, [i for _, i in pairs]]
    means[:, to] = own.means[:, source]
    covs[:, to] = own.covs[:, source]
    return log_weights, means, covs


def _fill(
    log_weights: Floats, means: Floats, covs: Floats, sets: Sequence[LabelSet], held: Bools, num_members: int,
    floor: float,
) -> Ints:  # fmt: skip
    """Fill in what the sensor lacks, in place; returns (num_members,) 1 where the sensor knows the label.

    sets: the common ones, of which `held` tells which the sensor has, then others that it has too.
    """
    members = [(i, label) for i, labels in enumerate(sets) for label in labels]
    present = [i >= len(held) or bool(held[i]) for i in range(len(sets))]
    versions: dict[Label, list[int]] = {}
    for m, (i, label) in enumerate(members):
        if present[i]:
            versions.setdefault(label, []).append(m)
    sources = [[] if present[i] else versions.get(label, []) for i, label in members[:num_members]]
    flat = np.array([m for found in sources for m in found], np.int64)
    set_of = np.array([i for i, _ in members], np.int64)
    offsets, missing = offsets_of([len(found) for found in sources]), np.flatnonzero(~held)
    fill_missing(
        log_weights, means, covs, flat, set_of[flat], offsets, missing, float(floor), 0, len(log_weights)
    )  # fmt: skip
    return np.array([present[i] or len(sources[m]) > 0 for m, (i, _) in enumerate(members[:num_members])], np.int64)
