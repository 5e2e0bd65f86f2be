"""What search gains where targets are born late and sensors see less than the region: random scenes, paired runs.

    python benchmarks/late_births.py                           # 16 scenes, 8 runs, a table
    python benchmarks/late_births.py --scenes 20 26 --runs 30
    python benchmarks/late_births.py --write docs/evidence/search.md

Two to four sensors see 80, 120 or 180 m in a square of 600, 900 or 1,200 m, and decide after every scan, every second
or every fifth. Two to four targets are there at first; in three of four scenes four to eight more are born later,
anywhere. Each scene is run with search and a learnt birth rate, as is the default, and without
(`undetected_target_value: 0`, the rate as promised). The table has the mean OSPA (cutoff 50 m, order 1) over scans and
runs, its paired difference
with one standard error (negative: search is better), the seconds until a late target is first tracked (`TimeToTrack`),
and CPU seconds of a run, without search and with it.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from pages import write_between

from vedette.evaluation import TimeToTrack, run_scenario
from vedette.kernels.base.types import Floats
from vedette.scenarios import Scenario, parse_scenario

STEPS, SEED, CUTOFF = 60, 3000, 50.0


def tracks_of(rng: np.random.Generator, half: float, early: int, late: int) -> list[dict[str, Any]]:
    """Targets that stay within the region, some from the first scan on."""
    found = []
    for k in range(early + late):
        place, velocity = rng.uniform(-0.85 * half, 0.85 * half, 2), rng.normal(0.0, 2.0, 2)
        start = 1 if k < early else int(rng.integers(5, 45))
        end = min(start + int(rng.integers(25, 60)), STEPS)
        leaves = np.abs(place + velocity * (end - start)) > half
        state = [*np.where(leaves, 0.5 * place, place).tolist(), *velocity.tolist()]
        found.append({"state": state, "start_step": start, **({"end_step": end} if end < STEPS else {})})
    return found


def scene(number: int, searches: bool) -> Scenario:
    """The scene of this number; searches: as is the default, or without search."""
    rng = np.random.default_rng(SEED + number)
    half, num_sensors = float(rng.choice([300.0, 450.0, 600.0])), int(rng.integers(2, 5))
    view, speed, every = (float(rng.choice(of)) for of in ([80.0, 120.0, 180.0], [10.0, 20.0], [1, 2, 5]))
    early, late = int(rng.integers(2, 5)), int(rng.integers(4, 9)) if number % 4 else 0
    sensor = {
        "platform": {"kind": "heading", "speed": speed, "headings_deg": [-90, -45, 0, 45, 90], "relative": True},
        "measurement": {"kind": "position"},
        "noise": {"kind": "constant", "std": [4.0, 4.0]},
        "detection": {"kind": "limited_range", "probability": 0.95, "max_range": view},
        "clutter": {"kind": "around_sensor", "rate": 1.0, "radius": view},
    }
    data = {
        "format": 1,
        "name": f"late-births-{number}",
        "time": {"num_steps": STEPS, "step_period": 1.0, "start": 1.0},
        "region": {"x_min": -half, "x_max": half, "y_min": -half, "y_max": half},
        "motion": {"kind": "constant_velocity", "sigma_v": 0.5},
        "survival": {"kind": "constant", "probability": 0.99},
        "birth": {"sites": [], "from_measurements": {"expected": 0.2, "max_existence": 0.1, "std": [10, 10, 4, 4]}},
        "targets": {"kind": "scripted", "tracks": tracks_of(rng, half, early, late)},
        "sensor_defaults": sensor,
        "sensors": [
            {
                "position": rng.uniform(-0.5 * half, 0.5 * half, 2).tolist(),
                "heading_deg": float(rng.uniform(0.0, 360.0)),
            }
            for _ in range(num_sensors)
        ],
        "fusion": {"kind": "sequential"},
        "control": {"decision_every": int(every), "horizon_steps": max(int(every), 2), "horizon_period": 1.0},
        "ospa": {"cutoff": CUTOFF, "order": 1.0},
    }
    if not searches:
        data["control"]["undetected_target_value"] = 0.0  # type: ignore[index]
    return Scenario(parse_scenario(yaml.safe_dump(data)), Path(f"late-births-{number}.yaml"))


def measured(given: Scenario, run: int) -> tuple[float, float, float]:
    """Mean OSPA over the scans of a run, m, seconds until late targets are tracked (NaN: none), and its CPU seconds."""
    start = time.process_time()
    record = run_scenario(given, "jdm", seed=0, run=run, num_threads=1)
    seconds, waits = time.process_time() - start, TimeToTrack(CUTOFF, 1.0)(record)
    waits = waits[~np.isnan(waits)]
    return float(record.ospa[:, 0].mean()), float(waits.mean()) if len(waits) else np.nan, seconds


def row(number: int, runs: int) -> tuple[str, float]:
    """The line of a scene, and its mean difference, m."""
    scenes = [scene(number, searches) for searches in (False, True)]
    found: Floats = np.array([[measured(given, run) for given in scenes] for run in range(runs)])
    (before, wait, without), (after, less, with_search) = found.mean(axis=0)
    gain = found[:, 1, 0] - found[:, 0, 0]
    late = "late births" if number % 4 else "none late"
    error = gain.std(ddof=1) / np.sqrt(runs)
    of_scene = f"| {number}, {late} | {before:.1f} | {after:.1f} | {gain.mean():+.1f} ± {error:.1f} "
    waits = f"{wait:.0f}, {less:.0f}" if number % 4 else ""
    line = f"{of_scene}| {waits} | {without:.2f}, {with_search:.2f} |"
    return line, float(gain.mean())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, nargs=2, default=(0, 16), metavar=("FIRST", "LAST"))
    parser.add_argument("--runs", type=int, default=8)
    parser.add_argument("--write", type=Path, help="page with the two marks between which the table goes")
    given = parser.parse_args()
    head = "| scene | without | search | difference | s until tracked | CPU s |"
    lines, gains = [head, "| --- | ---: | ---: | ---: | ---: | ---: |"], []
    for number in range(*given.scenes):
        line, gain = row(number, given.runs)
        print(line, flush=True)
        lines.append(line)
        gains.append(gain)
    error = np.std(gains, ddof=1) / np.sqrt(len(gains))
    lines.append(f"| mean of scenes | | | {np.mean(gains):+.1f} ± {error:.1f} | | |")
    print(lines[-1])
    if given.write is not None:
        write_between(given.write, "late_births.py", "\n".join(lines))


if __name__ == "__main__":
    main()
