"""How sensor platforms move: at constant speed along their heading (paper section IV)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from vedette.kernels.base.types import Floats
from vedette.models.arguments import as_array, reject
from vedette.models.measurement import wrap_angles


def advance(pose: ArrayLike, heading_rad: ArrayLike, speed: ArrayLike, dt: float) -> Floats:
    """The pose after `dt` seconds at `speed` along `heading_rad`; the platform turns at once and is kept by no border.

    Headings -pi and pi lead to the same pose, bit for bit.

    Args:
        pose: (..., 3) px, py, heading_rad, one or any number of sensors.
        heading_rad: new absolute heading, counter-clockwise from +x; one, or one a sensor.
        speed: m/s, one or one a sensor.
        dt: s, at least 0.

    Returns:
        (..., 3) new poses, headings in (-pi, pi].

    Raises:
        InputError: not finite, a negative speed or time, shapes that do not fit together.
    """
    poses, headings, speeds = (
        np.asarray(as_array(field, values, "fiu", "numbers"), dtype=np.float64)
        for field, values in (("pose", pose), ("heading_rad", heading_rad), ("speed", speed))
    )
    if poses.ndim == 0 or poses.shape[-1] != 3 or not np.isfinite(poses).all():
        raise reject("pose", "finite px, py, heading_rad in the last axis", poses.tolist())
    if not (math.isfinite(dt) and dt >= 0.0):
        raise reject("dt", "a time of at least 0 s", dt)
    for field, values in (("heading_rad", headings), ("speed", speeds)):
        fits = values.ndim == 0 or values.shape == poses.shape[:-1]
        if not fits or not np.isfinite(values).all() or (field == "speed" and (values < 0.0).any()):
            wanted = "finite numbers" if field == "heading_rad" else "finite numbers of at least 0"
            raise reject(field, f"{wanted}, one or one a sensor", values.tolist())
    wrapped = wrap_angles(headings)
    moved = np.empty_like(poses)
    moved[..., 0] = poses[..., 0] + dt * speeds * np.cos(wrapped)
    moved[..., 1] = poses[..., 1] + dt * speeds * np.sin(wrapped)
    moved[..., 2] = wrapped
    return moved
