"""Lines as they come in: the recording that any test may track, sent scan by scan."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np

from recordings import write_recording
from vedette.live import LiveLoop, build_live_loop, encode_line
from vedette.scenarios.from_recording import scenario_from_sensors

REGION = "region: {x_min: -6000.0, x_max: 6000.0, y_min: -6000.0, y_max: 6000.0}\n"
SYNCHRONOUS = """
region: {x_min: -1000.0, x_max: 1000.0, y_min: -1000.0, y_max: 1000.0}
motion: {kind: constant_velocity, sigma_v: 0.5}
birth: {sites: [], from_measurements: {expected: 0.5, max_existence: 0.03, std: [20.0, 20.0, 5.0, 5.0]}}
sensor_defaults:
  measurement: {kind: position}
  noise: {kind: constant, std: [10.0, 10.0]}
  detection: {kind: constant, probability: 0.9}
  clutter: {kind: region, rate: 1.0}
  platform: {kind: heading, speed: 5.0}
sensors: [{position: [0.0, 0.0]}, {position: [100.0, 0.0]}]
filter: {kind: lmb}
"""


def write_live(folder: Path, **options: Any) -> list[bytes]:
    """radars.yaml, for lines, beside the recording; and the recording as lines in order."""
    write_recording(folder, **options)
    text = (folder / "radars.yaml").read_text("utf-8")
    text = text.replace("bearings: north", "bearings: north, units: {bearing: deg, range: nmi}") + REGION
    (folder / "radars.yaml").write_text(text, "utf-8")
    lines: dict[tuple[str, str], dict[str, Any]] = {}
    with (folder / "scans.csv").open(newline="") as file:
        for row in csv.DictReader(file):
            pose = {"lon": float(row["own_lon"]), "lat": float(row["own_lat"])}
            scan: dict[str, Any] = {"sensor": row["radar"], "time": row["time"], "measurements": [], "pose": pose}
            found = lines.setdefault((row["time"], row["radar"]), scan)
            if row["brg_deg"]:
                found["measurements"].append([float(row["brg_deg"]), float(row["range_nmi"])])
    return [json.dumps(line).encode() for line in lines.values()]


def small(folder: Path, text: str = SYNCHRONOUS, **options: Any) -> LiveLoop:
    """A loop of two sensors that measure positions."""
    (folder / "small.yaml").write_text(text, "utf-8")
    known = scenario_from_sensors(folder / "small.yaml", decide_every=options.get("decide_every"))
    return build_live_loop(known, num_threads=1, **options)


def line(sensor: Any = 1, time: Any = 0.0, measurements: Any = (), **more: Any) -> bytes:
    return json.dumps({"sensor": sensor, "time": time, "measurements": measurements, **more}).encode()


def walk(num: int, seed: int = 0) -> list[bytes]:
    """Both sensors see one target that walks, at every second."""
    rng, lines = np.random.default_rng(seed), []
    for k in range(num):
        for s in (1, 2):
            lines.append(line(s, float(k), [(np.array([5.0 * k, 50.0]) + rng.normal(0.0, 10.0, 2)).tolist()]))
    return lines


def answered(live: LiveLoop, lines: list[bytes]) -> list[bytes]:
    """All answers, as lines."""
    state, found = live.initial(), list[bytes]()
    for one in lines:
        state, answers = live.process(state, one)
        found += map(encode_line, answers)
    return found


def crossing(num: int, seed: int = 0, drift: float = 0.0) -> list[bytes]:
    """Both sensors see three targets at every second; x of the first drifts by `drift` m/s from 60 s on, to 60 m."""
    rng, lines = np.random.default_rng(seed), []
    starts, velocities = (
        np.array([[-700.0, 200.0], [600.0, 500.0], [0.0, -600.0]]),
        np.array([[5, 1], [-5, -2], [1, 5]]),
    )
    for k in range(num):
        moved = [min(max(0.0, drift * (k - 60.0)), 60.0), 0.0]
        for s in (1, 2):
            seen = (starts + k * velocities)[rng.random(3) < 0.9]
            false = rng.uniform(-1000.0, 1000.0, (rng.poisson(1.0), 2))
            rows = np.vstack([seen + rng.normal(0.0, 10.0, seen.shape), false]) + (moved if s == 1 else [0.0, 0.0])
            lines.append(line(s, float(k), rows.tolist()))
    return lines
