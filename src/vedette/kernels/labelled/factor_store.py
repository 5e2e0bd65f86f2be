"""Store in which a factored density is written factor by factor."""

from typing import NamedTuple

import numpy as np

from vedette.kernels.base.arrays import filled_ints, grown_floats, grown_ints
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import FactoredGlmb, Floats, Glmb, Ints, Mixture, Tracks
from vedette.kernels.gaussian.components import components_like, copy_components, grown_components, own_components
from vedette.kernels.gaussian.linalg import log_add, log_sum
from vedette.kernels.gaussian.mixtures import descending_order
from vedette.kernels.labelled.groups import group_log_sums
from vedette.kernels.labelled.splitting import Choices, group_choices

# Indices of `FactorStore.filled`.
_TRACKS, _COMPONENTS, _HYPS, _ENTRIES, _FACTORS = range(5)


class FactorStore(NamedTuple):
    """The factors written so far, and room for more."""

    filled: Ints  # (5,) numbers of tracks, components, hypotheses, entries of `hyp_tracks`, and factors
    labels: Ints  # flat, two numbers per track
    offsets: Ints
    components: Mixture
    track_offsets: Ints
    hyp_offsets: Ints
    hyp_tracks: Ints
    hyp_log_weights: Floats
    factor_offsets: Ints


@kernel
def make_store(num_tracks: int, num_components: int, like: Mixture) -> FactorStore:
    """Return an empty store with room for this number of tracks, each its own factor.

    like: components with the same columns.
    """
    return FactorStore(
        np.zeros(5, np.int64),
        np.empty(2 * num_tracks, np.int64),
        np.zeros(num_tracks + 1, np.int64),
        components_like(like, num_components),
        np.zeros(num_tracks + 1, np.int64),
        np.zeros(2 * num_tracks + 1, np.int64),
        np.empty(num_tracks, np.int64),
        np.empty(2 * num_tracks),
        np.zeros(num_tracks + 1, np.int64),
    )


@kernel
def with_room(store: FactorStore, factors: int, tracks: int, components: int, hyps: int, entries: int) -> FactorStore:
    """Return the same factors with room for further factors, tracks, components, hypotheses and entries."""
    filled = store.filled
    return FactorStore(
        filled,
        grown_ints(store.labels, 2 * (filled[_TRACKS] + tracks)),
        grown_ints(store.offsets, filled[_TRACKS] + tracks + 1),
        grown_components(store.components, filled[_COMPONENTS], filled[_COMPONENTS] + components),
        grown_ints(store.track_offsets, filled[_FACTORS] + factors + 1),
        grown_ints(store.hyp_offsets, filled[_HYPS] + hyps + 1),
        grown_ints(store.hyp_tracks, filled[_ENTRIES] + entries),
        grown_floats(store.hyp_log_weights, filled[_HYPS] + hyps),
        grown_ints(store.factor_offsets, filled[_FACTORS] + factors + 1),
    )


@inlined
def has_room_for_single(store: FactorStore, components: int) -> bool:
    """Return True if a factor of one label and `components` components fits."""
    filled = store.filled
    return (
        2 * filled[_TRACKS] + 2 <= len(store.labels)
        and filled[_TRACKS] + 2 <= len(store.offsets)
        and filled[_COMPONENTS] + components <= len(store.components.log_weights)
        and filled[_FACTORS] + 2 <= len(store.factor_offsets)
        and filled[_FACTORS] + 2 <= len(store.track_offsets)
        and filled[_HYPS] + 3 <= len(store.hyp_offsets)
        and filled[_HYPS] + 2 <= len(store.hyp_log_weights)
        and filled[_ENTRIES] + 1 <= len(store.hyp_tracks)
    )


@inlined
def next_component(store: FactorStore) -> int:
    """Return the position for the components of the next track."""
    return int(store.filled[_COMPONENTS])


@inlined
def _close_track(store: FactorStore, step: int, index: int, end: int) -> None:
    filled = store.filled
    num = filled[_TRACKS]
    store.labels[2 * num], store.labels[2 * num + 1] = step, index
    filled[_TRACKS], filled[_COMPONENTS] = num + 1, end
    store.offsets[num + 1] = end


@inlined
def _close_factor(store: FactorStore) -> None:
    filled = store.filled
    filled[_FACTORS] += 1
    store.track_offsets[filled[_FACTORS]] = filled[_TRACKS]
    store.factor_offsets[filled[_FACTORS]] = filled[_HYPS]


@inlined
def append_single(store: FactorStore, step: int, index: int, end: int, logit: float) -> None:
    """Append a factor of one label, absent or present. Its components are already written, up to `end`."""
    filled = store.filled
    hyp, entry = filled[_HYPS], filled[_ENTRIES]
    store.hyp_log_weights[hyp], store.hyp_log_weights[hyp + 1] = -log_add(0.0, logit), -log_add(0.0, -logit)
    store.hyp_tracks[entry] = filled[_TRACKS]
    store.hyp_offsets[hyp + 1], store.hyp_offsets[hyp + 2] = entry, entry + 1
    filled[_HYPS], filled[_ENTRIES] = hyp + 2, entry + 1
    _close_track(store, step, index, end)
    _close_factor(store)


@kernel
def append_part(store: FactorStore, glmb: Glmb, choices: Choices, part_of: Ints, part: int) -> None:
    """Append the marginal over the labels of a part, heaviest hypothesis first. The store must have room."""
    groups = np.empty(len(glmb.hyp_log_weights), np.int64)
    firsts = group_choices(choices.symbols, part_of, part, groups)
    log_weights = group_log_sums(glmb.hyp_log_weights, groups, len(firsts))
    log_total, number = log_sum(log_weights), filled_ints(len(glmb.tracks.labels), -1)
    for g in descending_order(log_weights):
        for k in range(len(part_of)):
            track = choices.symbols[firsts[g], k]
            if part_of[k] != part or track < 0:
                continue
            if number[track] < 0:
                number[track] = store.filled[_TRACKS]
                _append_track(store, glmb.tracks, track)
            store.hyp_tracks[store.filled[_ENTRIES]] = number[track]
            store.filled[_ENTRIES] += 1
        hyp = store.filled[_HYPS]
        store.hyp_log_weights[hyp] = log_weights[g] - log_total
        store.filled[_HYPS] = hyp + 1
        store.hyp_offsets[hyp + 1] = store.filled[_ENTRIES]
    _close_factor(store)


@borrowing
def _append_track(store: FactorStore, tracks: Tracks, track: int) -> None:
    first, last = tracks.offsets[track], tracks.offsets[track + 1]
    end = copy_components(tracks.components, first, last, store.components, next_component(store))
    _close_track(store, tracks.labels[track, 0], tracks.labels[track, 1], end)


@kernel
def stored(store: FactorStore) -> FactoredGlmb:
    """Return the factors as a density, without the unused room."""
    filled = store.filled
    num = filled[_TRACKS]
    tracks = Tracks(
        store.labels[: 2 * num].copy().reshape((num, 2)),
        store.offsets[: num + 1].copy(),
        own_components(store.components, filled[_COMPONENTS]),
    )
    return FactoredGlmb(
        tracks,
        store.track_offsets[: filled[_FACTORS] + 1].copy(),
        store.hyp_offsets[: filled[_HYPS] + 1].copy(),
        store.hyp_tracks[: filled[_ENTRIES]].copy(),
        store.hyp_log_weights[: filled[_HYPS]].copy(),
        store.factor_offsets[: filled[_FACTORS] + 1].copy(),
    )
