"""Longitude and latitude, and metres in the plane that touches the Earth at an origin (WGS 84)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from vedette.errors import InputError
from vedette.kernels.base.types import Floats
from vedette.models.arguments import float_array, real, reject

PLANE_REACH = 1e6  # m along each axis; sensors and zones beyond are in no plane with the origin, but were mistyped
_LONGEST, _HIGHEST = 360.0, 90.0  # deg
_NEAR_ENOUGH = 1e-7  # m above the ellipsoid, of a point that is to lie on it; it is known to some 1e-8
_MOST_STEPS = 60


@dataclass(frozen=True, slots=True)
class Origin:
    """Where on the Earth (0, 0) is: x goes to the east, y to the north in the plane that touches it there.

    Distances from the origin come out short by about d^3 / (6 R^2): 4 mm at 10 km, 4 m at 100 km.

    Attributes:
        longitude_deg: degrees to the east.
        latitude_deg: degrees to the north.

    Raises:
        InputError: no longitude or latitude in degrees.
    """

    longitude_deg: float
    latitude_deg: float

    def __post_init__(self) -> None:
        for name, most in (("longitude_deg", _LONGEST), ("latitude_deg", _HIGHEST)):
            value = real(f"origin.{name}", getattr(self, name))
            if abs(value) > most:
                raise reject(f"origin.{name}", f"degrees from {-most:g} to {most:g}", value)

    def to_plane(self, longitude_deg: ArrayLike, latitude_deg: ArrayLike) -> Floats:
        """(n, 2) metres east and north of the origin: points of the ellipsoid, projected on its tangent plane.

        Args:
            longitude_deg, latitude_deg: (n,) degrees east and north.

        Raises:
            InputError: a point on the other side of the globe, which would fall on the place of one on this side.
        """
        from pymap3d import geodetic2enu  # here, as most programs need none

        longitudes = float_array("longitude_deg", longitude_deg, (None,))
        latitudes = float_array("latitude_deg", latitude_deg, (len(longitudes),))
        east, north, _ = geodetic2enu(latitudes, longitudes, 0.0, self.latitude_deg, self.longitude_deg, 0.0)
        ups = _cosines(longitudes, latitudes) @ _cosines(self.longitude_deg, self.latitude_deg)
        if (ups <= 0.0).any():
            index = int(np.argmin(ups))
            place = f"({longitudes[index]:g}, {latitudes[index]:g})"
            raise InputError(
                f"longitude, latitude: expected points on the origin's side of the globe; got {place} degrees"
            )
        return np.stack([east, north], axis=-1)

    def nearby(self, longitude_deg: float, latitude_deg: float) -> tuple[float, float] | None:
        """As `to_plane`, of a place in degrees; None of one that is beyond `PLANE_REACH`."""
        try:
            x, y = self.to_plane([longitude_deg], [latitude_deg])[0].tolist()
        except InputError:  # on the other side of the globe
            return None
        return (x, y) if max(abs(x), abs(y)) <= PLANE_REACH else None

    def to_degrees(self, positions: ArrayLike) -> Floats:
        """(n, 2) longitudes and latitudes in degrees of points of the plane, (n, 2) m east and north of the origin.

        The inverse of `to_plane`: of each point the one of the ellipsoid below it.

        Raises:
            InputError: a point of the plane that no point of this side of the globe lies below.
        """
        from pymap3d import enu2geodetic

        plane = float_array("positions", positions, (None, 2))
        up = np.zeros(len(plane))
        for _ in range(_MOST_STEPS):
            latitude, longitude, above = enu2geodetic(*plane.T, up, self.latitude_deg, self.longitude_deg, 0.0)
            if (np.abs(above) <= _NEAR_ENOUGH).all():
                return np.stack([longitude, latitude], axis=-1)
            # The height above the ellipsoid grows with that above the plane by the cosine of the angle between them.
            slopes = _cosines(longitude, latitude) @ _cosines(self.longitude_deg, self.latitude_deg)
            up = up - above / np.maximum(slopes, 0.1)
        index = int(np.argmax(np.abs(above)))
        raise reject("positions", "points above the origin's side of the globe", plane[index].tolist())


def _cosines(longitude_deg: ArrayLike, latitude_deg: ArrayLike) -> Floats:
    """(..., 3) direction cosines of what is up at a place."""
    longitude, latitude = np.radians(longitude_deg), np.radians(latitude_deg)
    return np.stack(
        [np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)], axis=-1
    )
