"""The sensors of a scenario: what they measure, and where they start."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from vedette.kernels.base.types import Floats
from vedette.models import (
    ClutterModel,
    DetectionModel,
    MeasurementModel,
    NoiseModel,
    Region,
    SensorModel,
    bearing_only,
    bearing_range,
    constant_detection,
    constant_noise,
    gaussian_detection,
    limited_range,
    limited_sector,
    measurement_space_clutter,
    position,
    range_dependent_noise,
    range_only,
    region_clutter,
)
from vedette.scenarios.build.custom import build_custom
from vedette.scenarios.schema.scenario import ScenarioModel
from vedette.scenarios.schema.sensors import (
    Clutter,
    ConstantDetection,
    ConstantNoise,
    CustomClutter,
    CustomDetection,
    CustomMeasurement,
    CustomNoise,
    Detection,
    GaussianDetection,
    LimitedRange,
    Measurement,
    Noise,
    RegionClutter,
    Sensor,
)
from vedette.scenarios.schema.tracking import GaussianMethod

_MEASUREMENTS = {
    "bearing_range": bearing_range,
    "bearing_only": bearing_only,
    "range_only": range_only,
    "position": position,
}


def build_poses(model: ScenarioModel) -> Floats:
    """(num_sensors, 3) initial poses [px, py, heading_rad]."""
    return np.array([(*sensor.position, math.radians(sensor.heading_deg)) for sensor in model.sensors])


def build_measurement(section: Measurement, folder: Path) -> MeasurementModel:
    """What a sensor measures."""
    if isinstance(section, CustomMeasurement):
        return build_custom(section, MeasurementModel, folder, "measurement")
    return _MEASUREMENTS[section.kind]()


def build_noise(section: Noise, measurement: Measurement, folder: Path) -> NoiseModel:
    """Measurement noise; of range-dependent noise, the parts that the measurement has."""
    if isinstance(section, CustomNoise):
        return build_custom(section, NoiseModel, folder, "noise")
    if isinstance(section, ConstantNoise):
        return constant_noise(section.std)
    ranges = {"sigma_range": section.sigma_range, "eta_range": section.eta_range}
    bearings = {"sigma_bearing": math.radians(section.sigma_bearing_deg), "eta_bearing": section.eta_bearing}
    return range_dependent_noise(
        **(ranges if measurement.kind != "bearing_only" else {}),
        **(bearings if measurement.kind != "range_only" else {}),
    )


def build_detection(section: Detection, folder: Path) -> DetectionModel:
    """Probability of detection."""
    if isinstance(section, CustomDetection):
        return build_custom(section, DetectionModel, folder, "detection")
    if isinstance(section, GaussianDetection):
        return gaussian_detection(section.sigma)
    if isinstance(section, ConstantDetection):
        return constant_detection(section.probability)
    if isinstance(section, LimitedRange):
        return limited_range(section.probability, section.max_range)
    return limited_sector(section.probability, section.max_range, math.radians(section.half_width_deg))


def build_clutter(
    section: Clutter, measurement: MeasurementModel, kind: str, region: Region, folder: Path
) -> ClutterModel:
    """False measurements; `kind` is that of the measurement."""
    if isinstance(section, CustomClutter):
        return build_custom(section, ClutterModel, folder, "clutter")
    if isinstance(section, RegionClutter):
        return region_clutter(section.rate, region, kind)
    return measurement_space_clutter(section.rate, section.low, section.high, angular=measurement.angular)


def build_sensor(section: Sensor, region: Region, method: GaussianMethod, folder: Path) -> SensorModel:
    """The sensor model; `folder` is what a custom model's file is relative to.

    Raises:
        InputError: a custom model that cannot be had, or parts that do not fit together.
    """
    measurement = build_measurement(section.measurement, folder)
    return SensorModel(
        measurement,
        build_noise(section.noise, section.measurement, folder),
        build_detection(section.detection, folder),
        build_clutter(section.clutter, measurement, section.measurement.kind, region, folder),
        method,
    )
