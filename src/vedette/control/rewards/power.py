"""Divergences that are made of power integrals; and the loss that is to be expected after the scans, in closed form."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from vedette.control.rewards.base import Exponents, UnitVolume, check_unit_volume, unit_volume_of
from vedette.densities import GLMB, LMB
from vedette.divergence import cauchy_schwarz, renyi
from vedette.kernels.base.types import Floats
from vedette.models.arguments import real, reject
from vedette.models.fields import Checked, Positive, part


@part("cauchy_schwarz", "reward")
@dataclass(frozen=True, slots=True)
class CauchySchwarzReward:
    """Cauchy-Schwarz divergence between the prediction and the update (paper eqs. 5, 8 and 13 to 17).

    On the label sets that both have.

    Attributes:
        unit_volume: unit K of hyper-volume (eq. 5): a number, or "reference" for (4 pi)^(d/2) sqrt(det P) of the
            prediction, under which K <p, p> is about 1 (paper-notes 15), and localisation counts as much as
            cardinality.

    Raises:
        InputError: another word, or a number that is not finite and above 0.
    """

    unit_volume: UnitVolume = 1.0
    exponents: ClassVar[Exponents] = ((0.0, 2.0), (1.0, 1.0), (2.0, 0.0))
    words: ClassVar[str] = "CS divergence"

    def __post_init__(self) -> None:
        check_unit_volume(self.unit_volume)

    @property
    def coefficients(self) -> Floats:
        """Of the power integrals, of which the reward is the sum: (Z(2, 0) + Z(0, 2)) / 2 - Z(1, 1)."""
        return np.array([0.5, -1.0, 0.5])

    def combine(self, z: Floats) -> Floats:
        """(Z(2, 0) + Z(0, 2)) / 2 - Z(1, 1)."""
        return 0.5 * (z[..., 0] + z[..., 2]) - z[..., 1]

    def __call__(self, predicted: GLMB | LMB, updated: GLMB | LMB) -> float:
        volume = unit_volume_of(self, predicted)
        return cauchy_schwarz(predicted, updated, unit_volume=volume, support="common")


@part("renyi", "reward")
@dataclass(frozen=True, slots=True)
class RenyiReward:
    """Renyi divergence of the prediction from the update, on the label sets that both have, where both sum to one.

    log(integral of predicted^order updated^(1 - order)) / (order - 1); see `vedette.divergence.renyi`. It needs no K.

    Attributes:
        order: exponent of the prediction, above 0 and not 1. 1/2 is symmetric, twice the Bhattacharyya distance. Above
            1 it is infinite, and so no reward, where the prediction is much wider than the update.

    Raises:
        InputError: another order.
    """

    order: Positive = 0.5
    words: ClassVar[str] = "Rényi divergence"

    def __post_init__(self) -> None:
        if real("order", self.order) <= 0.0 or self.order == 1.0:
            raise reject("order", "a finite number above 0 other than 1", self.order)

    @property
    def exponents(self) -> Exponents:
        """(order, 1 - order), and what normalises the two."""
        return (0.0, 1.0), (self.order, 1.0 - self.order), (1.0, 0.0)

    @property
    def coefficients(self) -> Floats:
        """Of the power integrals: see `combine`."""
        return np.array([self.order - 1.0, 1.0, -self.order]) / (self.order - 1.0)

    def combine(self, z: Floats) -> Floats:
        """(Z(order, 1 - order) - order Z(1, 0) - (1 - order) Z(0, 1)) / (order - 1)."""
        order = self.order
        return np.asarray((z[..., 1] - order * z[..., 2] - (1.0 - order) * z[..., 0]) / (order - 1.0))

    def __call__(self, predicted: GLMB | LMB, updated: GLMB | LMB) -> float:
        return renyi(predicted, updated, self.order, support="common")


@part("expected_loss", "reward")
@dataclass(frozen=True, slots=True)
class ExpectedLossReward(Checked):
    """Less the error to be expected of the targets' positions; in closed form, without samples.

    Cut off where a target counts as lost:

        R = -sum over labels of r (q min(sqrt(tr P+), c)^p + (1 - q) min(sqrt(tr P), c)^p)
        q = 1 - prod over sensors of (1 - P_D)

    with the predicted existence r and covariance P of the position, the mean P_D over the predicted Gaussian, and
    P+ the covariance after the scans given that the target is detected: P+^-1 = P^-1 + sum over sensors of P_D I / q, I
    the information of a measurement. Over a horizon of several steps, the information of each step, carried to its
    end. It needs no samples, and so knows no luck; what it is after is that every target is seen, and seen well. A
    label that is a mixture is taken at its heaviest component.

    Where a sensor has no target in its sight within the horizon, or a target is in nobody's, the loss is the mean of
    those at the end of the horizon and at two later times, at which sensors have gone on as they did
    (`vedette.control.beyond_horizon.BeyondHorizon.horizons`): otherwise all courses of the sensor were worth the same.

    It assumes that what the sensors measure is used in full, whatever the fusion.

    Attributes:
        cutoff: error that counts as a lost target, c [m].
        order: power of the error, p, that of the score by which the tracks are judged: 1 of OSPA as it is mostly taken,
            2 of squared errors. The larger, the more it is about what is known worst, such as weak labels that are
            spread wide.

    Raises:
        InputError: a cutoff or an order that is not above 0.
    """

    cutoff: Positive = 100.0
    order: Positive = 1.0
    words: ClassVar[str] = "minus expected loss"

    @property
    def missed_cost(self) -> float:
        """Of a target that is lost, c^p [m^p]."""
        return float(self.cutoff**self.order)
