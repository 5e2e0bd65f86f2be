"""The track table that labelled densities share: labels and Gaussian mixtures, flat with offsets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vedette.kernels import types as kt
from vedette.kernels.types import Floats, Ints


@dataclass(frozen=True, slots=True)
class TrackTable:
    """Gaussian-mixture densities of labelled tracks.

    Attributes:
        labels: (num_tracks, 2) birth step and birth index of each track.
        offsets: (num_tracks + 1,) components of track `i` are `offsets[i]:offsets[i + 1]`.
        log_weights: (num_components,) log mixture weights, normalised within each track.
        means: (num_components, state_dim).
        covs: (num_components, state_dim, state_dim), symmetric positive definite.
    """

    labels: Ints
    offsets: Ints
    log_weights: Floats
    means: Floats
    covs: Floats

    @property
    def num_tracks(self) -> int:
        return len(self.labels)

    @property
    def state_dim(self) -> int:
        return int(self.means.shape[1])

    def to_kernel(self) -> kt.Tracks:
        """The same arrays as the bundle that kernels take."""
        return kt.Tracks(self.labels, self.offsets, self.log_weights, self.means, self.covs)

    @classmethod
    def from_kernel(cls, tracks: kt.Tracks) -> TrackTable:
        return cls(*tracks)

    @classmethod
    def empty(cls, state_dim: int) -> TrackTable:
        return cls(
            np.empty((0, 2), np.int64),
            np.zeros(1, np.int64),
            np.empty(0),
            np.empty((0, state_dim)),
            np.empty((0, state_dim, state_dim)),
        )
