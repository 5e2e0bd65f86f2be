"""Which beliefs are valid: fusions check what they are given, but not what the library has only just made."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from vedette.densities import LMB, TrackTable
from vedette.densities.checks import label_step_up
from vedette.errors import InputError
from vedette.kernels.labelled.stacking import stack_tracks


class ValidBeliefs(tuple[Any, ...]):
    """Beliefs that need no check of their values, as filters of this library have made them at this step.

    A fusion takes them like any other sequence. It still checks their kinds and state dimensions.
    """

    __slots__ = ()


def all_valid(beliefs: Sequence[Any]) -> bool:
    """Whether all are LMBs of one state dimension that `validate` lets pass. It does not say what is wrong.

    At little more than the cost of one of them.
    """
    if not beliefs or not all(type(belief) is LMB and _formed(belief) for belief in beliefs):
        return False
    if len({belief.state_dim for belief in beliefs}) > 1:
        return False
    table = TrackTable.from_kernel(stack_tracks([belief.tracks.to_kernel() for belief in beliefs]))
    try:
        table.validate(error=InputError)
    except InputError:
        return False
    in_order = label_step_up(table.labels)
    firsts = np.cumsum([belief.tracks.num_tracks for belief in beliefs])
    in_order[firsts[(firsts > 0) & (firsts < len(table.labels))] - 1] = True
    return bool(in_order.all()) and not any(np.isnan(belief.existence_logit).any() for belief in beliefs)


def _formed(belief: LMB) -> bool:
    """Whether the arrays have their types and shapes, so that they may be stacked."""
    tracks = belief.tracks
    if not (_is(tracks.labels, np.int64, 2) and _is(tracks.means, np.float64, 2)):
        return False
    (num, width), (components, dim) = tracks.labels.shape, tracks.means.shape
    return (
        width == 2
        and _is(tracks.offsets, np.int64, 1)
        and tracks.offsets.shape == (num + 1,)
        and tracks.offsets[0] == 0
        and tracks.offsets[-1] == components
        and _is(tracks.log_weights, np.float64, 1)
        and tracks.log_weights.shape == (components,)
        and _is(tracks.covs, np.float64, 3)
        and tracks.covs.shape == (components, dim, dim)
        and _is(belief.existence_logit, np.float64, 1)
        and belief.existence_logit.shape == (num,)
    )


def _is(array: Any, dtype: type, ndim: int) -> bool:
    return type(array) is np.ndarray and array.dtype == dtype and array.ndim == ndim
