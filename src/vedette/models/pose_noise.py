"""Errors of measurements from errors of the sensor's own pose, such as those of a ship's navigation."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vedette.kernels.base.types import OWN_HEIGHT, Floats
from vedette.models.heights import ASSUMED_HEIGHT


class PoseStds(NamedTuple):
    """Standard deviations of a sensor's own pose: position, m; heading, rad; height, m; velocity, m/s. 0: exact."""

    x: float = 0.0
    y: float = 0.0
    heading: float = 0.0
    height: float = 0.0
    vx: float = 0.0
    vy: float = 0.0


def pose_stds_of(components: Sequence[str], with_height: bool) -> tuple[str, ...]:
    """Return the fields of `PoseStds` that affect a measurement of such components.

    with_height: True if it depends on heights. The error of a position counts with bearing and range, as its effect
    depends on where the target is. Measured positions are taken as free of it.
    """
    names: tuple[str, ...] = ("heading",) if "bearing" in components else ()
    if {"bearing", "range"} <= set(components):
        names += ("x", "y", *(("height",) if with_height else ()))
    return names + (("vx", "vy") if "range_rate" in components else ())


def pose_noise(measured: Sequence[float], components: Sequence[str], pose: Sequence[float], stds: PoseStds) -> Floats:
    """Return the covariance that errors of the sensor's pose add to a measurement, (m, m): J P J'.

    J has the derivatives of the measurement by the pose, for a target where the measurement puts it. A bearing is the
    sensor's heading plus an angle that it measures. The turn of the line of sight from errors of the position is left
    out of range rates.

    Args:
        measured: measurement, rad, m, m/s.
        components: names of its quantities.
        pose: of the sensor.
        stds: standard deviations of the pose, whose errors are independent.
    """
    own, jacobian = dict(zip(components, measured, strict=True)), np.zeros((len(components), len(stds)))
    rows = {name: jacobian[i] for i, name in enumerate(components)}
    if "bearing" in rows:
        rows["bearing"][2] = 1.0
    if not {"bearing", "range"} <= set(rows):
        return _product(jacobian, stds)
    east, north, distance = math.cos(own["bearing"]), math.sin(own["bearing"]), max(own["range"], 1.0)
    has_height = bool({"elevation", "altitude"} & set(own)) or stds.height > 0.0
    up = _height_above(own, pose, distance) if has_height else 0.0
    ground = max(math.sqrt(max(distance * distance - up * up, 0.0)), 1.0)
    rows["bearing"][:2] = north / ground, -east / ground
    rows["range"][:2] = -east * ground / distance, -north * ground / distance
    rows["range"][3] = -up / distance
    if "elevation" in rows:
        rows["elevation"][:2] = east * up / distance**2, north * up / distance**2
        rows["elevation"][3] = -ground / distance**2
    if "range_rate" in rows:
        rows["range_rate"][4:] = -east, -north
    return _product(jacobian, stds)


def _height_above(own: dict[str, float], pose: Sequence[float], distance: float) -> float:
    """Return the height of a measured target above the sensor, m."""
    height = pose[OWN_HEIGHT] if len(pose) > OWN_HEIGHT else 0.0
    if "elevation" in own:
        return distance * math.sin(own["elevation"])
    return min(own.get("altitude", ASSUMED_HEIGHT) - height, distance * math.sqrt(0.5))


def _product(jacobian: Floats, stds: PoseStds) -> Floats:
    cov = np.tril((jacobian * np.square(stds)) @ jacobian.T)
    return np.asarray(cov + np.tril(cov, -1).T)  # symmetric to the last bit
