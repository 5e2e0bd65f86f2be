"""Sections about what a sensor measures, and with what noise."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field

from vedette.scenarios.sections.base import Positive, Section
from vedette.scenarios.sections.custom import Custom

if TYPE_CHECKING:  # with the models comes the compiler, which a check does without
    from vedette.models import MeasurementModel, NoiseModel


class BearingRange(Section):
    """z = [bearing in rad, range in m]; the bearing counter-clockwise from east, in (-pi, pi]."""

    kind: Literal["bearing_range"] = Field(default="bearing_range", description="Kind of measurement [-].")
    dim: ClassVar[int | None] = 2
    angular: ClassVar[tuple[int, ...]] = (0,)

    def build(self, folder: Path) -> MeasurementModel:
        """What a sensor measures."""
        from vedette.models import bearing_range

        return bearing_range()


class BearingOnly(Section):
    """z = [bearing in rad], counter-clockwise from east, in (-pi, pi]."""

    kind: Literal["bearing_only"] = Field(default="bearing_only", description="Kind of measurement [-].")
    dim: ClassVar[int | None] = 1
    angular: ClassVar[tuple[int, ...]] = (0,)

    def build(self, folder: Path) -> MeasurementModel:
        """What a sensor measures."""
        from vedette.models import bearing_only

        return bearing_only()


class RangeOnly(Section):
    """z = [range in m]."""

    kind: Literal["range_only"] = Field(default="range_only", description="Kind of measurement [-].")
    dim: ClassVar[int | None] = 1
    angular: ClassVar[tuple[int, ...]] = ()

    def build(self, folder: Path) -> MeasurementModel:
        """What a sensor measures."""
        from vedette.models import range_only

        return range_only()


class Position(Section):
    """z = [px, py] in m, independent of where the sensor is."""

    kind: Literal["position"] = Field(default="position", description="Kind of measurement [-].")
    dim: ClassVar[int | None] = 2
    angular: ClassVar[tuple[int, ...]] = ()

    def build(self, folder: Path) -> MeasurementModel:
        """What a sensor measures."""
        from vedette.models import position

        return position()


class CustomMeasurement(Custom):
    """A user's `MeasurementModel`."""

    kind: Literal["custom"] = Field(default="custom", description="Kind of measurement [-].")
    dim: ClassVar[int | None] = None
    angular: ClassVar[tuple[int, ...]] = ()
    gives: ClassVar[str] = "vedette.models:MeasurementModel"

    def build(self, folder: Path) -> MeasurementModel:
        """What a sensor measures."""
        made: MeasurementModel = self.made(folder)
        return made


Measurement = Annotated[
    BearingRange | BearingOnly | RangeOnly | Position | CustomMeasurement, Field(discriminator="kind")
]
# Kinds of measurement that do not say where a target is.
WITHOUT_PLACE = ("bearing_only", "range_only")


class RangeDependentNoise(Section):
    """Standard deviations that grow with the distance d (paper section IV), evaluated at the predicted state.

    Range: sigma_range + eta_range d^2. Bearing: sigma_bearing + eta_bearing d.
    """

    kind: Literal["range_dependent"] = Field(default="range_dependent", description="Kind of noise [-].")
    sigma_range: Positive = Field(default=10.0, description="Range, standard deviation at distance 0 [m].")
    eta_range: float = Field(default=5e-5, ge=0.0, description="Range, growth with the square of distance [1/m].")
    sigma_bearing_deg: Positive = Field(default=1.0, description="Bearing, the same at distance 0 [deg].")
    eta_bearing: float = Field(default=5e-6, ge=0.0, description="Bearing, growth with distance [rad/m].")

    def build(self, measurement: Measurement, folder: Path) -> NoiseModel:
        """Measurement noise: the parts that the measurement has."""
        from vedette.models import range_dependent_noise

        ranges = {"sigma_range": self.sigma_range, "eta_range": self.eta_range}
        bearings = {"sigma_bearing": math.radians(self.sigma_bearing_deg), "eta_bearing": self.eta_bearing}
        return range_dependent_noise(
            **(ranges if measurement.kind != "bearing_only" else {}),
            **(bearings if measurement.kind != "range_only" else {}),
        )


NotNegative = Annotated[float, Field(ge=0.0)]
PositiveNumbers = Annotated[tuple[Positive, ...], Field(strict=False, min_length=1)]


class ConstantNoise(Section):
    """The same standard deviations everywhere."""

    kind: Literal["constant"] = Field(default="constant", description="Kind of noise [-].")
    std: PositiveNumbers = Field(
        description="Standard deviation of each measurement component; a bearing in radians [rad, m]."
    )

    def build(self, measurement: Measurement, folder: Path) -> NoiseModel:
        """Measurement noise."""
        from vedette.models import constant_noise

        return constant_noise(self.std)


class NoiseByAxis(Section):
    """Of a position: standard deviations std + growth d^2 along each axis, d the target's offset along it."""

    kind: Literal["by_axis"] = Field(default="by_axis", description="Kind of noise [-].")
    std: Annotated[tuple[Positive, Positive], Field(strict=False)] = Field(
        description="Standard deviation along x and y at offset 0 [m]."
    )
    growth: Annotated[tuple[NotNegative, NotNegative], Field(strict=False)] = Field(
        description="Growth with the square of the offset along x and y [1/m]."
    )

    def build(self, measurement: Measurement, folder: Path) -> NoiseModel:
        """Measurement noise."""
        from vedette.models import axis_noise

        return axis_noise(self.std, self.growth)


class CustomNoise(Custom):
    """A user's `NoiseModel`."""

    kind: Literal["custom"] = Field(default="custom", description="Kind of noise [-].")
    gives: ClassVar[str] = "vedette.models:NoiseModel"

    def build(self, measurement: Measurement, folder: Path) -> NoiseModel:
        """Measurement noise."""
        made: NoiseModel = self.made(folder)
        return made


Noise = Annotated[RangeDependentNoise | ConstantNoise | NoiseByAxis | CustomNoise, Field(discriminator="kind")]
