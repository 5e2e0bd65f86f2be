"""Sections about what a sensor measures, with what noise, detection and clutter."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field

from vedette.scenarios.sections.base import Positive, Probability, Section, SomeNumbers
from vedette.scenarios.sections.custom import Custom

if TYPE_CHECKING:  # with the models comes the compiler, which a check does without
    from vedette.models import ClutterModel, DetectionModel, MeasurementModel, NoiseModel, Region


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


class CustomNoise(Custom):
    """A user's `NoiseModel`."""

    kind: Literal["custom"] = Field(default="custom", description="Kind of noise [-].")
    gives: ClassVar[str] = "vedette.models:NoiseModel"

    def build(self, measurement: Measurement, folder: Path) -> NoiseModel:
        """Measurement noise."""
        made: NoiseModel = self.made(folder)
        return made


Noise = Annotated[RangeDependentNoise | ConstantNoise | CustomNoise, Field(discriminator="kind")]


class GaussianDetection(Section):
    """Probability of detection exp(-d^2 / (2 sigma^2)) at distance d (paper section IV)."""

    kind: Literal["gaussian"] = Field(default="gaussian", description="Kind of detection [-].")
    sigma: Positive = Field(default=10000.0, description="Distance scale of the fall of detection [m].")

    def build(self, folder: Path) -> DetectionModel:
        """Probability of detection."""
        from vedette.models import gaussian_detection

        return gaussian_detection(self.sigma)


class ConstantDetection(Section):
    """The same probability of detection everywhere."""

    kind: Literal["constant"] = Field(default="constant", description="Kind of detection [-].")
    probability: Probability = Field(description="Probability of detection [-].")

    def build(self, folder: Path) -> DetectionModel:
        """Probability of detection."""
        from vedette.models import constant_detection

        return constant_detection(self.probability)


class LimitedRange(Section):
    """Detection within a distance only."""

    kind: Literal["limited_range"] = Field(default="limited_range", description="Kind of detection [-].")
    probability: Probability = Field(description="Probability of detection within max_range [-].")
    max_range: Positive = Field(description="Greatest distance [m].")

    def build(self, folder: Path) -> DetectionModel:
        """Probability of detection."""
        from vedette.models import limited_range

        return limited_range(self.probability, self.max_range)


class LimitedSector(Section):
    """Detection within a distance and a sector (field of view) around the sensor's heading."""

    kind: Literal["limited_sector"] = Field(default="limited_sector", description="Kind of detection [-].")
    probability: Probability = Field(description="Probability of detection within the sector [-].")
    max_range: Positive = Field(description="Greatest distance [m].")
    half_width_deg: float = Field(gt=0.0, le=180.0, description="Greatest angle from the heading, either side [deg].")

    def build(self, folder: Path) -> DetectionModel:
        """Probability of detection."""
        from vedette.models import limited_sector

        return limited_sector(self.probability, self.max_range, math.radians(self.half_width_deg))


class CameraDetection(Section):
    """Detection within the field of view of a camera: along its pointing, as far to either side as its half width."""

    kind: Literal["camera"] = Field(default="camera", description="Kind of detection [-].")
    probability: Probability = Field(description="Probability of detection within the field of view [-].")
    max_range: Positive = Field(description="Greatest distance [m].")
    reference_half_width_deg: Annotated[float, Field(gt=0.0, le=180.0)] | None = Field(
        default=None,
        description="Where it zooms, the half width at which it sees so far; it sees as many times farther as its "
        "field is narrower. None: as far at every width [deg].",
    )

    def build(self, folder: Path) -> DetectionModel:
        """Probability of detection."""
        from vedette.models import camera

        reference = self.reference_half_width_deg
        return camera(self.probability, self.max_range, None if reference is None else math.radians(reference))


class CustomDetection(Custom):
    """A user's `DetectionModel`."""

    kind: Literal["custom"] = Field(default="custom", description="Kind of detection [-].")
    gives: ClassVar[str] = "vedette.models:DetectionModel"

    def build(self, folder: Path) -> DetectionModel:
        """Probability of detection."""
        made: DetectionModel = self.made(folder)
        return made


Detection = Annotated[
    GaussianDetection | ConstantDetection | LimitedRange | LimitedSector | CameraDetection | CustomDetection,
    Field(discriminator="kind"),
]


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


class CustomClutter(Custom):
    """A user's `ClutterModel`."""

    kind: Literal["custom"] = Field(default="custom", description="Kind of clutter [-].")
    gives: ClassVar[str] = "vedette.models:ClutterModel"

    def build(self, measurement: MeasurementModel, kind: str, region: Region, folder: Path) -> ClutterModel:
        """False measurements; `kind` is that of the measurement."""
        made: ClutterModel = self.made(folder)
        return made


Clutter = Annotated[RegionClutter | MeasurementSpaceClutter | CustomClutter, Field(discriminator="kind")]
