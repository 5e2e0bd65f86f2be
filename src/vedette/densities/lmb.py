"""Labelled multi-Bernoulli density with Gaussian-mixture tracks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import expit

from vedette.densities.tracks import TrackTable
from vedette.kernels import types as kt
from vedette.kernels.types import Floats


@dataclass(frozen=True, slots=True)
class LMB:
    """Labelled multi-Bernoulli density: independent tracks, each with a probability of existence.

    Attributes:
        tracks: one track a label, in increasing label order.
        existence_logit: (num_tracks,) log r - log(1 - r); keeps full precision near r = 0 and r = 1.
    """

    tracks: TrackTable
    existence_logit: Floats

    @property
    def existence(self) -> Floats:
        """(num_tracks,) probabilities of existence r."""
        return np.asarray(expit(self.existence_logit))

    def to_kernel(self) -> kt.Lmb:
        """The same arrays as the bundle that kernels take."""
        return kt.Lmb(self.tracks.to_kernel(), self.existence_logit)

    @classmethod
    def from_kernel(cls, lmb: kt.Lmb) -> LMB:
        return cls(TrackTable.from_kernel(lmb.tracks), lmb.existence_logit)

    @classmethod
    def empty(cls, state_dim: int) -> LMB:
        return cls(TrackTable.empty(state_dim), np.empty(0))
