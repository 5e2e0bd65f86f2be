"""Built-in measurements of targets with a height: slant ranges, elevations and altitudes.

States have a height pz and maybe a vertical velocity vz, by default those of `constant_velocity_height`. The plane is
flat, and heights are above it, in m. The height of a sensor is component 10 of its pose. With a shorter pose it is 0.
With offsets dx, dy, dz of the target from the sensor when the beam passes it, and g = sqrt(dx^2 + dy^2):

    bearing = atan2(dy, dx),  slant range = sqrt(g^2 + dz^2),  elevation = atan2(dz, g),  altitude = pz.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from vedette.internal.quantities import COMPONENTS, is_position
from vedette.kernels.base.compile import inlined
from vedette.kernels.base.types import CLIMB, HEIGHT, STATE_COMPONENTS, VX, VY, Floats, place_of
from vedette.kernels.gaussian.beam import Passage, Rise, own_height, passage, to_scan_time, turns
from vedette.models.arguments import reject
from vedette.models.fields import part
from vedette.models.functions import ModelFunction, model_function
from vedette.models.measurement import MeasurementModel
from vedette.models.turns import own_places

ASSUMED_HEIGHT = 5000.0  # m, height of a target with only a slant range measured
_STATE = STATE_COMPONENTS["constant_velocity_height"]

# params of every function here: places of height and vertical velocity in states, -1 for none


@inlined
def _rise(state: Floats, params: Floats) -> Rise:
    height, climb = int(params[0]), int(params[1])
    return Rise(height, climb, state[climb] if climb >= 0 else 0.0)


@inlined
def _height_at_beam(state: Floats, at: Passage, params: Floats) -> float:
    return state[int(params[0])] + at.lag * _rise(state, params).speed  # type: ignore[no-any-return]


@inlined
def _write_bearing_range(state: Floats, pose: Floats, params: Floats, out: Floats) -> tuple[float, float]:
    """Write bearing and slant range, and return ground range and height above the sensor."""
    at = passage(state, pose)
    ground, up = math.sqrt(at.dx * at.dx + at.dy * at.dy), _height_at_beam(state, at, params) - own_height(pose)
    out[0] = math.atan2(at.dy, at.dx)
    out[1] = math.sqrt(ground * ground + up * up)
    return ground, up


@inlined
def _write_slopes(state: Floats, pose: Floats, params: Floats, out: Floats) -> tuple[Passage, float, float]:
    """Write the derivatives of bearing and slant range at the passage, and return it, ground range and height above."""
    at = passage(state, pose)
    square, up = at.dx * at.dx + at.dy * at.dy, _height_at_beam(state, at, params) - own_height(pose)
    distance = math.sqrt(square + up * up)
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = 0.0
    if square > 0.0:
        out[0, 0], out[0, 1] = -at.dy / square, at.dx / square
    if distance > 0.0:
        out[1, 0], out[1, 1], out[1, int(params[0])] = at.dx / distance, at.dy / distance, up / distance
    return at, math.sqrt(square), up


@model_function("measurement")
def _bearing_slant_range(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    _write_bearing_range(state, pose, params, out)


@model_function("measurement_jacobian")
def _bearing_slant_range_jacobian(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    at, _, _ = _write_slopes(state, pose, params, out)
    to_scan_time(at, pose, False, _rise(state, params), out)


@model_function("measurement")
def _with_elevation(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    ground, up = _write_bearing_range(state, pose, params, out)
    out[2] = math.atan2(up, ground)


@model_function("measurement_jacobian")
def _with_elevation_jacobian(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    at, ground, up = _write_slopes(state, pose, params, out)
    square = ground * ground + up * up
    if ground > 0.0:
        out[2, 0], out[2, 1] = -up * at.dx / (ground * square), -up * at.dy / (ground * square)
        out[2, int(params[0])] = ground / square
    to_scan_time(at, pose, False, _rise(state, params), out)


@model_function("measurement")
def _with_altitude(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    _, up = _write_bearing_range(state, pose, params, out)
    out[2] = up + own_height(pose)


@model_function("measurement_jacobian")
def _with_altitude_jacobian(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    at, _, _ = _write_slopes(state, pose, params, out)
    out[2, int(params[0])] = 1.0
    to_scan_time(at, pose, False, _rise(state, params), out)


@model_function("measurement")
def _position_altitude(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    at = passage(state, pose)
    out[0], out[1] = state[0] + at.lag * state[VX], state[1] + at.lag * state[VY]
    out[2] = _height_at_beam(state, at, params)


@model_function("measurement_jacobian")
def _position_altitude_jacobian(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    for i in range(3):
        for j in range(out.shape[1]):
            out[i, j] = 0.0
    out[0, 0], out[1, 1], out[2, int(params[0])] = 1.0, 1.0, 1.0
    if turns(pose):
        to_scan_time(passage(state, pose), pose, True, _rise(state, params), out)


def _from_polar(measurements: Floats, pose: Floats, up: Floats) -> Floats:
    """Return (num, 3) positions with heights from bearings and slant ranges, and heights above the sensor, m."""
    bearings, ranges = measurements[:, 0], measurements[:, 1]
    ground = np.sqrt(np.maximum(ranges**2 - up**2, 0.0))
    x, y = own_places(bearings, pose).T
    return np.stack([x + ground * np.cos(bearings), y + ground * np.sin(bearings), up + own_height(pose)], axis=1)


def _at_elevation(measurements: Floats, pose: Floats) -> Floats:
    return _from_polar(measurements, pose, measurements[:, 1] * np.sin(measurements[:, 2]))


def _at_altitude(measurements: Floats, pose: Floats) -> Floats:
    return _from_polar(measurements, pose, measurements[:, 2] - own_height(pose))


def _at_assumed_height(measurements: Floats, pose: Floats) -> Floats:
    """Return positions at the assumed height, or at an elevation of at most 45 degrees for targets that are closer."""
    up = np.minimum(ASSUMED_HEIGHT - own_height(pose), measurements[:, 1] * math.sqrt(0.5))
    return _from_polar(measurements, pose, up)


def _at_position(measurements: Floats, pose: Floats) -> Floats:
    return measurements


# Positions with heights of the kinds whose measurements determine them.
PLACES_WITH_HEIGHT = {"bearing_range_elevation": _at_elevation, "bearing_range_altitude": _at_altitude}


def _of_states(
    components: Sequence[str], kind: str, function: ModelFunction, jacobian: ModelFunction, places: Any
) -> MeasurementModel:
    """Return a kind of measurement of states with these components. Raises `InputError` if they have no height."""
    if HEIGHT not in components:
        raise reject("state_components", f"names with {HEIGHT}, the height", ", ".join(components))
    params = np.array([place_of(name, components) for name in (HEIGHT, CLIMB)], np.float64)
    names, state = COMPONENTS[kind], tuple(components)
    more: dict[str, Any] = {"places": places, "is_linear": is_position(kind), "state_components": state}
    return MeasurementModel(len(names), function, params, jacobian, components=names, **more)


@part("bearing_slant_range", "measurement")
def bearing_slant_range(state_components: Sequence[str] = _STATE) -> MeasurementModel:
    """z = [bearing in rad, slant range in m] of a radar that measures no heights. Two radars' ranges determine them.

    A track starts at a height of 5 km, because one range does not determine it. `state_components`: of the motion.
    """
    functions = _bearing_slant_range, _bearing_slant_range_jacobian
    return _of_states(state_components, "bearing_slant_range", *functions, _at_assumed_height)


@part("bearing_range_elevation", "measurement")
def bearing_range_elevation(state_components: Sequence[str] = _STATE) -> MeasurementModel:
    """z = [bearing in rad, slant range in m, elevation in rad]. `state_components`: of the motion."""
    functions = _with_elevation, _with_elevation_jacobian
    return _of_states(state_components, "bearing_range_elevation", *functions, _at_elevation)


@part("bearing_range_altitude", "measurement")
def bearing_range_altitude(state_components: Sequence[str] = _STATE) -> MeasurementModel:
    """z = [bearing in rad, slant range in m, altitude in m], such as mode C. `state_components`: of the motion."""
    functions = _with_altitude, _with_altitude_jacobian
    return _of_states(state_components, "bearing_range_altitude", *functions, _at_altitude)


@part("position_altitude", "measurement")
def position_altitude(state_components: Sequence[str] = _STATE) -> MeasurementModel:
    """z = [px, py, pz] of the target in m. The sensor's pose has no effect. `state_components`: of the motion."""
    functions = _position_altitude, _position_altitude_jacobian
    return _of_states(state_components, "position_altitude", *functions, _at_position)
