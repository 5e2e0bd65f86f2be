"""Minimum distance between platforms."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from vedette.control.constraints.protocol import ConstraintContext, least_on_legs
from vedette.kernels.base.types import Bools
from vedette.models.fields import Checked, Positive, part


@part("separation", "constraint")
@dataclass(frozen=True, slots=True)
class Separation(Checked):
    """A minimum distance between any two platforms.

    It holds at the times of the horizon and between them, where both platforms are assumed to move linearly from one
    position to the next. The way from the present positions counts unless these are already too close.

    Attributes:
        distance: least distance, which is allowed itself [m].
    """

    distance: Positive
    name: ClassVar[str] = "separation"
    needs_beliefs: ClassVar[bool] = False
    time_invariant = True

    @property
    def interaction_range(self) -> float:
        """Distance in m beyond which pairs of sensors need no test."""
        return self.distance

    def courses(self, situation: ConstraintContext) -> tuple[Bools, ...]:
        """Return masks that allow all courses."""
        return tuple(np.ones(len(own), bool) for own in situation.courses)

    def pairs(self, situation: ConstraintContext, first: int, second: int) -> Bools | None:
        """Return the pairs of courses on which two sensors are never closer than `distance`."""
        one, other = situation.ways(first), situation.ways(second)
        x = one[:, np.newaxis, :, 0] - other[:, :, 0]
        y = one[:, np.newaxis, :, 1] - other[:, :, 1]
        least = self.distance**2
        if situation.poses is not None and x[0, 0, 0] ** 2 + y[0, 0, 0] ** 2 < least:
            x, y = x[:, :, 1:], y[:, :, 1:]
        nearest = (x * x + y * y).min(axis=2)
        if x.shape[2] > 1:
            nearest = np.minimum(nearest, least_on_legs(x, y).min(axis=2))
        return np.asarray(nearest >= least)
