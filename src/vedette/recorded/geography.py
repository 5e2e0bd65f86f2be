"""Longitude and latitude to metres in the plane that touches the Earth at an origin."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from vedette.errors import InputError
from vedette.kernels.base.types import Floats
from vedette.models.arguments import float_array, reject

# WGS 84: semi-major axis in metres and flattening.
SEMI_MAJOR_AXIS = 6378137.0
FLATTENING = 1.0 / 298.257223563
_ECCENTRICITY_SQUARED = FLATTENING * (2.0 - FLATTENING)


def _earth_centred(longitude_rad: Floats, latitude_rad: Floats) -> Floats:
    """(..., 3) Earth-centred coordinates in metres of points on the ellipsoid."""
    normal = SEMI_MAJOR_AXIS / np.sqrt(1.0 - _ECCENTRICITY_SQUARED * np.sin(latitude_rad) ** 2)
    x = normal * np.cos(latitude_rad) * np.cos(longitude_rad)
    y = normal * np.cos(latitude_rad) * np.sin(longitude_rad)
    z = normal * (1.0 - _ECCENTRICITY_SQUARED) * np.sin(latitude_rad)
    return np.stack([x, y, z], axis=-1)


def to_tangent_plane(longitude_deg: ArrayLike, latitude_deg: ArrayLike, origin_deg: tuple[float, float]) -> Floats:
    """(n, 2) metres east and north of the origin: points of the WGS 84 ellipsoid projected on its tangent plane.

    Distances from the origin come out short by about d^3 / (6 R^2): 4 mm at 10 km, 4 m at 100 km.

    Args:
        longitude_deg, latitude_deg: (n,) degrees east and north.
        origin_deg: longitude and latitude of (0, 0).

    Raises:
        InputError: a point on the other side of the globe, which would fall on the place of one on this side.
    """
    longitudes = np.radians(float_array("longitude_deg", longitude_deg, (None,)))
    latitudes = np.radians(float_array("latitude_deg", latitude_deg, (len(longitudes),)))
    origin = float_array("origin_deg", origin_deg, (2,))
    if abs(origin[0]) > 360.0 or abs(origin[1]) > 90.0:
        raise reject("origin_deg", "longitude and latitude in degrees", origin.tolist())
    longitude, latitude = np.radians(origin)
    east = np.array([-np.sin(longitude), np.cos(longitude), 0.0])
    up = np.array([np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)])
    points = _earth_centred(longitudes, latitudes)
    if (points @ up <= 0.0).any():
        index = int(np.argmin(points @ up))
        place = f"({np.degrees(longitudes[index]):g}, {np.degrees(latitudes[index]):g})"
        raise InputError(f"longitude, latitude: expected points on the origin's side of the globe; got {place} degrees")
    offsets = points - _earth_centred(longitude, latitude)
    return np.stack([offsets @ east, offsets @ np.cross(up, east)], axis=-1)
