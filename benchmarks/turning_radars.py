"""Turning radars against radars that see all at once, on the same flights drawn at random.

    python benchmarks/turning_radars.py                    # 20 scenes of each kind
    python benchmarks/turning_radars.py --first 1000       # others
    python benchmarks/turning_radars.py --write docs/evidence/turning-radars.md

A scene has six aircraft of 120 to 240 m/s, half of which turn for 40 s by 0.5 to 1.5 degrees a second, and one or two
radars; those of two turn at different rates. Noise .002 rad and 40 m, P_D .95, one false plot a turn.
The control has the same aircraft with all plots of a turn at its middle. Tracked as `vedette track
--max-target-speed 250` does. Prints the mean error of the estimates within 2 km of an aircraft, from 60 s on; its ratio
to that of the control, over scenes together and of the worst one; and the median squared error in units of
the belief's covariance, 1.39 for a Gaussian of two dimensions that is right.
"""

from __future__ import annotations

import math
import tempfile
from pathlib import Path

import numpy as np
from pages import table_of_scenes

from vedette.evaluation import track_recording
from vedette.kernels.base.types import Floats
from vedette.models.turns import Turn
from vedette.scenarios.from_recording import scenario_from_recording

PERIODS = 2.5, 4.0, 10.0, 12.0
PLACES = {"R": (0.0, 0.0), "S": (9000.0, -7000.0)}
DURATION = 240.0
STEP = 0.05  # s
STD = 0.002, 40.0  # rad, m


class Flights:
    """Aircraft as radars see them, some of which turn.

    turning: share of those that turn, by 0.5 to 1.5 degrees a second to either side from 80 s on for 40 s.
    """

    def __init__(self, rng: np.random.Generator, num: int, turning: float) -> None:
        self.rng = rng
        self.starts = rng.uniform(-40e3, 40e3, (num, 2))
        way, speed = rng.uniform(-math.pi, math.pi, num), rng.uniform(120.0, 240.0, num)
        rates = np.radians(rng.uniform(0.5, 1.5, num)) * rng.choice([-1.0, 1.0], num)
        rates[rng.uniform(size=num) >= turning] = 0.0
        self.times = np.arange(-20.0, DURATION + 20.0, STEP)
        turned = rates * np.clip(self.times[:, np.newaxis] - 80.0, 0.0, 40.0)
        ahead = np.stack([np.cos(way + turned), np.sin(way + turned)], axis=-1)
        self.ways = np.cumsum(STEP * speed[:, np.newaxis] * ahead, axis=0)
        self.ways += self.starts - self.ways[int(20.0 / STEP)]

    def at(self, time: float) -> Floats:
        """(num, 2) m."""
        share, k = math.modf((time - self.times[0]) / STEP)
        return np.asarray((1.0 - share) * self.ways[int(k)] + share * self.ways[int(k) + 1])

    def rows(self, place: tuple[float, float], turn: Turn, first: float, sweeps: bool) -> list[tuple[float, ...]]:
        """time, bearing and range of each detection; first: rad, where the beam points at 0 s."""
        found = []
        for i in range(len(self.starts)):
            for number in range(-1, int(DURATION / turn.period) + 1):
                time = middle = (number + 0.5) * turn.period
                for _ in range(60 if sweeps else 0):
                    off = self.at(time)[i] - place
                    lag = math.remainder(math.atan2(off[1], off[0]) - first - turn.rate * middle, 2.0 * math.pi)
                    time = middle + lag / turn.rate
                off = self.at(time)[i] - place
                missed = math.remainder(math.atan2(off[1], off[0]) - first - turn.rate * time, 2.0 * math.pi)
                if sweeps and abs(missed) > 1e-3:  # it is where one turn ends and the next begins
                    continue
                if not 0.0 <= time <= DURATION or self.rng.uniform() > 0.95:
                    continue
                bearing = math.atan2(off[1], off[0]) + self.rng.normal(0.0, STD[0])
                found.append((time, bearing, math.hypot(*off) + self.rng.normal(0.0, STD[1])))
        for _ in range(self.rng.poisson(DURATION / turn.period)):
            time = float(self.rng.uniform(0.0, DURATION))
            middle = (math.floor(time / turn.period) + 0.5) * turn.period
            bearing = first + turn.rate * time if sweeps else float(self.rng.uniform(-math.pi, math.pi))
            found.append((time if sweeps else middle, bearing, float(self.rng.uniform(1e3, 50e3))))
        return sorted((time, math.remainder(bearing, 2.0 * math.pi), far) for time, bearing, far in found)


def write(folder: Path, radars: dict[str, list[tuple[float, ...]]], places: dict[str, tuple[float, float]]) -> None:
    """A recording and its sensors file."""
    lines = ["time,sensor,bearing_rad,range_m"]
    lines += [f"{t!r},{name},{b!r},{r!r}" for name, rows in radars.items() for t, b, r in rows]
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "scans.csv").write_text("\n".join(lines), "utf-8")
    sensors = "".join(f"  - {{name: {name}, position: [{x}, {y}]}}\n" for name, (x, y) in places.items())
    (folder / "radars.yaml").write_text(
        "recording: {bearings: east}\nsensor_defaults:\n  measurement: {kind: bearing_range}\n"
        f"  noise: {{kind: constant, std: [{STD[0]}, {STD[1]}]}}\n"
        f"  detection: {{kind: constant, probability: 0.95}}\nsensors:\n{sensors}",
        "utf-8",
    )


def track(folder: Path, flights: Flights) -> tuple[float, float, float]:
    """Of the estimates within 2 km of an aircraft, after 60 s: mean error in m, median squared error, number a scan."""
    found = scenario_from_recording(folder / "radars.yaml", folder / "scans.csv", speed=250.0)
    record = track_recording(found.scenario, found.recording)
    errors, squares, counts = list[float](), list[float](), list[int]()
    for time, estimate in zip(record.times.tolist(), record.estimates, strict=True):
        at = found.recording.start + time
        if not 60.0 <= at <= DURATION - 15.0:
            continue
        off = estimate.means[:, np.newaxis, :2] - flights.at(at)
        nearest = np.hypot(*off.transpose(2, 0, 1)).argmin(axis=1)
        near = off[np.arange(len(off)), nearest]
        own = np.hypot(*near.T) < 2000.0
        errors += np.hypot(*near[own].T).tolist()
        squares += np.einsum("ni,nij,nj->n", near, np.linalg.inv(estimate.covs[:, :2, :2]), near)[own].tolist()
        counts.append(int(own.sum()))
    return float(np.mean(errors)), float(np.median(squares)), float(np.mean(counts))


def compare(folder: Path, seed: int, period: float, num_radars: int) -> Floats:
    """(2, 2) mean error in m and median squared error of turning radars, and of radars that see all at once."""
    found, places = [], dict(list(PLACES.items())[:num_radars])
    for sweeps in (True, False):
        rng = np.random.default_rng([seed, round(10.0 * period), num_radars])
        clockwise, firsts = bool(rng.integers(2)), rng.uniform(-math.pi, math.pi, 2)
        flights = Flights(rng, 6, 0.5)
        turns = Turn(period, clockwise), Turn(1.1 * period, not clockwise)
        radars = {
            name: flights.rows(place, turn, first, sweeps)
            for (name, place), turn, first in zip(places.items(), turns, firsts.tolist(), strict=False)
        }
        write(folder, radars, places)
        found.append(track(folder, flights)[:2])
    return np.array(found)


def table(runs: int, first: int) -> str:
    """As Markdown."""
    columns = "turn, s", "radars", "error, m", "ratio", "worst scene", "squared error"
    lines = [f"| {' | '.join(columns)} |", f"|{' ---: |' * len(columns)}"]
    with tempfile.TemporaryDirectory() as folder:
        for period in PERIODS:
            for num in (1, 2):
                found = np.array([compare(Path(folder), first + run, period, num) for run in range(runs)])
                mine, control = found[:, 0, 0], found[:, 1, 0]
                ratio, worst = mine.mean() / control.mean(), (mine / control).max()
                squared = np.median(found[:, 0, 1])
                lines.append(f"| {period:g} | {num} | {mine.mean():.1f} | {ratio:.2f} | {worst:.2f} | {squared:.2f} |")
    return "\n".join(lines)


if __name__ == "__main__":
    table_of_scenes(__doc__, "turning_radars.py", table)
