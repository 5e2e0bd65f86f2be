"""Labelled multi-Bernoulli density with Gaussian-mixture tracks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from vedette.densities import checks
from vedette.densities.containers import Container, for_kernel, unchecked
from vedette.densities.tracks import TrackTable
from vedette.errors import InputError, NumericalError, VedetteError
from vedette.kernels.base import types as kt
from vedette.kernels.base.types import Floats
from vedette.probabilities import expit


@dataclass(frozen=True, slots=True)
class LMB(Container):
    """Labelled multi-Bernoulli density: independent tracks, each with a probability of existence.

    Attributes:
        tracks: one track a label, in increasing label order.
        existence_logit: (num_tracks,) log r - log(1 - r); keeps full precision near r = 0 and r = 1, where it may be
            -inf and inf.

    The arrays are copied, checked once, here, and read-only from then on.

    Raises:
        InputError: as `validate`.
    """

    tracks: TrackTable
    existence_logit: Floats

    def __post_init__(self) -> None:
        self._own_arrays()
        if not isinstance(self.tracks, TrackTable):
            raise InputError(f"tracks: expected a TrackTable; got {type(self.tracks).__name__}")
        self._validate_existence(InputError)

    @property
    def existence(self) -> Floats:
        """(num_tracks,) probabilities of existence r."""
        return expit(self.existence_logit)

    @property
    def state_dim(self) -> int:
        """Length of a target's state."""
        return int(self.tracks.means.shape[1])

    def to_kernel(self) -> kt.Lmb:
        """The same arrays as the bundle that kernels take."""
        return kt.Lmb(self.tracks.to_kernel(), for_kernel(self.existence_logit))

    @classmethod
    def from_kernel(cls, lmb: kt.Lmb) -> LMB:
        """The arrays of a bundle as they are; a kernel's own need no check."""
        return unchecked(cls, TrackTable.from_kernel(lmb.tracks), lmb.existence_logit)

    @classmethod
    def empty(cls, state_dim: int) -> LMB:
        """The density that is certain of no target."""
        return unchecked(cls, TrackTable.empty(state_dim), np.empty(0))

    @classmethod
    def from_bernoullis(cls, labels: Any, existence: Any, means: Any, covs: Any) -> LMB:
        """Density of one Gaussian a label, in any order; it is put in increasing label order.

        labels: (num_tracks, 2) integers. existence: (num_tracks,) in [0, 1]. means: (num_tracks, state_dim).
        covs: (num_tracks, state_dim, state_dim). Raises `InputError` for another shape, a label twice, a probability
        outside [0, 1], or a covariance that is not symmetric positive definite.
        """
        given = TrackTable.from_gaussians(labels, means, covs)
        probabilities = checks.as_floats("existence", existence, (given.num_tracks,))
        if not np.all((probabilities >= 0.0) & (probabilities <= 1.0)):
            raise InputError(f"existence: expected probabilities; got {probabilities.tolist()}")
        with np.errstate(divide="ignore"):
            logit = np.log(probabilities) - np.log1p(-probabilities)
        order = np.lexsort(given.labels.T[::-1])
        tracks = TrackTable(
            given.labels[order], given.offsets, given.log_weights, given.means[order], given.covs[order]
        )
        return cls(tracks, logit[order])

    def validate(self, *, error: type[VedetteError] = NumericalError) -> None:
        """Raise unless labels increase, existences are logits and every track is a probability density.

        `InputError` for faults of form; `error` for values that are not numbers, not normalised to 1e-9 or covariances
        that are not symmetric positive definite.
        """
        self.tracks.validate(error=error)
        self._validate_existence(error)

    def _validate_existence(self, error: type[VedetteError]) -> None:
        checks.check_array("existence_logit", self.existence_logit, np.float64, (self.tracks.num_tracks,))
        in_order = checks.label_step_up(self.tracks.labels)
        if not in_order.all():
            place = int(np.flatnonzero(~in_order)[0])
            pair = self.tracks.labels[place : place + 2].tolist()
            raise InputError(f"tracks.labels[{place}]: expected distinct labels in increasing order; got {pair}")
        faulty = np.isnan(self.existence_logit)
        if faulty.any():
            raise error(f"existence_logit[{int(np.flatnonzero(faulty)[0])}]: expected a number; got nan")
