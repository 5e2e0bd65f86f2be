"""Built-in measurements of targets with a height: slant ranges, elevations and altitudes.

States are [px, py, vx, vy, pz, vz] (`constant_velocity_height`). The plane is flat, and heights are above it, in m. The
height of a sensor is component 10 of its pose. With a shorter pose it is 0. With offsets dx, dy, dz of the target from
the sensor when the beam passes it, and g = sqrt(dx^2 + dy^2):

    bearing = atan2(dy, dx),  slant range = sqrt(g^2 + dz^2),  elevation = atan2(dz, g),  altitude = pz.
"""

from __future__ import annotations

import math

import numpy as np

from vedette.kernels.base.compile import inlined
from vedette.kernels.base.types import HEIGHT, Floats
from vedette.kernels.gaussian.beam import Passage, own_height, passage, to_scan_time, turns
from vedette.models.fields import part
from vedette.models.functions import model_function
from vedette.models.measurement import MeasurementModel
from vedette.models.turns import own_places

ASSUMED_HEIGHT = 5000.0  # m, height of a target with only a slant range measured


@inlined
def _height_at_beam(state: Floats, at: Passage) -> float:
    return state[HEIGHT] + at.lag * state[HEIGHT + 1]  # type: ignore[no-any-return]


@inlined
def _write_bearing_range(state: Floats, pose: Floats, out: Floats) -> tuple[float, float]:
    """Write bearing and slant range, and return ground range and height above the sensor."""
    at = passage(state, pose)
    ground, up = math.sqrt(at.dx * at.dx + at.dy * at.dy), _height_at_beam(state, at) - own_height(pose)
    out[0] = math.atan2(at.dy, at.dx)
    out[1] = math.sqrt(ground * ground + up * up)
    return ground, up


@inlined
def _write_slopes(state: Floats, pose: Floats, out: Floats) -> tuple[Passage, float, float]:
    """Write the derivatives of bearing and slant range at the passage, and return it, ground range and height above."""
    at = passage(state, pose)
    square, up = at.dx * at.dx + at.dy * at.dy, _height_at_beam(state, at) - own_height(pose)
    distance = math.sqrt(square + up * up)
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = 0.0
    if square > 0.0:
        out[0, 0], out[0, 1] = -at.dy / square, at.dx / square
    if distance > 0.0:
        out[1, 0], out[1, 1], out[1, HEIGHT] = at.dx / distance, at.dy / distance, up / distance
    return at, math.sqrt(square), up


@model_function("measurement")
def _bearing_slant_range(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    _write_bearing_range(state, pose, out)


@model_function("measurement_jacobian")
def _bearing_slant_range_jacobian(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    at, _, _ = _write_slopes(state, pose, out)
    to_scan_time(at, pose, False, state[HEIGHT + 1], out)


@model_function("measurement")
def _with_elevation(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    ground, up = _write_bearing_range(state, pose, out)
    out[2] = math.atan2(up, ground)


@model_function("measurement_jacobian")
def _with_elevation_jacobian(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    at, ground, up = _write_slopes(state, pose, out)
    square = ground * ground + up * up
    if ground > 0.0:
        out[2, 0], out[2, 1] = -up * at.dx / (ground * square), -up * at.dy / (ground * square)
        out[2, HEIGHT] = ground / square
    to_scan_time(at, pose, False, state[HEIGHT + 1], out)


@model_function("measurement")
def _with_altitude(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    _, up = _write_bearing_range(state, pose, out)
    out[2] = up + own_height(pose)


@model_function("measurement_jacobian")
def _with_altitude_jacobian(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    at, _, _ = _write_slopes(state, pose, out)
    out[2, HEIGHT] = 1.0
    to_scan_time(at, pose, False, state[HEIGHT + 1], out)


@model_function("measurement")
def _position_altitude(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    at = passage(state, pose)
    out[0], out[1], out[2] = state[0] + at.lag * state[2], state[1] + at.lag * state[3], _height_at_beam(state, at)


@model_function("measurement_jacobian")
def _position_altitude_jacobian(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    for i in range(3):
        for j in range(out.shape[1]):
            out[i, j] = 0.0
    out[0, 0], out[1, 1], out[2, HEIGHT] = 1.0, 1.0, 1.0
    if turns(pose):
        to_scan_time(passage(state, pose), pose, True, state[HEIGHT + 1], out)


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


@part("bearing_slant_range", "measurement")
def bearing_slant_range() -> MeasurementModel:
    """z = [bearing in rad, slant range in m] of a radar that measures no heights. Two radars' ranges determine them.

    A track starts at a height of 5 km, because one range does not determine it. States are [px, py, vx, vy, pz, vz].
    """
    functions = _bearing_slant_range, np.empty(0), _bearing_slant_range_jacobian
    return MeasurementModel(2, *functions, places=_at_assumed_height, components=("bearing", "range"))


@part("bearing_range_elevation", "measurement")
def bearing_range_elevation() -> MeasurementModel:
    """z = [bearing in rad, slant range in m, elevation in rad]. States are [px, py, vx, vy, pz, vz]."""
    functions = _with_elevation, np.empty(0), _with_elevation_jacobian
    return MeasurementModel(3, *functions, places=_at_elevation, components=("bearing", "range", "elevation"))


@part("bearing_range_altitude", "measurement")
def bearing_range_altitude() -> MeasurementModel:
    """z = [bearing in rad, slant range in m, altitude in m], such as mode C. States are [px, py, vx, vy, pz, vz]."""
    functions = _with_altitude, np.empty(0), _with_altitude_jacobian
    return MeasurementModel(3, *functions, places=_at_altitude, components=("bearing", "range", "altitude"))


@part("position_altitude", "measurement")
def position_altitude() -> MeasurementModel:
    """z = [px, py, pz] of the target in m. The sensor's pose has no effect. States are [px, py, vx, vy, pz, vz]."""
    functions = _position_altitude, np.empty(0), _position_altitude_jacobian
    return MeasurementModel(3, *functions, places=_at_position, is_linear=True, components=("x", "y", "altitude"))
