"""Sections about the sensors: where they are, how they move, and what they see."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pydantic import Field

from vedette.scenarios.faults import Finding, describe
from vedette.scenarios.sections.base import GaussianMethod, Name, Point, Section, check
from vedette.scenarios.sections.platforms import AnyPlatform, Still
from vedette.scenarios.sections.sensing import (
    BearingRange,
    Clutter,
    Detection,
    GaussianDetection,
    Measurement,
    Noise,
    RangeDependentNoise,
    RegionClutter,
)

if TYPE_CHECKING:  # with the models comes the compiler, which a check does without
    from vedette.models import Region, SensorModel


class Sensor(Section):
    """One sensor and the platform that carries it."""

    name: Name | None = Field(default=None, description="What to call it; none: `sensor 1`, `sensor 2`, ... [-].")
    position: Point = Field(description="Where it starts [m].")
    heading_deg: float = Field(default=0.0, description="Heading at the start, counter-clockwise from east [deg].")
    platform: AnyPlatform = Field(default=Still(), description="What carries it: what it may do [-].")
    moves_from: Literal["first_decision", "start"] = Field(
        default="first_decision",
        description="Whether it lies still until its first decision, as in the paper, or is under way on its course, "
        "or under the first of its actions [-].",
    )
    measurement: Measurement = Field(default=BearingRange(), description="What it measures [-].")
    noise: Noise = Field(default=RangeDependentNoise(), description="Measurement noise [-].")
    detection: Detection = Field(default=GaussianDetection(), description="Probability of detection [-].")
    clutter: Clutter = Field(default=RegionClutter(), description="False measurements [-].")

    @check
    def _a_camera_carries_a_camera(self) -> Iterator[Finding]:
        if self.detection.kind == "camera" and len(self.pose) < 5:
            yield ("platform",), "a camera, as its detection is a camera's", self.platform.kind

    @check
    def _noise_fits(self) -> Iterator[Finding]:
        noise, dim = self.noise, self.measurement.dim
        if noise.kind == "range_dependent" and self.measurement.kind in ("position", "custom"):
            kind = self.measurement.kind
            yield ("noise",), f"constant or custom noise for a {kind} measurement", "range_dependent noise"
        elif noise.kind == "constant" and dim is not None and len(noise.std) != dim:
            yield ("noise", "std"), self._components(dim), describe(noise.std)

    @check
    def _clutter_is_for_a_known_measurement(self) -> Iterator[Finding]:
        if self.clutter.kind == "region" and self.measurement.kind == "custom":
            yield ("clutter",), "measurement_space or custom clutter for a custom measurement", "region clutter"

    @check
    def _clutter_has_the_components(self) -> Iterator[Finding]:
        if self.clutter.kind != "measurement_space":
            return
        low, high, dim = self.clutter.low, self.clutter.high, self.measurement.dim
        for name, values in (("low", low), ("high", high)):
            if dim is not None and len(values) != dim:
                yield ("clutter", name), self._components(dim), describe(values)
        if dim is None and len(low) != len(high):
            yield ("clutter", "high"), f"as many numbers as low, {len(low)}", describe(high)

    @check
    def _clutter_is_a_box(self) -> Iterator[Finding]:
        if self.clutter.kind != "measurement_space":
            return
        for j, (low, high) in enumerate(zip(self.clutter.low, self.clutter.high, strict=False)):
            if high <= low:
                yield ("clutter", "high", j), f"a number above low, {low:g}", describe(high)
            elif j in self.measurement.angular and high - low > 2.0 * math.pi * (1.0 + 1e-9):
                yield ("clutter", "high", j), f"an angle of at most 2 pi above low, {low:g}", describe(high)

    def _components(self, dim: int) -> str:
        numbers = "1 number" if dim == 1 else f"{dim} numbers"
        return f"{numbers}, as a {self.measurement.kind} measurement has"

    @property
    def pose(self) -> tuple[float, ...]:
        """Where it starts: [px, py, heading_rad], and what else its platform has."""
        return (*self.position, math.radians(self.heading_deg), *self.platform.components())

    def build(self, region: Region, method: GaussianMethod, folder: Path) -> SensorModel:
        """What it sees; `folder` is what a custom model's file is relative to.

        Raises:
            InputError: a custom model that cannot be had, or parts that do not fit together.
        """
        from vedette.models import SensorModel

        measurement = self.measurement.build(folder)
        return SensorModel(
            measurement,
            self.noise.build(self.measurement, folder),
            self.detection.build(folder),
            self.clutter.build(measurement, self.measurement.kind, region, folder),
            method,
        )


class SensorDefaults(Section):
    """What every sensor has unless it says otherwise; key by key, a sensor's own value replaces the whole default."""

    heading_deg: float | None = Field(default=None, description="Heading at the start [deg].")
    platform: AnyPlatform | None = Field(default=None, description="What carries them: what they may do [-].")
    moves_from: Literal["first_decision", "start"] | None = Field(
        default=None, description="Whether they lie still until the first decision [-]."
    )
    measurement: Measurement | None = Field(default=None, description="What they measure [-].")
    noise: Noise | None = Field(default=None, description="Measurement noise [-].")
    detection: Detection | None = Field(default=None, description="Probability of detection [-].")
    clutter: Clutter | None = Field(default=None, description="False measurements [-].")
