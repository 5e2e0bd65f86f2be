"""Concatenation of bundles, so that one kernel call processes them all, and extraction of tracks."""

from collections.abc import Sequence

import numpy as np

from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Glmb, Ints, Tracks
from vedette.kernels.gaussian.components import components_like, copy_components, joined_components, stacked_mixtures


def join_offsets(offsets: Sequence[Ints]) -> Ints:
    """Return the offsets of the concatenation of ragged arrays, each with offsets from 0 on."""
    joined, end = [np.zeros(1, np.int64)], 0
    for item in offsets:
        joined.append(item[1:] + end)
        end += int(item[-1])
    return np.concatenate(joined)


def stack_tracks(tables: Sequence[Tracks]) -> Tracks:
    """Return one track table of all the tracks, in the order given."""
    labels, offsets, components = zip(*tables, strict=True)
    return Tracks(np.concatenate(labels), join_offsets(offsets), joined_components(components))


def stack_glmbs(glmbs: Sequence[Glmb]) -> Glmb:
    """Return one bundle of all the hypotheses over one track table, in the order given, with unchanged weights."""
    tracks, offsets, members, log_weights = zip(*glmbs, strict=True)
    starts = np.cumsum([0, *(len(table.labels) for table in tracks[:-1])])
    shifted = np.concatenate(members) + np.repeat(starts, [*map(len, members)])
    return Glmb(stack_tracks(tracks), join_offsets(offsets), shifted, np.concatenate(log_weights))


@kernel
def joined_tracks(first: Tracks, second: Tracks) -> Tracks:
    """Return the tracks of both, in their order."""
    offsets = np.concatenate((first.offsets, second.offsets[1:] + first.offsets[-1]))
    labels = np.concatenate((first.labels, second.labels))
    return Tracks(labels, offsets, stacked_mixtures(first.components, second.components))


@kernel
def taken_tracks(tracks: Tracks, places: Ints) -> Tracks:
    """Return the tracks at `places`, in that order."""
    num, given = len(places), tracks.components
    labels, offsets = np.empty((num, 2), np.int64), np.zeros(num + 1, np.int64)
    for i in range(num):
        labels[i, 0], labels[i, 1] = tracks.labels[places[i], 0], tracks.labels[places[i], 1]
        offsets[i + 1] = offsets[i] + tracks.offsets[places[i] + 1] - tracks.offsets[places[i]]
    components = components_like(given, offsets[num])
    for i in range(num):
        copy_components(given, tracks.offsets[places[i]], tracks.offsets[places[i] + 1], components, offsets[i])
    return Tracks(labels, offsets, components)
