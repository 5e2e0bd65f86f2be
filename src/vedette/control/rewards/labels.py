"""Rewards that are sums over targets, each valued by its Bernoulli before and after the scans."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from vedette.control.rewards.label_functions import (
    cardinality_variance_of_label,
    gospa_of_label,
    kullback_leibler_of_label,
    peecs_of_label,
)
from vedette.kernels.base.types import Floats
from vedette.models.arguments import positive, probability
from vedette.models.functions import ModelFunction


@dataclass(frozen=True, slots=True)
class KullbackLeiblerReward:
    """Kullback-Leibler divergence of the update from the prediction, label by label: how much is learnt, in nats.

    With ideal measurements; under `ideal_measurements: sampled` its mean estimates the mutual information of targets
    and measurements.
    """

    num_terms: ClassVar[int] = 1

    @property
    def function(self) -> ModelFunction:
        """See `vedette.control.rewards.label_functions`."""
        return kullback_leibler_of_label

    @property
    def params(self) -> Floats:
        """None."""
        return np.empty(0)

    @property
    def coefficients(self) -> Floats:
        """Of the sums."""
        return np.ones(1)

    def combine(self, sums: Floats) -> Floats:
        """The sum."""
        return np.asarray(sums[..., 0])


@dataclass(frozen=True, slots=True)
class CardinalityVarianceReward:
    """Less the variance of the number of targets: sum of r (1 - r) over the labels (of a GLMB, of its LMB)."""

    num_terms: ClassVar[int] = 1

    @property
    def function(self) -> ModelFunction:
        """See `vedette.control.rewards.label_functions`."""
        return cardinality_variance_of_label

    @property
    def params(self) -> Floats:
        """None."""
        return np.empty(0)

    @property
    def coefficients(self) -> Floats:
        """Of the sums."""
        return -np.ones(1)

    def combine(self, sums: Floats) -> Floats:
        """Less the sum."""
        return np.asarray(-sums[..., 0])


@dataclass(frozen=True, slots=True)
class ExpectedGospaReward:
    """Less the mean squared GOSPA (alpha = 2, p = 2) that is to be expected of the best estimate after the update.

    Label by label a target is reported where that costs less:
    min(r min(tr P, c^2) + (1 - r) c^2 / 2, r c^2 / 2), P the covariance of the position.

    Attributes:
        cutoff: c, m.

    Raises:
        InputError: a cutoff that is not above 0.
    """

    cutoff: float = 100.0
    num_terms: ClassVar[int] = 1

    def __post_init__(self) -> None:
        positive("cutoff", self.cutoff)

    @property
    def function(self) -> ModelFunction:
        """See `vedette.control.rewards.label_functions`."""
        return gospa_of_label

    @property
    def params(self) -> Floats:
        """The squared cutoff."""
        return np.array([self.cutoff**2])

    @property
    def coefficients(self) -> Floats:
        """Of the sums."""
        return -np.ones(1)

    def combine(self, sums: Floats) -> Floats:
        """Less the sum, m^2."""
        return np.asarray(-sums[..., 0])


@dataclass(frozen=True, slots=True)
class PeecsReward:
    """Less the posterior expected error of cardinality and states (Gostar, Hoseinnezhad, Bab-Hadiashar 2013, 2015).

    share * 4 / n * sum r (1 - r) + (1 - share) * sum r min(tr P / c^2, 1) / sum r over n labels: the variance of the
    number of targets relative to the largest there is, and the mean error of their positions relative to a cutoff (in
    the place of the publication's scale, which is that of the particles at hand).

    Attributes:
        share: of the error of the cardinality, in [0, 1].
        cutoff: c, m.

    Raises:
        InputError: a share outside [0, 1], a cutoff that is not above 0.
    """

    share: float = 0.5
    cutoff: float = 100.0
    num_terms: ClassVar[int] = 4

    def __post_init__(self) -> None:
        probability("share", self.share)
        positive("cutoff", self.cutoff)

    @property
    def function(self) -> ModelFunction:
        """See `vedette.control.rewards.label_functions`."""
        return peecs_of_label

    @property
    def params(self) -> Floats:
        """The squared cutoff."""
        return np.array([self.cutoff**2])

    def combine(self, sums: Floats) -> Floats:
        """Less the weighed errors; 0 where there is no label."""
        variance, error, existence, num = np.moveaxis(sums, -1, 0)
        with np.errstate(invalid="ignore", divide="ignore"):
            cardinality = np.where(num > 0.0, 4.0 * variance / num, 0.0)
            state = np.where(existence > 0.0, error / existence, 0.0)
        return np.asarray(-(self.share * cardinality + (1.0 - self.share) * state))
