"""A sensor that sees nothing: with it a filter's step is its prediction."""

from __future__ import annotations

from functools import cache

import numpy as np

from vedette.models import SensorModel, constant_detection, constant_noise, measurement_space_clutter, position


@cache
def blind_sensor() -> SensorModel:
    """It never detects and has no clutter; any position will do for it."""
    return SensorModel(
        position(),
        constant_noise([1.0, 1.0]),
        constant_detection(0.0),
        measurement_space_clutter(0.0, [0.0, 0.0], [1.0, 1.0]),
    )


NO_SCAN = np.empty((0, 2))
NO_POSE = np.zeros(3)
