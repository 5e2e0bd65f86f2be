"""What a sensor says too much, always by the same amount."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from vedette.internal.quantities import QUANTITIES
from vedette.kernels.base.types import Floats
from vedette.models.arguments import reject
from vedette.models.measurement import wrap_angles

LEAST_RANGE = 1.0  # m; what is left of a range where a bias is taken off or added


@dataclass(frozen=True, slots=True)
class Bias:
    """What the scans of a sensor say too much.

    Attributes:
        range: m.
        bearing: rad, in the direction in which the scans count: clockwise in a recording from the north, elsewhere
            counter-clockwise.
        clock: s; how far its times are ahead.
        x, y: m; of where the sensor is said to be, or of the positions that it measures.
        range_rate: m/s.
        elevation: rad.
        altitude: m.

    Raises:
        InputError: a number that is not finite.
    """

    range: float = 0.0
    bearing: float = 0.0
    clock: float = 0.0
    x: float = 0.0
    y: float = 0.0
    range_rate: float = 0.0
    elevation: float = 0.0
    altitude: float = 0.0

    def __post_init__(self) -> None:
        for each in fields(self):
            if not math.isfinite(value := getattr(self, each.name)):
                raise reject(f"Bias.{each.name}", "a finite number", value)

    def __sub__(self, other: Bias) -> Bias:
        """What is left of it where another is taken off."""
        return Bias(*(getattr(self, each.name) - getattr(other, each.name) for each in fields(self)))


NO_BIAS = Bias()


def with_offsets(measured: Floats, offsets: Floats, components: Sequence[str]) -> Floats:
    """(num, meas_dim) measurements plus (meas_dim,) offsets, angles in (-pi, pi], ranges at least `LEAST_RANGE`.

    components: the quantities that are measured, of `vedette.internal.quantities.QUANTITIES`.
    """
    found = measured + offsets
    for i, name in enumerate(components):
        quantity = QUANTITIES[name]
        least = quantity.least + LEAST_RANGE
        found[:, i] = wrap_angles(found[:, i]) if quantity.is_angle else np.maximum(found[:, i], least)
    return found
