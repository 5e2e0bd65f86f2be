"""Sections about the sensors: where they are, what they measure, with what noise, detection and clutter."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from vedette.scenarios.schema.base import Custom, Name, Point, Positive, Probability, Section, SomeNumbers

_BEARING = "Bearing from atan2 of the offset, counter-clockwise from east, in (-pi, pi]; residuals are wrapped [-]."


class BearingRange(Section):
    """z = [bearing in rad, range in m]."""

    kind: Literal["bearing_range"] = Field(default="bearing_range", description="Kind of measurement [-].")
    bearing_function: Literal["atan2"] = Field(default="atan2", description=_BEARING)


class BearingOnly(Section):
    """z = [bearing in rad]."""

    kind: Literal["bearing_only"] = Field(default="bearing_only", description="Kind of measurement [-].")
    bearing_function: Literal["atan2"] = Field(default="atan2", description=_BEARING)


class RangeOnly(Section):
    """z = [range in m]."""

    kind: Literal["range_only"] = Field(default="range_only", description="Kind of measurement [-].")


class Position(Section):
    """z = [px, py] in m, independent of where the sensor is."""

    kind: Literal["position"] = Field(default="position", description="Kind of measurement [-].")


class CustomMeasurement(Custom):
    """A user's `MeasurementModel`."""

    kind: Literal["custom"] = Field(default="custom", description="Kind of measurement [-].")


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


PositiveNumbers = Annotated[tuple[Positive, ...], Field(strict=False, min_length=1)]


class ConstantNoise(Section):
    """The same standard deviations everywhere."""

    kind: Literal["constant"] = Field(default="constant", description="Kind of noise [-].")
    std: PositiveNumbers = Field(
        description="Standard deviation of each measurement component; a bearing in radians [rad, m]."
    )


class CustomNoise(Custom):
    """A user's `NoiseModel`."""

    kind: Literal["custom"] = Field(default="custom", description="Kind of noise [-].")


Noise = Annotated[RangeDependentNoise | ConstantNoise | CustomNoise, Field(discriminator="kind")]


class GaussianDetection(Section):
    """Probability of detection exp(-d^2 / (2 sigma^2)) at distance d (paper section IV)."""

    kind: Literal["gaussian"] = Field(default="gaussian", description="Kind of detection [-].")
    sigma: Positive = Field(default=10000.0, description="Distance scale of the fall of detection [m].")


class ConstantDetection(Section):
    """The same probability of detection everywhere."""

    kind: Literal["constant"] = Field(default="constant", description="Kind of detection [-].")
    probability: Probability = Field(description="Probability of detection [-].")


class LimitedRange(Section):
    """Detection within a distance only."""

    kind: Literal["limited_range"] = Field(default="limited_range", description="Kind of detection [-].")
    probability: Probability = Field(description="Probability of detection within max_range [-].")
    max_range: Positive = Field(description="Greatest distance [m].")


class LimitedSector(Section):
    """Detection within a distance and a sector (field of view) around the sensor's heading."""

    kind: Literal["limited_sector"] = Field(default="limited_sector", description="Kind of detection [-].")
    probability: Probability = Field(description="Probability of detection within the sector [-].")
    max_range: Positive = Field(description="Greatest distance [m].")
    half_width_deg: float = Field(gt=0.0, le=180.0, description="Greatest angle from the heading, either side [deg].")


class CustomDetection(Custom):
    """A user's `DetectionModel`."""

    kind: Literal["custom"] = Field(default="custom", description="Kind of detection [-].")


Detection = Annotated[
    GaussianDetection | ConstantDetection | LimitedRange | LimitedSector | CustomDetection,
    Field(discriminator="kind"),
]


class RegionClutter(Section):
    """Poisson clutter, uniform over the surveillance region; its intensity carries the Jacobian of the measurement."""

    kind: Literal["region"] = Field(default="region", description="Kind of clutter [-].")
    rate: float = Field(default=25.0, ge=0.0, le=1e6, description="Mean number of clutter measurements a scan [-].")


class MeasurementSpaceClutter(Section):
    """Poisson clutter, uniform over a box of the sensor's measurement space."""

    kind: Literal["measurement_space"] = Field(default="measurement_space", description="Kind of clutter [-].")
    rate: float = Field(default=25.0, ge=0.0, le=1e6, description="Mean number of clutter measurements a scan [-].")
    low: SomeNumbers = Field(description="Lowest value of each measurement component; a bearing in radians [rad, m].")
    high: SomeNumbers = Field(description="Highest value of each measurement component; a bearing in radians [rad, m].")


class CustomClutter(Custom):
    """A user's `ClutterModel`."""

    kind: Literal["custom"] = Field(default="custom", description="Kind of clutter [-].")


Clutter = Annotated[RegionClutter | MeasurementSpaceClutter | CustomClutter, Field(discriminator="kind")]

Headings = Literal["absolute", "relative"]
Actions = Annotated[tuple[float, ...], Field(strict=False, min_length=1)]


class Sensor(Section):
    """One sensor and the platform that carries it."""

    name: Name | None = Field(default=None, description="What to call it; none: `sensor 1`, `sensor 2`, ... [-].")
    position: Point = Field(description="Where it starts [m].")
    heading_deg: float = Field(default=0.0, description="Heading at the start, counter-clockwise from east [deg].")
    speed: float = Field(default=0.0, ge=0.0, description="Speed when under way; 0: a fixed sensor [m/s].")
    moves_from: Literal["first_decision", "start"] = Field(
        default="first_decision", description="Whether it lies still until its first decision, as in the paper [-]."
    )
    actions_deg: Actions | None = Field(default=None, description="Its own actions; none: those of control [deg].")
    headings: Headings | None = Field(default=None, description="What its own actions mean; none: as control says [-].")
    measurement: Measurement = Field(default=BearingRange(), description="What it measures [-].")
    noise: Noise = Field(default=RangeDependentNoise(), description="Measurement noise [-].")
    detection: Detection = Field(default=GaussianDetection(), description="Probability of detection [-].")
    clutter: Clutter = Field(default=RegionClutter(), description="False measurements [-].")


class SensorDefaults(Section):
    """What every sensor has unless it says otherwise; key by key, a sensor's own value replaces the whole default."""

    heading_deg: float | None = Field(default=None, description="Heading at the start [deg].")
    speed: Annotated[float, Field(ge=0.0)] | None = Field(default=None, description="Speed when under way [m/s].")
    moves_from: Literal["first_decision", "start"] | None = Field(
        default=None, description="Whether they lie still until the first decision [-]."
    )
    actions_deg: Actions | None = Field(default=None, description="Their actions [deg].")
    headings: Headings | None = Field(default=None, description="What these actions mean [-].")
    measurement: Measurement | None = Field(default=None, description="What they measure [-].")
    noise: Noise | None = Field(default=None, description="Measurement noise [-].")
    detection: Detection | None = Field(default=None, description="Probability of detection [-].")
    clutter: Clutter | None = Field(default=None, description="False measurements [-].")
