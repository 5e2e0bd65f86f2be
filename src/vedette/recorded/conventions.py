"""Units, directions and column names in the rows of a recording."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from vedette.internal.quantities import ANGLES, HEIGHTS, LENGTHS, QUANTITIES, SPEEDS
from vedette.models.arguments import reject
from vedette.models.heights import ASSUMED_HEIGHT
from vedette.recorded.scan_times import Bearings
from vedette.recorded.tables import TIMES

# Quantities of a row, and the units that may follow at the end of a column's name.
UNITS: dict[str, Mapping[str, float]] = {
    "time": TIMES,
    **{name: each.units for name, each in QUANTITIES.items()},
    "lon": {"deg": 1.0},
    "lat": {"deg": 1.0},
    "own_x": LENGTHS,
    "own_y": LENGTHS,
    "own_lon": {"deg": 1.0},
    "own_lat": {"deg": 1.0},
    "own_heading": ANGLES,
    "own_vx": SPEEDS,
    "own_vy": SPEEDS,
    "own_height": HEIGHTS,
    **{f"{name}_std": each.units for name, each in QUANTITIES.items()},
    "own_x_std": LENGTHS,
    "own_y_std": LENGTHS,
    "own_heading_std": ANGLES,
    "own_height_std": HEIGHTS,
    "own_vx_std": SPEEDS,
    "own_vy_std": SPEEDS,
    "xy_correlation": {"": 1.0},
    "snr": {"db": 1.0},
    "class": {"": 1.0},
    "size": LENGTHS,
}
# Endings of columns that are units, but none of the quantity: taken for SI units they would be wrong without a word.
_UNREAD = ("mi", "mile", "miles", "yd", "cm", "mm", "feet", "knots", "mph", "kph", "fps", "mil", "gon")
OTHER_UNITS = frozenset((*HEIGHTS, *SPEEDS, *ANGLES, *_UNREAD))
OWN_SPEEDS = ("own_vx", "own_vy")  # velocity of a sensor, east and north, read if it measures range rates
# Third components of measurements, which single rows need not have, and what stands in for them until births.
GAPS = {"altitude": ASSUMED_HEIGHT, "elevation": 0.0, "range_rate": 0.0}
OTHER_NAMES = {
    "lon": ("longitude",),
    "lat": ("latitude",),
    "longitude": ("lon", "LON"),  # names in reports
    "latitude": ("lat", "LAT"),
    "id": ("mmsi", "MMSI", "icao24", "track_id"),
    "time": ("time_s", "time_ms", "time_us", "time_ns", "time_utc", "BaseDateTime"),
    "range": ("distance",),
    "altitude": ("height", "flight_level"),
    "size": ("length",),
}
# Largest distance between places in metres and in degrees in one row: m, plus a share of the distance from the origin.
ONE_PLACE, ONE_PLACE_SHARE = 50.0, 0.001
MOST = {
    **dict.fromkeys(("lon", "own_lon"), 360.0),
    **dict.fromkeys(("lat", "own_lat"), 90.0),
    "own_heading": 2.0 * math.pi,
    "own_height": QUANTITIES["altitude"].most,
    **dict.fromkeys(OWN_SPEEDS, QUANTITIES["range_rate"].most),
    **{name: each.most for name, each in QUANTITIES.items() if each.most < math.inf},
    **{f"{name}_std": math.pi for name, each in QUANTITIES.items() if each.is_angle},
    "own_heading_std": math.pi,
    "xy_correlation": 1.0,
    "snr": 200.0,
}
OVER_A_TURN = math.radians(10.0)  # largest excess of an angle from bias or noise


@dataclass(frozen=True, slots=True)
class Conventions:
    """Conventions for reading the rows.

    Attributes:
        columns: name in the table of a quantity, if it differs: {"time": "Time", "sensor": "radar", ...}.
        units: unit of a quantity ("m", "km", "nmi"; "deg", "rad"; "s", "ms"), if its column's name does not end with
            it, as `range_km` and `bearing_deg` do. The defaults are m and s. Angles have none.
        bearings: zero and sense of bearings and headings: "north", clockwise, like a compass, or "east",
            counter-clockwise, like the library.
        scan_window: s. Rows of a sensor within this time after its first make one scan, at the mean of their times.
        empty_scans: "found": between the rows of a sensor with a regular period, a scan without rows found nothing.
            "none": the sensor did not scan.
        bad_rows: "refuse": an unreadable row is an error. "skip": it is left out and counted.

    Raises:
        InputError: an unknown quantity, unit or word, or a time below 0.
    """

    columns: Mapping[str, str]
    units: Mapping[str, str]
    bearings: Bearings | None = None
    scan_window: float = 0.0
    bad_rows: Literal["refuse", "skip"] = "refuse"
    empty_scans: Literal["found", "none"] = "found"

    def __post_init__(self) -> None:
        known = tuple(dict.fromkeys(("time", "sensor", *UNITS)))
        for where, given in (("columns", self.columns), ("units", self.units)):
            if not isinstance(given, Mapping):
                raise reject(where, "a mapping of quantities, such as {range: nmi}", given)
            for name in given:
                if name not in known:
                    raise reject(where, f"quantities among {', '.join(known)}", name)
        for name, unit in self.units.items():
            if unit not in UNITS.get(name, {}):
                raise reject(f"units.{name}", f"one of {', '.join(UNITS.get(name, ())) or 'none'}", unit)
        words = {"bearings": ("east", "north", None), "bad_rows": ("refuse", "skip"), "empty_scans": ("found", "none")}
        for name, allowed in words.items():
            if getattr(self, name) not in allowed:
                raise reject(name, f"{allowed[0]} or {allowed[1]}", getattr(self, name))
        if not 0.0 <= self.scan_window < math.inf:
            raise reject("scan_window", "seconds, at least 0", self.scan_window)
