"""Sections about the probability with which a sensor detects a target."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field

from vedette.scenarios.sections.base import Positive, Probability, Section
from vedette.scenarios.sections.custom import Custom

if TYPE_CHECKING:  # with the models comes the compiler, which a check does without
    from vedette.models import DetectionModel


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
    """Detection within a distance, and less or none beyond."""

    kind: Literal["limited_range"] = Field(default="limited_range", description="Kind of detection [-].")
    probability: Probability = Field(description="Probability of detection within max_range [-].")
    max_range: Positive = Field(description="Greatest distance [m].")
    outside: Probability = Field(default=0.0, description="Probability of detection beyond max_range [-].")

    def build(self, folder: Path) -> DetectionModel:
        """Probability of detection."""
        from vedette.models import limited_range

        return limited_range(self.probability, self.max_range, self.outside)


class LimitedSector(Section):
    """Detection within a distance and a sector (field of view) around the sensor's heading; less or none beyond."""

    kind: Literal["limited_sector"] = Field(default="limited_sector", description="Kind of detection [-].")
    probability: Probability = Field(description="Probability of detection within the sector [-].")
    max_range: Positive = Field(description="Greatest distance [m].")
    half_width_deg: float = Field(gt=0.0, le=180.0, description="Greatest angle from the heading, either side [deg].")
    outside: Probability = Field(default=0.0, description="Probability of detection outside the sector [-].")

    def build(self, folder: Path) -> DetectionModel:
        """Probability of detection."""
        from vedette.models import limited_sector

        return limited_sector(self.probability, self.max_range, math.radians(self.half_width_deg), self.outside)


class SoftSector(Section):
    """Detection that falls off gradually at the edges of a sector around the sensor's heading.

    probability / (1 + exp(range_slope (d - max_range))) / (1 + exp(angle_slope (|angle| - half_width))) at distance d.
    """

    kind: Literal["soft_sector"] = Field(default="soft_sector", description="Kind of detection [-].")
    probability: Probability = Field(description="Probability of detection deep within the sector [-].")
    max_range: Positive = Field(description="Distance at which half of it is left [m].")
    half_width_deg: float = Field(
        default=180.0,
        gt=0.0,
        le=180.0,
        description="Angle from the heading, either side, at which half of it is left [deg].",
    )
    range_slope: Positive = Field(description="Steepness of the edge in range [1/m].")
    angle_slope: Positive | None = Field(
        default=None,
        description="Steepness of the edges in angle; none: sharp ones, and at 180 degrees none at all [1/rad].",
    )
    cut: bool = Field(default=False, description="Whether nothing is detected beyond max_range and half_width_deg [-].")

    def build(self, folder: Path) -> DetectionModel:
        """Probability of detection."""
        from vedette.models import soft_sector

        return soft_sector(
            self.probability,
            self.max_range,
            math.radians(self.half_width_deg),
            range_slope=self.range_slope,
            angle_slope=self.angle_slope,
            cut=self.cut,
        )


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
    GaussianDetection
    | ConstantDetection
    | LimitedRange
    | LimitedSector
    | SoftSector
    | CameraDetection
    | CustomDetection,
    Field(discriminator="kind"),
]
