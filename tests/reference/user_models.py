"""Models as a user would write them, shared by tests."""

from __future__ import annotations

import math

from vedette.models import MeasurementModel, model_function


@model_function("measurement")
def my_bearing_range(state, pose, params, out):
    dx = state[0] - pose[0]
    dy = state[1] - pose[1]
    out[0] = math.atan2(dy, dx)
    out[1] = math.sqrt(dx * dx + dy * dy)


@model_function("measurement_jacobian")
def my_bearing_range_jacobian(state, pose, params, out):
    dx = state[0] - pose[0]
    dy = state[1] - pose[1]
    square = dx * dx + dy * dy
    distance = math.sqrt(square)
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = 0.0
    out[0, 0] = -dy / square
    out[0, 1] = dx / square
    out[1, 0] = dx / distance
    out[1, 1] = dy / distance


def user_made_bearing_range(*, jacobian: bool = True) -> MeasurementModel:
    return MeasurementModel(
        2,
        my_bearing_range,
        jacobian=my_bearing_range_jacobian if jacobian else None,
        angular=[True, False],  # type: ignore[arg-type]
    )


@model_function("transition")
def nothing_like_a_state(state, dt, params, out):
    for i in range(out.shape[0]):
        out[i] = math.nan
