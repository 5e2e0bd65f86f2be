"""Fusion of track densities, label by label: what the two fusions of labelled densities share."""

from __future__ import annotations

import numpy as np

from vedette.densities import TrackTable
from vedette.errors import NumericalError
from vedette.fusion.base import PowerRule
from vedette.kernels.base.types import Floats, Ints, Tracks
from vedette.kernels.gaussian.pooling import pooled_tracks
from vedette.kernels.labelled.gci import fuse_tracks


def fused_tracks(
    labels: Ints, chosen: Ints, weights: Floats, tracks: Tracks, rule: PowerRule
) -> tuple[TrackTable, Floats]:
    """Fused track of each label and log of the integral of the product of the powers (paper eqs. 11 and 12).

    labels: (num, 2). chosen: (num, S) each sensor's track in `tracks`, -1 where it does not know the label; of
    mixtures already reduced. weights: (S,) or (num, S) fusion weights, positive where a track is chosen. The fused
    mixtures are reduced by the rule's caps. Raises `NumericalError` where a product of powers is no density.
    """
    try:
        offsets, log_weights, means, covs, log_overlaps = fuse_tracks(
            chosen,
            np.array(np.broadcast_to(weights, chosen.shape)),
            tracks,
            rule.points,
            rule.point_weights,
        )
    except FloatingPointError as fault:
        raise NumericalError(f"fusion of tracks: {fault}") from None
    if len(rule.points) > 0:
        # Hoelder: the integral is at most 1, which cubature may overshoot.
        log_overlaps = np.minimum(log_overlaps, 0.0)
    fused = Tracks(labels, offsets, log_weights, means, covs)
    return TrackTable.from_kernel(reduced_tracks(fused, rule)), log_overlaps


def reduced_tracks(tracks: Tracks, rule: PowerRule) -> Tracks:
    """The tracks with their mixtures reduced by the rule's caps."""
    num = len(tracks.labels)
    if len(tracks.log_weights) == num:
        return tracks
    each = np.arange(num + 1)
    return pooled_tracks(tracks, tracks.labels, each, each[:-1].copy(), np.ones(num), rule.caps)
