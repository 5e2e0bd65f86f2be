"""How targets move and what a sensor at a place sees of them; all of it functions that a user can write too."""

from vedette.models.birth import BirthModel, MeasurementBirth
from vedette.models.cartesian import position
from vedette.models.clutter import ClutterModel, ClutterSampler, measurement_space_clutter
from vedette.models.detection import (
    MAX_PROB_DETECTION,
    DetectionModel,
    camera,
    constant_detection,
    gaussian_detection,
    limited_range,
    limited_sector,
)
from vedette.models.functions import ModelFunction, model_function
from vedette.models.kinematics import constant_velocity, coordinated_turn
from vedette.models.measurement import MeasurementModel, NoiseModel
from vedette.models.motion import MotionModel, SurvivalModel, constant_survival, kernel_motion
from vedette.models.noise import constant_noise, range_dependent_noise
from vedette.models.polar import bearing_only, bearing_range, range_only
from vedette.models.region import Region
from vedette.models.region_clutter import region_clutter
from vedette.models.sensor import SensorModel
from vedette.models.targets import TargetModel

__all__ = [
    "MAX_PROB_DETECTION",
    "BirthModel",
    "ClutterModel",
    "ClutterSampler",
    "DetectionModel",
    "MeasurementBirth",
    "MeasurementModel",
    "ModelFunction",
    "MotionModel",
    "NoiseModel",
    "Region",
    "SensorModel",
    "SurvivalModel",
    "TargetModel",
    "bearing_only",
    "bearing_range",
    "camera",
    "constant_detection",
    "constant_noise",
    "constant_survival",
    "constant_velocity",
    "coordinated_turn",
    "gaussian_detection",
    "kernel_motion",
    "limited_range",
    "limited_sector",
    "measurement_space_clutter",
    "model_function",
    "position",
    "range_dependent_noise",
    "range_only",
    "region_clutter",
]
