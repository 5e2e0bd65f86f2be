"""Sections about the sensors: where they are, how they move, and what they see."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from pydantic import Field

from vedette.plausible import told_elsewhere
from vedette.scenarios.faults import Finding, describe
from vedette.scenarios.sections.base import (
    DetectionAt,
    GaussianMethod,
    Name,
    Point,
    Section,
    Step,
    check,
)
from vedette.scenarios.sections.clutter import Clutter, RegionClutter
from vedette.scenarios.sections.detection import Detection, GaussianDetection
from vedette.scenarios.sections.platforms import AnyPlatform, Still
from vedette.scenarios.sections.sensing import BearingRange, Measurement, Noise, RangeDependentNoise
from vedette.scenarios.sections.sensor_checks import clutter_box_findings, clutter_findings, noise_findings
from vedette.scenarios.sections.true_sensors import TrueSensor

if TYPE_CHECKING:  # with the models comes the compiler, which a check does without
    from vedette.kernels.base.types import Bools
    from vedette.models import Region, SensorModel
    from vedette.simulation import TrueSensor as TrueSensorModel


class ScanTimes(Section):
    """The steps at which a sensor scans: the first, and every so many after it."""

    every: Step = Field(default=1, description="Steps from one scan to the next [-].")
    first: Step = Field(default=1, description="Step of the first scan [-].")

    @check
    def _within_the_first_round(self) -> Iterator[Finding]:
        if self.first > self.every:
            yield ("first",), f"a step up to every, {self.every}", describe(self.first)

    def build(self, num_steps: int) -> Bools:
        """(num_steps,) whether it scans."""
        return np.asarray((np.arange(1, num_steps + 1) - self.first) % self.every == 0)


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

    truth: TrueSensor | None = Field(
        default=None,
        description="What it is in truth, where the filters' model of it differs [-].",
    )
    scans: ScanTimes = Field(default=ScanTimes(), description="Steps at which it scans [-].")

    @check
    def _a_camera_carries_a_camera(self) -> Iterator[Finding]:
        true = () if self.truth is None else (self.truth.detection, self.truth.first_detection)
        kinds = [section.kind for section in (self.detection, *true) if section is not None]
        if "camera" in kinds and len(self.pose) < 5:
            yield ("platform",), "a camera, as its detection is a camera's", self.platform.kind

    @check
    def _noise_fits(self) -> Iterator[Finding]:
        yield from noise_findings(self.measurement, self.noise, ("noise",))

    @check
    def _clutter_is_for_the_measurement(self) -> Iterator[Finding]:
        yield from clutter_findings(self.measurement, self.clutter, ("clutter",))

    @check
    def _clutter_is_a_box(self) -> Iterator[Finding]:
        yield from clutter_box_findings(self.measurement, self.clutter, ("clutter",))

    @check
    def _truth_is_of_one_kind_with_the_model(self) -> Iterator[Finding]:
        if self.truth is not None:
            yield from self.truth.findings_beside(self.measurement)

    @property
    def pose(self) -> tuple[float, ...]:
        """Where it starts: [px, py, heading_rad], and what else its platform has."""
        return (*self.position, math.radians(self.heading_deg), *self.platform.components())

    def build(
        self, region: Region, method: GaussianMethod, folder: Path, detection_at: DetectionAt = "centre"
    ) -> SensorModel:
        """What the filters know of it; `folder` is what a custom model's file is relative to.

        Raises:
            InputError: a custom model that cannot be had, or parts that do not fit together.
        """
        from vedette.models import SensorModel

        measurement = self.measurement.build(folder)
        noise, detection = self.noise.build(self.measurement, folder), self.detection.build(folder)
        clutter = self.clutter.build(measurement, self.measurement.kind, region, folder)
        with told_elsewhere():
            return SensorModel(measurement, noise, detection, clutter, method, detection_at)

    def build_true(self, known: SensorModel, region: Region, folder: Path) -> TrueSensorModel:
        """What it is, beside what the filters know; errors as of `build`."""
        from vedette.simulation.true_sensors import TrueSensor

        if self.truth is None:
            return TrueSensor(known)
        return self.truth.build(known, self.measurement, region, folder)


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
    truth: TrueSensor | None = Field(
        default=None, description="What they are in truth, where the filters' model of them differs [-]."
    )
    scans: ScanTimes | None = Field(default=None, description="Steps at which they scan [-].")
