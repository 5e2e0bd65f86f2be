"""How many bytes a sensor sends: numbers of 8 bytes, each symmetric matrix as its triangle, without compression."""

from __future__ import annotations

from typing import Any

import numpy as np

from vedette.densities import GLMB, LMB

_NUMBER = 8


def bytes_of_scan(scan: Any, pose: Any) -> int:
    """The measurements, and the pose that they were taken from; 0 where there was no scan."""
    return 0 if scan is None else _NUMBER * (np.size(scan) + len(pose))


def bytes_of_belief(belief: Any) -> int:
    """Labels, existences or hypotheses, and the components of all tracks; 0 of a density that is no GLMB or LMB."""
    if not isinstance(belief, GLMB | LMB):
        return 0
    tracks, dim = belief.tracks, belief.state_dim
    numbers = 2 * tracks.num_tracks + len(tracks.log_weights) * (1 + dim + dim * (dim + 1) // 2)
    own = tracks.num_tracks if isinstance(belief, LMB) else belief.num_hyps + len(belief.hyp_tracks)
    return _NUMBER * (numbers + own)
