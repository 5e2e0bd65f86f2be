"""Clutter that is uniform in the surveillance region, with the Jacobian of each kind of measurement.

Uniform in x, y is not uniform in bearing and range: the intensity at (bearing, range) is rate * range / area inside the
region and 0 outside (paper-notes 5). The intensity of bearings or ranges alone is its integral along the ray or arc.
"""

import math
from dataclasses import dataclass

import numpy as np

from vedette.internal.quantities import HEIGHT_DEPENDENT
from vedette.kernels.base.compile import inlined, kernel
from vedette.kernels.base.types import Floats
from vedette.kernels.gaussian.beam import own_height, own_place
from vedette.models.arguments import non_negative, one_of, reject
from vedette.models.clutter import (
    ClutterModel,
    angular_of,
    log_density_of_rate,
    log_or_minus_infinity,
    plane_params,
    with_rates,
)
from vedette.models.fields import NonNegative, Positive, part
from vedette.models.functions import ModelFunction, model_function, write_rows
from vedette.models.measurement import MeasurementModel
from vedette.models.region import Region

# params of every function here: log(rate / area), x_min, x_max, y_min, y_max; `plane_params`


@inlined
def _inside(x: float, y: float, params: Floats) -> bool:
    return bool(params[1] <= x <= params[2] and params[3] <= y <= params[4])


@kernel
def _clip_ray(start: float, slope: float, low: float, high: float, near: float, far: float) -> tuple[float, float]:
    """Return the part of [near, far] in which start + slope * t lies in [low, high], empty if near > far."""
    if slope == 0.0:
        return (near, far) if low <= start <= high else (1.0, 0.0)
    first, second = (low - start) / slope, (high - start) / slope
    return max(near, min(first, second)), min(far, max(first, second))


@kernel
def _arc_in_quadrant(radius: float, x_low: float, x_high: float, y_low: float, y_high: float) -> float:
    """Return the angle within [0, pi/2] over which radius * (cos, sin) lies in the box. Both are monotone there."""
    if x_high < 0.0 or y_high < 0.0 or x_low > radius or y_low > radius:
        return 0.0
    start = max(math.acos(min(x_high / radius, 1.0)), math.asin(max(y_low / radius, 0.0)))
    end = min(math.acos(max(x_low / radius, 0.0)), math.asin(min(y_high / radius, 1.0)))
    return max(0.0, end - start)


@model_function("log_clutter_intensity")
def _position(measurement: Floats, pose: Floats, params: Floats) -> float:
    inside = _inside(measurement[0] + params[6], measurement[1] + params[7], params)
    return params[0] if inside else -math.inf


@inlined
def _at_range(measurement: Floats, pose: Floats, params: Floats) -> float:
    bearing, distance = measurement[0] + params[6], measurement[1] + params[7]
    own_x, own_y = own_place(bearing, pose)
    x = own_x + params[9] + distance * math.cos(bearing)
    y = own_y + params[10] + distance * math.sin(bearing)
    if not (distance > 0.0 and _inside(x, y, params)):
        return -math.inf
    return params[0] + math.log(distance)  # type: ignore[no-any-return]


@model_function("log_clutter_intensity")
def _bearing_range(measurement: Floats, pose: Floats, params: Floats) -> float:
    return _at_range(measurement, pose, params)


@model_function("log_clutter_intensity")
def _bearing_range_rate(measurement: Floats, pose: Floats, params: Floats) -> float:
    return _at_range(measurement, pose, params) + log_density_of_rate(measurement, params)


@model_function("log_clutter_intensity")
def _bearing(measurement: Floats, pose: Floats, params: Floats) -> float:
    bearing = measurement[0] + params[6]
    own_x, own_y = own_place(bearing, pose)
    x, y = own_x + params[9], own_y + params[10]
    near, far = _clip_ray(x, math.cos(bearing), params[1], params[2], 0.0, math.inf)
    near, far = _clip_ray(y, math.sin(bearing), params[3], params[4], near, far)
    if not near < far:
        return -math.inf
    return params[0] + math.log(0.5 * (far - near) * (far + near))  # type: ignore[no-any-return]


@model_function("log_clutter_intensity")
def _range(measurement: Floats, pose: Floats, params: Floats) -> float:
    distance, x, y = measurement[0] + params[6], pose[0] + params[9], pose[1] + params[10]
    if not distance > 0.0:
        return -math.inf
    x_low, x_high, y_low, y_high = params[1] - x, params[2] - x, params[3] - y, params[4] - y
    arc = (
        _arc_in_quadrant(distance, x_low, x_high, y_low, y_high)
        + _arc_in_quadrant(distance, -x_high, -x_low, y_low, y_high)
        + _arc_in_quadrant(distance, x_low, x_high, -y_high, -y_low)
        + _arc_in_quadrant(distance, -x_high, -x_low, -y_high, -y_low)
    )
    return params[0] + math.log(distance * arc) if arc > 0.0 else -math.inf


@inlined
def _share_of_heights(least: float, most: float, sensor: float, highest: float) -> float:
    """Return the share of heights from 0 to `highest` whose distance from the sensor's lies between two values."""
    above = max(0.0, min(highest - sensor, most) - least) if highest > sensor else 0.0
    return (above + max(0.0, min(sensor, most) - least)) / highest


@inlined
def _at_slant_range(measurement: Floats, pose: Floats, params: Floats) -> float:
    """Log intensity over bearing and slant range, whatever the height."""
    bearing, distance = measurement[0] + params[6], measurement[1] + params[7]
    own_x, own_y = own_place(bearing, pose)
    near, far = _clip_ray(own_x + params[9], math.cos(bearing), params[1], params[2], 0.0, math.inf)
    near, far = _clip_ray(own_y + params[10], math.sin(bearing), params[3], params[4], near, far)
    if not (near < far and distance > near):
        return -math.inf
    least = math.sqrt(max(0.0, distance * distance - far * far))
    share = _share_of_heights(least, math.sqrt(distance * distance - near * near), own_height(pose), params[5])
    return params[0] + math.log(distance * share) if share > 0.0 else -math.inf


@model_function("log_clutter_intensity")
def _bearing_slant_range(measurement: Floats, pose: Floats, params: Floats) -> float:
    return _at_slant_range(measurement, pose, params)


@inlined
def _at_height(bearing: float, ground: float, height: float, pose: Floats, params: Floats) -> float:
    """Log intensity per m^3 at a bearing, ground range and height."""
    own_x, own_y = own_place(bearing, pose)
    x = own_x + params[9] + ground * math.cos(bearing)
    y = own_y + params[10] + ground * math.sin(bearing)
    if not (0.0 <= height <= params[5] and _inside(x, y, params)):
        return -math.inf
    return params[0] - math.log(params[5])  # type: ignore[no-any-return]


@model_function("log_clutter_intensity")
def _bearing_range_elevation(measurement: Floats, pose: Floats, params: Floats) -> float:
    if math.isnan(measurement[2]):
        return _at_slant_range(measurement, pose, params)
    distance, elevation = measurement[1] + params[7], measurement[2] + params[8]
    ground = distance * math.cos(elevation)
    if not (distance > 0.0 and ground > 0.0):
        return -math.inf
    height = own_height(pose) + distance * math.sin(elevation)
    return _at_height(measurement[0] + params[6], ground, height, pose, params) + math.log(distance * ground)


@model_function("log_clutter_intensity")
def _bearing_range_altitude(measurement: Floats, pose: Floats, params: Floats) -> float:
    if math.isnan(measurement[2]):
        return _at_slant_range(measurement, pose, params)
    distance, height = measurement[1] + params[7], measurement[2] + params[8]
    square = distance * distance - (height - own_height(pose)) ** 2
    if not (distance > 0.0 and square > 0.0):
        return -math.inf
    return _at_height(measurement[0] + params[6], math.sqrt(square), height, pose, params) + math.log(distance)


@model_function("log_clutter_intensity")
def _position_altitude(measurement: Floats, pose: Floats, params: Floats) -> float:
    inside = _inside(measurement[0] + params[6], measurement[1] + params[7], params)
    if inside and math.isnan(measurement[2]):
        return params[0]  # type: ignore[no-any-return]
    if not (inside and 0.0 <= measurement[2] + params[8] <= params[5]):
        return -math.inf
    return params[0] - math.log(params[5])  # type: ignore[no-any-return]


_KINDS: dict[str, ModelFunction] = {
    "bearing_range": _bearing_range,
    "bearing_range_rate": _bearing_range_rate,
    "bearing_only": _bearing,
    "range_only": _range,
    "position": _position,
    "bearing_slant_range": _bearing_slant_range,
    "bearing_range_elevation": _bearing_range_elevation,
    "bearing_range_altitude": _bearing_range_altitude,
    "position_altitude": _position_altitude,
}


@dataclass(frozen=True, slots=True)
class _RegionSampler:
    rate: float
    region: Region
    kind: str
    largest: float  # range rate or height

    def __call__(
        self, pose: Floats, measurement: MeasurementModel, *, state_dim: int, rng: np.random.Generator
    ) -> Floats:
        num_clutter = int(rng.poisson(self.rate))
        states = np.zeros((num_clutter, state_dim))
        states[:, :2] = self.region.sample(num_clutter, rng=rng)
        if self.kind in HEIGHT_DEPENDENT and measurement.height >= 0:
            states[:, measurement.height] = rng.uniform(0.0, self.largest, num_clutter)
        drawn = np.empty((num_clutter, measurement.meas_dim))
        write_rows(measurement.function, states, pose, measurement.params, drawn)
        return with_rates(drawn, self.kind, self.largest, rng)


@part("region", "clutter")
def region_clutter(
    rate: NonNegative,
    region: Region,
    kind: str,
    *,
    max_range_rate: Positive | None = None,
    max_height: Positive | None = None,
) -> ClutterModel:
    """Poisson clutter, uniform over the surveillance region (paper section IV, paper-notes 5).

    Clutter is drawn by applying the sensor's measurement function to uniform positions at rest. Range rates are
    uniform from -max_range_rate to max_range_rate, and heights from 0 to max_height.

    Args:
        rate: expected number per scan (paper: 25).
        region: the surveillance region.
        kind: kind of measurement, a key of `vedette.internal.quantities.COMPONENTS`. For other measurements, use a
            `ClutterModel` with a custom log intensity and sampler.
        max_range_rate: largest range rate of a false measurement, either way, where range rates are measured. none: 300
            [m/s].
        max_height: largest height of a false measurement, where heights play a part. none: 12 km [m].
    """
    one_of("kind", kind, _KINDS)
    if not isinstance(region, Region):
        raise reject("region", "a Region", region)
    rate = non_negative("rate", rate)
    own = plane_params(kind, max_range_rate, max_height)
    params = np.concatenate([[log_or_minus_infinity(rate / region.area)], region.bounds, own])
    sampler = _RegionSampler(rate, region, kind, float(own[0]))
    return ClutterModel(rate, _KINDS[kind], params, sampler, angular=angular_of(kind))
