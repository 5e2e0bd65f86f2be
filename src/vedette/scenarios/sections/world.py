"""Sections about the world: time, region, motion and survival."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from vedette.kernels.base.types import STATE_COMPONENTS
from vedette.scenarios.diagnostics import Finding, describe
from vedette.scenarios.sections.base import GaussianMethod, Positive, Section, Whole, check
from vedette.scenarios.sections.custom import Custom, MissingMember
from vedette.scenarios.sections.derived import Part, derived, one_of

if TYPE_CHECKING:  # importing the models imports the compiler, which a check does not need
    from vedette.kernels.base.types import Floats
    from vedette.models import MotionModel


# Largest distance of a time from a scan, in scans: rounding of sums of decimal fractions.
TIME_TOLERANCE = 1e-6


class Time(Section):
    """The scans: step k of 1 .. num_steps is at start + (k - 1) * step_period."""

    num_steps: Annotated[Whole, Field(ge=1, le=1_000_000, description="Number of scans [-].")]
    step_period: Positive = Field(default=1.0, description="Time between scans [s].")
    start: float = Field(default=1.0, description="Time of the first scan [s].")

    @check
    def _distinct(self) -> Iterator[Finding]:
        latest = abs(self.start) + self.num_steps * self.step_period
        if self.step_period < 1e6 * math.ulp(latest):
            yield ("step_period",), f"a period that can be told apart at {latest:g} s", describe(self.step_period)

    def build(self) -> Floats:
        """Return the times of the scans in s, (num_steps,); that of step k is entry k - 1."""
        return self.start + self.step_period * np.arange(self.num_steps, dtype=np.float64)

    def step_at(self, moment: float) -> int | None:
        """Return the scan at a time, s; None if there is none."""
        position = (moment - self.start) / self.step_period + 1.0
        return round(position) if abs(position - round(position)) <= TIME_TOLERANCE else None


def _not_above(name: str, value: float, other: str, least: float) -> Iterator[Finding]:
    if value <= least:
        yield (name,), f"a number above {other}, {least:g}", describe(value)


@derived("vedette.models.region:Region")
class RegionSection(Part):
    """The surveillance region: a rectangle, x to the east and y to the north."""

    _width = check(lambda self: _not_above("x_max", self.x_max, "x_min", self.x_min))
    _height = check(lambda self: _not_above("y_max", self.y_max, "y_min", self.y_min))


StateOrder = Annotated[
    Literal["grouped", "interleaved"],
    Field(
        description="Order in which this file writes states: grouped is [px, py, vx, vy] (the order of the paper's F "
        "and Q), interleaved is [px, vx, py, vy] (the order of its text). A turn rate, or height and vertical "
        "velocity, come last. The library itself always has them grouped [-]."
    ),
]


class _Motion(Part):
    """How targets move, and in which order the file writes their states."""

    state_order: StateOrder = "grouped"

    @property
    def components(self) -> tuple[str, ...]:
        """Names of the components of a state."""
        return STATE_COMPONENTS[self.kind]


class CustomMotion(Custom):
    """A user's `MotionModel`."""

    kind: Literal["custom"] = Field(default="custom", description="Kind of motion [-].")
    components: tuple[str, ...] = Field(strict=False, min_length=2, description="Components of its state, by name [-].")
    gives: ClassVar[str] = "vedette.models:MotionModel"

    @property
    def state_order(self) -> Literal["grouped"]:
        """Order of states: that of the model."""
        return "grouped"

    def build(self, folder: Path, method: GaussianMethod = "auto") -> MotionModel:
        """Return the motion model.

        Raises `InputError` if the components of its state differ from the given ones, or have another order.
        """
        from vedette.models.motion import STATE_ORDER

        motion: MotionModel = self.instantiate(folder)
        if motion.components != self.components:
            wanted = f"those of {self.function}, {', '.join(motion.components)}"
            raise MissingMember(self, "components", wanted, ", ".join(self.components))
        if (fault := motion.velocity_fault()) is not None:
            raise MissingMember(self, "function", f"a state {STATE_ORDER}", fault)
        return motion if method == "auto" else replace(motion, method=method)


if TYPE_CHECKING:
    Motion = _Motion
    Survival = Part
else:
    Motion = one_of("motion", "models", own=(CustomMotion,), parent=_Motion)
    Survival = one_of("survival", "models", "vedette.models:SurvivalModel")


def grouped_order(motion: Motion) -> list[int]:
    """Return the index in the file's states of each component of the library's states [px, py, vx, vy, ...]."""
    if motion.state_order == "grouped":
        return list(range(len(motion.components)))
    return [0, 2, 1, 3, *range(4, len(motion.components))]
