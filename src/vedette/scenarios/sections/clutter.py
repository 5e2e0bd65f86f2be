"""Sections about false measurements."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field

from vedette.scenarios.faults import Finding
from vedette.scenarios.sections.base import Positive, Section, SomeNumbers, check
from vedette.scenarios.sections.custom import Custom

if TYPE_CHECKING:  # with the models comes the compiler, which a check does without
    from vedette.models import ClutterModel, MeasurementModel, Region


class RegionClutter(Section):
    """Poisson clutter, uniform over the surveillance region; its intensity carries the Jacobian of the measurement."""

    kind: Literal["region"] = Field(default="region", description="Kind of clutter [-].")
    rate: float = Field(default=25.0, ge=0.0, le=1e6, description="Mean number of clutter measurements a scan [-].")

    def build(self, measurement: MeasurementModel, kind: str, region: Region, folder: Path) -> ClutterModel:
        """False measurements; `kind` is that of the measurement."""
        from vedette.models import region_clutter

        return region_clutter(self.rate, region, kind)


class MeasurementSpaceClutter(Section):
    """Poisson clutter, uniform over a box of the sensor's measurement space."""

    kind: Literal["measurement_space"] = Field(default="measurement_space", description="Kind of clutter [-].")
    rate: float = Field(default=25.0, ge=0.0, le=1e6, description="Mean number of clutter measurements a scan [-].")
    low: SomeNumbers = Field(description="Lowest value of each measurement component; a bearing in radians [rad, m].")
    high: SomeNumbers = Field(description="Highest value of each measurement component; a bearing in radians [rad, m].")

    def build(self, measurement: MeasurementModel, kind: str, region: Region, folder: Path) -> ClutterModel:
        """False measurements; `kind` is that of the measurement."""
        from vedette.models import measurement_space_clutter

        return measurement_space_clutter(self.rate, self.low, self.high, angular=measurement.angular)


class ClutterAroundSensor(Section):
    """Poisson clutter, uniform over a disc or a square around the sensor, or the part of it about its heading.

    For a position or bearing_range measurement. It moves and turns with the sensor.
    """

    kind: Literal["around_sensor"] = Field(default="around_sensor", description="Kind of clutter [-].")
    rate: float = Field(
        default=25.0, ge=0.0, le=1e6, description="Mean number of clutter measurements a scan in the figure [-]."
    )
    radius: Positive | None = Field(default=None, description="Of a disc [m].")
    half_side: Positive | None = Field(default=None, description="Of a square along the axes, half its side [m].")
    half_width_deg: float = Field(
        default=180.0, gt=0.0, le=180.0, description="Greatest angle from the heading, either side [deg]."
    )

    @check
    def _one_figure(self) -> Iterator[Finding]:
        if (self.radius is None) == (self.half_side is None):
            yield (), "either radius or half_side", "neither" if self.radius is None else "both"

    def build(self, measurement: MeasurementModel, kind: str, region: Region, folder: Path) -> ClutterModel:
        """False measurements; `kind` is that of the measurement."""
        from vedette.models import around_sensor

        half_width = math.radians(self.half_width_deg)
        return around_sensor(self.rate, kind, radius=self.radius, half_side=self.half_side, half_width_rad=half_width)


class CustomClutter(Custom):
    """A user's `ClutterModel`."""

    kind: Literal["custom"] = Field(default="custom", description="Kind of clutter [-].")
    gives: ClassVar[str] = "vedette.models:ClutterModel"

    def build(self, measurement: MeasurementModel, kind: str, region: Region, folder: Path) -> ClutterModel:
        """False measurements; `kind` is that of the measurement."""
        made: ClutterModel = self.made(folder)
        return made


Clutter = Annotated[
    RegionClutter | MeasurementSpaceClutter | ClutterAroundSensor | CustomClutter, Field(discriminator="kind")
]
