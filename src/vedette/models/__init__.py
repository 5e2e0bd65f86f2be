"""Models of targets and sensors: motion, survival, birth, measurement, noise, detection and clutter."""

from vedette.models.bias import Bias
from vedette.models.birth import BirthModel, MeasurementBirth
from vedette.models.classes import ClassFeatures
from vedette.models.clutter import ClutterModel, ClutterSampler, measurement_space_clutter
from vedette.models.correlation import discounted
from vedette.models.detection import (
    DetectionModel,
    camera,
    constant_detection,
    gaussian_detection,
    limited_range,
    limited_sector,
    soft_sector,
)
from vedette.models.detection_functions import MAX_PROB_DETECTION
from vedette.models.functions import ModelFunction, model_function
from vedette.models.grid import CellGrid
from vedette.models.heights import (
    bearing_range_altitude,
    bearing_range_elevation,
    bearing_slant_range,
    position_altitude,
)
from vedette.models.kinematics import constant_velocity, constant_velocity_height, coordinated_turn
from vedette.models.manoeuvres import constant_acceleration, constant_turn, ornstein_uhlenbeck, random_walk
from vedette.models.measurement import MeasurementModel, NoiseModel, position
from vedette.models.modes import Modes, hiding_modes, motion_of_filter, sensor_of_filter
from vedette.models.motion import MotionModel, SurvivalModel, constant_survival, kernel_motion
from vedette.models.noise import axis_noise, constant_noise, range_dependent_noise
from vedette.models.polar import bearing_only, bearing_range, bearing_range_rate, range_only
from vedette.models.region import Region
from vedette.models.region_clutter import region_clutter
from vedette.models.scan_rows import ScanRows
from vedette.models.sensor import SensorModel
from vedette.models.sensor_clutter import around_sensor
from vedette.models.signal import SignalModel
from vedette.models.targets import TargetModel
from vedette.models.undetected import UndetectedModel

__all__ = [
    "MAX_PROB_DETECTION",
    "Bias",
    "BirthModel",
    "CellGrid",
    "ClassFeatures",
    "ClutterModel",
    "ClutterSampler",
    "DetectionModel",
    "MeasurementBirth",
    "MeasurementModel",
    "ModelFunction",
    "Modes",
    "MotionModel",
    "NoiseModel",
    "Region",
    "ScanRows",
    "SensorModel",
    "SignalModel",
    "SurvivalModel",
    "TargetModel",
    "UndetectedModel",
    "around_sensor",
    "axis_noise",
    "bearing_only",
    "bearing_range",
    "bearing_range_altitude",
    "bearing_range_elevation",
    "bearing_range_rate",
    "bearing_slant_range",
    "camera",
    "constant_acceleration",
    "constant_detection",
    "constant_noise",
    "constant_survival",
    "constant_turn",
    "constant_velocity",
    "constant_velocity_height",
    "coordinated_turn",
    "discounted",
    "gaussian_detection",
    "hiding_modes",
    "kernel_motion",
    "limited_range",
    "limited_sector",
    "measurement_space_clutter",
    "model_function",
    "motion_of_filter",
    "ornstein_uhlenbeck",
    "position",
    "position_altitude",
    "random_walk",
    "range_dependent_noise",
    "range_only",
    "region_clutter",
    "sensor_of_filter",
    "soft_sector",
]
