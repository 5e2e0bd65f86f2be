"""Several bundles as one, so that one kernel call sees them all. Plain NumPy."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vedette.kernels.base.types import Glmb, Ints, Tracks


def join_offsets(offsets: Sequence[Ints]) -> Ints:
    """Offsets of the concatenation of ragged arrays, each with offsets from 0 on."""
    joined, end = [np.zeros(1, np.int64)], 0
    for item in offsets:
        joined.append(item[1:] + end)
        end += int(item[-1])
    return np.concatenate(joined)


def stack_tracks(tables: Sequence[Tracks]) -> Tracks:
    """One track table of all the tracks, in the order given."""
    return Tracks(
        np.concatenate([table.labels for table in tables]),
        join_offsets([table.offsets for table in tables]),
        np.concatenate([table.log_weights for table in tables]),
        np.concatenate([table.means for table in tables]),
        np.concatenate([table.covs for table in tables]),
    )


def stack_glmbs(glmbs: Sequence[Glmb]) -> Glmb:
    """One bundle of all the hypotheses over one track table, in the order given; the weights stay as they are."""
    starts = np.cumsum([0] + [len(glmb.tracks.labels) for glmb in glmbs])
    return Glmb(
        stack_tracks([glmb.tracks for glmb in glmbs]),
        join_offsets([glmb.hyp_offsets for glmb in glmbs]),
        np.concatenate([glmb.hyp_tracks + start for glmb, start in zip(glmbs, starts, strict=False)]),
        np.concatenate([glmb.hyp_log_weights for glmb in glmbs]),
    )


__all__ = ["join_offsets", "stack_glmbs", "stack_tracks"]
