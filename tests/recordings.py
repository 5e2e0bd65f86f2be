"""A recording that any test may track: two radars of their own periods, ships on straight courses, in foreign units."""

from __future__ import annotations

import csv
import datetime
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vedette.recorded import Origin

ORIGIN = Origin(-1.1171, 50.7865)
START = datetime.datetime(2016, 1, 12, 13, 2, 21, tzinfo=datetime.UTC)
SHIPS = np.array([[-2000.0, -1000.0, 4.0, 3.0], [1500.0, 500.0, -5.0, 1.0], [0.0, 2500.0, 0.5, -6.0]])
RADARS = {"Calshot": ((-3000.0, -3000.0), 5.0), "boat": ((3500.0, -2500.0), 8.0)}
SENSORS = """origin: {lon: -1.1171, lat: 50.7865}
recording: {columns: {sensor: radar, bearing: brg_deg}, bearings: north}
sensor_defaults:
  measurement: {kind: bearing_range}
  noise: {kind: range_dependent, sigma_range: 20.0, eta_range: 0.0, sigma_bearing_deg: 0.7, eta_bearing: 0.0}
  detection: {kind: constant, probability: 0.95}
sensors:
  - {name: Calshot, position: {lon: -1.1597, lat: 50.7595}}
  - {name: boat, position: [0.0, 0.0]}
"""


def write_recording(
    folder: Path,
    *,
    seconds: float = 120.0,
    seed: int = 0,
    biases: Mapping[str, tuple[float, float, float]] | None = None,
    drift: float = 0.0,
) -> None:
    """scans.csv, truth.csv and radars.yaml: ISO times, nautical miles, compass bearings, the boat's own places.

    biases: of a radar in range, m, bearing, deg clockwise, and clock, s. drift: of the boat's ranges, m/s.
    """
    rng, rows = np.random.default_rng(seed), list[list[Any]]()
    for name, (place, period) in RADARS.items():
        far, turned, ahead = (biases or {}).get(name, (0.0, 0.0, 0.0))
        for time in np.arange(rng.uniform(0.0, period), seconds, period).tolist():
            own = np.array(place) + (np.array([-4.0, 2.0]) * time if name == "boat" else 0.0)
            seen = SHIPS[rng.random(len(SHIPS)) < 0.95]
            offsets = seen[:, :2] + seen[:, 2:] * time - own
            far_now = far + (drift * time if name == "boat" else 0.0)
            ranges = np.hypot(*offsets.T) + rng.normal(0.0, 20.0, len(seen))
            bearings = np.arctan2(*offsets.T) + rng.normal(0.0, math.radians(0.7), len(seen))
            clutter = rng.uniform(-6000.0, 6000.0, (rng.poisson(2.0), 2)) - own
            ranges = np.concatenate([ranges, np.hypot(*clutter.T)])
            bearings = np.concatenate([bearings, np.arctan2(*clutter.T)])
            bearings = ORIGIN.azimuth(0.5 * math.pi - bearings, own)  # from true north at the radar
            lon, lat = ORIGIN.to_degrees([own])[0].tolist()
            told = (lon, lat)
            found = [
                [f"{max(r + far_now, 0.0) / 1852.0:.6f}", f"{(math.degrees(b) + turned) % 360.0:.4f}"]
                for r, b in zip(ranges, bearings, strict=True)
            ]
            rows += [[_iso(time + ahead), name, *one, *told] for one in found or [["", ""]]]
    rows.sort(key=lambda row: row[0])
    _write(folder / "scans.csv", ["time", "radar", "range_nmi", "brg_deg", "own_lon", "own_lat"], rows)
    rows = []
    for ship, state in enumerate(SHIPS):
        for time in np.arange(0.0, seconds + 10.0, 10.0).tolist():
            rows.append([_iso(time), f"ship {ship}", *ORIGIN.to_degrees([state[:2] + state[2:] * time])[0].tolist()])
    _write(folder / "truth.csv", ["time", "id", "longitude", "latitude"], rows)
    (folder / "radars.yaml").write_text(SENSORS, "utf-8")


def silence(path: Path, first: float, last: float) -> None:
    """Between two times, in s from the start, every scan of a file has found nothing."""
    head, *rows = path.read_text("utf-8").splitlines()
    cells = [row.split(",") for row in rows]
    cells = [[*row[:2], "", "", *row[4:]] if _iso(first) <= row[0] < _iso(last) else row for row in cells]
    path.write_text("\n".join([head, *dict.fromkeys(map(",".join, cells))]) + "\n", "utf-8")


def _iso(time: float) -> str:
    return (START + datetime.timedelta(seconds=time)).isoformat(timespec="milliseconds")


def _write(path: Path, header: list[str], rows: list[list[Any]]) -> None:
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([header, *rows])
