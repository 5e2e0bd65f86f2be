"""Crowds of any number of targets before one sensor, of a given density: who decides how, asked of targets."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from vedette.errors import InputError

MEASURED = ("position", "bearing_range")
MOST_TARGETS = 100_000
DENSITIES = (1e-3, 1e6)  # targets a km^2
_SQUARE_KM = 1e6  # m^2


@dataclass(frozen=True, slots=True, kw_only=True)
class GeneratedCrowd:
    """What a crowd is made from; equal settings give the same file, and a run's seed the same targets and scans.

    Targets are spread evenly over a square whose area grows with their number, so that crowds of ten and of ten
    thousand are equally hard and differ in size alone. They move at about 4 m/s; from scan to scan of 1 s one in a
    hundred dies, and as many are born. One still sensor sees each with probability 0.95, to 5 m, among false
    measurements.

    Attributes:
        num_targets: 1 to 100,000, at the first scan and on average.
        density: targets a km^2, 0.001 to 1,000,000; at 25 the next target is 100 m off on average.
        clutter: false measurements a target and scan, 0 to 100.
        measured: "position", or "bearing_range" from outside the square.
        num_steps: scans, 1 to 10,000.

    Raises:
        InputError: names the field, what was expected and what came.
    """

    num_targets: int = 100
    density: float = 25.0
    clutter: float = 0.3
    measured: str = "position"
    num_steps: int = 40

    def __post_init__(self) -> None:
        if self.measured not in MEASURED:
            raise InputError(f"measured: expected one of {', '.join(MEASURED)}; got {self.measured!r}")
        _whole("num_targets", self.num_targets, MOST_TARGETS)
        _whole("num_steps", self.num_steps, 10_000)
        for name, (least, most) in (("density", DENSITIES), ("clutter", (0.0, 100.0))):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | float) or not least <= value <= most:
                raise InputError(f"{name}: expected a number from {least:g} to {most:g}; got {value!r}")

    @property
    def side(self) -> float:
        """Of the square, m."""
        return math.sqrt(self.num_targets / self.density * _SQUARE_KM)

    @property
    def name(self) -> str:
        """Such as `crowd-1000`; what is not as usual is added."""
        usual, parts = GeneratedCrowd(), ["crowd", str(self.num_targets)]
        parts += [] if self.density == usual.density else [f"density-{self.density:g}"]
        parts += [] if self.clutter == usual.clutter else [f"clutter-{self.clutter:g}"]
        parts += [] if self.measured == usual.measured else ["bearing-range"]
        parts += [] if self.num_steps == usual.num_steps else [f"steps-{self.num_steps}"]
        return "-".join(parts)


def _whole(name: str, value: Any, most: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= most:
        raise InputError(f"{name}: expected a whole number from 1 to {most}; got {value!r}")
