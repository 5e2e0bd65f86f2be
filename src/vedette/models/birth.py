"""Labelled multi-Bernoulli birth at fixed sites."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from vedette.kernels.base.types import Floats
from vedette.models.arguments import float_array, positive_definite, reject


@dataclass(frozen=True, slots=True, eq=False)
class BirthModel:
    """Each site may give birth to one target a step; its label is (step, site index) (paper-notes 6).

    Attributes:
        existence: (num_sites,) birth probability of each site, in (0, 1).
        means: (num_sites, state_dim) mean state of a birth.
        covs: (num_sites, state_dim, state_dim) its covariance, symmetric positive definite.
        steps: the filter steps at which births may happen; None: every step.

    Raises:
        InputError: names the field, what was expected and what came.
    """

    existence: Floats
    means: Floats
    covs: Floats
    steps: frozenset[int] | None = None

    def __post_init__(self) -> None:
        means = float_array("BirthModel.means", self.means, (None, None))
        num_sites, state_dim = means.shape
        existence = float_array("BirthModel.existence", self.existence, (num_sites,))
        covs = float_array("BirthModel.covs", self.covs, (num_sites, state_dim, state_dim))
        if state_dim < 2:
            raise reject("BirthModel.means", "states of at least 2 components, px and py first", f"{state_dim}")
        if ((existence <= 0.0) | (existence >= 1.0)).any():
            raise reject("BirthModel.existence", "probabilities above 0 and below 1", existence.tolist())
        for site, cov in enumerate(covs):
            positive_definite(f"BirthModel.covs[{site}]", cov)
        for name, value in (("existence", existence), ("means", means), ("covs", covs), ("steps", _steps(self.steps))):
            object.__setattr__(self, name, value)

    @property
    def num_sites(self) -> int:
        """Number of birth sites."""
        return len(self.existence)

    @property
    def state_dim(self) -> int:
        """Length of a target's state."""
        return int(self.means.shape[1])

    def is_active(self, step: int) -> bool:
        """Whether targets may be born at this filter step."""
        return self.num_sites > 0 and (self.steps is None or step in self.steps)

    @classmethod
    def none(cls, state_dim: int) -> BirthModel:
        """No births ever."""
        return cls(np.empty(0), np.empty((0, state_dim)), np.empty((0, state_dim, state_dim)))


def _steps(steps: Iterable[int] | None) -> frozenset[int] | None:
    if steps is None:
        return None
    try:
        values = list(steps)
        if any(isinstance(value, bool) or int(value) != value for value in values):
            raise ValueError
        return frozenset(int(value) for value in values)
    except (TypeError, ValueError):
        raise reject("BirthModel.steps", "None or whole numbers", steps) from None
