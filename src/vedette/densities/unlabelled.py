"""Unlabelled densities of identically distributed targets: Poisson, independent identically distributed cluster."""

import math
from abc import abstractmethod
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from vedette.densities import checks
from vedette.densities.containers import Components, MultiTarget, for_kernel, no_components, unchecked
from vedette.densities.inspection import Targets
from vedette.densities.tracks import log_weights as logs_of
from vedette.errors import InputError, NumericalError, VedetteError
from vedette.internal.text import pluralise
from vedette.kernels.base import types as kt
from vedette.kernels.base.types import Floats
from vedette.kernels.gaussian.marks import unmarked


class Unlabelled(Components, MultiTarget):
    """Base of the unlabelled densities of Gaussian components. The arrays are copied, checked once, and read-only."""

    __slots__ = ()
    _weight: ClassVar[str] = "expected_number"

    def __len__(self) -> int:
        """Number of components, or of Bernoullis of a multi-Bernoulli."""
        return len(self._targets().weights)

    def _summary(self) -> str:
        what = "component" if self._weight == "expected_number" else "Bernoulli"
        return f"of {pluralise(len(self), what)}, {self.expected_number:.4g} targets expected"

    @property
    @abstractmethod
    def expected_number(self) -> float:
        """Mean number of targets."""


@dataclass(frozen=True, slots=True, repr=False)
class Poisson(Unlabelled):
    """Poisson density of intensity sum over i of exp(log_weights[i]) N(.; means[i], covs[i]).

    Attributes:
        log_weights: (num_components,) log of the expected number of targets of each component.
        means: (num_components, state_dim).
        covs: (num_components, state_dim, state_dim).
        marks: optional columns of the components, such as log probabilities of classes.

    The arrays are copied, checked once at creation, and read-only afterwards.
    """

    log_weights: Floats
    means: Floats
    covs: Floats
    marks: kt.Marks = field(default_factory=unmarked)

    @property
    def expected_number(self) -> float:
        """Mean number of targets."""
        with np.errstate(over="ignore"):  # may overflow to infinity
            return float(np.exp(self.log_weights).sum())

    def _targets(self) -> Targets:
        with np.errstate(over="ignore"):
            return Targets(None, np.exp(self.log_weights), self.means, self.covs)

    def cardinality(self) -> Floats:
        """Return the probabilities of 0, 1, ... targets, up to a number beyond which less than 1e-20 remains."""
        return poisson_numbers(self.expected_number)

    def to_kernel(self) -> kt.Mixture:
        """Return the arrays as a kernel bundle."""
        return self._components()

    @classmethod
    def from_kernel(cls, mixture: kt.Mixture) -> "Poisson":
        """Return a density with the arrays of a kernel bundle, without copies and checks."""
        return unchecked(cls, *mixture)

    @classmethod
    def empty(cls, like: Any) -> "Poisson":
        """Return the density that is certain of no target. like: as in `TrackTable.empty`."""
        return cls(*no_components(like))

    @classmethod
    def from_gaussians(cls, expected_numbers: Any, means: Any, covs: Any) -> "Poisson":
        """Return the density with the expected number, mean and covariance of each component.

        expected_numbers: (num_components,) linear. means: (num_components, state_dim).
        covs: (num_components, state_dim, state_dim). Raises `InputError` for another shape, a negative number, or a
        covariance that is not symmetric positive definite.
        """
        logs = logs_of("expected_numbers", expected_numbers)
        return cls(logs, *checks.as_gaussians(means, covs, len(logs)))

    def validate(self, *, error: type[VedetteError] = NumericalError) -> None:
        """Raise unless every array has its type and shape and every component is a Gaussian.

        `InputError` for faults of form, and `error` for values that are not finite or covariances that are not
        symmetric positive definite.
        """
        checks.check_components("", self, error)


def poisson_numbers(mean: float) -> Floats:
    """Return the Poisson probabilities of 0, 1, ..., up to a number beyond which less than 1e-20 remains."""
    from scipy.special import gammaln

    if not mean > 0.0:
        return np.ones(1)
    numbers = np.arange(math.ceil(mean + 12.0 * math.sqrt(mean)) + 41)
    return np.asarray(np.exp(numbers * math.log(mean) - mean - gammaln(numbers + 1.0)))


@dataclass(frozen=True, slots=True, repr=False)
class IidCluster(Unlabelled):
    """Iid cluster: a number of targets from a cardinality distribution, each drawn independently from one density.

    The intensity is the expected number times that density.

    Attributes:
        log_cardinality: (most + 1,) log probabilities of 0, 1, ..., most targets, normalised.
        log_weights: (num_components,) log mixture weights of the density of one target, normalised. There may be none
            if the density is certain of no target.
        means: (num_components, state_dim).
        covs: (num_components, state_dim, state_dim).
        marks: optional columns of the components, such as log probabilities of classes.

    The arrays are copied, checked once at creation, and read-only afterwards.
    """

    log_cardinality: Floats
    log_weights: Floats
    means: Floats
    covs: Floats
    marks: kt.Marks = field(default_factory=unmarked)

    @property
    def expected_number(self) -> float:
        """Mean number of targets."""
        return float(np.exp(self.log_cardinality) @ np.arange(len(self.log_cardinality)))

    def _targets(self) -> Targets:
        return Targets(None, self.expected_number * np.exp(self.log_weights), self.means, self.covs)

    def cardinality(self) -> Floats:
        """Return the probabilities of 0, 1, ..., most targets."""
        return np.asarray(np.exp(self.log_cardinality))

    def to_kernel(self) -> tuple[Floats, kt.Mixture]:
        """Return the log cardinality distribution and the density of one target in kernel form."""
        return for_kernel(self.log_cardinality), self._components()

    @classmethod
    def from_kernel(cls, log_cardinality: Floats, mixture: kt.Mixture) -> "IidCluster":
        """Return a density with the arrays of a kernel bundle, without copies and checks."""
        return unchecked(cls, log_cardinality, *mixture)

    @classmethod
    def empty(cls, like: Any) -> "IidCluster":
        """Return the density that is certain of no target. like: as in `TrackTable.empty`."""
        return cls(np.zeros(1), *no_components(like))

    @classmethod
    def from_gaussians(cls, cardinality: Any, weights: Any, means: Any, covs: Any) -> "IidCluster":
        """Return the density with linear probabilities of 0, 1, ... targets and the Gaussian mixture of one target.

        cardinality: (most + 1,). weights: (num_components,), summing to one. means: (num_components, state_dim).
        covs: (num_components, state_dim, state_dim). Raises `InputError` for another shape, probabilities or weights
        that are negative or do not sum to one, or a covariance that is not symmetric positive definite.
        """
        log_cardinality, logs = logs_of("cardinality", cardinality), logs_of("weights", weights)
        return cls(log_cardinality, logs, *checks.as_gaussians(means, covs, len(logs)))

    def validate(self, *, error: type[VedetteError] = NumericalError) -> None:
        """Raise unless the cardinalities and the weights are normalised and every component is a Gaussian.

        `InputError` for faults of form, and `error` for values that are not finite, not normalised to 1e-9 or
        covariances that are not symmetric positive definite, and if targets are possible without a density for them.
        """
        checks.check_array("log_cardinality", self.log_cardinality, np.float64, (None,))
        if len(self.log_cardinality) == 0:
            raise InputError("log_cardinality: expected at least the probability of no target; got none")
        checks.check_log_weights("log_cardinality", self.log_cardinality, error)
        whole = np.array([0, len(self.log_cardinality)])
        checks.check_normalised("log_cardinality", self.log_cardinality, whole, error)
        checks.check_array("log_weights", self.log_weights, np.float64, (None,))
        num = len(self.log_weights)
        offsets = np.array([0, num] if num else [0])
        checks.check_mixtures("", self, offsets, len(offsets) - 1, error)
        if num == 0 and np.any(self.log_cardinality[1:] > -np.inf):
            raise error("log_weights: expected the density of a target, as there may be some; got no component")
