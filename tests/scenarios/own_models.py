"""Models that a user keeps beside a scenario file."""

from __future__ import annotations

import math

import numpy as np

from vedette.kernels.base.types import Floats
from vedette.models import (
    DetectionModel,
    MeasurementModel,
    MotionModel,
    NoiseModel,
    SurvivalModel,
    measurement_space_clutter,
    model_function,
)


@model_function("transition")
def _drift(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    out[0] = state[0] + dt * params[0]
    out[1] = state[1]
    out[2] = state[2]


@model_function("process_noise_cov")
def _drift_noise(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    for i in range(3):
        for j in range(3):
            out[i, j] = dt if i == j else 0.0


@model_function("prob_survival")
def _survival(state: Floats, dt: float, params: Floats) -> float:
    return 0.75


@model_function("measurement")
def _distance(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    out[0] = math.sqrt((state[0] - pose[0]) ** 2 + (state[1] - pose[1]) ** 2)


@model_function("measurement_noise_cov")
def _distance_noise(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    out[0, 0] = 4.0


@model_function("prob_detection")
def _detection(state: Floats, pose: Floats, params: Floats) -> float:
    return 0.5


def motion(speed: float = 1.0) -> MotionModel:
    """Steady drift to the east; state [px, py, anything]."""
    return MotionModel(3, _drift, _drift_noise, np.array([speed]), np.empty(0))


@model_function("transition")
def _with_height_third(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    for i in range(3):
        out[i] = state[i] + dt * state[i + 3]
        out[i + 3] = state[i + 3]


@model_function("process_noise_cov")
def _noise_of_six(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    for i in range(6):
        for j in range(6):
            out[i, j] = dt if i == j else 0.0


def height_third() -> MotionModel:
    """Constant velocity; state [px, py, pz, vx, vy, vz]."""
    return MotionModel(6, _with_height_third, _noise_of_six)


def bad_motion() -> MotionModel:
    """Fails."""
    raise ValueError("no such current")


survival = SurvivalModel(_survival, np.empty(0))
measurement = MeasurementModel(1, _distance, np.empty(0))
noise = NoiseModel(_distance_noise, np.empty(0), 1)
detection = DetectionModel(_detection, np.empty(0))
clutter = measurement_space_clutter(3.0, [0.0], [100.0])
