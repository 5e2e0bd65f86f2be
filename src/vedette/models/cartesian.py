"""Built-in position measurement."""

from __future__ import annotations

import numpy as np

from vedette.kernels.base.types import Floats
from vedette.models.fields import part
from vedette.models.functions import model_function
from vedette.models.measurement import MeasurementModel


@model_function("measurement")
def _position(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    out[0] = state[0]
    out[1] = state[1]


@model_function("measurement_jacobian")
def _position_jacobian(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    for i in range(2):
        for j in range(out.shape[1]):
            out[i, j] = 1.0 if i == j else 0.0


def _places(measurements: Floats, pose: Floats) -> Floats:
    return measurements


@part("position", "measurement")
def position() -> MeasurementModel:
    """z = [px, py] of the target in m, in the frame of the region; the sensor's pose plays no part."""
    angular = np.array([False, False])
    return MeasurementModel(2, _position, np.empty(0), _position_jacobian, angular, _places, is_linear=True)
