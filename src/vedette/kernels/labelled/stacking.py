"""Several bundles as one, so that one kernel call sees them all. Plain NumPy."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vedette.kernels.base.types import Glmb, Ints, Tracks
from vedette.kernels.gaussian.components import joined_components


def join_offsets(offsets: Sequence[Ints]) -> Ints:
    """Offsets of the concatenation of ragged arrays, each with offsets from 0 on."""
    joined, end = [np.zeros(1, np.int64)], 0
    for item in offsets:
        joined.append(item[1:] + end)
        end += int(item[-1])
    return np.concatenate(joined)


def stack_tracks(tables: Sequence[Tracks]) -> Tracks:
    """One track table of all the tracks, in the order given."""
    labels, offsets, components = zip(*tables, strict=True)
    return Tracks(np.concatenate(labels), join_offsets(offsets), joined_components(components))


def stack_glmbs(glmbs: Sequence[Glmb]) -> Glmb:
    """One bundle of all the hypotheses over one track table, in the order given; the weights stay as they are."""
    tracks, offsets, members, log_weights = zip(*glmbs, strict=True)
    starts = np.cumsum([0, *(len(table.labels) for table in tracks[:-1])])
    shifted = np.concatenate(members) + np.repeat(starts, [*map(len, members)])
    return Glmb(stack_tracks(tracks), join_offsets(offsets), shifted, np.concatenate(log_weights))
