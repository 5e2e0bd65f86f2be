"""Recordings of a ferry with radar, lidar, infra-red and optical cameras: errors of tracks for each set of sensors.

    python benchmarks/ferry.py DATASET [--scenarios 2 4 5 13 17] [--sets radar radar+lidar all] [--sensors FILE]
    python benchmarks/ferry.py DATASET --write docs/evidence/real-recordings.md

DATASET is a checkout of github.com/Autoferry/sensor_fusion_dataset (CC0). Two vessels have truth. At each radar scan
the score counts estimates within 50 m of a vessel: GOSPA (order 2, cutoffs 20 and 50 m), share of scans with an
estimate within 20 m of a vessel, their root mean square error, changes of label, second estimates near a vessel. Other
estimates are counted apart (far: mean a scan). One setting of each sensor serves all scenarios and sets. The rows
`independent` are without `correlation`.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml
from numpy.typing import NDArray
from pages import write_between
from scipy.optimize import linear_sum_assignment

from vedette.densities import Estimate
from vedette.evaluation.runs import track_recording
from vedette.scenarios.from_recording import scenario_from_recording

Floats = NDArray[np.float64]
NAMES = {1: "lidar", 2: "radar", 3: "ir", 4: "eo"}
SETS = {"radar": ("radar",), "radar+lidar": ("radar", "lidar"), "radar+cameras": ("radar", "ir", "eo")}
SETS["all"] = ("radar", "lidar", "ir", "eo")
NEAR, CUTOFFS, FOUND = 50.0, (20.0, 50.0), 20.0
SETTINGS = Path(__file__).with_name("ferry.yaml")


class Scan(NamedTuple):
    """A scan: time, s; sensor; position of the ferry, east and north, m; offsets, (n, 2) m, or bearings, (n,) rad."""

    time: float
    sensor: str
    own: Floats
    measured: Floats


class Score(NamedTuple):
    """Score of a run; see the text of this file."""

    gospa: Floats  # (num_scans, 2) at both cutoffs, m
    seen: float  # share of scans of a vessel
    rmse: float  # m
    changes: int  # of label
    second: float  # estimates a scan near a vessel that has one
    far: float  # estimates a scan


def read(dataset: Path, number: int) -> tuple[list[Scan], dict[int, Floats]]:
    """Return the scans of a scenario in order of time, and the (n, 3) times and positions of each vessel."""
    base = dataset / f"scenario{number}" / f"scenario{number}"
    rows = json.loads(Path(f"{base}_detections.json").read_text("utf-8"))
    start, scans = min(row["time"] for row in rows), list[Scan]()
    for row in sorted(rows, key=lambda row: row["time"]):
        given = np.array(row["measurement"] if row["measurement"] is not None else [], np.float64)
        if row["sensorID"] in (1, 2):
            given = given.reshape(2, -1)[::-1].T if given.size else np.empty((0, 2))  # from north, east
        own = np.array(row["ownshipPosition"][1::-1])
        scans.append(Scan(row["time"] - start, NAMES[row["sensorID"]], own, given if given.ndim else given[None]))
    vessels: dict[int, list[list[float]]] = {}
    for entry in json.loads(Path(f"{base}_groundTruth.json").read_text("utf-8")):
        for row in entry if isinstance(entry, list) else [entry]:
            vessels.setdefault(row["targetID"], []).append([row["time"] - start, *row["position"][1::-1]])
    return scans, {name: np.unique(np.array(rows), axis=0) for name, rows in vessels.items()}


def positions(vessels: dict[int, Floats], time: float) -> dict[int, Floats]:
    """Return the positions of the vessels that are recorded at a time."""
    there = {name: own for name, own in vessels.items() if own[0, 0] - 1.0 <= time <= own[-1, 0] + 1.0}
    return {name: np.array([np.interp(time, own[:, 0], own[:, i]) for i in (1, 2)]) for name, own in there.items()}


def write_rows(scans: list[Scan], path: Path) -> None:
    """Write scans as rows for `vedette track`; one without measurements is a row with empty cells."""
    with path.open("w", newline="") as opened:
        table = csv.writer(opened)
        table.writerow(["time", "sensor", "range_m", "bearing_rad", "own_x", "own_y"])
        for scan in scans:
            rows: list[tuple[Any, Any]] = [
                (math.hypot(*each), math.atan2(*each)) if scan.measured.ndim == 2 else ("", each)
                for each in scan.measured
            ]
            table.writerows([scan.time, scan.sensor, *each, *scan.own] for each in rows or [("", "")])


def gospa(gaps: Floats, cutoff: float) -> float:
    """GOSPA of order 2 from the distances of estimates (rows) and targets (columns)."""
    matched = gaps[linear_sum_assignment(np.minimum(gaps, cutoff) ** 2)]
    matched = matched[matched < cutoff]
    return math.sqrt((matched**2).sum() + 0.5 * cutoff**2 * (sum(gaps.shape) - 2 * len(matched)))


def score(estimates: list[Estimate], times: Floats, vessels: dict[int, Floats]) -> Score:
    """Score the estimates of a run."""
    errors, each, last = list[float](), list[list[float]](), dict[int, tuple[int, ...]]()
    changes = second = far = wanted = 0
    for estimate, time_s in zip(estimates, times, strict=True):
        there = positions(vessels, time_s)
        true, found = np.array(list(there.values())).reshape(-1, 2), estimate.means[:, :2]
        gaps = np.hypot(*(found[:, None] - true[None]).transpose(2, 0, 1))
        near = gaps.min(axis=1, initial=math.inf) < NEAR
        far += int((~near).sum())
        labels, gaps = [tuple(map(int, label)) for label in estimate.labels[near]], gaps[near]
        each.append([gospa(gaps, cutoff) for cutoff in CUTOFFS])
        kept = np.array([[last.get(name) == label for name in there] for label in labels]).reshape(gaps.shape)
        pairs = zip(*linear_sum_assignment(np.minimum(gaps, FOUND) - 5.0 * kept), strict=True)
        pairs = [(i, j) for i, j in pairs if gaps[i, j] < FOUND]
        wanted, second = wanted + len(there), second + len(labels) - len(pairs)
        for i, j in pairs:
            name = list(there)[j]
            changes += last.get(name, labels[i]) != labels[i]
            last[name] = labels[i]
            errors.append(gaps[i, j])
    num, seen = len(times), len(errors) / max(wanted, 1)
    return Score(np.array(each), seen, math.sqrt(np.square(errors).mean()), changes, second / num, far / num)


def tracked(dataset: Path, number: int, sensors: tuple[str, ...], settings: dict[str, Any]) -> tuple[Score, float, int]:
    """Return the score of a set of sensors on a scenario, its CPU time, s, and its number of scans."""
    scans, vessels = read(dataset, number)
    used = [scan for scan in scans if scan.sensor in sensors]
    text = settings | {"sensors": [each for each in settings["sensors"] if each["name"] in sensors]}
    with tempfile.TemporaryDirectory() as folder:
        rows, file = Path(folder) / "scans.csv", Path(folder) / "sensors.yaml"
        write_rows(used, rows)
        file.write_text(yaml.safe_dump(text, sort_keys=False), "utf-8")
        before = time.process_time()
        recorded = scenario_from_recording(file, rows)
        record = track_recording(recorded.scenario, recorded.recording)
        spent = time.process_time() - before
    at = np.array([scan.time for scan in scans if scan.sensor == "radar"])
    times = recorded.recording.times + recorded.recording.start
    nearest = np.abs(times[None] - at[:, None]).argmin(axis=1)
    return score([record.estimates[i] for i in nearest], at, vessels), spent, len(used)


def table(dataset: Path, numbers: list[int], sets: list[str], settings: dict[str, Any]) -> Iterator[str]:
    """Yield the lines of the table."""
    yield "| sensors | scenario | GOSPA 20 / 50 m | seen | error, m | changes of label | second | far | ms a scan |"
    yield "| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |"
    white = {**settings, "sensors": [{**each, "correlation": {}} for each in settings["sensors"]]}
    for name in sets:
        ways = [(name, settings)]
        if any(each.get("correlation") and each["name"] in SETS[name] for each in settings["sensors"]):
            ways.insert(0, (f"{name}, independent", white))
        for words, own_settings in ways:
            found = [tracked(dataset, number, SETS[name], own_settings) for number in numbers]
            for number, (own, spent, num) in zip(numbers, found, strict=True):
                yield _row(words, str(number), [own], spent / num)
            total, num_scans = sum(spent for _, spent, _ in found), sum(num for *_, num in found)
            yield _row(words, "mean", [own for own, *_ in found], total / num_scans)


def _row(name: str, number: str, scores: list[Score], spent: float) -> str:
    near, wide = np.mean([own.gospa.mean(axis=0) for own in scores], axis=0)
    seen, rmse, changes, second, far = np.mean([own[1:] for own in scores], axis=0)
    cells = [name, number, f"{near:.2f} / {wide:.2f}", f"{seen:.2f}", f"{rmse:.1f}", f"{changes:.1f}"]
    return f"| {' | '.join([*cells, f'{second:.2f}', f'{far:.1f}', f'{1e3 * spent:.1f}'])} |"


def main() -> None:
    """Read the arguments and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--scenarios", type=int, nargs="+", default=[2, 4, 5, 13, 17])
    parser.add_argument("--sets", nargs="+", choices=list(SETS), default=list(SETS))
    parser.add_argument("--sensors", type=Path, default=SETTINGS)
    parser.add_argument("--write", type=Path)
    given = parser.parse_args()
    settings, lines = yaml.safe_load(given.sensors.read_text("utf-8")), list[str]()
    for line in table(given.dataset, given.scenarios, given.sets, settings):
        lines.append(line)
        print(line, flush=True)
    if given.write is not None:
        write_between(given.write, "ferry.py DATASET", "\n".join(lines))


if __name__ == "__main__":
    main()
