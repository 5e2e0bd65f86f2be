"""Sensors whose errors or misses last for many scans: error of tracks with `correlation` given, ignored, or thinned.

    python benchmarks/lasting_errors.py [--scenes 20] [--first 0] [--kinds errors misses both neither]

A radar scans every 2 s with independent errors, and a camera every 0.2 s. Of the camera's bearings the errors
(`errors`), the misses (`misses`), both or neither last, by correlation times that are drawn over decades: 0.5 to 20 s.
Drawn are also noise, detection, clutter, and three to five targets on straight courses for 60 s. `radar` is without the
camera. `ignored` takes the camera's scans as independent, `given` has the correlation times, `twice` and `half` have
wrong ones by these factors, `thinned` is what a user would do by hand: one scan of the camera in two of the longest
correlation times. OSPA (cutoff 50 m) is the mean over scans with its standard error over scenes. The last columns are
error over what covariances say, which should be 1, and changes of label a run.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from pages import write_between
from scenes import decades

from vedette.evaluation.metrics.targets import target_scores
from vedette.evaluation.runs import run_scenario
from vedette.scenarios import Scenario, parse_scenario

STREAM, STEP, DURATION, CUTOFF = 6201, 0.2, 60.0, 50.0
KINDS = {"errors": (True, False), "misses": (False, True), "both": (True, True), "neither": (False, False)}
WAYS = ("radar", "ignored", "given", "half", "twice", "thinned")


def correlation(noise_s: float, misses_s: float, seen: float) -> dict[str, Any]:
    """Return a section: errors and misses of these correlation times, s. seen: share of time with a target in view."""
    stays = {"visible_s": misses_s / (1.0 - seen), "hidden_s": misses_s / seen} if misses_s else {}
    return {"noise_s": noise_s, **stays}


def scenario(kind: str, number: int, way: str) -> Scenario:
    """Return a scene of a kind, the same targets, scans and errors for a number, filtered in a way."""
    rng = np.random.default_rng([STREAM, number])
    lasting = [decades(rng, 0.5, 20.0) if lasts else 0.0 for lasts in KINDS[kind]]
    noise, bearing, seen = decades(rng, 3.0, 20.0), decades(rng, 0.005, 0.04), float(rng.uniform(0.3, 0.9))
    detection = float(rng.uniform(0.7, 0.99))
    rates = [decades(rng, 0.3, 5.0) for _ in range(2)]
    tracks = []
    for _ in range(int(rng.integers(3, 6))):
        heading, speed = rng.uniform(-math.pi, math.pi), rng.uniform(2.0, 6.0)
        place = rng.uniform(-300.0, 300.0, 2).tolist()
        tracks.append({"state": [*place, speed * math.cos(heading), speed * math.sin(heading)]})
    place = rng.uniform(-400.0, 400.0, 2).tolist()
    radar = {
        "name": "radar",
        "position": place,
        "measurement": {"kind": "bearing_range"},
        "noise": {"kind": "range_dependent", "sigma_range": noise, "sigma_bearing_deg": 1.0},
        "detection": {"kind": "constant", "probability": 0.9},
        "clutter": {"kind": "region", "rate": rates[0]},
        "scans": {"period": 2.0},
    }
    camera = {
        "name": "camera",
        "position": place,
        "measurement": {"kind": "bearing_only"},
        "noise": {"kind": "constant", "std": [bearing]},
        "detection": {"kind": "constant", "probability": detection},
        "clutter": {"kind": "region", "rate": rates[1]},
    }
    factor = {"given": 1.0, "half": 0.5, "twice": 2.0}.get(way, 0.0)
    camera["correlation"] = correlation(factor * lasting[0], factor * lasting[1], seen)
    camera["true_parameters"] = {"correlation": correlation(*lasting, seen)}
    if lasting[1]:
        camera["true_parameters"]["detection"] = camera["detection"]
        if not factor:
            camera["detection"] = {"kind": "constant", "probability": detection * seen}
    if way == "thinned" and max(lasting) > 0.0:
        camera["scans"] = {"every": max(1, round(2.0 * max(lasting) / STEP))}
    text = {
        "format": 1,
        "name": f"{kind}-{number}",
        "time": {"num_steps": round(DURATION / STEP), "step_period": STEP},
        "region": {"x_min": -700.0, "x_max": 700.0, "y_min": -700.0, "y_max": 700.0},
        "motion": {"kind": "constant_velocity", "sigma_v": 0.1},
        "survival": {"kind": "constant", "probability": 0.9999},
        "birth": {"sites": [{"existence": 0.002, "mean": [0.0] * 4, "std": [250.0, 250.0, 4.0, 4.0]}]},
        "targets": {"kind": "scripted", "tracks": tracks},
        "sensors": [radar] if way == "radar" else [radar, camera],
        "fusion": {"kind": "none" if way == "radar" else "sequential"},
        "ospa": {"cutoff": CUTOFF},
    }
    return Scenario(parse_scenario(yaml.safe_dump(text)), None)


def row(kind: str, numbers: range, way: str) -> str:
    """Return a row of the table: the mean over scenes."""
    ospa, ratios, switches = list[float](), list[float](), list[int]()
    for number in numbers:
        record = run_scenario(scenario(kind, number, way), "stationary", seed=number)
        ospa.append(float(record.ospa[len(record.ospa) // 4 :, 0].mean()))
        scores = target_scores(record, cutoff=CUTOFF, order=1.0)
        ratios.append(float(np.nanmedian([own.error_ratio for own in scores])))
        switches.append(sum(own.label_switches for own in scores))
    error = np.std(ospa, ddof=1) / math.sqrt(len(ospa))
    return (
        f"| {kind} | {way} | {np.mean(ospa):.2f} ± {error:.2f} | {np.nanmean(ratios):.2f} | {np.mean(switches):.1f} |"
    )


def table(kinds: list[str], numbers: range) -> Iterator[str]:
    """Yield the lines of the table."""
    yield "| lasting | camera | OSPA, m | error over its bar | changes of label |"
    yield "| --- | --- | ---: | ---: | ---: |"
    for kind in kinds:
        for way in WAYS if kind != "neither" else WAYS[:3]:
            yield row(kind, numbers, way)


def main() -> None:
    """Read the arguments and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kinds", nargs="+", choices=list(KINDS), default=list(KINDS))
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--scenes", type=int, default=20)
    parser.add_argument("--write", type=Path)
    given = parser.parse_args()
    lines = list[Any]()
    for line in table(given.kinds, range(given.first, given.first + given.scenes)):
        lines.append(line)
        print(line, flush=True)
    if given.write is not None:
        write_between(given.write, "lasting_errors.py", "\n".join(lines))


if __name__ == "__main__":
    main()
