"""How many bytes a sensor sends: numbers of 8 bytes, each symmetric matrix as its triangle, without compression."""

from __future__ import annotations

from typing import Any

import numpy as np

from vedette.densities import LMB, FactoredGLMB, Labelled

_NUMBER = 8


def bytes_of_scan(scan: Any, pose: Any) -> int:
    """The measurements, and the pose that they were taken from; 0 where there was no scan."""
    return 0 if scan is None else _NUMBER * (np.size(scan) + len(pose))


def bytes_of_belief(belief: Any) -> int:
    """Labels, existences or hypotheses, and the components of all tracks; 0 of a density without labels."""
    if not isinstance(belief, Labelled):
        return 0
    tracks, dim = belief.tracks, belief.state_dim
    numbers = 2 * tracks.num_tracks + len(tracks.log_weights) * (1 + dim + dim * (dim + 1) // 2)
    if isinstance(belief, LMB):
        return _NUMBER * (numbers + tracks.num_tracks)
    own = belief.num_hyps + len(belief.hyp_tracks)
    if isinstance(belief, FactoredGLMB):
        own -= 2 * int(np.count_nonzero(belief.is_bernoulli))  # of which an existence says all
    return _NUMBER * (numbers + own)
