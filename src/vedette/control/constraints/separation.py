"""Platforms that keep their distance from each other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from vedette.control.constraints.protocol import ConstraintContext, least_on_legs
from vedette.kernels.base.types import Bools
from vedette.models.fields import Checked, Positive, part


@part("separation", "constraint")
@dataclass(frozen=True, slots=True)
class Separation(Checked):
    """Any two platforms keep a least distance.

    At the times of the horizon, and between two of them, where both are taken to go straight and evenly from one
    position to the next. The way from where they are now counts where they are not too near already.

    Attributes:
        distance: least distance, which is allowed itself [m].

    Raises:
        InputError: a distance that is not above 0.
    """

    distance: Positive
    name: ClassVar[str] = "separation"
    needs_beliefs: ClassVar[bool] = False
    time_invariant = True

    @property
    def interaction_range(self) -> float:
        """Sensors further apart need not be asked about."""
        return self.distance

    def courses(self, situation: ConstraintContext) -> tuple[Bools, ...]:
        """All."""
        return tuple(np.ones(len(own), bool) for own in situation.courses)

    def pairs(self, situation: ConstraintContext, first: int, second: int) -> Bools | None:
        """The courses on which two sensors are never nearer than `distance`."""
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
