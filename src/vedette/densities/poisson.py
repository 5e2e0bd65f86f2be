"""Poisson multi-target density with Gaussian-mixture intensity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from vedette.densities import checks
from vedette.densities.containers import Container, kernel_arrays, unchecked
from vedette.densities.tracks import log_weights
from vedette.errors import InputError, NumericalError, VedetteError
from vedette.kernels.base import types as kt
from vedette.kernels.base.types import Floats
from vedette.models.arguments import no_gaussians

_ARRAYS = kernel_arrays("log_weights", "means", "covs")


@dataclass(frozen=True, slots=True)
class Poisson(Container):
    """Poisson density of intensity sum over i of exp(log_weights[i]) N(.; means[i], covs[i]).

    Attributes:
        log_weights: (num_components,) log of the expected number of targets that each component carries.
        means: (num_components, state_dim).
        covs: (num_components, state_dim, state_dim).

    The arrays are copied, checked once, here, and read-only from then on.

    Raises:
        InputError: as `validate`.
    """

    log_weights: Floats
    means: Floats
    covs: Floats

    def __post_init__(self) -> None:
        self._own_arrays()
        self.validate(error=InputError)

    @property
    def state_dim(self) -> int:
        """Length of a target's state."""
        return int(self.means.shape[1])

    @property
    def expected_number(self) -> float:
        """Mean number of targets."""
        with np.errstate(over="ignore"):  # more than any number
            return float(np.exp(self.log_weights).sum())

    def to_kernel(self) -> kt.Mixture:
        """The same arrays as the bundle that kernels take."""
        return kt.Mixture(*_ARRAYS(self))

    @classmethod
    def from_kernel(cls, mixture: kt.Mixture) -> Poisson:
        """The arrays of a bundle as they are; a kernel's own need no check."""
        return unchecked(cls, *mixture)

    @classmethod
    def empty(cls, state_dim: int) -> Poisson:
        """The density that is certain of no target."""
        return cls(np.empty(0), *no_gaussians(state_dim))

    @classmethod
    def from_gaussians(cls, expected_numbers: Any, means: Any, covs: Any) -> Poisson:
        """Density from the expected number, mean and covariance of each component.

        expected_numbers: (num_components,) linear. means: (num_components, state_dim).
        covs: (num_components, state_dim, state_dim). Raises `InputError` for another shape, a negative number, or a
        covariance that is not symmetric positive definite.
        """
        logs = log_weights("expected_numbers", expected_numbers)
        checked_means = checks.as_floats("means", means, (len(logs), None))
        dim = checked_means.shape[1]
        return cls(logs, checked_means, checks.as_floats("covs", covs, (len(logs), dim, dim)))

    def validate(self, *, error: type[VedetteError] = NumericalError) -> None:
        """Raise unless every array has its type and shape and every component is a Gaussian.

        `InputError` for faults of form; `error` for values that are not finite or covariances that are not symmetric
        positive definite.
        """
        checks.check_array("means", self.means, np.float64, (None, None))
        num_components, dim = self.means.shape
        if dim == 0:
            raise InputError("means: expected a state of at least 1 dimension; got 0")
        checks.check_array("log_weights", self.log_weights, np.float64, (num_components,))
        checks.check_array("covs", self.covs, np.float64, (num_components, dim, dim))
        checks.check_log_weights("log_weights", self.log_weights, error)
        checks.check_finite("means", self.means, error)
        checks.check_covariances("covs", self.covs, error)
