"""Factored labelled density: a product of independent GLMBs over disjoint labels."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from vedette.densities import checks
from vedette.densities.containers import kernel_arrays, unchecked
from vedette.densities.glmb import GLMB, Hypotheses
from vedette.densities.labelled import LabelledDensity
from vedette.densities.tracks import TrackTable, tracks_between
from vedette.densities.undetected import UndetectedTargets
from vedette.errors import InputError, VedetteError
from vedette.internal.text import pluralise
from vedette.kernels.base import types as kt
from vedette.kernels.base.types import Bools, Floats, Ints
from vedette.kernels.labelled.cardinality import convolved
from vedette.kernels.labelled.labels import group_by_label_set
from vedette.kernels.labelled.stacking import join_offsets, stack_glmbs
from vedette.models.arguments import instance

_FACTORS = kernel_arrays("track_offsets", "hyp_offsets", "hyp_tracks", "hyp_log_weights", "factor_offsets")


@dataclass(frozen=True, slots=True, repr=False)
class FactoredGLMB(Hypotheses):
    """Product of independent GLMBs (factors), no two of which share a label.

    A GLMB is one factor, an LMB one factor per label. The factors are independent: the probability of a label set is
    the product of the probabilities of its parts, so that a short list of hypotheses per factor represents all their
    combinations.

    Attributes:
        tracks: track table of all factors. The tracks of a factor are adjacent.
        track_offsets: (num_factors + 1,) tracks of factor `f` are `track_offsets[f]:track_offsets[f + 1]`.
        hyp_offsets: (num_hyps + 1,) tracks of hypothesis `h` are `hyp_tracks[hyp_offsets[h]:hyp_offsets[h + 1]]`.
        hyp_tracks: indices into `tracks`, in increasing label order within a hypothesis.
        hyp_log_weights: (num_hyps,) log weights, normalised within each factor.
        factor_offsets: (num_factors + 1,) hypotheses of factor `f` are `factor_offsets[f]:factor_offsets[f + 1]`.
        undetected: targets without a label, independent of all others, or None if there are none.

    The arrays are copied, checked once at creation, and read-only afterwards.
    """

    tracks: TrackTable
    track_offsets: Ints
    hyp_offsets: Ints
    hyp_tracks: Ints
    hyp_log_weights: Floats
    factor_offsets: Ints
    undetected: UndetectedTargets | None = None
    is_product: ClassVar[Literal[True]] = True

    @property
    def num_factors(self) -> int:
        """Number of factors."""
        return len(self.factor_offsets) - 1

    def _parts(self) -> str:
        rest = "" if self.undetected is None else f", undetected targets: {self.undetected.in_short()}"
        return f"{Hypotheses._parts(self)}, {pluralise(self.num_factors, 'factor')}{rest}"

    @property
    def is_bernoulli(self) -> Bools:
        """Mask (num_factors,) of the factors of one label, see `bernoulli_factors`."""
        return bernoulli_factors(self.to_kernel())

    @property
    def factor_of(self) -> Ints:
        """Index of the factor of each hypothesis, shape (num_hyps,)."""
        return np.repeat(np.arange(self.num_factors), np.diff(self.factor_offsets))

    @property
    def is_marginalised(self) -> bool:
        """True if every label set occurs once in its factor."""
        return len(sets_of_factors(self.as_hypotheses(), self.factor_of)[1]) == self.num_hyps

    def cardinality(self) -> Floats:
        """Return the probabilities of 0, 1, ... targets, labelled or not."""
        labels = self.cardinality_of_labels()
        return labels if self.undetected is None else np.convolve(labels, self.undetected.cardinality())

    def cardinality_of_labels(self) -> Floats:
        """Return the probabilities of 0, 1, ...

        Labelled targets, up to the total of the factors' largest hypotheses.
        """
        sizes, offsets = np.diff(self.hyp_offsets), self.size_offsets()
        chances = np.bincount(offsets[self.factor_of] + sizes, np.exp(self.hyp_log_weights), minlength=offsets[-1])
        return convolved(np.asarray(chances, np.float64), offsets)

    def size_offsets(self) -> Ints:
        """Offsets (num_factors + 1,) of runs with one entry for each number of targets of a factor, from 0 up."""
        sizes = np.diff(self.hyp_offsets)
        largest = np.maximum.reduceat(sizes, self.factor_offsets[:-1]) if self.num_factors else sizes
        return checks.offsets_of(largest + 1)

    def factor(self, index: int) -> GLMB:
        """Return one factor as a GLMB."""
        low, high = self.track_offsets[index], self.track_offsets[index + 1]
        first, last = self.factor_offsets[index], self.factor_offsets[index + 1]
        begin, end = self.hyp_offsets[first], self.hyp_offsets[last]
        tracks, offsets = tracks_between(self.tracks, low, high), self.hyp_offsets[first : last + 1] - begin
        return unchecked(GLMB, tracks, offsets, self.hyp_tracks[begin:end] - low, self.hyp_log_weights[first:last])

    @property
    def factors(self) -> tuple[GLMB, ...]:
        """All factors as GLMBs, in order."""
        return tuple(self.factor(index) for index in range(self.num_factors))

    def to_kernel(self) -> kt.FactoredGlmb:
        """Return the arrays as a kernel bundle."""
        return kt.FactoredGlmb(self.tracks.to_kernel(), *_FACTORS(self))

    def to_factors(self) -> kt.FactoredGlmb:
        """Return the arrays as a kernel bundle."""
        return self.to_kernel()

    @classmethod
    def from_kernel(cls, density: kt.FactoredGlmb, undetected: UndetectedTargets | None = None) -> "FactoredGLMB":
        """Return a density with the arrays of a kernel bundle, without copies and checks."""
        return unchecked(cls, TrackTable.from_kernel(density.tracks), *density[1:], undetected)

    @classmethod
    def empty(cls, like: Any) -> "FactoredGLMB":
        """Return the density that is certain of no target, without factors. like: as in `TrackTable.empty`."""
        zero, none = np.zeros(1, np.int64), np.empty(0, np.int64)
        return unchecked(cls, TrackTable.empty(like), zero, zero.copy(), none, np.empty(0), np.zeros(1, np.int64), None)

    @classmethod
    def from_factors(cls, factors: Sequence[GLMB], state_dim: int) -> "FactoredGLMB":
        """Return the product of GLMBs, no two of which may share a label.

        Raises `InputError` for a label in two factors, or a factor of another state dimension.
        """
        for index, factor in enumerate(factors):
            if not isinstance(factor, GLMB) or factor.state_dim != state_dim:
                got = f"{type(factor).__name__} of {getattr(factor, 'state_dim', 'no')} dimensions"
                raise InputError(f"factors[{index}]: expected a GLMB of states of dimension {state_dim}; got {got}")
        return cls.product([cls.of(factor) for factor in factors], state_dim)

    @classmethod
    def of(cls, density: LabelledDensity) -> "FactoredGLMB":
        """Return the same density: a GLMB as one factor, an LMB as one per label (hypotheses: absent, then present)."""
        return density if isinstance(density, cls) else unchecked(cls, density.tracks, *density.to_factors()[1:], None)

    @classmethod
    def product(cls, parts: "Sequence[FactoredGLMB]", state_dim: int) -> "FactoredGLMB":
        """Return the product of densities, no two of which may share a label: their factors, concatenated.

        state_dim: of all densities. Raises `InputError` for a label in two of them.
        """
        empty = cls.empty(parts[0].tracks if parts else state_dim)
        parts = [part for part in parts if part.num_factors > 0]
        if len(parts) < 2:
            return parts[0] if parts else empty
        stack = stack_glmbs([part.as_hypotheses() for part in parts])
        made: FactoredGLMB = unchecked(
            cls,
            TrackTable.from_kernel(stack.tracks),
            join_offsets([part.track_offsets for part in parts]),
            *stack[1:],
            join_offsets([part.factor_offsets for part in parts]),
            None,
        )
        made._validate_labels()
        return made

    def _validate_form(self, error: type[VedetteError]) -> None:
        if self.undetected is not None:
            instance("undetected", self.undetected, UndetectedTargets)
        checks.check_array("hyp_log_weights", self.hyp_log_weights, np.float64, (None,))
        checks.check_array("hyp_tracks", self.hyp_tracks, np.int64, (None,))
        checks.check_array("factor_offsets", self.factor_offsets, np.int64, (None,))
        num, num_tracks = max(self.num_factors, 0), self.tracks.num_tracks
        checks.check_offsets("factor_offsets", self.factor_offsets, num, self.num_hyps, empty_allowed=False)
        checks.check_offsets("track_offsets", self.track_offsets, num, num_tracks, empty_allowed=True)
        checks.check_offsets("hyp_offsets", self.hyp_offsets, self.num_hyps, len(self.hyp_tracks), empty_allowed=True)
        if self._factors_fit():
            num = 0  # no fault to report
        for index in range(num):
            try:
                self.factor(index)._validate_form(error)
            except VedetteError as fault:
                raise type(fault)(f"factor {index}: {fault}") from None
        self._validate_labels()

    def _factors_fit(self) -> bool:
        """Return True if each factor is a normalised GLMB. Checks all at once, as there may be thousands."""
        owner = np.repeat(self.factor_of, np.diff(self.hyp_offsets))
        if not (
            (self.track_offsets[owner] <= self.hyp_tracks) & (self.hyp_tracks < self.track_offsets[owner + 1])
        ).all():
            return False
        in_order = checks.labels_increase(self.tracks.labels[self.hyp_tracks], self.hyp_offsets)
        weights = self.hyp_log_weights
        if not in_order.all() or np.isnan(weights).any() or (weights == np.inf).any():
            return False
        sums = checks.run_log_sums(weights, self.factor_offsets)
        return bool((np.abs(sums) <= checks.NORMALISATION_TOLERANCE).all())

    def _validate_labels(self) -> None:
        """Raise `InputError` if two factors share a label."""
        factor_of = np.repeat(np.arange(self.num_factors), np.diff(self.track_offsets))
        labels = self.tracks.labels
        order = np.lexsort((factor_of, labels[:, 1], labels[:, 0]))
        same = (labels[order[1:]] == labels[order[:-1]]).all(axis=1) & (factor_of[order[1:]] != factor_of[order[:-1]])
        if same.any():
            place = int(np.flatnonzero(same)[0])
            pair = [int(factor_of[order[place]]), int(factor_of[order[place + 1]])]
            raise InputError(
                f"tracks.labels: expected each label in one factor; got {labels[order[place]].tolist()} in {pair}"
            )


def sets_of_factors(hypotheses: kt.Glmb, factor_of: Ints) -> tuple[Ints, Ints]:
    """Return `group_by_label_set` with separate sets for hypotheses of different factors. factor_of: (num_hyps,)."""
    set_of, first = group_by_label_set(hypotheses)
    if (factor_of == factor_of[:1]).all():
        return set_of, first
    numbers = set_of * (factor_of.max() + 1) + factor_of
    _, first, place = np.unique(numbers, return_index=True, return_inverse=True)
    order = np.argsort(first)
    return np.argsort(order)[place], first[order]


def bernoulli_factors(density: kt.FactoredGlmb) -> Bools:
    """Mask (num_factors,) of the factors of one label in the form of an LMB: absent, then present."""
    tracks, factors, hyps = density.track_offsets, density.factor_offsets, density.hyp_offsets
    alone = np.flatnonzero((tracks[1:] - tracks[:-1] == 1) & (factors[1:] - factors[:-1] == 2))
    first, found = factors[alone], np.zeros(len(factors) - 1, np.bool_)
    found[alone] = (hyps[first + 1] == hyps[first]) & (hyps[first + 2] - hyps[first + 1] == 1)
    return found
