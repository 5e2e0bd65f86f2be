"""Batches of labelled densities on the same label sets, such as the possible posteriors of a sensor."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from vedette.densities.checks import offsets_of
from vedette.densities.containers import for_kernel, unchecked
from vedette.densities.glmb import GLMB
from vedette.densities.label_sets import Label, LabelSet, label_sets, without_zero_weights
from vedette.densities.labelled import LMB, LabelledDensity
from vedette.densities.tracks import gaussian_tracks, single_gaussians
from vedette.internal.probabilities import log_expit
from vedette.internal.threads import run_chunks
from vedette.kernels.base.types import Bools, Floats, Ints
from vedette.kernels.labelled.case_conversions import LmbCases, glmb_cases_to_lmb
from vedette.kernels.labelled.power_integrals import SensorCases

# A label set, and the name of its factor: for an LMB the label, for a GLMB nothing.
FactorSet: TypeAlias = tuple[LabelSet, LabelSet]


@dataclass(frozen=True, slots=True, eq=False)
class DensityBatch:
    """Labelled densities of one kind on the same label sets, with one Gaussian per track.

    Each is a product of factors, and a factor is a weighted list of label sets with a Gaussian for each (set, label): a
    marginalised GLMB has one factor, an LMB one per label, with the sets {} and {l}.
    """

    kind: type[GLMB] | type[LMB]  # container class of a single case
    factors: tuple[LabelSet, ...]  # names of the factors: for an LMB each its label, for a GLMB the single name `()`
    factor_offsets: Ints  # (num_factors + 1,) into `sets`
    sets: tuple[LabelSet, ...]  # label sets, factor after factor
    log_weights: Floats  # (num_cases, num_sets) log weight of each set in its factor
    # (num_cases, num_members, ...) one Gaussian for each label of each set, in order, without meaning if a GLMB's set
    # has log weight -inf
    means: Floats
    covs: Floats
    num_samples: int = 1  # for planners: case `action * num_samples + sample` is of this action and this sample
    num_threads: int = 1  # threads that may share work on the cases. The result does not depend on it

    @classmethod
    def of_glmbs(
        cls, sets: Sequence[LabelSet], log_weights: Floats, means: Floats, covs: Floats, **counts: int
    ) -> "DensityBatch":
        """Return a batch of marginalised GLMBs on distinct label sets, log_weights (num_cases, num_sets)."""
        return cls(GLMB, ((),), np.array([0, len(sets)]), tuple(sets), log_weights, means, covs, **counts)

    @classmethod
    def of_lmbs(
        cls, labels: Sequence[Label], existence_logits: Floats, means: Floats, covs: Floats, **counts: int
    ) -> "DensityBatch":
        """Return a batch of LMBs of these labels, existence_logits (num_cases, num_labels)."""
        log_weights = np.empty((len(existence_logits), 2 * len(labels)))
        log_weights[:, 0::2], log_weights[:, 1::2] = log_expit(-existence_logits), log_expit(existence_logits)
        factors = tuple((label,) for label in labels)
        sets = tuple(labels for factor in factors for labels in ((), factor))
        offsets = 2 * np.arange(len(factors) + 1)
        return cls(LMB, factors, offsets, sets, log_weights, means, covs, **counts)

    @classmethod
    def of(cls, density: LabelledDensity) -> "DensityBatch":
        """Return a batch of one LMB or marginalised GLMB. Mixtures are replaced by one Gaussian of their moments."""
        tracks = single_gaussians(density.tracks).to_kernel()
        gaussians = tracks.components
        if isinstance(density, LMB):
            labels = [tuple(label) for label in tracks.labels.tolist()]
            return cls.of_lmbs(labels, density.existence_logit[None], gaussians.means[None], gaussians.covs[None])
        assert isinstance(density, GLMB)
        means, covs = gaussians.means[density.hyp_tracks], gaussians.covs[density.hyp_tracks]
        log_weights = for_kernel(density.hyp_log_weights)
        return cls.of_glmbs(label_sets(density).sets, log_weights[None], means[None], covs[None])

    @property
    def is_lmb(self) -> bool:
        """True if every label is a factor of its own."""
        return self.kind.is_lmb

    @property
    def num_cases(self) -> int:
        """Number of densities."""
        return len(self.log_weights)

    @property
    def state_dim(self) -> int:
        """Length of a target's state."""
        return int(self.means.shape[2])

    @property
    def set_offsets(self) -> Ints:
        """Offsets of the members of each label set, shape (num_sets + 1,)."""
        return offsets_of([len(labels) for labels in self.sets])

    @property
    def places(self) -> tuple[FactorSet, ...]:
        """Each label set with the name of its factor. The sets of several batches are matched by it."""
        sizes = np.diff(self.factor_offsets).tolist()
        names = (name for name, size in zip(self.factors, sizes, strict=True) for _ in range(size))
        return tuple(zip(names, self.sets, strict=True))

    @property
    def existence_logits(self) -> Floats:
        """Log-odds of existence of LMBs, shape (num_cases, num_labels)."""
        return np.asarray(self.log_weights[:, 1::2] - self.log_weights[:, 0::2])

    @property
    def possible(self) -> Bools:
        """Mask (num_cases, num_sets), False for a GLMB's sets of weight zero and an LMB's labels that cannot exist."""
        if not self.is_lmb:
            return np.asarray(self.log_weights > -np.inf)
        return np.repeat(self.log_weights[:, 1::2] > -np.inf, 2, axis=1)

    def density(self, case: int) -> GLMB | LMB:
        """Return one case as a container: an LMB, or a marginalised GLMB without sets of weight zero."""
        labels = np.array([label for labels in self.sets for label in labels], np.int64).reshape(-1, 2)
        tracks = gaussian_tracks(labels, self.means[case].copy(), self.covs[case].copy())
        if self.is_lmb:
            return unchecked(LMB, tracks, self.existence_logits[case].copy())
        members = np.arange(len(labels))
        return without_zero_weights(unchecked(GLMB, tracks, self.set_offsets, members, self.log_weights[case].copy()))


def lmb_batch(own: DensityBatch) -> DensityBatch:
    """Return GLMBs as LMBs of the same existence probabilities and one Gaussian per label, in label order."""
    members = np.array([label for labels in own.sets for label in labels], np.int64).reshape(-1, 2)
    labels = np.unique(members, axis=0)
    shape, dim = (own.num_cases, len(labels)), own.state_dim
    logits, means, covs = np.empty(shape), np.empty((*shape, dim)), np.empty((*shape, dim, dim))
    given, set_offsets = SensorCases(own.log_weights, own.possible, own.means, own.covs), own.set_offsets

    def work(first: int, last: int) -> None:
        glmb_cases_to_lmb(members, set_offsets, given, labels, first, last, LmbCases(logits, means, covs))

    run_chunks(work, own.num_cases, own.num_threads)
    known = [tuple(label) for label in labels.tolist()]
    return DensityBatch.of_lmbs(known, logits, means, covs, num_samples=own.num_samples, num_threads=own.num_threads)
