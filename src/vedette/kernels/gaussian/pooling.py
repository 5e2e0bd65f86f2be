"""Tracks as single Gaussians, and pools of weighted tracks, each reduced to one track."""

import math

import numpy as np

from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Ints, Mixture, Tracks
from vedette.kernels.gaussian.components import (
    components_between,
    components_like,
    copy_component,
    merge_all,
    merge_components,
    own_components,
)
from vedette.kernels.gaussian.linalg import log_sum
from vedette.kernels.gaussian.mixtures import require_gaussians
from vedette.kernels.gaussian.reduction import MixtureCaps, make_reduction_work, most_kept, reduce_into


@kernel
def merged_mixtures(mixtures: Mixture, offsets: Ints) -> Mixture:
    """The Gaussian of the moments of each mixture `offsets[i]:offsets[i + 1]`, with its weight and its marks merged.

    Components of a mixture of weight 0 count alike. No mixture is empty.
    """
    num, largest = len(offsets) - 1, 0
    for i in range(num):
        largest = max(largest, offsets[i + 1] - offsets[i])
    out, components, weights = components_like(mixtures, num), np.empty(largest, np.int64), np.empty(largest)
    for i in range(num):
        first, end = offsets[i], offsets[i + 1]
        if end - first == 1:  # most tracks
            copy_component(mixtures, first, out, i)
            continue
        own = components_between(mixtures, first, end)
        merge_all(own, end - first, components, weights, log_sum(own.log_weights), out, i)
    return out


@inlined
def add_to_pool(track: int, weight: float, slot_of: Ints, pool: Ints, weights: Floats, end: int) -> int:
    """Add `weight` to `track`'s place in the open pool, or give it the place `end`. Returns the new end of the pool."""
    slot = slot_of[track]
    if slot < 0:
        slot_of[track] = end
        pool[end] = track
        weights[end] = weight
        return end + 1
    weights[slot] += weight
    return end


@kernel
def _gather(
    tracks: Tracks, pool: Ints, weights: Floats, low: int, high: int, components: Ints, component_weights: Floats
) -> int:
    """Components of the pool `low:high` and their linear weights, into the last two arguments. Returns their number."""
    count, log_weights = 0, tracks.components.log_weights
    for p in range(low, high):
        for source in range(tracks.offsets[pool[p]], tracks.offsets[pool[p] + 1]):
            components[count] = source
            log_weight = log_weights[source]
            # A single Gaussian has log weight 0: the usual case needs no exponential.
            component_weights[count] = weights[p] if log_weight == 0.0 else weights[p] * math.exp(log_weight)
            count += 1
    return count


@borrowing
def _write_normalised(mixture: Mixture, components: Ints, weights: Floats, num: int, wide: Mixture) -> None:
    """Write (-> wide) the mixture of the first `num` of `components` under linear weights, normalised."""
    total = 0.0
    for c in range(num):
        total += weights[c]
    for c in range(num):
        share = weights[c] / total if total > 0.0 else 1.0 / num
        copy_component(mixture, components[c], wide, c)
        wide.log_weights[c] = math.log(share) if share > 0.0 else -math.inf


@kernel
def pooled_tracks(
    tracks: Tracks, labels: Ints, pool_offsets: Ints, pool: Ints, weights: Floats, caps: MixtureCaps
) -> Tracks:
    """One track for each pool of tracks: the mixture of the pool under its linear weights, reduced."""
    num, used, largest, room = len(labels), 0, 0, 0
    for i in range(num):
        size = 0
        for p in range(pool_offsets[i], pool_offsets[i + 1]):
            size += tracks.offsets[pool[p] + 1] - tracks.offsets[pool[p]]
        largest = max(largest, size)
        room += most_kept(size, caps)
    components, component_weights = np.empty(largest, np.int64), np.empty(largest)
    wide, work = components_like(tracks.components, largest), make_reduction_work(largest, tracks.components)
    offsets, out, given = np.zeros(num + 1, np.int64), components_like(tracks.components, room), tracks.components
    for i in range(num):
        count = _gather(tracks, pool, weights, pool_offsets[i], pool_offsets[i + 1], components, component_weights)
        if caps.max_components == 1 or count == 1:
            merge_components(given, components, component_weights, count, out, used)
            out.log_weights[used] = 0.0
            used += 1
        else:
            _write_normalised(given, components, component_weights, count, wide)
            used = reduce_into(wide, count, caps, work, out, used)
        offsets[i + 1] = used
    if used < room:
        out = own_components(out, used)
    require_gaussians(out.means, out.covs)
    return Tracks(labels, offsets, out)


@kernel
def reduced_tracks(tracks: Tracks, caps: MixtureCaps) -> Tracks:
    """The tracks with their mixtures reduced by the caps, or the same bundle where each is one Gaussian."""
    num = len(tracks.labels)
    if len(tracks.components.log_weights) == num:
        return tracks
    each = np.arange(num + 1)
    return pooled_tracks(tracks, tracks.labels, each, each[:-1].copy(), np.ones(num), caps)
