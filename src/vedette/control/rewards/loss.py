"""The loss that is to be expected after the scans, in closed form and without samples."""

from __future__ import annotations

from dataclasses import dataclass

from vedette.models.arguments import positive


@dataclass(frozen=True, slots=True)
class ExpectedLossReward:
    """Less the squared error that is to be expected of the targets' positions, cut off where one counts as lost:

        R = -sum over labels of r (q min(tr P+, c^2) + (1 - q) min(tr P, c^2))
        q = 1 - prod over sensors of (1 - P_D)

    with the predicted existence r and covariance P of the position, the mean P_D over the predicted Gaussian, and
    P+ the covariance after the scans given that the target is detected: P+^-1 = P^-1 + sum over sensors of P_D I / q, I
    the information of a measurement. Over a horizon of several steps, the information of each step, carried to its
    end. It needs no samples, and so knows no luck; what it is after is that every target is seen, and seen well.

    It assumes that what the sensors measure is used in full, whatever the fusion.

    Attributes:
        cutoff: c, m.

    Raises:
        InputError: a cutoff that is not above 0.
    """

    cutoff: float = 100.0

    def __post_init__(self) -> None:
        positive("cutoff", self.cutoff)
