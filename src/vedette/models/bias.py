"""Constant bias of a sensor's measurements, clock and position."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from vedette.internal.quantities import QUANTITIES
from vedette.kernels.base.types import Floats
from vedette.models.fields import Real, check_fields, part
from vedette.models.measurement import wrap_angles

LEAST_RANGE = 1.0  # m; smallest range after a bias is subtracted or added


@part(bearing_deg="bearing", elevation_deg="elevation")
@dataclass(frozen=True, slots=True)
class Bias:
    """Constant bias of the scans of a sensor: the reported minus the true value of each quantity.

    Attributes:
        range: bias of ranges [m].
        bearing: bias of bearings, positive in the direction of the scans' angles: clockwise of a sensor with a compass
            and where recorded or live scans have bearings from the north, else counter-clockwise [rad].
        clock: time by which the sensor's clock is ahead [s].
        x, y: bias of the reported position of the sensor, or of the positions that it measures, east and north [m].
        range_rate: bias of range rates [m/s].
        elevation: bias of elevations [rad].
        altitude: bias of altitudes [m].
    """

    range: Real = 0.0
    bearing: Real = 0.0
    clock: Real = 0.0
    x: Real = 0.0
    y: Real = 0.0
    range_rate: Real = 0.0
    elevation: Real = 0.0
    altitude: Real = 0.0

    def __post_init__(self) -> None:
        check_fields(self, "Bias.")

    def __sub__(self, other: "Bias") -> "Bias":
        """Return the difference of two biases, component by component."""
        return Bias(*(getattr(self, each.name) - getattr(other, each.name) for each in fields(self)))


NO_BIAS = Bias()


def with_offsets(measured: Floats, offsets: Floats, components: Sequence[str]) -> Floats:
    """Return (num, meas_dim) measurements plus (meas_dim,) offsets, angles in (-pi, pi], ranges >= `LEAST_RANGE`.

    components: names of the measured quantities in `vedette.internal.quantities.QUANTITIES`.
    """
    shifted = measured + offsets
    for i, name in enumerate(components):
        quantity = QUANTITIES[name]
        least = quantity.least + LEAST_RANGE
        shifted[:, i] = wrap_angles(shifted[:, i]) if quantity.is_angle else np.maximum(shifted[:, i], least)
    return shifted
