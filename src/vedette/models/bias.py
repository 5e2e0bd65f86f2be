"""What a sensor says too much, always by the same amount."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from vedette.models.arguments import reject

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

    Raises:
        InputError: a number that is not finite.
    """

    range: float = 0.0
    bearing: float = 0.0
    clock: float = 0.0
    x: float = 0.0
    y: float = 0.0

    def __post_init__(self) -> None:
        for each in fields(self):
            if not math.isfinite(value := getattr(self, each.name)):
                raise reject(f"Bias.{each.name}", "a finite number", value)

    def __sub__(self, other: Bias) -> Bias:
        """What is left of it where another is taken off."""
        return Bias(*(getattr(self, each.name) - getattr(other, each.name) for each in fields(self)))


NO_BIAS = Bias()
