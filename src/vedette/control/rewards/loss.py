"""The loss that is to be expected after the scans, in closed form and without samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from vedette.models.fields import Positive, check_fields, part


@part("expected_loss", "reward")
@dataclass(frozen=True, slots=True)
class ExpectedLossReward:
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
    (`vedette.control.additive.look_on`): otherwise all courses of the sensor were worth the same.

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

    def __post_init__(self) -> None:
        check_fields(self)
