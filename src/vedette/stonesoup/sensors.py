"""Conversion of Stone Soup's measurement models, noise, fields of view and clutter into sensor models.

Its bearings are counter-clockwise from the x axis as in Vedette, but relative to the direction of the sensor.
Measurements are rotated by the `rotation_offset` (`vedette.recorded.detections.elements_of`), and the pose uses it.
"""

import math
from typing import Any

import numpy as np
from stonesoup.models.clutter import ClutterModel as CartesianClutter
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.measurement.nonlinear import Cartesian2DToBearing, CartesianToBearingRange
from stonesoup.sensor.radar.radar import (
    RadarBearing,
    RadarBearingRange,
    RadarRotatingBearing,
    RadarRotatingBearingRange,
)
from stonesoup.simulator.simple import SimpleDetectionSimulator

from vedette.internal.quantities import QUANTITIES
from vedette.kernels.base.types import Floats
from vedette.models import (
    ClutterModel,
    DetectionModel,
    MeasurementModel,
    NoiseModel,
    Region,
    bearing_only,
    bearing_range,
    constant_detection,
    constant_noise,
    limited_range,
    limited_sector,
    measurement_space_clutter,
    model_function,
    position,
    region_clutter,
)
from vedette.models.arguments import float_array, positive_definite, reject
from vedette.stonesoup.motions import StateLayout

# Measured quantities, by the names of `vedette.recorded.table_of_detections`; the model; and its name for clutter.
_MEASURED: dict[type, tuple[tuple[str, ...], Any, str]] = {
    LinearGaussian: (("x", "y"), position, "position"),
    CartesianToBearingRange: (("bearing", "range"), bearing_range, "bearing_range"),
    Cartesian2DToBearing: (("bearing",), bearing_only, "bearing_only"),
}
_ROUND = (RadarBearingRange, RadarBearing)
_ROTATING = (RadarRotatingBearingRange, RadarRotatingBearing)
_NO_LIMIT = 1e9  # m, range of an unlimited field of view


def _entry(model: Any) -> tuple[tuple[str, ...], Any, str]:
    if type(model) not in _MEASURED:
        wanted = f"one of {', '.join(kind.__name__ for kind in _MEASURED)}"
        raise reject("measurement_model", wanted, type(model).__name__)
    return _MEASURED[type(model)]


def measurement_model_of(sensor: Any) -> Any:
    """Return the current measurement model of a sensor, or the model itself."""
    return getattr(sensor, "measurement_model", sensor)


def measured_quantities(model: Any) -> tuple[str, ...]:
    """Return the quantities of a measurement, by the names of `vedette.recorded.table_of_detections`."""
    return _entry(model)[0]


def convert_measurement(model: Any, layout: StateLayout) -> MeasurementModel:
    """Convert a Stone Soup measurement model. Bearings are rotated by its `rotation_offset`.

    `LinearGaussian` of the position, `CartesianToBearingRange` and `Cartesian2DToBearing`.

    Raises:
        InputError: another model, or one whose `mapping` is not that of the position in the motion model.
    """
    made: MeasurementModel = _entry(model)[1]()
    if tuple(model.mapping) != layout.position:
        wanted = f"{layout.position}, where the transition model has x and y"
        raise reject("measurement_model.mapping", wanted, str(tuple(model.mapping)))
    return made


def convert_pose(model: Any) -> Floats:
    """Return [px, py, heading_rad] of the sensor of a measurement model, or zeros if it has no position.

    Raises:
        InputError: a sensor that is rotated about the x or the y axis.
    """
    _entry(model)
    offset, rotation = getattr(model, "translation_offset", None), getattr(model, "rotation_offset", None)
    if offset is None or rotation is None:
        return np.zeros(3)
    place, turned = (np.asarray(given, object).ravel().astype(np.float64) for given in (offset, rotation))
    if np.any(turned[:-1] != 0.0):
        raise reject("measurement_model.rotation_offset", "turns about the z axis alone, (0, 0, yaw)", turned.tolist())
    return float_array("measurement_model.translation_offset", [*place[:2], turned[-1]], (3,))


@model_function("measurement_noise_cov")
def _constant_cov(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = params[i * out.shape[1] + j]


def convert_noise(model: Any) -> NoiseModel:
    """Convert the noise covariance of a measurement model, diagonal or not.

    Raises:
        InputError: a matrix that is not positive definite.
    """
    num = len(measured_quantities(model))
    cov = float_array("measurement_model.noise_covar", np.asarray(model.covar(), np.float64), (num, num))
    positive_definite("measurement_model.noise_covar", cov)
    stds = np.sqrt(np.diag(cov))
    if (cov == np.diag(np.diag(cov))).all():
        return constant_noise(stds)
    return NoiseModel(_constant_cov, cov.ravel(), num, stds)


def convert_detection(sensor: Any, prob_detection: float) -> DetectionModel:
    """Return detection with a probability inside a sensor's field of view, and 0 outside.

    For a measurement model, everywhere.

    Stone Soup's radars detect every target in their field of view. The probability corrects this.

    Raises:
        InputError: a sensor with an unsupported field of view, or with obstacles.
    """
    if type(sensor) in _MEASURED:
        return constant_detection(prob_detection)
    if type(sensor) not in (*_ROUND, *_ROTATING):
        kinds = ", ".join(kind.__name__ for kind in (*_ROUND, *_ROTATING))
        wanted = f"one of {kinds}, or a measurement model with a detection model of your own"
        raise reject("sensors", wanted, type(sensor).__name__)
    if sensor.obstacles:
        raise reject("sensors.obstacles", "none", f"{len(sensor.obstacles)} of {type(sensor).__name__}")
    reach = float(sensor.max_range)
    if type(sensor) in _ROTATING:
        return limited_sector(prob_detection, min(reach, _NO_LIMIT), 0.5 * float(sensor.fov_angle))
    return limited_range(prob_detection, reach) if math.isfinite(reach) else constant_detection(prob_detection)


def convert_clutter(source: Any, model: Any) -> ClutterModel:
    """Return uniform clutter of a measurement model.

    Args:
        source: a Stone Soup `ClutterModel` that is uniform in x and y; a `SimpleDetectionSimulator`, whose
            `meas_range` and `clutter_rate` are used; or a clutter model of Vedette.
        model: measurement model of the sensor.

    Raises:
        InputError: another source or distribution.
    """
    quantities, _, kind = _entry(model)
    if isinstance(source, ClutterModel):
        return source
    if isinstance(source, CartesianClutter):
        name = getattr(source.distribution, "__name__", type(source.distribution).__name__)
        bounds = np.asarray(source.dist_params, np.float64)
        if name != "uniform" or bounds.shape != (2, 2):
            wanted = "a uniform distribution with two bounds for x and y"
            raise reject("clutter.distribution", wanted, f"{name} with dist_params of shape {bounds.shape}")
        return region_clutter(float(source.clutter_rate), Region(*bounds[0], *bounds[1]), kind)
    if not isinstance(source, SimpleDetectionSimulator):
        wanted = "a ClutterModel or a SimpleDetectionSimulator of Stone Soup, or a ClutterModel of vedette.models"
        raise reject("clutter", wanted, type(source).__name__)
    bounds = float_array("clutter.meas_range", np.asarray(source.meas_range, np.float64), (len(quantities), 2))
    angular = [QUANTITIES[name].is_angle for name in quantities]
    if any(angular):
        bounds[angular] += convert_pose(model)[2]
    return measurement_space_clutter(float(source.clutter_rate), bounds[:, 0], bounds[:, 1], angular=angular)
