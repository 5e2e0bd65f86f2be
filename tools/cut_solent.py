"""Cut the ships of the `solent` scenario out of a public AIS recording.

    python tools/cut_solent.py SolentAIS_20160112_130211.csv src/vedette/scenarios/data/solent.csv

The recording is `docs/demos/SolentAIS_20160112_130211.csv` in the source distribution of Stone Soup 1.9.1 (MIT).
The steps and the numbers below are all there is to it; `src/vedette/scenarios/data/README.md` says them in words.
"""

from __future__ import annotations

import argparse
import csv
import itertools
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vedette.recorded.cleaning import longest_reachable
from vedette.recorded.geography import Origin
from vedette.recorded.tables import seconds

Path2D = NDArray[np.float64]  # (n, 3): time in s, x east and y north in m

ORIGIN_DEG = (-1.1171, 50.7865)  # longitude and latitude of the middle of the box
HALF_BOX = 3000.0  # m
WINDOW = (1800.0, 3600.0)  # s after the first report of the file
MAX_SPEED = 30.0  # m/s; reports that would need more are dropped
MAX_GAP = 90.0  # s; a longer silence ends the track
MIN_SPEED = 1.0  # m/s, taken over SPEED_SPAN; slower is moored, anchored or drifting
SPEED_SPAN = 120.0  # s
MIN_DURATION = 180.0  # s; a shorter run is left out
REPORT_SPACING = 9.0  # s; closer reports are thinned


def read_ships(recording: Path) -> dict[str, Path2D]:
    """Reports of each ship in time order, in seconds from the first one and metres east and north of the origin."""
    with recording.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    times = np.array([seconds(row["Time"]) for row in rows])
    longitudes, latitudes = ([float(row[name]) for row in rows] for name in ("Longitude_degrees", "Latitude_degrees"))
    reports = np.column_stack([times - times.min(), Origin(*ORIGIN_DEG).to_plane(longitudes, latitudes)])
    names = np.array([row["MMSI"] for row in rows])
    order = np.lexsort((times, names))
    ships, starts = np.unique(names[order], return_index=True)
    return dict(zip(ships.tolist(), np.split(reports[order], starts[1:]), strict=True))


def thin(reports: Path2D) -> Path2D:
    """Leave out the reports that the ship could not have made at `MAX_SPEED`, and those too close in time."""
    good = reports[longest_reachable(reports[:, 0], reports[:, 1:], MAX_SPEED)]
    kept = [good[0]]
    for report in good[1:]:
        if report[0] - kept[-1][0] >= REPORT_SPACING:
            kept.append(report)
    return np.array(kept)


def under_way(reports: Path2D) -> NDArray[np.bool_]:
    """(n,) whether the ship made good at least `MIN_SPEED` over the span around each report."""
    times = reports[:, 0]
    early = np.clip(times - SPEED_SPAN / 2, times[0], None)
    late = np.clip(times + SPEED_SPAN / 2, None, times[-1])
    moved = [np.interp(late, times, reports[:, axis]) - np.interp(early, times, reports[:, axis]) for axis in (1, 2)]
    return np.asarray(np.hypot(*moved) >= MIN_SPEED * np.maximum(late - early, REPORT_SPACING))


def runs(reports: Path2D) -> Iterator[Path2D]:
    """Stretches without a long silence in which the ship is under way, inside the box and the window."""
    breaks = np.flatnonzero(np.diff(reports[:, 0]) > MAX_GAP) + 1
    for stretch in np.split(reports, breaks):
        inside = np.all(np.abs(stretch[:, 1:]) <= HALF_BOX, axis=1)
        inside &= (stretch[:, 0] >= WINDOW[0]) & (stretch[:, 0] <= WINDOW[1])
        wanted = inside & under_way(stretch)
        for is_wanted, group in itertools.groupby(range(len(stretch)), key=wanted.__getitem__):
            run = stretch[list(group)]
            if is_wanted and run[-1, 0] - run[0, 0] >= MIN_DURATION:
                yield run


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", type=Path)
    parser.add_argument("out", type=Path)
    arguments = parser.parse_args()
    found = [run for reports in read_ships(arguments.recording).values() for run in runs(thin(reports))]
    found.sort(key=lambda run: (run[0, 0], run[0, 1]))
    rows = [(report[0] - WINDOW[0], number, *report[1:]) for number, run in enumerate(found, 1) for report in run]
    rows.sort()
    with arguments.out.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["time", "id", "x", "y"])
        writer.writerows((f"{time:.1f}", number, f"{x:.1f}", f"{y:.1f}") for time, number, x, y in rows)


if __name__ == "__main__":
    main()
