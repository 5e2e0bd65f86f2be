"""Poisson multi-target density with Gaussian-mixture intensity."""

from __future__ import annotations

from dataclasses import dataclass

from vedette.kernels.types import Floats


@dataclass(frozen=True, slots=True)
class Poisson:
    """Poisson density: intensity sum of exp(log_weights[i]) N(.; means[i], covs[i]); weights sum to the expected number.

    Attributes:
        log_weights: (num_components,) log of the expected number carried by each component.
        means: (num_components, state_dim).
        covs: (num_components, state_dim, state_dim).
    """

    log_weights: Floats
    means: Floats
    covs: Floats
