"""Aircraft with heights from slant ranges, elevations and altitudes, on scenes drawn at random.

    python benchmarks/heights.py                    # 20 scenes of each kind
    python benchmarks/heights.py --first 1000       # others
    python benchmarks/heights.py --write docs/evidence/heights.md

A scene has five aircraft of 120 to 240 m/s at 3 to 9 km, half of them climbing or sinking, and two radars 20 km apart
that scan every 4 s for 200 s. Noise .002 rad in bearing, 40 m in range, .005 rad in elevation, 30 m in altitude; P_D
.95, two false plots a scan. Tracked as `vedette track --max-target-speed 250` does. The last kind tracks the same slant
ranges as ranges in the plane, as a tracker without heights does. Prints the mean errors of the estimates within 2 km of
an aircraft, from 60 s on, the share of the aircraft that have such an estimate, and the median squared error of
position and height in units of the belief's covariance: 2.37 for a Gaussian of three dimensions that is right, 1.39 for
one of two.
"""

from __future__ import annotations

import math
import tempfile
from pathlib import Path

import numpy as np
from pages import table_of_scenes

from vedette.evaluation import track_recording
from vedette.kernels.base.types import Floats
from vedette.scenarios.from_recording import scenario_from_recording

RADARS = {"R": (-10e3, 0.0, 30.0), "S": (10e3, 0.0, 200.0)}
PERIOD, DURATION = 4.0, 200.0
STDS = {"bearing": 0.002, "range": 40.0, "elevation": 0.005, "altitude": 30.0}
COLUMNS = {"bearing": "bearing_rad", "range": "range_m", "elevation": "elevation_rad", "altitude": "altitude_m"}
KINDS = {
    "bearing_slant_range": ("bearing", "range"),
    "bearing_range_elevation": ("bearing", "range", "elevation"),
    "bearing_range_altitude": ("bearing", "range", "altitude"),
    "bearing_range": ("bearing", "range"),
}


class Aircraft:
    """Aircraft that fly straight on, level or climbing: (num, 3) positions and velocities."""

    def __init__(self, rng: np.random.Generator, num: int = 5) -> None:
        self.rng = rng
        way, speed = rng.uniform(-math.pi, math.pi, num), rng.uniform(120.0, 240.0, num)
        climb = np.where(rng.uniform(size=num) < 0.5, 0.0, rng.uniform(-10.0, 10.0, num))
        self.starts = np.column_stack([rng.uniform(-30e3, 30e3, (num, 2)), rng.uniform(3e3, 9e3, num)])
        self.velocities = np.column_stack([speed * np.cos(way), speed * np.sin(way), climb])

    def at(self, time: float) -> Floats:
        """(num, 3) m."""
        return np.asarray(self.starts + time * self.velocities)

    def scan(self, time: float, radar: tuple[float, float, float], kind: str) -> Floats:
        """(num, meas_dim) measurements of a radar, with noise, misses and false plots."""
        seen = self.at(time)[self.rng.uniform(size=len(self.starts)) < 0.95]
        false = self.rng.uniform([-35e3, -35e3, 0.0], [35e3, 35e3, 12e3], (self.rng.poisson(2.0), 3))
        true, drawn = measured(seen - radar, radar[2], kind), measured(false - radar, radar[2], kind)
        return np.concatenate([true + self.rng.normal(0.0, [STDS[name] for name in KINDS[kind]], true.shape), drawn])


def measured(off: Floats, own_height: float, kind: str) -> Floats:
    """(num, meas_dim) measurements without noise of offsets (num, 3) from the radar, m."""
    ground = np.hypot(off[:, 0], off[:, 1])
    quantities = {
        "bearing": np.arctan2(off[:, 1], off[:, 0]),
        "range": np.hypot(ground, off[:, 2]),
        "elevation": np.arctan2(off[:, 2], ground),
        "altitude": off[:, 2] + own_height,
    }
    return np.column_stack([quantities[name] for name in KINDS[kind]])


def write(folder: Path, aircraft: Aircraft, kind: str, num_radars: int) -> None:
    """A recording and its sensors file."""
    names, radars = KINDS[kind], dict(list(RADARS.items())[:num_radars])
    lines = [f"time,sensor,{','.join(COLUMNS[name] for name in names)}"]
    for time in np.arange(0.0, DURATION, PERIOD).tolist():
        for name, radar in radars.items():
            rows = aircraft.scan(time, radar, kind).tolist() or [[""] * len(names)]
            lines += [f"{time},{name},{','.join(map(str, row))}" for row in rows]
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "scans.csv").write_text("\n".join(lines), "utf-8")
    sensors = "".join(
        f"  - {{name: {name}, position: [{x}, {y}]{'' if kind == 'bearing_range' else f', height: {z}'}}}\n"
        for name, (x, y, z) in radars.items()
    )
    (folder / "radars.yaml").write_text(
        f"recording: {{bearings: east, turns: none}}\nsensor_defaults:\n  measurement: {{kind: {kind}}}\n"
        f"  noise: {{kind: constant, std: {[STDS[name] for name in names]}}}\n"
        f"  detection: {{kind: constant, probability: 0.95}}\nsensors:\n{sensors}",
        "utf-8",
    )


def track(folder: Path, aircraft: Aircraft) -> Floats:
    """(4,) mean error in the plane and in height, m; share of aircraft with an estimate; median squared error."""
    found = scenario_from_recording(folder / "radars.yaml", folder / "scans.csv", speed=250.0)
    record, components = track_recording(found.scenario, found.recording), found.scenario.model.motion.components
    has_height = "pz" in components
    kept = [0, 1, components.index("pz")] if has_height else [0, 1]
    plane, heights, squares, shares = list[float](), list[float](), list[float](), list[float]()
    for time, estimate in zip(record.times.tolist(), record.estimates, strict=True):
        if time < 60.0:
            continue
        true = aircraft.at(found.recording.start + time)
        off = estimate.means[:, np.newaxis, kept] - true[:, : len(kept)]
        nearest = np.hypot(off[..., 0], off[..., 1]).argmin(axis=1)
        own = off[np.arange(len(off)), nearest]
        near = np.hypot(own[:, 0], own[:, 1]) < 2000.0
        covs = estimate.covs[near][:, kept][:, :, kept]
        plane += np.hypot(own[near, 0], own[near, 1]).tolist()
        heights += np.abs(own[near, -1]).tolist() if has_height else []
        squares += np.einsum("ni,nij,nj->n", own[near], np.linalg.inv(covs), own[near]).tolist()
        shares.append(len(set(nearest[near].tolist())) / len(true))
    height = float(np.mean(heights)) if heights else math.nan
    return np.array([np.mean(plane) if plane else math.nan, height, np.mean(shares), np.median(squares or [math.nan])])


def scene(folder: Path, seed: int, kind: str, num_radars: int) -> Floats:
    """(4,) as `track`, of one scene; the same aircraft for every kind."""
    aircraft = Aircraft(np.random.default_rng([seed, num_radars]))
    write(folder, aircraft, kind, num_radars)
    return track(folder, aircraft)


def table(runs: int, first: int) -> str:
    """As Markdown."""
    columns = "measured", "radars", "error, m", "worst scene, m", "height error, m", "share tracked", "squared error"
    lines = [f"| {' | '.join(columns)} |", f"| --- |{' ---: |' * (len(columns) - 1)}"]
    with tempfile.TemporaryDirectory() as folder:
        for kind, num in [(kind, 2) for kind in KINDS] + [(kind, 1) for kind in list(KINDS)[1:]]:
            found = np.array([scene(Path(folder), seed, kind, num) for seed in range(first, first + runs)])
            error, height, share, squared = found.mean(axis=0).tolist()
            worst, named = float(found[:, 0].max()), "slant range as a range in the plane"
            told = f"{height:.0f}" if kind != "bearing_range" else "-"
            label = named if kind == "bearing_range" else f"`{kind}`"
            lines.append(f"| {label} | {num} | {error:.0f} | {worst:.0f} | {told} | {share:.2f} | {squared:.2f} |")
    return "\n".join(lines)


if __name__ == "__main__":
    table_of_scenes(__doc__, "heights.py", table)
