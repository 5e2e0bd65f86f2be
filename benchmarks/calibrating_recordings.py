"""Calibration of real recordings: the radar of the Autoferry data set, tracked with given and with estimated values.

    python benchmarks/calibrating_recordings.py DATASET [--scenarios 2 4 5 13 17] [--write docs/evidence/calibration.md]

DATASET is a checkout of github.com/Autoferry/sensor_fusion_dataset (CC0). The sensors file has noise of 8 m and 1
degree and a detection probability of .9. GOSPA (order 2, cutoff 20 m) is that of estimates within 50 m of a vessel, as
only the two vessels have truth, with the standard error of differences from ten blocks of time. True errors are those
of the measurement nearest to a vessel, within 20 m, as a standard deviation.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from ferry import Scan, positions, read, score, write_rows
from numpy.typing import NDArray
from pages import write_between

from vedette.calibration import Calibration, calibrate
from vedette.evaluation.runs import track_recording
from vedette.scenarios.calibration import build_problem, calibrated_text
from vedette.scenarios.from_recording import scenario_from_recording

Floats = NDArray[np.float64]
MINUS = "\N{MINUS SIGN}"
CUTOFF, BLOCKS = 20.0, 10
SENSORS = """recording: {bearings: north}
sensors:
  - name: radar
    position: [0.0, 0.0]
    measurement: {kind: bearing_range}
    noise: {kind: range_dependent, sigma_range: 8.0, eta_range: 0.0, sigma_bearing_deg: 1.0, eta_bearing: 0.0}
    detection: {kind: constant, probability: 0.9}
"""


def scores(scans: list[Scan], vessels: dict[int, Floats], file: Path, rows: Path) -> Floats:
    """(num_scans,) GOSPA at the scans, tracked with a sensors file."""
    recorded = scenario_from_recording(file, rows)
    record = track_recording(recorded.scenario, recorded.recording)
    return score(list(record.estimates), np.array([scan.time for scan in scans]), vessels).gospa[:, 0]


def true_errors(scans: list[Scan], vessels: dict[int, Floats]) -> dict[str, float]:
    """Return the standard deviations of the errors of range, m, and bearing, degrees."""
    rows = []
    for scan in scans:
        for x, y in (place - scan.own for place in positions(vessels, scan.time).values()):
            gaps = np.hypot(*(scan.measured - [x, y]).T)
            if gaps.min(initial=math.inf) < CUTOFF:
                near_x, near_y = scan.measured[gaps.argmin()]
                turn = math.remainder(math.atan2(near_x, near_y) - math.atan2(x, y), 2.0 * math.pi)
                rows.append((math.hypot(near_x, near_y) - math.hypot(x, y), math.degrees(turn)))
    return dict(zip(("range", "bearing"), np.std(rows, axis=0).tolist(), strict=True))


def radar_scans(dataset: Path, number: int) -> tuple[list[Scan], dict[int, Floats]]:
    """Return the radar scans of a scenario, and the times and positions of each vessel."""
    scans, vessels = read(dataset, number)
    return [scan for scan in scans if scan.sensor == "radar"], vessels


def write_files(scans: list[Scan], rows: Path, sensors: Path) -> None:
    """Write the scans as rows, and the sensors file."""
    write_rows(scans, rows)
    sensors.write_text(SENSORS, "utf-8")


def row(dataset: Path, number: int, folder: Path) -> tuple[str, list[bool]]:
    """Return the row of a scenario, and for each noise with an interval whether the true error is inside."""
    scans, vessels = radar_scans(dataset, number)
    rows, file, written = folder / "scans.csv", folder / "radar.yaml", folder / "calibrated.yaml"
    write_files(scans, rows, file)
    recorded = scenario_from_recording(file, rows)
    found = calibrate(build_problem(recorded.scenario, biases=False))
    written.write_text(calibrated_text(recorded.scenario, file, found, folder), "utf-8")
    before, after = (scores(scans, vessels, each, rows) for each in (file, written))
    sums = np.array([part.sum() for part in np.array_split(after - before, BLOCKS)])
    error = math.sqrt(BLOCKS * sums.var(ddof=1)) / len(scans)
    true, inside = true_errors(scans, vessels), list[bool]()
    cells = [str(number), str(len(scans)), f"{before.mean():.2f}", f"{after.mean():.2f}"]
    cells.append(f"{(after - before).mean():+.2f} ± {error:.2f}".replace("-", MINUS))
    cells.append(f"{true['range']:.1f}, {true['bearing']:.1f}")
    for each in found.estimates:
        if each.parameter.kind == "noise" and not math.isnan(each.ci_low):
            inside.append(each.ci_low <= true[each.parameter.component] <= each.ci_high)
    return f"| {' | '.join([*cells, _changes(found)])} |", inside


def _changes(found: Calibration) -> str:
    if not found.converged:
        return "none, not converged"
    changed = [
        f"{each.parameter.label} {each.value:.2g} ({each.ci_low:.2g} to {each.ci_high:.2g})"
        for each in found.estimates
        if each.is_better
    ]
    return ", ".join(changed) or "none"


def table(dataset: Path, numbers: list[int]) -> Iterator[str]:
    """Yield the lines of the table."""
    yield "| scenario | scans | GOSPA, m | calibrated | difference | true errors, m, degrees | changed, with interval |"
    yield "| --- | ---: | ---: | ---: | ---: | ---: | --- |"
    inside = list[bool]()
    for number in numbers:
        with tempfile.TemporaryDirectory() as folder:
            line, own = row(dataset, number, Path(folder))
        inside += own
        yield line
    yield ""
    yield f"Intervals of noise that contain the true error: {sum(inside)} of {len(inside)}."


def main() -> None:
    """Read the arguments and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--scenarios", type=int, nargs="+", default=[2, 4, 5, 13, 17])
    parser.add_argument("--write", type=Path)
    given = parser.parse_args()
    text = "\n".join(table(given.dataset, given.scenarios))
    print(text)
    if given.write is not None:
        write_between(given.write, "calibrating_recordings.py DATASET", text)


if __name__ == "__main__":
    main()
