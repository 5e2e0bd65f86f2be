"""Base of the labelled densities, and the simplest of them, the labelled multi-Bernoulli."""

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, Self

import numpy as np

from vedette.densities import checks
from vedette.densities.containers import MultiTarget, for_kernel, unchecked
from vedette.densities.inspection import Hypothesis, Target, Targets, indices_or_none
from vedette.densities.tracks import TrackTable, merged_tracks, mode_probabilities, take_tracks
from vedette.errors import InputError, NumericalError, VedetteError
from vedette.internal.probabilities import expit
from vedette.internal.text import pluralise
from vedette.kernels.base import types as kt
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.gaussian.components import taken_components
from vedette.kernels.gaussian.pooling import merged_mixtures
from vedette.kernels.labelled.cardinality import convolved
from vedette.kernels.labelled.conversions import factored_to_glmb

LABELLED = "a GLMB, an LMB or a FactoredGLMB"  # description in messages


class LabelledDensity(MultiTarget):
    """A labelled multi-target density: a product of factors, each a weighted list of label sets, over one track table.

    An LMB is one factor per label, with the sets {} and {l}. A GLMB is one factor, and a FactoredGLMB any number of
    them. Operations that all of them support are methods of this class, so that callers need not distinguish them.

    Attributes:
        tracks: track table of all factors.
        is_lmb: whether every label is a factor of its own, of one track.
        is_product: whether it is stored as a product of GLMBs, whatever their number.
    """

    __slots__ = ()
    tracks: TrackTable
    is_lmb: ClassVar[bool]
    is_product: ClassVar[bool]

    def _own_parts(self) -> None:
        self._own_arrays()
        if not isinstance(self.tracks, TrackTable):
            raise InputError(f"tracks: expected a TrackTable; got {type(self.tracks).__name__}")
        self._validate_form(InputError)

    @property
    def state_dim(self) -> int:
        """Length of a target's state."""
        return int(self.tracks.means.shape[1])

    @property
    def num_classes(self) -> int:
        """Number of classes of targets, or 0 if they have none."""
        return self.tracks.num_classes

    @property
    @abstractmethod
    def is_marginalised(self) -> bool:
        """True if every label set occurs once in its factor."""

    @property
    @abstractmethod
    def track_existence(self) -> Floats:
        """Probability that a target exists and has this track, shape (num_tracks,)."""

    def cardinality_of_labels(self) -> Floats:
        """Return the probabilities of 0, 1, ... labelled targets."""
        return self.cardinality()

    @abstractmethod
    def label_existence(self) -> tuple[Ints, Floats]:
        """See `vedette.densities.existence_probabilities`."""

    def __len__(self) -> int:
        """Number of labels, probable or not."""
        return len(self.label_existence()[0])

    def targets(self) -> Iterator[Target]:
        """Iterate over label, existence probability, mean and covariance of each target, in increasing label order.

        Mean and covariance are those of the label's marginal density, over all hypotheses and components. For an
        estimate that keeps rival components apart see `vedette.densities.map_estimate`.
        """
        return self._targets().each()

    def hypotheses(self, max_hypotheses: int = 1000) -> Iterator[Hypothesis]:
        """Iterate over the likeliest hypotheses by descending weight: `weight`, `labels`, and `tracks` (table rows).

        `measurements` has, label by label, the row of the last scan that the hypothesis associates with the target,
        None if it was missed. It is known, and not None as a whole, after the scan of a `DeltaGlmbFilter` that is not
        marginalised. `TrackTable.sources` gives the previous track of each. In an LMB and in a product of GLMBs a track
        combines the effect of all measurements.

        For a product, such as an LMB, these are products of one hypothesis of each factor. The weights are
        probabilities: with more than `max_hypotheses` hypotheses, they sum to less than one. Raises `InputError` for a
        `max_hypotheses` below 1.
        """
        (listed, left_out), taken = self.heaviest_sets(max_hypotheses), self.tracks.measurements
        weights, ends = np.exp(listed.hyp_log_weights) * (1.0 - left_out), listed.hyp_offsets.tolist()
        for weight, first, last in zip(weights.tolist(), ends[:-1], ends[1:], strict=True):
            tracks = listed.hyp_tracks[first:last]
            labels = tuple((step, index) for step, index in self.tracks.labels[tracks].tolist())
            yield Hypothesis(weight, labels, tracks, None if taken is None else tuple(indices_or_none(taken[tracks])))

    def heaviest_sets(self, max_hypotheses: int) -> tuple[kt.Glmb, float]:
        """See `vedette.densities.as_glmb`."""
        if max_hypotheses < 1:
            raise InputError(f"max_hypotheses: expected at least 1; got {max_hypotheses}")
        labels, label_of = checks.distinct_labels(self.tracks.labels)
        glmb, left_out = factored_to_glmb(self.to_factors(), label_of, len(labels), int(max_hypotheses))
        return glmb, float(left_out)

    def _targets(self) -> Targets:
        labels, existence = self.label_existence()
        table, place = checks.distinct_labels(self.tracks.labels)
        merged = merged_tracks(self.tracks)
        if len(labels) == 0:
            return Targets(labels, existence, merged.means[:0], merged.covs[:0])
        weights, counts = self.track_existence, np.bincount(place)
        totals = np.bincount(place, weights)[place]
        shares = np.where(totals > 0.0, weights / np.where(totals > 0.0, totals, 1.0), 1.0 / counts[place])
        order = np.argsort(place, kind="stable")
        with np.errstate(divide="ignore"):
            versions = taken_components(merged._replace(log_weights=np.log(shares)), order)
        moments = merged_mixtures(versions, checks.offsets_of(counts))
        of_tracks = shares[:, np.newaxis] * mode_probabilities(self.tracks)
        modes = np.zeros((len(table), of_tracks.shape[1]))
        np.add.at(modes, place, of_tracks)
        _, row = checks.distinct_labels(np.concatenate([table, labels]))  # the table may contain unused labels
        own = row[len(table) :]
        taken = self.tracks.measurements
        if taken is not None:
            chances = np.zeros((len(table), taken.max() + 2))  # per label: missed, then by measurement
            np.add.at(chances, (place, taken + 1), weights)
            taken = chances.argmax(axis=1)[own] - 1
        return Targets(labels, existence, moments.means[own], moments.covs[own], modes[own], taken)

    def _parts(self) -> str:
        """Return the part of the summary after the labels."""
        return ""

    def _summary(self) -> str:
        labels, existence = self.label_existence()
        return f"of {pluralise(len(labels), 'label')}{self._parts()}, {existence.sum():.4g} targets expected"

    @abstractmethod
    def to_kernel(self) -> Any:
        """Return the arrays as a kernel bundle."""

    @abstractmethod
    def to_factors(self) -> kt.FactoredGlmb:
        """Return the factors as a kernel bundle."""

    def as_hypotheses(self) -> kt.Glmb:
        """Return the hypotheses of all factors as one list. Its weights sum to the number of factors."""
        factors = self.to_factors()
        return kt.Glmb(factors.tracks, factors.hyp_offsets, factors.hyp_tracks, factors.hyp_log_weights)

    @abstractmethod
    def with_labels(self, labels: Ints) -> Self:
        """Return the density with other labels (num_tracks, 2). Distinct labels must stay distinct."""

    def validate(self, *, error: type[VedetteError] = NumericalError) -> None:
        """Raise unless the tracks are probability densities, and hypotheses are normalised and in label order.

        `InputError` for faults of form, and `error` for values that are not finite, not normalised to 1e-9 or
        covariances that are not symmetric positive definite.
        """
        self.tracks.validate(error=error)
        self._validate_form(error)

    @abstractmethod
    def _validate_form(self, error: type[VedetteError]) -> None:
        """Raise if an array outside the track table is invalid."""


@dataclass(frozen=True, slots=True, repr=False)
class LMB(LabelledDensity):
    """Labelled multi-Bernoulli density: independent tracks, each with a probability of existence.

    Attributes:
        tracks: one track per label, in increasing label order.
        existence_logit: (num_tracks,) log r - log(1 - r), with full precision near r = 0 and r = 1, where it may be
            -inf and inf.

    The arrays are copied, checked once at creation, and read-only afterwards.
    """

    tracks: TrackTable
    existence_logit: Floats
    is_lmb: ClassVar[Literal[True]] = True
    is_product: ClassVar[Literal[False]] = False

    def __post_init__(self) -> None:
        self._own_parts()

    @property
    def existence(self) -> Floats:
        """Existence probabilities r, shape (num_tracks,)."""
        return expit(self.existence_logit)

    @property
    def track_existence(self) -> Floats:
        """Existence probabilities r, shape (num_tracks,), as each label has one track."""
        return self.existence

    @property
    def is_marginalised(self) -> bool:
        """Always True."""
        return True

    def label_existence(self) -> tuple[Ints, Floats]:
        """See `vedette.densities.existence_probabilities`."""
        return self.tracks.labels, self.existence

    def cardinality(self) -> Floats:
        """Return the probabilities of 0, 1, ..., num_tracks targets."""
        return poisson_binomial(self.existence_logit)

    def to_kernel(self) -> kt.Lmb:
        """Return the arrays as a kernel bundle."""
        return kt.Lmb(self.tracks.to_kernel(), for_kernel(self.existence_logit))

    def to_factors(self) -> kt.FactoredGlmb:
        """Return a kernel bundle with one factor per label, whose hypotheses are absence and presence."""
        num = self.tracks.num_tracks
        log_weights = np.empty((num, 2))
        log_weights[:, 0] = -np.logaddexp(0.0, self.existence_logit)
        log_weights[:, 1] = -np.logaddexp(0.0, -self.existence_logit)
        each = np.arange(num + 1)
        ends = np.repeat(each, 2)[:-1]
        return kt.FactoredGlmb(self.tracks.to_kernel(), each, ends, np.arange(num), log_weights.ravel(), 2 * each)

    def with_labels(self, labels: Ints) -> "LMB":
        """Return the density with other labels, sorted in increasing order."""
        return self.with_fields(tracks=self.tracks.with_fields(labels=labels)).take(np.lexsort(labels.T[::-1]))

    def take(self, places: Ints) -> "LMB":
        """Return the labels at `places`, in that order."""
        return unchecked(LMB, take_tracks(self.tracks, places), self.existence_logit[places])

    @classmethod
    def from_kernel(cls, lmb: kt.Lmb) -> "LMB":
        """Return a density with the arrays of a kernel bundle, without copies and checks."""
        return unchecked(cls, TrackTable.from_kernel(lmb.tracks), lmb.existence_logit)

    @classmethod
    def empty(cls, like: Any) -> "LMB":
        """Return the density that is certain of no target. like: as in `TrackTable.empty`."""
        return unchecked(cls, TrackTable.empty(like), np.empty(0))

    @classmethod
    def from_bernoullis(cls, labels: Any, existence: Any, means: Any, covs: Any) -> "LMB":
        """Return a density of one Gaussian per label. The labels may be in any order and are sorted.

        labels: (num_tracks, 2) integers. existence: (num_tracks,) in [0, 1]. means: (num_tracks, state_dim).
        covs: (num_tracks, state_dim, state_dim). Raises `InputError` for another shape, a label twice, a probability
        outside [0, 1], or a covariance that is not symmetric positive definite.
        """
        given = TrackTable.from_gaussians(labels, means, covs)
        logit = checks.as_logits("existence", existence, given.num_tracks)
        order = np.lexsort(given.labels.T[::-1])
        return cls(take_tracks(given, order), logit[order])

    def _validate_form(self, error: type[VedetteError]) -> None:
        checks.check_array("existence_logit", self.existence_logit, np.float64, (self.tracks.num_tracks,))
        in_order = checks.label_step_up(self.tracks.labels)
        if not in_order.all():
            place = int(np.flatnonzero(~in_order)[0])
            pair = self.tracks.labels[place : place + 2].tolist()
            raise InputError(f"tracks.labels[{place}]: expected distinct labels in increasing order; got {pair}")
        checks.check_logits("existence_logit", self.existence_logit, error)


def poisson_binomial(existence_logit: Floats) -> Floats:
    """Return the distribution of the number of independent targets that exist."""
    chances = np.stack([expit(-existence_logit), expit(existence_logit)], axis=1)
    return convolved(chances.ravel(), 2 * np.arange(len(chances) + 1))
