"""Clutter that is uniform in a figure around the sensor, which moves and turns with it.

The figure is a disc or a square, or the part of it within an angle of the heading. The intensity per square metre is
rate / area inside and 0 outside. At (bearing, range) it includes the Jacobian, rate * range / area (paper-notes 5).
"""

import math
from dataclasses import dataclass

import numpy as np

from vedette.kernels.base.compile import inlined, kernel
from vedette.kernels.base.types import HEADING, Floats
from vedette.kernels.gaussian.scratch import wrap_angle
from vedette.models.arguments import non_negative, one_of, positive, reject
from vedette.models.clutter import (
    ClutterModel,
    angular_of,
    log_density_of_rate,
    log_or_minus_infinity,
    plane_params,
    with_rates,
)
from vedette.models.fields import HalfWidth, NonNegative, Positive, part
from vedette.models.functions import ModelFunction, model_function
from vedette.models.measurement import MeasurementModel

# params of every function here: log rate, radius or half side, 1 for a square or 0 for a disc, half width of the
# sector, `plane_params`


@kernel
def _square_up_to(angle: float) -> float:
    """Area of a square of half side 1 between the direction -pi / 4 and `angle`. Grows by 1 each quarter turn."""
    quarters = math.floor((angle + 0.25 * math.pi) / (0.5 * math.pi))
    return quarters + 0.5 * (math.tan(angle - 0.5 * math.pi * quarters) + 1.0)


@kernel
def _area(heading: float, size: float, is_square: bool, half_width: float) -> float:
    """Return the area of the figure in m^2. For a sector of a square it depends on the heading."""
    if is_square:
        return size * size * (_square_up_to(heading + half_width) - _square_up_to(heading - half_width))
    return half_width * size * size


@kernel
def _log_density(dx: float, dy: float, heading: float, params: Floats) -> float:
    """Return the log of the expected number per square metre at an offset from the sensor."""
    size, is_square, half_width = params[1], params[2] > 0.0, params[3]
    reach = max(abs(dx), abs(dy)) if is_square else math.sqrt(dx * dx + dy * dy)
    if not reach <= size or (half_width < math.pi and abs(wrap_angle(math.atan2(dy, dx) - heading)) > half_width):
        return -math.inf
    return params[0] - math.log(_area(heading, size, is_square, half_width))  # type: ignore[no-any-return]


@model_function("log_clutter_intensity")
def _position(measurement: Floats, pose: Floats, params: Floats) -> float:
    dx = measurement[0] + params[5] - (pose[0] + params[8])
    dy = measurement[1] + params[6] - (pose[1] + params[9])
    return _log_density(dx, dy, pose[HEADING], params)


@inlined
def _at_range(measurement: Floats, pose: Floats, params: Floats) -> float:
    bearing, distance = measurement[0] + params[5], measurement[1] + params[6]
    if not distance > 0.0:
        return -math.inf
    dx, dy = distance * math.cos(bearing), distance * math.sin(bearing)
    return _log_density(dx, dy, pose[HEADING], params) + math.log(distance)


@model_function("log_clutter_intensity")
def _bearing_range(measurement: Floats, pose: Floats, params: Floats) -> float:
    return _at_range(measurement, pose, params)


@model_function("log_clutter_intensity")
def _bearing_range_rate(measurement: Floats, pose: Floats, params: Floats) -> float:
    return _at_range(measurement, pose, params) + log_density_of_rate(measurement, params)


_KINDS: dict[str, ModelFunction] = {
    "position": _position,
    "bearing_range": _bearing_range,
    "bearing_range_rate": _bearing_range_rate,
}


@dataclass(frozen=True, slots=True)
class _AroundSampler:
    rate: float
    size: float
    is_square: bool
    half_width: float
    kind: str
    max_range_rate: float

    def __call__(
        self, pose: Floats, measurement: MeasurementModel, *, state_dim: int, rng: np.random.Generator
    ) -> Floats:
        num_clutter, heading = int(rng.poisson(self.rate)), float(pose[HEADING])
        share = rng.uniform(size=(num_clutter, 2))
        angles = heading + self.half_width * (2.0 * share[:, 0] - 1.0)
        reach = np.full(num_clutter, self.size)
        if self.is_square:
            # Inverse of the area up to an angle, so that equal areas are equally likely.
            ends = [_square_up_to(heading + side * self.half_width) for side in (-1.0, 1.0)]
            quarters, rest = np.divmod(ends[0] + share[:, 0] * (ends[1] - ends[0]), 1.0)
            within = np.arctan(2.0 * rest - 1.0)
            angles, reach = 0.5 * math.pi * quarters + within, self.size / np.cos(within)
        states = np.zeros((num_clutter, state_dim))
        distances = reach * np.sqrt(share[:, 1])
        states[:, 0] = pose[0] + distances * np.cos(angles)
        states[:, 1] = pose[1] + distances * np.sin(angles)
        return with_rates(measurement.measure(states, pose), self.kind, self.max_range_rate, rng)


@part("around_sensor", "clutter")
def around_sensor(
    rate: NonNegative,
    kind: str,
    *,
    radius: Positive | None = None,
    half_side: Positive | None = None,
    half_width_rad: HalfWidth = math.pi,
    max_range_rate: Positive | None = None,
) -> ClutterModel:
    """Clutter uniform over a disc, a square along the axes, or a sector of either, centred on the sensor.

    If a simulator draws points over a larger figure and keeps only this part, `rate` is their number times the share of
    the area that is kept, such as pi / 4 for a square that is clipped to the disc in it.

    Args:
        rate: expected number per scan in the figure.
        kind: kind of the sensor's measurements: "position", "bearing_range" or "bearing_range_rate".
        radius: radius of a disc [m].
        half_side: half the side of a square along the axes. Give either this or the radius [m].
        half_width_rad: greatest angle from the heading, either side [rad].
        max_range_rate: largest range rate of a false measurement, either way, where range rates are measured, uniform
            up to it. none: 300 [m/s].
    """
    one_of("kind", kind, _KINDS)
    if (radius is None) == (half_side is None):
        raise reject("radius, half_side", "one of them", "neither" if radius is None else "both")
    if positive("half_width_rad", half_width_rad) > math.pi:
        raise reject("half_width_rad", "an angle in (0, pi]", half_width_rad)
    rate, is_square = non_negative("rate", rate), radius is None
    size = positive("half_side", half_side) if is_square else positive("radius", radius)
    own = plane_params(kind, max_range_rate)
    params = np.array([log_or_minus_infinity(rate), size, float(is_square), half_width_rad, *own])
    sampler = _AroundSampler(rate, size, is_square, half_width_rad, kind, float(own[0]))
    return ClutterModel(rate, _KINDS[kind], params, sampler, angular=angular_of(kind))
