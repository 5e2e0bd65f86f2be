"""Rewards of all joint actions without forming a fused density: Cauchy-Schwarz divergence of fused pseudo-posteriors.

The same sums as `fusion.fuse` followed by `divergence.cauchy_schwarz`, over arrays that were laid out once. The label sets
are those that any sensor's prior and the prediction have.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import log_expit, logit

from vedette.control.priors import LabelSet
from vedette.control.pseudo import PseudoPosteriors
from vedette.control.threads import run_chunks
from vedette.densities import GLMB, LMB
from vedette.divergence import log_inner_product
from vedette.fusion import Clmb, CmDeltaGlmb
from vedette.kernels.fused_divergence import Cases, Prediction
from vedette.kernels.information import row_size
from vedette.kernels.planning import fill_missing, reward_table, write_rows
from vedette.kernels.types import Bools, Floats, Ints


class _Layout(NamedTuple):
    """Common label sets of a table. set_offsets: (num_sets + 1,) into members; label_of, set_of: of each member."""

    sets: tuple[LabelSet, ...]
    set_offsets: Ints
    label_of: tuple[tuple[int, int], ...]
    set_of: Ints
    references: Floats


def _layout(posteriors: Sequence[PseudoPosteriors], prediction: GLMB | LMB, sets: tuple[LabelSet, ...]) -> _Layout:
    label_of = tuple(label for labels in sets for label in labels)
    sizes = [len(labels) for labels in sets]
    set_offsets = np.concatenate([np.zeros(1, np.int64), np.cumsum(sizes)]).astype(np.int64)
    near = {(step, site): i for i, (step, site) in enumerate(prediction.tracks.labels.tolist())}
    references = prediction.tracks.means[[near[label] for label in label_of]]
    return _Layout(sets, set_offsets, label_of, np.repeat(np.arange(len(sets)), sizes), np.ascontiguousarray(references))


class _Laid(NamedTuple):
    """Cases of one sensor on the common label sets, before the fusion weight is applied."""

    log_weights: Floats
    means: Floats
    covs: Floats
    held: Bools
    known: Ints


def _lay_out(own: PseudoPosteriors, layout: _Layout, floor: float) -> _Laid:
    """Put the sensor's sets in their common places and stand-ins in those that it lacks."""
    num_cases, dim = len(own.log_weights), own.means.shape[2]
    starts = np.concatenate([np.zeros(1, np.int64), np.cumsum([len(labels) for labels in own.sets])])
    where = {labels: i for i, labels in enumerate(own.sets)}
    sources = [where.get(labels, -1) for labels in layout.sets]
    held = np.array([source >= 0 for source in sources], bool)
    # The stand-ins draw on all the sensor's sets, also those that the prediction lacks: they follow the common ones.
    extra = [i for i, labels in enumerate(own.sets) if labels not in set(layout.sets)]
    num_common, num_members = len(layout.sets), len(layout.label_of)
    columns = [source for source in sources if source >= 0]
    log_weights = np.full((num_cases, num_common + len(extra)), -math.inf)
    log_weights[:, np.flatnonzero(held)] = own.log_weights[:, columns]
    log_weights[:, num_common:] = own.log_weights[:, extra]
    total = num_members + sum(len(own.sets[i]) for i in extra)
    means, covs = np.zeros((num_cases, total, dim)), np.zeros((num_cases, total, dim, dim))
    label_of, set_of = list(layout.label_of), layout.set_of.tolist()
    at = num_members
    for place, source in [*enumerate(sources), *((num_common + k, i) for k, i in enumerate(extra))]:
        if source < 0:
            continue
        size = len(own.sets[source])
        to = layout.set_offsets[place] if place < num_common else at
        means[:, to : to + size] = own.means[:, starts[source] : starts[source] + size]
        covs[:, to : to + size] = own.covs[:, starts[source] : starts[source] + size]
        if place >= num_common:
            label_of += own.sets[source]
            set_of += [place] * size
            at += size
    known = _stand_in(log_weights, means, covs, label_of, set_of, held, num_members, floor, own.is_lmb)
    return _Laid(
        np.ascontiguousarray(log_weights[:, :num_common]),
        np.ascontiguousarray(means[:, :num_members]),
        np.ascontiguousarray(covs[:, :num_members]),
        np.tile(held, (num_cases, 1)),
        known,
    )


def _stand_in(
    log_weights: Floats, means: Floats, covs: Floats, label_of: list[tuple[int, int]], set_of: list[int], held: Bools,
    num_members: int, floor: float, is_lmb: bool,
) -> Ints:  # fmt: skip
    """Fill in what the sensor lacks, in place; returns (num_members,) 1 where the sensor knows the label."""
    missing = np.flatnonzero(~held)
    present = [m for m, at in enumerate(set_of) if at >= len(held) or held[at]]
    by_label: dict[tuple[int, int], list[int]] = {}
    for m in present:
        by_label.setdefault(label_of[m], []).append(m)
    sources = [by_label.get(label_of[m], []) if not held[set_of[m]] else [] for m in range(num_members)]
    known = np.array([held[set_of[m]] or len(sources[m]) > 0 for m in range(num_members)], np.int64)
    if len(missing) == 0:
        return known
    if is_lmb:
        least = np.where(np.isfinite(log_weights), log_weights, np.inf).min(axis=1)
        log_weights[:, missing] = np.minimum(floor, least)[:, np.newaxis]
        return known
    flat = [m for members in sources for m in members]
    offsets = np.concatenate([np.zeros(1, np.int64), np.cumsum([len(members) for members in sources])])
    fill_missing(
        log_weights, means, covs, np.array(flat, np.int64), np.array([set_of[m] for m in flat], np.int64),
        offsets.astype(np.int64), missing, float(floor), 0, len(log_weights),
    )  # fmt: skip
    return known


def _cases(laid: Sequence[_Laid], weights: Sequence[float], layout: _Layout, is_lmb: bool, num_threads: int) -> Cases:
    dim = laid[0].means.shape[2]
    starts = np.cumsum([0] + [len(one.log_weights) for one in laid])
    rows = np.empty((starts[-1], len(layout.label_of), int(row_size(dim))))
    present, absent = [], []
    for one, weight, start in zip(laid, weights, starts, strict=False):
        mine = rows[start : start + len(one.log_weights)]

        def work(first: int, last: int, one: _Laid = one, weight: float = weight, mine: Floats = mine) -> None:
            write_rows(first, last, one.known, one.means, one.covs, layout.references, float(weight), mine)

        run_chunks(work, len(one.log_weights), num_threads)
        present.append(weight * (log_expit(one.log_weights) if is_lmb else one.log_weights))
        absent.append(weight * log_expit(-one.log_weights) if is_lmb else np.zeros_like(one.log_weights))
    held = np.concatenate([one.held for one in laid])
    return Cases(layout.set_offsets, np.concatenate(present), np.concatenate(absent), held, rows)


def _prediction(prediction: GLMB | LMB, layout: _Layout, unit_volume: float) -> Prediction:
    """The prediction, already restricted to the common label sets, laid out as the cases are."""
    is_lmb = isinstance(prediction, LMB)
    rows = np.empty((1, len(layout.label_of), int(row_size(prediction.tracks.state_dim))))
    places = []
    if is_lmb:
        order = {(step, site): i for i, (step, site) in enumerate(prediction.tracks.labels.tolist())}
        places = [order[label] for label in layout.label_of]
        logits = prediction.existence_logit[places]
        present, absent = log_expit(logits), log_expit(-logits)
    else:
        assert isinstance(prediction, GLMB)
        labels, offsets = prediction.tracks.labels.tolist(), prediction.hyp_offsets
        hyp_of = {
            tuple((labels[t][0], labels[t][1]) for t in prediction.hyp_tracks[offsets[h] : offsets[h + 1]]): h
            for h in range(prediction.num_hyps)
        }
        present = np.array([prediction.hyp_log_weights[hyp_of[labels]] for labels in layout.sets])
        absent = np.zeros(len(layout.sets))
        for labels in layout.sets:
            h = hyp_of[labels]
            places += prediction.hyp_tracks[offsets[h] : offsets[h + 1]].tolist()
    means = np.ascontiguousarray(prediction.tracks.means[places])[np.newaxis]
    covs = np.ascontiguousarray(prediction.tracks.covs[places])[np.newaxis]
    write_rows(0, 1, np.ones(len(places), np.int64), means, covs, layout.references, 1.0, rows)
    log_self = _self_product(prediction, unit_volume)
    return Prediction(present, absent, rows[0], 0.0, log_self)


def _self_product(prediction: GLMB | LMB, unit_volume: float) -> float:
    """log <prediction, prediction> of a GLMB that need not be normalised, or an LMB."""
    if isinstance(prediction, LMB):
        return log_inner_product(prediction, prediction, unit_volume=unit_volume)
    total = np.logaddexp.reduce(prediction.hyp_log_weights)
    scaled = GLMB(
        prediction.tracks, prediction.hyp_offsets, prediction.hyp_tracks, prediction.hyp_log_weights - total
    )
    return log_inner_product(scaled, scaled, unit_volume=unit_volume) + 2.0 * float(total)


def joint_rewards(
    posteriors: Sequence[PseudoPosteriors],
    prediction: GLMB | LMB,
    fusion: CmDeltaGlmb | Clmb,
    num_samples: int,
    unit_volume: float,
    num_threads: int,
) -> Floats:
    """(num_joint, num_samples) rewards of all joint actions of the sensors, the last sensor's action fastest.

    posteriors: one a sensor, all GLMB or all LMB as the fusion wants. prediction: one Gaussian a track, restricted to label
    sets (labels) that some sensor's posteriors have; marginalised if a GLMB.
    """
    is_lmb = isinstance(prediction, LMB)
    sets: tuple[LabelSet, ...]
    if isinstance(prediction, LMB):
        sets = tuple(((step, site),) for step, site in prediction.tracks.labels.tolist())
        floor = float(logit(fusion.missing_existence)) if isinstance(fusion, Clmb) else 0.0
    else:
        labels, offsets = prediction.tracks.labels.tolist(), prediction.hyp_offsets
        sets = tuple(
            tuple((labels[t][0], labels[t][1]) for t in prediction.hyp_tracks[offsets[h] : offsets[h + 1]])
            for h in range(prediction.num_hyps)
        )
        floor = fusion.missing_log_weight if isinstance(fusion, CmDeltaGlmb) else 0.0
    layout = _layout(posteriors, prediction, sets)
    laid = [_lay_out(own, layout, floor) for own in posteriors]
    cases = _cases(laid, fusion.weights, layout, is_lmb, num_threads)
    target = _prediction(prediction, layout, unit_volume)
    num_actions = np.array([len(own.log_weights) // num_samples for own in posteriors], np.int64)
    first_cases = np.concatenate([np.zeros(1, np.int64), np.cumsum(num_actions * num_samples)[:-1]]).astype(np.int64)
    rewards = np.empty((int(np.prod(num_actions)), num_samples))
    actions = np.ascontiguousarray(np.indices(num_actions).reshape(len(num_actions), -1).T)
    dim, log_volume = int(prediction.tracks.state_dim), math.log(unit_volume)

    def work(first: int, last: int) -> None:
        reward_table(
            cases, first_cases, actions, num_samples, target, dim, log_volume, is_lmb, first, last, rewards
        )  # fmt: skip

    run_chunks(work, len(rewards), num_threads)
    return rewards
