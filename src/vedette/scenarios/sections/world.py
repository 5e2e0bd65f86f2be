"""Sections about the world: time, region, motion and survival."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from vedette.plausible import told_elsewhere
from vedette.scenarios.faults import Finding, describe
from vedette.scenarios.sections.base import (
    GaussianMethod,
    Positive,
    Probability,
    Section,
    Whole,
    check,
)
from vedette.scenarios.sections.custom import Custom, NotGiven

if TYPE_CHECKING:  # with the models comes the compiler, which a check does without
    from vedette.kernels.base.types import Floats
    from vedette.models import MotionModel, Region, SurvivalModel


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
        """(num_steps,) times of the scans in s; that of step k is entry k - 1."""
        return self.start + self.step_period * np.arange(self.num_steps, dtype=np.float64)


class RegionSection(Section):
    """The surveillance region: a rectangle, x to the east and y to the north."""

    x_min: float = Field(description="Western edge [m].")
    x_max: float = Field(description="Eastern edge [m].")
    y_min: float = Field(description="Southern edge [m].")
    y_max: float = Field(description="Northern edge [m].")

    @check
    def _width(self) -> Iterator[Finding]:
        if self.x_max <= self.x_min:
            yield ("x_max",), f"a number above x_min, {self.x_min:g}", describe(self.x_max)

    @check
    def _height(self) -> Iterator[Finding]:
        if self.y_max <= self.y_min:
            yield ("y_max",), f"a number above y_min, {self.y_min:g}", describe(self.y_max)

    def build(self) -> Region:
        """The surveillance region."""
        from vedette.models import Region

        with told_elsewhere():
            return Region(self.x_min, self.x_max, self.y_min, self.y_max)


StateOrder = Annotated[
    Literal["grouped", "interleaved"],
    Field(
        description="Order in which this file writes states: grouped is [px, py, vx, vy] (the order of the paper's F "
        "and Q), interleaved is [px, vx, py, vy] (the order of its text). A turn rate comes last. The library itself "
        "always has them grouped [-]."
    ),
]


class ConstantVelocity(Section):
    """Constant velocity with white acceleration noise. State [px, py, vx, vy]."""

    kind: Literal["constant_velocity"] = Field(default="constant_velocity", description="Kind of motion [-].")
    sigma_v: float = Field(
        default=5.0,
        ge=0.0,
        description="Standard deviation of a held acceleration; of a continuous one the root of its spectral density, "
        "in m/s^1.5 [m/s^2].",
    )
    acceleration: Literal["held", "continuous"] = Field(
        default="held",
        description="Whether the acceleration is constant within a step, as in the paper, or white in continuous time "
        "[-].",
    )
    state_order: StateOrder = "grouped"

    @property
    def state_dim(self) -> int:
        """Number of components of a state."""
        return 4

    def build(self, method: GaussianMethod, folder: Path) -> MotionModel:
        """The motion model."""
        from vedette.models import constant_velocity

        return constant_velocity(self.sigma_v, acceleration=self.acceleration, method=method)


class CoordinatedTurn(Section):
    """Turn at an unknown rate. State [px, py, vx, vy, turn rate in rad/s]."""

    kind: Literal["coordinated_turn"] = Field(default="coordinated_turn", description="Kind of motion [-].")
    sigma_v: float = Field(default=5.0, ge=0.0, description="Standard deviation of the acceleration [m/s^2].")
    sigma_turn_rate_deg: float = Field(
        default=1.0, ge=0.0, description="Standard deviation of the turn acceleration [deg/s^2]."
    )
    state_order: StateOrder = "grouped"

    @property
    def state_dim(self) -> int:
        """Number of components of a state."""
        return 5

    def build(self, method: GaussianMethod, folder: Path) -> MotionModel:
        """The motion model."""
        from vedette.models import coordinated_turn

        return coordinated_turn(self.sigma_v, math.radians(self.sigma_turn_rate_deg), method=method)


class CustomMotion(Custom):
    """A user's `MotionModel`."""

    kind: Literal["custom"] = Field(default="custom", description="Kind of motion [-].")
    state_dim: Annotated[Whole, Field(ge=2, le=100, description="Number of components of its state [-].")]
    gives: ClassVar[str] = "vedette.models:MotionModel"

    @property
    def state_order(self) -> Literal["grouped"]:
        """States are written as the model has them."""
        return "grouped"

    def build(self, method: GaussianMethod, folder: Path) -> MotionModel:
        """The motion model. Raises `InputError` where it has another state dimension than it says."""
        motion: MotionModel = self.made(folder)
        if motion.state_dim != self.state_dim:
            raise NotGiven(self, "state_dim", f"that of {self.function}, {motion.state_dim}", str(self.state_dim))
        return motion if method == "auto" else replace(motion, method=method)


Motion = Annotated[ConstantVelocity | CoordinatedTurn | CustomMotion, Field(discriminator="kind")]


def grouped_order(motion: Motion) -> list[int]:
    """Place in the file's states of each component of the library's states [px, py, vx, vy, ...]."""
    if motion.state_order == "grouped":
        return list(range(motion.state_dim))
    return [0, 2, 1, 3, *range(4, motion.state_dim)]


class ConstantSurvival(Section):
    """The same probability of survival everywhere."""

    kind: Literal["constant"] = Field(default="constant", description="Kind of survival [-].")
    probability: Probability = Field(
        default=0.98, description="Probability of living on to the next scan, or through the period [-]."
    )
    period: Positive | None = Field(
        default=None,
        description="Time for which the probability is meant; none: a scan, however long after another [s].",
    )

    def build(self, folder: Path) -> SurvivalModel:
        """The survival model."""
        from vedette.models import constant_survival

        return constant_survival(self.probability, self.period)


class CustomSurvival(Custom):
    """A user's `SurvivalModel`."""

    kind: Literal["custom"] = Field(default="custom", description="Kind of survival [-].")
    gives: ClassVar[str] = "vedette.models:SurvivalModel"

    def build(self, folder: Path) -> SurvivalModel:
        """The survival model."""
        made: SurvivalModel = self.made(folder)
        return made


Survival = Annotated[ConstantSurvival | CustomSurvival, Field(discriminator="kind")]
