"""The surveillance region."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from vedette.internal.unit_warnings import look_like_degrees, warn_implausible
from vedette.kernels.base.types import Bools, Floats
from vedette.models.arguments import as_array, generator, reject
from vedette.models.fields import Real, check_fields


def warn_if_corners_in_degrees(field: str, corners: Floats) -> None:
    """Warn of an area whose corners look like longitudes and latitudes."""
    if look_like_degrees(corners):
        width, height = np.ptp(corners, axis=0)
        got = f"an area of {width:.3g} by {height:.3g} m at {tuple(corners[0].tolist())}"
        warn_implausible(field, "metres from the origin", got, "are these longitudes and latitudes")


@dataclass(frozen=True, slots=True)
class Region:
    """Rectangle [x_min, x_max] x [y_min, y_max] with a positive area.

    Attributes:
        x_min: western edge [m].
        x_max: eastern edge [m].
        y_min: southern edge [m].
        y_max: northern edge [m].
    """

    x_min: Real
    x_max: Real
    y_min: Real
    y_max: Real

    def __post_init__(self) -> None:
        check_fields(self, "Region.")
        for low, high in (("x_min", "x_max"), ("y_min", "y_max")):
            if getattr(self, high) <= getattr(self, low):
                raise reject(f"Region.{high}", f"a number above {low} = {getattr(self, low)}", getattr(self, high))
        warn_if_corners_in_degrees("Region", self.corners)

    @property
    def area(self) -> float:
        """Area in m^2."""
        return (self.x_max - self.x_min) * (self.y_max - self.y_min)

    @property
    def corners(self) -> Floats:
        """Corners, (4, 2), counter-clockwise from the south-west."""
        x, y = (self.x_min, self.x_max, self.x_max, self.x_min), (self.y_min, self.y_min, self.y_max, self.y_max)
        return np.column_stack([x, y])

    @property
    def bounds(self) -> Floats:
        """Bounds x_min, x_max, y_min, y_max, (4,)."""
        return np.array([self.x_min, self.x_max, self.y_min, self.y_max])

    def contains(self, positions: ArrayLike) -> Bools:
        """Return True for each of (n, 2) positions that lies inside or on the edge, (n,)."""
        x, y = np.moveaxis(as_array("positions", positions, "fiu", "numbers"), -1, 0)
        return np.asarray((x >= self.x_min) & (x <= self.x_max) & (y >= self.y_min) & (y <= self.y_max))

    def sample(self, num: int, *, rng: np.random.Generator) -> Floats:
        """Return positions drawn uniformly, (num, 2)."""
        return generator(rng).uniform([self.x_min, self.y_min], [self.x_max, self.y_max], size=(num, 2))
