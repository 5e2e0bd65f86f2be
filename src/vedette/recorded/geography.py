"""Longitude and latitude, and metres in the plane that touches the Earth at an origin (WGS 84)."""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from vedette.errors import InputError
from vedette.kernels.base.types import Bools, Floats
from vedette.models.arguments import float_array, real, reject
from vedette.platforms.compass import wrapped

PLANE_REACH = 1e6  # m along each axis; sensors and zones beyond are probably mistyped
_LONGEST, _HIGHEST = 360.0, 90.0  # deg
_NEAR_ENOUGH = 1e-7  # m, largest height of a point on the ellipsoid; heights are accurate to about 1e-8 m
_MOST_STEPS = 60
_RADIUS, _SQUASH = 6378137.0, (2.0 - 1.0 / 298.257223563) / 298.257223563  # m, and the square of the eccentricity


@dataclass(frozen=True, slots=True)
class Origin:
    """The place (0, 0) on the Earth: x is to the east, y to the north in the tangent plane there.

    The projection is orthographic: a point of the ellipsoid is moved along the vertical of the origin. Distances from
    the origin are too short by about d^3 / (6 R^2): 4 mm at 10 km, 4 m at 100 km. Away from the origin true north is
    not along y: the meridians converge, by the difference of longitude times the sine of the latitude. It is a
    `vedette.platforms.Compass`, which converts azimuths at any place to angles of the plane and back. The remaining
    error of an azimuth between two points is at most about .005 degrees at 100 km from the origin.

    Attributes:
        longitude_deg: degrees to the east.
        latitude_deg: degrees to the north.

    Raises:
        InputError: no longitude or latitude in degrees.
    """

    longitude_deg: float
    latitude_deg: float

    def __post_init__(self) -> None:
        for name, limit in (("longitude_deg", _LONGEST), ("latitude_deg", _HIGHEST)):
            value = real(f"origin.{name}", getattr(self, name))
            if abs(value) > limit:
                raise reject(f"origin.{name}", f"degrees from {-limit:g} to {limit:g}", value)

    def to_plane(self, longitude_deg: ArrayLike, latitude_deg: ArrayLike) -> Floats:
        """Return metres east and north of the origin, (n, 2): points of the ellipsoid, projected on its tangent plane.

        Args:
            longitude_deg, latitude_deg: (n,) degrees east and north.

        Raises:
            InputError: a point on the other side of the globe, which would coincide with one on this side.
        """
        from pymap3d import geodetic2enu  # imported here, as most programs do not need it

        longitudes = float_array("longitude_deg", longitude_deg, (None,))
        latitudes = float_array("latitude_deg", latitude_deg, (len(longitudes),))
        east, north, _ = geodetic2enu(latitudes, longitudes, 0.0, self.latitude_deg, self.longitude_deg, 0.0)
        beyond = self.beyond(longitudes, latitudes)
        if beyond.any():
            index = int(np.argmax(beyond))
            place = f"({longitudes[index]:g}, {latitudes[index]:g})"
            raise InputError(
                f"longitude, latitude: expected points on the origin's side of the globe; got {place} degrees"
            )
        return np.stack([east, north], axis=-1)

    def beyond(self, longitude_deg: Floats, latitude_deg: Floats) -> Bools:
        """Return True for each point on the other side of the globe, (n,)."""
        ups = _cosines(longitude_deg, latitude_deg) @ _cosines(self.longitude_deg, self.latitude_deg)
        return np.asarray(ups <= 0.0)

    def nearby(self, longitude_deg: float, latitude_deg: float) -> tuple[float, float] | None:
        """Return the place in the plane, m, of a place in degrees, or None if it is beyond `PLANE_REACH`."""
        try:
            x, y = self.to_plane([longitude_deg], [latitude_deg])[0].tolist()
        except InputError:  # on the other side of the globe
            return None
        return (x, y) if max(abs(x), abs(y)) <= PLANE_REACH else None

    def to_degrees(self, positions: ArrayLike) -> Floats:
        """Return longitudes and latitudes in degrees, (n, 2), of points of the plane, (n, 2) m.

        The inverse of `to_plane`: for each point, the point of the ellipsoid below it.

        Raises:
            InputError: a point of the plane with no point of this side of the globe below it.
        """
        from pymap3d import enu2geodetic

        plane = float_array("positions", positions, (None, 2))
        up = np.zeros(len(plane))
        for _ in range(_MOST_STEPS):
            latitude, longitude, above = enu2geodetic(*plane.T, up, self.latitude_deg, self.longitude_deg, 0.0)
            if (np.abs(above) <= _NEAR_ENOUGH).all():
                return np.stack([longitude, latitude], axis=-1)
            # Height above the ellipsoid grows with height above the plane by the cosine of the angle between them.
            slopes = _cosines(longitude, latitude) @ _cosines(self.longitude_deg, self.latitude_deg)
            up = up - above / np.maximum(slopes, 0.1)
        index = int(np.argmax(np.abs(above)))
        raise reject("positions", "points above the origin's side of the globe", plane[index].tolist())

    def angle(self, azimuth: ArrayLike, place: ArrayLike) -> Floats:
        """Return angles of the plane, rad in [-pi, pi], of azimuths, clockwise from true north at `place`, (2,) m."""
        given = np.asarray(azimuth, np.float64)
        (east_x, north_x), (east_y, north_y) = self._axes_at(place)
        sines, cosines = np.sin(given), np.cos(given)
        return wrapped(np.arctan2(east_y * sines + north_y * cosines, east_x * sines + north_x * cosines))

    def azimuth(self, angle: ArrayLike, place: ArrayLike) -> Floats:
        """Return azimuths, rad in [-pi, pi] clockwise from true north at `place`, (2,) m, of angles of the plane."""
        given = np.asarray(angle, np.float64)
        (east_x, north_x), (east_y, north_y) = self._axes_at(place)
        sines, cosines = np.sin(given), np.cos(given)
        return wrapped(np.arctan2(north_y * cosines - north_x * sines, east_x * sines - east_y * cosines))

    def axes(self, longitude_deg: ArrayLike, latitude_deg: ArrayLike) -> Floats:
        """Return true east (first column) and true north at places in degrees, (n,), in the plane, (n, 2, 2)."""
        longitude, latitude = np.radians(longitude_deg), np.radians(latitude_deg)
        origin = math.radians(self.latitude_deg)
        off = longitude - math.radians(self.longitude_deg)
        sines, cosines = np.sin(latitude), np.cos(latitude)
        axes = [
            [np.cos(off), -sines * np.sin(off)],
            [math.sin(origin) * np.sin(off), math.sin(origin) * sines * np.cos(off) + math.cos(origin) * cosines],
        ]
        return np.asarray(np.moveaxis(np.array(axes), -1, 0))

    def _axes_at(self, place: ArrayLike) -> tuple[tuple[float, float], tuple[float, float]]:
        x, y = np.asarray(place, np.float64)[:2].tolist()
        return _axes_at(self, x, y)


@lru_cache(maxsize=4096)
def _axes_at(origin: Origin, x: float, y: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return `Origin.axes` at one place of the plane, in closed form, as planners need very many places.

    The point of the ellipsoid is the intersection with the vertical of the origin through the place, at the smaller
    root of a quadratic equation.
    """
    sine, cosine = math.sin(math.radians(origin.latitude_deg)), math.cos(math.radians(origin.latitude_deg))
    across = _RADIUS / math.sqrt(1.0 - _SQUASH * sine**2)
    out, up = across * cosine - y * sine, across * (1.0 - _SQUASH) * sine + y * cosine
    polar = _RADIUS**2 * (1.0 - _SQUASH)
    square = cosine**2 / _RADIUS**2 + sine**2 / polar
    linear, constant = out * cosine / _RADIUS**2 + up * sine / polar, (out**2 + x**2) / _RADIUS**2 + up**2 / polar - 1.0
    rest = linear**2 - square * constant
    if rest <= 0.0:
        raise reject("positions", "points above the origin's side of the globe", [x, y])
    rise = -constant / (linear + math.sqrt(rest))
    out, up = out + rise * cosine, up + rise * sine
    off, latitude = math.atan2(x, out), math.atan2(up, (1.0 - _SQUASH) * math.hypot(out, x))
    north = sine * math.sin(latitude) * math.cos(off) + cosine * math.cos(latitude)
    return (math.cos(off), -math.sin(latitude) * math.sin(off)), (sine * math.sin(off), north)


def _cosines(longitude_deg: ArrayLike, latitude_deg: ArrayLike) -> Floats:
    """Return direction cosines of the vertical at a place, (..., 3)."""
    longitude, latitude = np.radians(longitude_deg), np.radians(latitude_deg)
    return np.stack(
        [np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)], axis=-1
    )
