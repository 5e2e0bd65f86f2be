"""Fields of view with an edge, for drawings and for checks, which compile nothing."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from vedette.kernels.base.types import HALF_WIDTH, HEADING, POINTING
from vedette.scenarios.sections.sensors import Sensor

_MIN_DETECTION = 0.01  # share of the probability of a soft sector below which detection is neglected


class FieldOfView(NamedTuple):
    """A sector of a disc around a sensor: middle and half width in rad, reach in m, probability within it."""

    middle: float
    half_width: float
    reach: float
    probability: float


def field_of_view(sensor: Sensor, pose: Sequence[float] | None = None) -> FieldOfView | None:
    """Return the field of view of a sensor at a pose, or at its start; None without an edge, or for a custom model.

    The edge of a soft sector is where its probability has dropped to a half.
    """
    section, at = sensor.detection, sensor.pose if pose is None else pose
    if section.kind == "limited_range":
        return FieldOfView(at[HEADING], math.pi, section.max_range, section.probability)
    if section.kind in ("limited_sector", "soft_sector"):
        return FieldOfView(at[HEADING], math.radians(section.half_width_deg), section.max_range, section.probability)
    if section.kind == "camera" and len(at) >= 5:
        reference, width = section.reference_half_width_deg, at[HALF_WIDTH]
        reach = section.max_range * (math.radians(reference) / width if reference is not None and width > 0.0 else 1.0)
        return FieldOfView(at[POINTING], width, reach, section.probability)
    return None


def max_range(sensor: Sensor) -> float:
    """Return the range beyond which a sensor measures nothing at any pose, m; inf if its detection has no such edge."""
    view, detection = field_of_view(sensor), sensor.detection
    if view is None or detection.kind == "camera" or getattr(detection, "outside", 0.0) > 0.0:  # a camera zooms
        return math.inf
    faded = math.log(1.0 / _MIN_DETECTION - 1.0) / detection.range_slope if detection.kind == "soft_sector" else 0.0
    return view.reach + faded
