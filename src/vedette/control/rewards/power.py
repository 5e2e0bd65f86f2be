"""Divergences of prediction and update that are made of power integrals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from vedette.control.rewards.base import Exponents, UnitVolume, check_unit_volume, unit_volume_of
from vedette.densities import GLMB, LMB
from vedette.divergence import cauchy_schwarz, renyi
from vedette.kernels.base.types import Floats
from vedette.models.arguments import real, reject
from vedette.models.fields import Positive, part


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
