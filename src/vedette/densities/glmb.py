"""Generalized labelled multi-Bernoulli density with Gaussian-mixture tracks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vedette.densities.tracks import TrackTable
from vedette.kernels import types as kt
from vedette.kernels.types import Floats, Ints


@dataclass(frozen=True, slots=True)
class GLMB:
    """delta-GLMB density (paper eq. 4); marginalised delta-GLMB (eq. 8) where every label set occurs once.

    Attributes:
        tracks: track table shared by all hypotheses.
        hyp_offsets: (num_hyps + 1,) tracks of hypothesis `h` are `hyp_tracks[hyp_offsets[h]:hyp_offsets[h + 1]]`.
        hyp_tracks: indices into `tracks`, in increasing label order within a hypothesis.
        hyp_log_weights: (num_hyps,) normalised log weights.
    """

    tracks: TrackTable
    hyp_offsets: Ints
    hyp_tracks: Ints
    hyp_log_weights: Floats

    @property
    def num_hyps(self) -> int:
        return len(self.hyp_log_weights)

    def to_kernel(self) -> kt.Glmb:
        """The same arrays as the bundle that kernels take."""
        return kt.Glmb(self.tracks.to_kernel(), self.hyp_offsets, self.hyp_tracks, self.hyp_log_weights)

    @classmethod
    def from_kernel(cls, glmb: kt.Glmb) -> GLMB:
        return cls(TrackTable.from_kernel(glmb.tracks), glmb.hyp_offsets, glmb.hyp_tracks, glmb.hyp_log_weights)

    @classmethod
    def empty(cls, state_dim: int) -> GLMB:
        """The density that is certain of no target."""
        return cls(TrackTable.empty(state_dim), np.zeros(2, np.int64), np.empty(0, np.int64), np.zeros(1))
