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


@model_function("transition")
def _accelerates(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    for j in range(state.shape[0]):
        out[j] = state[j]
    for axis in range(2):
        out[axis] += dt * state[axis + 2] + 0.5 * dt * dt * state[axis + 4]
        out[axis + 2] += dt * state[axis + 4]


@model_function("transition_jacobian")
def _accelerates_jacobian(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = 1.0 if i == j else 0.0
    for axis in range(2):
        out[axis, axis + 2] = out[axis + 2, axis + 4] = dt
        out[axis, axis + 4] = 0.5 * dt * dt


@model_function("process_noise_cov")
def _shaken(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = 0.0
    for j in range(4, out.shape[0]):
        out[j, j] = dt * params[0] if j < 6 else dt * params[1]


def accelerating(*others: str) -> MotionModel:
    """Constant acceleration; state [px, py, vx, vy, ax, ay], and others that stay as they are."""
    names = ("px", "py", "vx", "vy", "ax", "ay", *others)
    functions = _accelerates, _shaken, np.empty(0), np.array([1e-4, 4.0]), _accelerates_jacobian
    return MotionModel(len(names), *functions, components=names)


def accelerating_at_height() -> MotionModel:
    """Constant acceleration in the plane; state [px, py, vx, vy, ax, ay, pz]."""
    return accelerating("pz")
