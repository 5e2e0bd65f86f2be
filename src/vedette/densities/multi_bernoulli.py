"""Unlabelled multi-Bernoulli density with Gaussian-mixture components."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from vedette.densities import checks
from vedette.densities.containers import for_kernel, no_components, unchecked
from vedette.densities.inspection import Target, Targets
from vedette.densities.labelled import poisson_binomial
from vedette.densities.unlabelled import Unlabelled
from vedette.errors import NumericalError, VedetteError
from vedette.internal.probabilities import expit
from vedette.kernels.base import types as kt
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.gaussian.marks import unmarked
from vedette.kernels.gaussian.pooling import merged_mixtures


@dataclass(frozen=True, slots=True, repr=False)
class MultiBernoulli(Unlabelled):
    """Independent Bernoullis, each a target with its existence probability: an LMB without labels.

    Attributes:
        existence_logit: (num_bernoullis,) log r - log(1 - r), which may be -inf and inf.
        offsets: (num_bernoullis + 1,) components of Bernoulli `i` are `offsets[i]:offsets[i + 1]`.
        log_weights: (num_components,) log mixture weights, normalised within each Bernoulli.
        means: (num_components, state_dim).
        covs: (num_components, state_dim, state_dim), symmetric positive definite.
        marks: optional columns of the components, such as log probabilities of classes.

    The arrays are copied, checked once at creation, and read-only afterwards.
    """

    existence_logit: Floats
    offsets: Ints
    log_weights: Floats
    means: Floats
    covs: Floats
    marks: kt.Marks = field(default_factory=unmarked)
    _weight: ClassVar[str] = "existence"

    def targets(self) -> Iterator[Target]:
        """Iterate over existence probability, mean and covariance of each Bernoulli. Their labels are None."""
        return self._targets().each()

    def _targets(self) -> Targets:
        merged = merged_mixtures(self._components(), for_kernel(self.offsets))
        return Targets(None, self.existence, merged.means, merged.covs)

    @property
    def num_bernoullis(self) -> int:
        """Number of Bernoullis."""
        return len(self.existence_logit)

    @property
    def existence(self) -> Floats:
        """Existence probabilities r, shape (num_bernoullis,)."""
        return expit(self.existence_logit)

    @property
    def expected_number(self) -> float:
        """Mean number of targets."""
        return float(self.existence.sum())

    def cardinality(self) -> Floats:
        """Return the probabilities of 0, 1, ..., num_bernoullis targets."""
        return poisson_binomial(self.existence_logit)

    def to_kernel(self) -> kt.Lmb:
        """Return the arrays as a kernel bundle, with label (-1, -1) for all."""
        labels = np.full((self.num_bernoullis, 2), -1, np.int64)
        tracks = kt.Tracks(labels, for_kernel(self.offsets), self._components())
        return kt.Lmb(tracks, for_kernel(self.existence_logit))

    @classmethod
    def from_kernel(cls, lmb: kt.Lmb) -> "MultiBernoulli":
        """Return the Bernoullis of a kernel bundle, ignoring labels, without copies and checks."""
        return unchecked(cls, lmb.existence_logit, lmb.tracks.offsets, *lmb.tracks.components)

    @classmethod
    def empty(cls, like: Any) -> "MultiBernoulli":
        """Return the density that is certain of no target. like: as in `TrackTable.empty`."""
        return cls(np.empty(0), np.zeros(1, np.int64), *no_components(like))

    @classmethod
    def from_gaussians(cls, existence: Any, means: Any, covs: Any) -> "MultiBernoulli":
        """Return a density of one Gaussian per Bernoulli.

        existence: (num_bernoullis,) in [0, 1]. means: (num_bernoullis, state_dim). covs: (num_bernoullis, state_dim,
        state_dim). Raises `InputError` for another shape, a probability outside [0, 1], or a covariance that is not
        symmetric positive definite.
        """
        logit = checks.as_logits("existence", existence, None)
        num = len(logit)
        return cls(logit, np.arange(num + 1), np.zeros(num), *checks.as_gaussians(means, covs, num))

    def validate(self, *, error: type[VedetteError] = NumericalError) -> None:
        """Raise unless existences are logits and every Bernoulli's mixture is a probability density.

        `InputError` for faults of form, and `error` for NaN values, values not normalised to 1e-9 or covariances that
        are not symmetric positive definite.
        """
        checks.check_array("existence_logit", self.existence_logit, np.float64, (None,))
        num = self.num_bernoullis
        checks.check_mixtures("", self, self.offsets, num, error)
        checks.check_logits("existence_logit", self.existence_logit, error)
