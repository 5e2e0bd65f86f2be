"""The track table of labelled densities: labels and Gaussian mixtures, flat with offsets, and parts and moments."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from vedette.densities import checks
from vedette.densities.containers import Components, for_kernel, kernel_arrays, no_components, unchecked
from vedette.errors import InputError, NumericalError, VedetteError
from vedette.internal.text import pluralise
from vedette.kernels.base import types as kt
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.gaussian.components import components_of, taken_components, without_modes
from vedette.kernels.gaussian.marks import NOT_DRAWN, unmarked
from vedette.kernels.gaussian.mixtures import heaviest_of_runs
from vedette.kernels.gaussian.pooling import merged_mixtures, reduced_tracks
from vedette.kernels.gaussian.reduction import MixtureCaps

UNSCANNED = -2  # replaces a measurement index
DEFAULT_MERGE_DISTANCE = 2.0
OF_ANY_MODE = MixtureCaps(-math.inf, DEFAULT_MERGE_DISTANCE, 2**62)  # for components of different modes
_ARRAYS = kernel_arrays("labels", "offsets", *kt.Mixture._fields)


@dataclass(frozen=True, slots=True, repr=False)
class TrackTable(Components):
    """Gaussian-mixture densities of labelled tracks.

    Attributes:
        labels: (num_tracks, 2) birth step and birth index of each track.
        offsets: (num_tracks + 1,) components of track `i` are `offsets[i]:offsets[i + 1]`.
        log_weights: (num_components,) log mixture weights, normalised within each track.
        means: (num_components, state_dim).
        covs: (num_components, state_dim, state_dim), symmetric positive definite.
        marks: optional columns of the components, such as log probabilities of classes.
        sources: (num_tracks, 2) origin of each track in a `DeltaGlmbFilter`: its track in the previous belief, -1 if it
            was born, and the row of its measurement in the scan, -1 if it was missed, -2 if there was no scan (a
            prediction). None for tracks made of several, or by another filter, and if the origin is unknown.

    The arrays are copied, checked once at creation, and read-only afterwards.
    """

    labels: Ints
    offsets: Ints
    log_weights: Floats
    means: Floats
    covs: Floats
    marks: kt.Marks = field(default_factory=unmarked)
    sources: Ints | None = None

    @property
    def num_tracks(self) -> int:
        """Number of tracks."""
        return len(self.labels)

    def _summary(self) -> str:
        components = pluralise(len(self.log_weights), "component")
        return f"of {pluralise(self.num_tracks, 'track')} in {components}, of {self.state_dim} state components"

    @property
    def measurements(self) -> Ints | None:
        """Measurements in `sources`, shape (num_tracks,), or None if they are unknown or there was no scan."""
        return None if self.sources is None or (self.sources[:, 1] == UNSCANNED).any() else self.sources[:, 1]

    def to_kernel(self) -> kt.Tracks:
        """Return the arrays as a kernel bundle."""
        labels, offsets, log_weights, means, covs, marks = _ARRAYS(self)
        return kt.Tracks(labels, offsets, kt.Mixture(log_weights, means, covs, marks))

    @classmethod
    def from_kernel(cls, tracks: kt.Tracks, sources: Ints | None = None) -> "TrackTable":
        """Return a table with the arrays of a kernel bundle, without copies and checks."""
        return unchecked(cls, tracks.labels, tracks.offsets, *tracks.components, sources)

    @classmethod
    def empty(cls, like: Any) -> "TrackTable":
        """Return a table without tracks. Raises `InputError` for an invalid state dimension.

        like: a state dimension, or a track table, density without labels or birth model of the same states and marks.
        """
        return cls.from_kernel(kt.Tracks(np.empty((0, 2), np.int64), np.zeros(1, np.int64), no_components(like)))

    @classmethod
    def from_gaussians(cls, labels: Any, means: Any, covs: Any) -> "TrackTable":
        """Return tracks of one Gaussian each.

        labels: (num_tracks, 2) integers. means: (num_tracks, state_dim). covs: (num_tracks, state_dim, state_dim).
        Raises `InputError` for another shape, or for a covariance that is not symmetric positive definite.
        """
        checked = checks.as_ints("labels", labels, (None, 2))
        num = len(checked)
        return cls(checked, np.arange(num + 1), np.zeros(num), *checks.as_gaussians(means, covs, num))

    @classmethod
    def from_mixtures(cls, labels: Any, mixtures: Sequence[tuple[Any, Any, Any]]) -> "TrackTable":
        """Return tracks of one Gaussian mixture each, as (weights, means, covs) with linear weights that sum to one.

        Raises `InputError` for another shape, for weights that are negative or do not sum to one, or for a covariance
        that is not symmetric positive definite.
        """
        checked = checks.as_ints("labels", labels, (len(mixtures), 2))
        if not mixtures:
            raise InputError("mixtures: expected at least one; got none (use TrackTable.empty)")
        weights = [log_weights(f"mixtures[{i}] weights", mixture[0]) for i, mixture in enumerate(mixtures)]
        means, covs, dim = [], [], None
        for i, mixture in enumerate(mixtures):
            num = len(weights[i])
            means.append(checks.as_floats(f"mixtures[{i}] means", mixture[1], (num, dim)))
            dim = means[0].shape[1]
            covs.append(checks.as_floats(f"mixtures[{i}] covs", mixture[2], (num, dim, dim)))
        offsets = np.cumsum([0, *(len(weight) for weight in weights)])
        return cls(checked, offsets, np.concatenate(weights), np.concatenate(means), np.concatenate(covs))

    def validate(self, *, error: type[VedetteError] = NumericalError) -> None:
        """Raise unless every array has its type and shape and every track is a probability density.

        `InputError` for faults of form, and `error` for values that are not finite, not normalised to 1e-9 or
        covariances that are not symmetric positive definite.
        """
        checks.check_array("tracks.labels", self.labels, np.int64, (None, 2))
        checks.check_mixtures("tracks.", self, self.offsets, self.num_tracks, error)
        if self.sources is not None:
            checks.check_sources("tracks.sources", self.sources, self.num_tracks)


def log_weights(field: str, weights: Any) -> Floats:
    """Return the logs of a user's linear weights. Raises `InputError` for a weight that is negative or not finite."""
    linear = checks.as_floats(field, weights, (None,))
    if not np.all((linear >= 0.0) & (linear < np.inf)):
        raise InputError(f"{field}: expected numbers of at least 0; got {linear.tolist()}")
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(linear))


def take_tracks(tracks: TrackTable, places: Ints) -> TrackTable:
    """Return the tracks at `places`, in that order."""
    offsets, components = checks.take_runs(tracks.offsets, places)
    taken = taken_components(tracks.to_kernel().components, components)
    sources = None if tracks.sources is None else tracks.sources[places]
    return TrackTable.from_kernel(kt.Tracks(tracks.labels[places], offsets, taken), sources)


def tracks_between(tracks: TrackTable, first: int, last: int) -> TrackTable:
    """Return the tracks `first:last`."""
    start, stop = tracks.offsets[first], tracks.offsets[last]
    components = taken_components(tracks.to_kernel().components, slice(start, stop))
    sources = None if tracks.sources is None else tracks.sources[first:last]
    offsets = tracks.offsets[first : last + 1] - start
    return TrackTable.from_kernel(kt.Tracks(tracks.labels[first:last], offsets, components), sources)


def relabelled_tracks(tracks: TrackTable, labels: Ints) -> TrackTable:
    """Return the same mixtures with other labels."""
    return tracks.with_fields(labels=labels, sources=None)


def places_of(labels: Ints, table: Ints) -> Ints:
    """Return the place of each label among the distinct labels of a table, shape (num_labels,), or -1 if absent."""
    place = {tuple(label): i for i, label in enumerate(table.tolist())}
    return np.array([place.get(tuple(label), -1) for label in labels.tolist()], np.int64)


def gaussian_tracks(labels: Ints, means: Floats, covs: Floats, marks: kt.Marks | None = None) -> TrackTable:
    """Return `TrackTable.from_gaussians` of internal arrays, without copies and checks."""
    num = len(labels)
    components = components_of(np.zeros(num), means, covs, marks)
    return TrackTable.from_kernel(kt.Tracks(labels, np.arange(num + 1), components))


def place_labels(tables: Sequence[Ints]) -> tuple[Ints, Ints]:
    """Labels (num_labels, 2) of several tables in increasing order, and their places (num_labels, num_tables).

    A table must not have a label twice. The place is -1 if the table lacks the label.
    """
    labels, row = checks.distinct_labels(np.concatenate(tables))
    places, ends = np.full((len(labels), len(tables)), -1), checks.offsets_of([len(table) for table in tables])
    for t, (low, high) in enumerate(pairwise(ends.tolist())):
        places[row[low:high], t] = np.arange(high - low)
    return labels, places


def single_gaussians(tracks: TrackTable) -> TrackTable:
    """Return the tracks with each mixture replaced by one Gaussian of its moments."""
    if len(tracks.log_weights) == tracks.num_tracks:
        return tracks
    return gaussian_tracks(tracks.labels, *merged_tracks(tracks)[1:])


def mixture_moments(log_weights: Floats, means: Floats, covs: Floats) -> tuple[Floats, Floats]:
    """Return the mean (state_dim,) and covariance (state_dim, state_dim) of one Gaussian mixture of any total weight.

    Raises `InputError` for a mixture of weight zero.
    """
    if not (np.asarray(log_weights) > -math.inf).any():
        raise InputError("log_weights: expected a mixture of positive weight; got none")
    log_weights, means, covs = (np.array(given, np.float64) for given in (log_weights, means, covs))
    merged = merged_mixtures(components_of(log_weights, means, covs), np.array([0, len(log_weights)]))
    return merged.means[0], merged.covs[0]


def over_modes(tracks: TrackTable) -> TrackTable:
    """Return the tracks without modes, so that near components of different ones are one."""
    if not tracks.has_modes:
        return tracks
    given = tracks.to_kernel()
    plain = without_modes(given.components)
    return TrackTable.from_kernel(reduced_tracks(given._replace(components=plain), OF_ANY_MODE))


def mode_probabilities(tracks: TrackTable) -> Floats:
    """Return the probability of each mode of each track, (num_tracks, number of modes that occur)."""
    modes = tracks.modes
    table = np.zeros((tracks.num_tracks, modes.max(initial=NOT_DRAWN) + 1))
    owner, drawn = np.repeat(np.arange(tracks.num_tracks), np.diff(tracks.offsets)), np.flatnonzero(modes != NOT_DRAWN)
    if len(drawn):
        np.add.at(table, (owner[drawn], modes[drawn]), np.exp(tracks.log_weights[drawn]))
    return table


def merged_tracks(tracks: TrackTable) -> kt.Mixture:
    """Return one component for each track, of its moments and with its marks merged, in new arrays."""
    return merged_mixtures(tracks.to_kernel().components, for_kernel(tracks.offsets))


def track_moments(tracks: TrackTable) -> tuple[Floats, Floats]:
    """Return the mean (num_tracks, state_dim) and covariance (num_tracks, state_dim, state_dim) of every track."""
    merged = merged_tracks(tracks)
    return merged.means, merged.covs


def heaviest_components(log_weights: Floats, offsets: Ints, chosen: Ints) -> Ints:
    """Heaviest component of each chosen mixture of a density, shape (len(chosen),), the first on a tie."""
    return heaviest_of_runs(for_kernel(log_weights), for_kernel(offsets), np.array(chosen, np.int64))
