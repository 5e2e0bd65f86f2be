"""The quantities that sensors measure, and the kinds of measurements: one table for models, recordings and files."""

import math
from collections.abc import Mapping
from typing import NamedTuple

# Units as they end the names of columns, and one of each in SI units; the first is the SI unit.
LENGTHS = {"m": 1.0, "km": 1000.0, "nmi": 1852.0, "nm": 1852.0, "ft": 0.3048}
ANGLES = {"rad": 1.0, "deg": math.pi / 180.0}
HEIGHTS = LENGTHS | {"fl": 30.48}
SPEEDS = {"mps": 1.0, "kmh": 1.0 / 3.6, **dict.fromkeys(("kn", "kt", "kts"), 1852.0 / 3600.0)}


class Quantity(NamedTuple):
    """A quantity that sensors measure."""

    units: Mapping[str, float]  # one of `LENGTHS`, `HEIGHTS`, `ANGLES`, `SPEEDS`
    unit: str  # unit in scenario files and messages
    per_si: float  # number of these units in one SI unit
    least: float  # smallest value without noise and bias, SI
    most: float  # largest size in a recording, SI, or inf if it is limited like positions
    far: float  # standard deviation of measurements with an unknown bias, SI
    # standard deviations of a bias, in `unit`, before any recording (of lengths, at least `USUAL_SHARE` of the range),
    # and above which it counts as not found
    usual_bias: float
    unknown: float

    @property
    def is_angle(self) -> bool:
        """True for an angle, whose residuals are wrapped."""
        return self.units is ANGLES

    @property
    def in_si(self) -> float:
        """Number of SI units in one `unit`."""
        return self.units.get(self.unit, 1.0)

    @property
    def si(self) -> str:
        """SI unit in messages."""
        return "rad" if self.is_angle else self.unit


USUAL_SHARE = 0.01  # of the range, prior standard deviation of a bias of lengths
_LENGTH = Quantity(LENGTHS, "m", 1.0, -math.inf, math.inf, 300.0, 5.0, 1000.0)
QUANTITIES = {
    "bearing": Quantity(ANGLES, "deg", 180.0 / math.pi, -math.inf, 2.0 * math.pi, math.radians(3.0), 1.0, 10.0),
    "range": _LENGTH._replace(least=0.0),
    "range_rate": Quantity(SPEEDS, "m/s", 1.0, -math.inf, 1e5, 10.0, 1.0, 100.0),
    "x": _LENGTH,
    "y": _LENGTH,
    "elevation": Quantity(ANGLES, "deg", 180.0 / math.pi, -math.inf, math.pi / 2.0, math.radians(3.0), 1.0, 10.0),
    "altitude": Quantity(HEIGHTS, "m", 1.0, -math.inf, 1e5, 300.0, 5.0, 1000.0),
}
# Those that only a measurement can be biased in; a bias of x, y is also of the place of the sensor.
ONLY_MEASURED = ("bearing", "range", "range_rate", "elevation", "altitude")
# The components of each kind of measurement.
COMPONENTS = {
    "bearing_range": ("bearing", "range"),
    "bearing_range_rate": ("bearing", "range", "range_rate"),
    "bearing_only": ("bearing",),
    "range_only": ("range",),
    "position": ("x", "y"),
    "bearing_slant_range": ("bearing", "range"),
    "bearing_range_elevation": ("bearing", "range", "elevation"),
    "bearing_range_altitude": ("bearing", "range", "altitude"),
    "position_altitude": ("x", "y", "altitude"),
}
# The kinds that depend on the height of a target; their ranges are slant ranges.
HEIGHT_DEPENDENT = ("bearing_slant_range", "bearing_range_elevation", "bearing_range_altitude", "position_altitude")
# The kinds that say where a target is.
PLACED = tuple(kind for kind, names in COMPONENTS.items() if names[:2] in (("bearing", "range"), ("x", "y")))


def is_position(kind: str) -> bool:
    """Return True if measurements of a kind are positions, in metres or degrees."""
    return COMPONENTS.get(kind, ())[:2] == ("x", "y")


def is_doppler(kind: str) -> bool:
    """Return True if measurements of a kind have a range rate, relative to the velocity of the sensor."""
    return "range_rate" in COMPONENTS.get(kind, ())


def in_file(name: str) -> str:
    """Return the name of a quantity in a scenario file: `bearing_deg`, `range`."""
    return f"{name}_deg" if QUANTITIES[name].is_angle else name


def si_column(name: str) -> str:
    """Return the name of a quantity's column in SI units: `bearing_rad`, `range_m`."""
    return f"{name}_{next(iter(QUANTITIES[name].units))}"


def angles(names: tuple[str, ...]) -> tuple[int, ...]:
    """Return which components are angles."""
    return tuple(i for i, name in enumerate(names) if QUANTITIES[name].is_angle)
