"""Generalized labelled multi-Bernoulli density with Gaussian-mixture tracks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vedette.densities import checks
from vedette.densities.containers import Container, kernel_arrays, unchecked
from vedette.densities.tracks import TrackTable, log_weights
from vedette.errors import InputError, NumericalError, VedetteError
from vedette.kernels.base import types as kt
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.labelled.labels import group_by_label_set

_ARRAYS = kernel_arrays("hyp_offsets", "hyp_tracks", "hyp_log_weights")


@dataclass(frozen=True, slots=True)
class GLMB(Container):
    """delta-GLMB density (paper eq. 4); marginalised delta-GLMB (eq. 10) where every label set occurs once.

    Attributes:
        tracks: track table shared by all hypotheses.
        hyp_offsets: (num_hyps + 1,) tracks of hypothesis `h` are `hyp_tracks[hyp_offsets[h]:hyp_offsets[h + 1]]`.
        hyp_tracks: indices into `tracks`, in increasing label order within a hypothesis.
        hyp_log_weights: (num_hyps,) normalised log weights.

    The arrays are copied, checked once, here, and read-only from then on.

    Raises:
        InputError: as `validate`.
    """

    tracks: TrackTable
    hyp_offsets: Ints
    hyp_tracks: Ints
    hyp_log_weights: Floats

    def __post_init__(self) -> None:
        self._own_arrays()
        if not isinstance(self.tracks, TrackTable):
            raise InputError(f"tracks: expected a TrackTable; got {type(self.tracks).__name__}")
        self._validate_hypotheses(InputError)

    @property
    def num_hyps(self) -> int:
        """Number of hypotheses."""
        return len(self.hyp_log_weights)

    @property
    def state_dim(self) -> int:
        """Length of a target's state."""
        return int(self.tracks.means.shape[1])

    @property
    def is_marginalised(self) -> bool:
        """Whether every label set occurs once."""
        return len(group_by_label_set(self.to_kernel())[1]) == self.num_hyps

    def to_kernel(self) -> kt.Glmb:
        """The same arrays as the bundle that kernels take."""
        return kt.Glmb(self.tracks.to_kernel(), *_ARRAYS(self))

    @classmethod
    def from_kernel(cls, glmb: kt.Glmb) -> GLMB:
        """The arrays of a bundle as they are; a kernel's own need no check."""
        return unchecked(cls, TrackTable.from_kernel(glmb.tracks), *glmb[1:])

    @classmethod
    def empty(cls, state_dim: int) -> GLMB:
        """The density that is certain of no target."""
        none = TrackTable.empty(state_dim)
        return unchecked(cls, none, np.zeros(2, np.int64), np.empty(0, np.int64), np.zeros(1))

    @classmethod
    def from_hypotheses(cls, tracks: TrackTable, hypotheses: Sequence[Sequence[int]], weights: Any) -> GLMB:
        """Density from hypotheses, each a sequence of indices into `tracks` in any order, and their linear weights.

        Raises `InputError` for an index that is not in the table, for a label twice in one hypothesis, and for weights
        that are negative or do not sum to one.
        """
        hyp_log_weights = log_weights("weights", weights)
        if len(hyp_log_weights) != len(hypotheses):
            raise InputError(f"weights: expected {len(hypotheses)}, one a hypothesis; got {len(hyp_log_weights)}")
        hyps = [checks.as_ints(f"hypotheses[{h}]", hyp, (None,)) for h, hyp in enumerate(hypotheses)]
        for h, hyp in enumerate(hyps):
            _check_indices(f"hypotheses[{h}]", hyp, tracks.num_tracks)
            hyps[h] = hyp[np.lexsort(tracks.labels[hyp].T[::-1])]
        hyp_offsets = np.cumsum([0, *(len(hyp) for hyp in hyps)])
        return cls(tracks, hyp_offsets, np.concatenate([np.empty(0, np.int64), *hyps]), hyp_log_weights)

    def validate(self, *, error: type[VedetteError] = NumericalError) -> None:
        """Raise unless this is a normalised density over tracks that exist, in label order, no label twice in one.

        `InputError` for faults of form; `error` for values that are not finite, not normalised to 1e-9 or covariances
        that are not symmetric positive definite.
        """
        self.tracks.validate(error=error)
        self._validate_hypotheses(error)

    def _validate_hypotheses(self, error: type[VedetteError]) -> None:
        checks.check_array("hyp_log_weights", self.hyp_log_weights, np.float64, (None,))
        if self.num_hyps == 0:
            raise InputError("hyp_log_weights: expected at least one hypothesis; got none")
        checks.check_array("hyp_tracks", self.hyp_tracks, np.int64, (None,))
        num_entries = len(self.hyp_tracks)
        checks.check_offsets("hyp_offsets", self.hyp_offsets, self.num_hyps, num_entries, empty_allowed=True)
        _check_indices("hyp_tracks", self.hyp_tracks, self.tracks.num_tracks)
        in_order = checks.labels_increase(self.tracks.labels[self.hyp_tracks], self.hyp_offsets)
        if not in_order.all():
            place = int(np.flatnonzero(~in_order)[0])
            hyp = int(np.searchsorted(self.hyp_offsets, place, side="right")) - 1
            pair = self.tracks.labels[self.hyp_tracks[place : place + 2]].tolist()
            raise InputError(f"hyp_tracks: expected distinct labels in increasing order; hypothesis {hyp} has {pair}")
        checks.check_log_weights("hyp_log_weights", self.hyp_log_weights, error)
        checks.check_normalised("hyp_log_weights", self.hyp_log_weights, np.array([0, self.num_hyps]), error)


def _check_indices(field: str, indices: Ints, num_tracks: int) -> None:
    faulty = (indices < 0) | (indices >= num_tracks)
    if faulty.any():
        place = int(np.flatnonzero(faulty)[0])
        raise InputError(f"{field}[{place}]: expected an index into {num_tracks} tracks; got {indices[place]}")
