"""Densities of listed hypotheses, and the generalised labelled multi-Bernoulli, which is a single list."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, Self

import numpy as np

from vedette.densities import checks
from vedette.densities.containers import kernel_arrays, unchecked
from vedette.densities.labelled import LabelledDensity
from vedette.densities.tracks import TrackTable, log_weights
from vedette.errors import InputError, VedetteError
from vedette.internal.text import pluralise
from vedette.kernels.base import types as kt
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.labelled.labels import group_by_label_set

_HYPOTHESES = kernel_arrays("hyp_offsets", "hyp_tracks", "hyp_log_weights")


class Hypotheses(LabelledDensity):
    """Base of densities whose factors are lists of hypotheses, each a set of tracks with its weight in the factor."""

    __slots__ = ()
    hyp_offsets: Ints
    hyp_tracks: Ints
    hyp_log_weights: Floats
    is_lmb: ClassVar[Literal[False]] = False

    def __post_init__(self) -> None:
        self._own_parts()

    @property
    def num_hyps(self) -> int:
        """Number of hypotheses, over all factors."""
        return len(self.hyp_log_weights)

    def _parts(self) -> str:
        hyps = "1 hypothesis" if self.num_hyps == 1 else f"{self.num_hyps} hypotheses"
        return f", {pluralise(self.tracks.num_tracks, 'track')}, {hyps}"

    @property
    def track_existence(self) -> Floats:
        """Probability that a target exists and has this track, shape (num_tracks,)."""
        weights = np.repeat(np.exp(self.hyp_log_weights), np.diff(self.hyp_offsets))
        return np.bincount(self.hyp_tracks, weights, self.tracks.num_tracks).astype(np.float64)

    def label_existence(self) -> tuple[Ints, Floats]:
        """See `vedette.densities.existence_probabilities`."""
        labels, place = checks.distinct_labels(self.tracks.labels)
        label_of = place[self.hyp_tracks]
        weights = np.repeat(np.exp(self.hyp_log_weights), np.diff(self.hyp_offsets))
        held = np.bincount(label_of, minlength=len(labels)) > 0  # the table may contain unused labels
        return labels[held], np.minimum(np.bincount(label_of, weights, len(labels))[held], 1.0)

    def with_labels(self, labels: Ints) -> Self:
        """Return the density with other labels (num_tracks, 2). Distinct labels must stay distinct."""
        members, hyps = labels[self.hyp_tracks], np.repeat(np.arange(self.num_hyps), np.diff(self.hyp_offsets))
        order = np.lexsort((members[:, 1], members[:, 0], hyps))
        return self.with_fields(tracks=self.tracks.with_fields(labels=labels), hyp_tracks=self.hyp_tracks[order])


@dataclass(frozen=True, slots=True, repr=False)
class GLMB(Hypotheses):
    """delta-GLMB density (paper eq. 4), marginalised delta-GLMB (eq. 10) if every label set occurs once.

    Attributes:
        tracks: track table shared by all hypotheses.
        hyp_offsets: (num_hyps + 1,) tracks of hypothesis `h` are `hyp_tracks[hyp_offsets[h]:hyp_offsets[h + 1]]`.
        hyp_tracks: indices into `tracks`, in increasing label order within a hypothesis.
        hyp_log_weights: (num_hyps,) normalised log weights.

    The arrays are copied, checked once at creation, and read-only afterwards.
    """

    tracks: TrackTable
    hyp_offsets: Ints
    hyp_tracks: Ints
    hyp_log_weights: Floats
    is_product: ClassVar[Literal[False]] = False

    @property
    def is_marginalised(self) -> bool:
        """True if every label set occurs once."""
        return len(group_by_label_set(self.to_kernel())[1]) == self.num_hyps

    def cardinality(self) -> Floats:
        """Return the probabilities of 0, 1, ... targets, up to the size of the largest hypothesis."""
        return np.asarray(np.bincount(np.diff(self.hyp_offsets), np.exp(self.hyp_log_weights)), np.float64)

    def heaviest(self, number: int) -> tuple[Ints, Floats]:
        """Return the heaviest hypothesis of `number` targets: tracks and existence probability of each one's label."""
        candidates = np.flatnonzero(np.diff(self.hyp_offsets) == number)
        best = int(candidates[np.argmax(self.hyp_log_weights[candidates])])
        chosen = self.hyp_tracks[self.hyp_offsets[best] : self.hyp_offsets[best + 1]]
        labels = self.tracks.labels
        same = (labels[:, None, 0] == labels[chosen, 0]) & (labels[:, None, 1] == labels[chosen, 1])
        return chosen, np.minimum(self.track_existence @ same, 1.0)

    def to_kernel(self) -> kt.Glmb:
        """Return the arrays as a kernel bundle."""
        return kt.Glmb(self.tracks.to_kernel(), *_HYPOTHESES(self))

    def to_factors(self) -> kt.FactoredGlmb:
        """Return the density as a kernel bundle with one factor."""
        own = self.to_kernel()
        tracks_end, hyps_end = np.array([0, len(own.tracks.labels)]), np.array([0, len(own.hyp_log_weights)])
        return kt.FactoredGlmb(own.tracks, tracks_end, *own[1:], hyps_end)

    @classmethod
    def from_kernel(cls, glmb: kt.Glmb, sources: Ints | None = None) -> "GLMB":
        """Return a density with the arrays of a kernel bundle and its track sources, without copies and checks."""
        return unchecked(cls, TrackTable.from_kernel(glmb.tracks, sources), *glmb[1:])

    @classmethod
    def empty(cls, like: Any) -> "GLMB":
        """Return the density that is certain of no target. like: as in `TrackTable.empty`."""
        return unchecked(cls, TrackTable.empty(like), np.zeros(2, np.int64), np.empty(0, np.int64), np.zeros(1))

    @classmethod
    def from_hypotheses(cls, tracks: TrackTable, hypotheses: Sequence[Sequence[int]], weights: Any) -> "GLMB":
        """Return the density of hypotheses, each a sequence of indices into `tracks`, and their linear weights.

        The indices may be in any order. Raises `InputError` for an index outside the table, a label twice in one
        hypothesis, and weights that are negative or do not sum to one.
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

    def _validate_form(self, error: type[VedetteError]) -> None:
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
