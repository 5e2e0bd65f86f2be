"""Several marginalised GLMBs on the union of their label sets, with stand-ins for the sets that a sensor lacks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vedette.densities.checks import label_step_up
from vedette.fusion.base import PowerRule
from vedette.kernels.base.types import Bools, Floats, Glmb, Ints, Tracks
from vedette.kernels.labelled.conversions import glmb_to_lmb
from vedette.kernels.labelled.labels import group_by_label_set
from vedette.kernels.labelled.stacking import stack_glmbs, stack_tracks


class Aligned(NamedTuple):
    """All sensors on the union of their label sets; a member is a (label set, label).

    set_offsets: (num_sets + 1,) into members. set_of_member: (num_members,). labels: (num_members, 2).
    chosen: (num_members, S) place in `tracks`, -1 where the sensor does not know the label. log_weights, held:
    (num_sets, S) weight of the set, and whether it is the sensor's own; otherwise a floor. num_missing_labels: (S,)
    labels that the sensor does not know.
    """

    set_offsets: Ints
    set_of_member: Ints
    labels: Ints
    chosen: Ints
    tracks: Tracks
    log_weights: Floats
    held: Bools
    num_missing_labels: Ints

    def existence(self, log_weights: Floats) -> Floats:
        """(num_labels, n) existence of each label, in increasing order, under (num_sets, n) weights of the sets."""
        order = np.lexsort(self.labels.T[::-1])
        is_next = label_step_up(self.labels[order])
        place = np.zeros(len(order), np.int64)
        place[order[1:]] = np.cumsum(is_next)
        existence = np.zeros((np.count_nonzero(is_next) + min(len(order), 1), log_weights.shape[1]))
        np.add.at(existence, place, np.exp(log_weights)[self.set_of_member])
        return existence


def align(sensors: Sequence[Glmb], missing_log_weight: float, rule: PowerRule) -> Aligned:
    """Sensors' marginalised GLMBs, each of at least one hypothesis, on the union of their label sets.

    Where a sensor lacks a set, its weight is the least of `missing_log_weight` and the weights that it has, and the
    density of each label its marginal density over the sets that it has, reduced by the rule's caps.
    """
    stack = stack_glmbs(sensors)
    group_of, first = group_by_label_set(stack)
    sensor_of = np.repeat(np.arange(len(sensors)), [len(sensor.hyp_log_weights) for sensor in sensors])
    hyp_of = np.full((len(first), len(sensors)), -1)
    hyp_of[group_of, sensor_of] = np.arange(len(group_of))
    held = hyp_of >= 0
    floors = [min(missing_log_weight, float(sensor.hyp_log_weights.min())) for sensor in sensors]
    log_weights = np.where(held, stack.hyp_log_weights[hyp_of], floors)
    sizes = np.diff(stack.hyp_offsets)[first]
    set_offsets = np.concatenate([np.zeros(1, np.int64), np.cumsum(sizes)])
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
        marginal = glmb_to_lmb(sensors[s], rule.caps).tracks
        places, num_missing_labels[s] = _find_labels(marginal.labels, labels[lacking])
        chosen[lacking, s] = np.where(places >= 0, places + len(tracks.labels), -1)
        tracks = stack_tracks([tracks, marginal])
    return Aligned(set_offsets, set_of_member, labels, chosen, tracks, log_weights, held, num_missing_labels)


def _find_labels(known: Ints, wanted: Ints) -> tuple[Ints, int]:
    """Place of each wanted label among the known ones or -1, and the number of distinct labels that are not known."""
    place_of = {tuple(label): place for place, label in enumerate(known.tolist())}
    labels = [tuple(label) for label in wanted.tolist()]
    places = np.array([place_of.get(label, -1) for label in labels], np.int64)
    return places, len(set(labels) - place_of.keys())
