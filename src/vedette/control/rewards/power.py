"""Divergences that are made of power integrals, and the expected loss after the scans, in closed form."""

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

    It is computed on the label sets that both densities have.

    Attributes:
        unit_volume: unit K of hyper-volume (eq. 5): a number, or "reference" for (4 pi)^(d/2) sqrt(det P) of the
            prediction, for which K <p, p> is about 1 (paper-notes 15), and localisation counts as much as cardinality.
    """

    unit_volume: UnitVolume = 1.0
    exponents: ClassVar[Exponents] = ((0.0, 2.0), (1.0, 1.0), (2.0, 0.0))
    words: ClassVar[str] = "CS divergence"

    def __post_init__(self) -> None:
        check_unit_volume(self.unit_volume)

    @property
    def coefficients(self) -> Floats:
        """Coefficients of the power integrals in the reward (Z(2, 0) + Z(0, 2)) / 2 - Z(1, 1)."""
        return np.array([0.5, -1.0, 0.5])

    def combine(self, z: Floats) -> Floats:
        """Return (Z(2, 0) + Z(0, 2)) / 2 - Z(1, 1)."""
        return 0.5 * (z[..., 0] + z[..., 2]) - z[..., 1]

    def __call__(self, predicted: GLMB | LMB, updated: GLMB | LMB) -> float:
        volume = unit_volume_of(self, predicted)
        return cauchy_schwarz(predicted, updated, unit_volume=volume, support="common")


@part("renyi", "reward")
@dataclass(frozen=True, slots=True)
class RenyiReward:
    """Renyi divergence of the prediction from the update, normalised on the label sets that both have.

    log(integral of predicted^order updated^(1 - order)) / (order - 1), see `vedette.divergence.renyi`. It needs no K.

    Attributes:
        order: exponent of the prediction, above 0 and not 1. 1/2 is symmetric, twice the Bhattacharyya distance. Above
            1 it is infinite, and so not a valid reward, if the prediction is much wider than the update.

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
        """(order, 1 - order), and the exponents that normalise both densities."""
        return (0.0, 1.0), (self.order, 1.0 - self.order), (1.0, 0.0)

    @property
    def coefficients(self) -> Floats:
        """Coefficients of the power integrals: see `combine`."""
        return np.array([self.order - 1.0, 1.0, -self.order]) / (self.order - 1.0)

    def combine(self, z: Floats) -> Floats:
        """Return (Z(order, 1 - order) - order Z(1, 0) - (1 - order) Z(0, 1)) / (order - 1)."""
        order = self.order
        return np.asarray((z[..., 1] - order * z[..., 2] - (1.0 - order) * z[..., 0]) / (order - 1.0))

    def __call__(self, predicted: GLMB | LMB, updated: GLMB | LMB) -> float:
        return renyi(predicted, updated, self.order, support="common")


@part("expected_loss", "reward")
@dataclass(frozen=True, slots=True)
class ExpectedLossReward(Checked):
    """Negative expected error of the targets' positions, in closed form and without samples.

    The error is limited by a cutoff, beyond which a target counts as lost:

        R = -sum over labels of r (q min(sqrt(tr P+), c)^p + (1 - q) u),  q = 1 - prod over sensors of (1 - P_D)
        u = min(sqrt(tr P), c)^p, or c^p if r (c^p - min(sqrt(tr P), c)^p) < (1 - r) c^p exp(-n)

    This is the mean OSPA of the best estimates, without the part that does not depend on the action. A label that is
    not detected is reported only if this costs less. A false label costs c^p unless another target is missing, for
    which it counts then. exp(-n) is the probability that none is, with n undetected targets (`State.undetected`, or 0
    if not known).

    The existence r and the covariance P of the position are predicted, P_D is the mean over the predicted Gaussian, and
    P+ is the covariance after the scans given that the target is detected: P+^-1 = P^-1 + sum over sensors of P_D I /
    q, I the information of a measurement. Over a horizon of several steps, the information of each step is propagated
    to its end. The reward has no sampling noise. It favours actions that detect every target, and detect it accurately.
    A label that is a mixture is represented by its heaviest component.

    If no target is within detection range of a sensor during the horizon, or a target is out of range of all sensors,
    the loss is the mean of those at the end of the horizon and at two later times, for which sensors are assumed to
    go on to the targets that they approach (`vedette.control.cost_to_go.CostToGo`). Otherwise all courses of the sensor
    would have equal rewards.

    It assumes that the sensors' measurements are used in full, whatever the fusion.

    Attributes:
        cutoff: error that counts as a lost target, c [m].
        order: power of the error, p, that of the score by which the tracks are evaluated: 1 for the usual OSPA, 2 for
            squared errors. A larger order gives more weight to the least certain targets, such as weak labels with wide
            densities.
    """

    cutoff: Positive = 100.0
    order: Positive = 1.0
    words: ClassVar[str] = "minus expected loss"

    @property
    def missed_cost(self) -> float:
        """Cost of a target that is lost, c^p [m^p]."""
        return float(self.cutoff**self.order)
