"""Built-in measurement noise: constant, or growing with the target's distance, as in the paper or axis by axis."""

import numpy as np

from vedette.errors import InputError
from vedette.kernels.base.compile import inlined
from vedette.kernels.base.types import Floats
from vedette.kernels.gaussian.beam import angle_of_extent, offset_at_beam, passage
from vedette.models.arguments import float_array, non_negative, positive, reject
from vedette.models.fields import NonNegativePair, PositivePair, Positives, part
from vedette.models.functions import model_function
from vedette.models.measurement import NoiseModel


@model_function("measurement_noise_cov")
def _constant(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = params[i] * params[i] if i == j else 0.0


@inlined
def _write_polar(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    dx, dy = offset_at_beam(state, pose)
    square = dx * dx + dy * dy
    sigma_range = params[0] + params[1] * square
    sigma_bearing = params[2] + params[3] * np.sqrt(square)
    out[0, 0] = sigma_bearing * sigma_bearing + angle_of_extent(params[4], square)
    out[0, 1] = 0.0
    out[1, 0] = 0.0
    out[1, 1] = sigma_range * sigma_range + params[4] * params[4]


@model_function("measurement_noise_cov")
def _bearing_range(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    _write_polar(state, pose, params, out)


@model_function("measurement_noise_cov")
def _with_third(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    _write_polar(state, pose, params, out)
    for i in range(2):
        out[i, 2] = 0.0
        out[2, i] = 0.0
    out[2, 2] = params[5] * params[5]


@model_function("measurement_noise_cov")
def _bearing(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    dx, dy = offset_at_beam(state, pose)
    square = dx * dx + dy * dy
    sigma_bearing = params[0] + params[1] * np.sqrt(square)
    out[0, 0] = sigma_bearing * sigma_bearing + angle_of_extent(params[2], square)


@model_function("measurement_noise_cov")
def _range(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    dx, dy = offset_at_beam(state, pose)
    sigma_range = params[0] + params[1] * (dx * dx + dy * dy)
    out[0, 0] = sigma_range * sigma_range + params[2] * params[2]


@model_function("measurement_noise_cov")
def _by_axis(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    at = passage(state, pose)
    for i in range(2):
        offset = at.dx if i == 0 else at.dy
        std = params[i] + params[2 + i] * offset * offset
        out[i, i] = std * std
        out[i, 1 - i] = 0.0


@part("constant", "noise", std="stds")
def constant_noise(stds: Positives) -> NoiseModel:
    """Independent noise with the same standard deviations everywhere.

    Args:
        stds: standard deviation of each measurement component, a bearing in radians [rad, m].
    """
    values = float_array("stds", stds, (None,))
    if len(values) == 0 or (values <= 0.0).any():
        raise reject("stds", "one or more numbers above 0", stds)
    return NoiseModel(_constant, values, len(values), values)


@part("by_axis", "noise")
def axis_noise(std: PositivePair, quadratic_growth: NonNegativePair) -> NoiseModel:
    """Noise of positions: standard deviations std + quadratic_growth d^2 along each axis, d the target's offset on it.

    Args:
        std: (2,) standard deviation along x and y at offset 0 [m].
        quadratic_growth: (2,) growth with the square of the offset along x and y [1/m].
    """
    stds, growths = float_array("std", std, (2,)), float_array("quadratic_growth", quadratic_growth, (2,))
    if (stds <= 0.0).any():
        raise reject("std", "2 numbers above 0", std)
    if (growths < 0.0).any():
        raise reject("quadratic_growth", "2 numbers of at least 0", quadratic_growth)
    return NoiseModel(_by_axis, np.concatenate([stds, growths]), 2, stds)


def range_dependent_noise(
    sigma_range: float | None = None,
    eta_range: float = 0.0,
    sigma_bearing: float | None = None,
    eta_bearing: float = 0.0,
    sigma_range_rate: float | None = None,
    sigma_elevation: float | None = None,
    sigma_altitude: float | None = None,
    extent: float = 0.0,
) -> NoiseModel:
    """Noise that grows with the distance d of the target (paper section IV, paper-notes 3).

    The standard deviations are sigma_range + eta_range d^2 and sigma_bearing + eta_bearing d. To their squares the
    point of a large target that reflects adds extent^2 and (extent / d)^2, at most 1. With only `sigma_bearing`
    the model is for bearing-only sensors, with only `sigma_range` for range-only sensors, and with both for [bearing,
    range]. One of `sigma_range_rate`, `sigma_elevation` and `sigma_altitude` adds this third component. The distance is
    that in the plane.

    Args:
        sigma_range: m, above 0 (paper: 10).
        eta_range: 1/m (paper: 5e-5).
        sigma_bearing: rad, above 0 (paper: pi/180).
        eta_bearing: rad/m (paper: 5e-6).
        sigma_range_rate: m/s, above 0, at every distance.
        sigma_elevation: rad, above 0, at every distance.
        sigma_altitude: m, above 0, at every distance.
        extent: standard deviation of the reflecting point about the middle of the target, m, along and across the line
            of sight. It is taken as independent from scan to scan.
    """
    floor = non_negative("extent", extent)
    ranges = _growth("range", sigma_range, eta_range)
    bearings = _growth("bearing", sigma_bearing, eta_bearing)
    thirds = {"range_rate": sigma_range_rate, "elevation": sigma_elevation, "altitude": sigma_altitude}
    given_thirds = [(f"sigma_{name}", sigma) for name, sigma in thirds.items() if sigma is not None]
    for name, sigma in given_thirds:
        if not (ranges and bearings):
            raise reject(name, "None where no sigma_range and sigma_bearing are given", sigma)
        if (name, sigma) != given_thirds[0]:
            raise reject(name, f"None beside {given_thirds[0][0]}, as one third component is measured", sigma)
    if given_thirds:
        std = positive(*given_thirds[0])
        return NoiseModel(
            _with_third, np.array([*ranges, *bearings, floor, std]), 3, np.array([bearings[0], ranges[0], std])
        )
    if ranges and bearings:
        return NoiseModel(_bearing_range, np.array([*ranges, *bearings, floor]), 2, np.array([bearings[0], ranges[0]]))
    if bearings:
        return NoiseModel(_bearing, np.array([*bearings, floor]), 1, np.array(bearings[:1]))
    if ranges:
        return NoiseModel(_range, np.array([*ranges, floor]), 1, np.array(ranges[:1]))
    raise InputError("sigma_range, sigma_bearing: expected at least one of them; got neither")


def _growth(component: str, sigma: float | None, eta: float) -> list[float]:
    """Return [sigma, eta] of one component, empty if the sensor does not measure it."""
    if sigma is not None:
        return [positive(f"sigma_{component}", sigma), non_negative(f"eta_{component}", eta)]
    if eta != 0.0:
        raise reject(f"eta_{component}", f"0 where no sigma_{component} is given", eta)
    return []


BUILT_IN = frozenset({_constant, _by_axis, _bearing_range, _with_third, _bearing, _range})  # linear in their parameters
