"""Which biases of a single radar a calibration reports, and how often its intervals cover the truth.

    python benchmarks/calibrating_one_place.py [--runs N] [--first SEED]
    python benchmarks/calibrating_one_place.py --write docs/evidence/calibration.md

One radar, at rest or weaving, measures five ships of up to 10 m/s for five minutes. Its ranges are 80 m too long, and
its bearings are turned by 0.5 degrees. The ships move with the process noise that the calibration assumes, or straight.
Each run is another recording. Prints how many biases are reported, their root mean square error, and how many
intervals of each parameter cover the truth; of all with a 95 % interval of the share (Wilson). Equal arguments print
equal tables.
"""

from __future__ import annotations

import csv
import math
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pages import table_of_scenes

from vedette.calibration import calibrate
from vedette.scenarios.calibration import build_problem
from vedette.scenarios.from_recording import scenario_from_recording

SECONDS, HALF_SIDE, STDS, SIGMA_V = 300.0, 7000.0, (20.0, 0.012, 0.5), 0.05  # s, m; m, rad, m/s; m/s^1.5
FAR, TURNED, PERIOD = 80.0, 0.5, 5.0  # m, degrees; s
TOLD = """recording: {bearings: east}
motion: {kind: constant_velocity, sigma_v: 0.05, noise_model: continuous_white}
sensor_defaults:
  measurement: {kind: KIND}
  noise: {kind: range_dependent, sigma_range: 25.0, eta_range: 0.0, sigma_bearing_deg: 0.9, eta_bearing: 0.0DOPPLER}
  detection: {kind: constant, probability: 0.8}
  clutter: {kind: region, rate: 3.0CLUTTER}
sensors:
"""


def _at(x: float, y: float) -> Callable[[float], np.ndarray]:
    return lambda time: np.array([x, y])


def _weaving(amplitude: float) -> Callable[[float], np.ndarray]:
    return lambda time: np.array([8.0 * time - 1200.0, amplitude * math.sin(2.0 * math.pi * time / 120.0)])


class Arrangement(NamedTuple):
    """Position of the radar over time, m; number of its random numbers; noise of the ships, and range rates.

    known: the biases are given.
    """

    course: Callable[[float], np.ndarray]
    stream: int
    noisy: bool = True
    doppler: bool = False
    known: bool = False


ARRANGEMENTS = {
    "at rest": Arrangement(_at(0.0, 0.0), 0),
    "at rest, straight ships": Arrangement(_at(0.0, 0.0), 1, noisy=False),
    "at rest, with range rates": Arrangement(_at(0.0, 0.0), 2, doppler=True),
    "the same, biases given": Arrangement(_at(0.0, 0.0), 2, doppler=True, known=True),
    "weaves by 80 m": Arrangement(_weaving(80.0), 4),
    "weaves by 300 m": Arrangement(_weaving(300.0), 5),
}


def ship(noisy: bool, rng: np.random.Generator) -> np.ndarray:
    """(num, 4) states once a tenth of a second."""
    step, state = 0.1, np.concatenate([rng.uniform(-4000.0, 4000.0, 2), rng.uniform(-10.0, 10.0, 2)])
    kicks = (SIGMA_V * math.sqrt(step) if noisy else 0.0) * rng.normal(size=(round(SECONDS / step) + 1, 2))
    velocities = state[2:] + np.cumsum(kicks, axis=0)
    places = state[:2] + np.cumsum(step * velocities, axis=0)
    return np.column_stack([places - places[len(places) // 2] + state[:2], velocities])


def write_recording(folder: Path, arrangement: Arrangement, rng: np.random.Generator) -> None:
    """scans.csv and radars.yaml."""
    ships, rows = [ship(arrangement.noisy, rng) for _ in range(5)], list[list[object]]()
    doppler = arrangement.doppler
    for time in np.arange(rng.uniform(0.0, PERIOD), SECONDS, PERIOD).tolist():
        own, found = arrangement.course(time), list[tuple[float, float, float]]()
        for states in ships:
            dx, dy = (state := states[round(10.0 * time)])[:2] - own
            noise, reach = rng.normal(0.0, STDS), math.hypot(dx, dy)
            rate = (dx * state[2] + dy * state[3]) / reach + noise[2]
            bearing = math.atan2(dy, dx) + noise[1] + math.radians(TURNED)
            if rng.random() < 0.9:
                found.append((max(reach + noise[0] + FAR, 0.0), bearing, rate))
        for dx, dy in rng.uniform(-HALF_SIDE, HALF_SIDE, (rng.poisson(2.0), 2)).tolist():
            found.append((math.hypot(dx, dy), math.atan2(dy, dx), rng.uniform(-30.0, 30.0)))
        rows += [[time, "r0", *own, a, b, *([c] if doppler else [])] for a, b, c in found]
    header = ["time", "sensor", "own_x", "own_y", "range_m", "bearing_rad", *(["range_rate_mps"] if doppler else [])]
    with (folder / "scans.csv").open("w", newline="") as file:
        csv.writer(file).writerows([header, *sorted(rows, key=lambda row: float(str(row[0])))])
    text = TOLD.replace("KIND", "bearing_range_rate" if doppler else "bearing_range")
    text = text.replace("DOPPLER", ", sigma_range_rate: 0.6" if doppler else "")
    text = text.replace("CLUTTER", ", max_range_rate: 30.0" if doppler else "")
    bias = f", bias: {{range: {FAR}, bearing_deg: {TURNED}}}" if arrangement.known else ""
    (folder / "radars.yaml").write_text(f"{text}  - {{name: r0, position: [0, 0]{bias}}}\n", "utf-8")


TRUTH = {"range": FAR, "bearing_deg": TURNED, "range_rate": 0.0, "noise.sigma_range": STDS[0]}
TRUTH |= {"noise.sigma_bearing_deg": math.degrees(STDS[1]), "noise.sigma_range_rate": STDS[2]}
TRUTH |= {"detection.probability": 0.9, "clutter.rate": 2.0}


def row(name: str, runs: int, first: int) -> str:
    """A row of the table."""
    arrangement = ARRANGEMENTS[name]
    counts = {label: np.zeros(2, np.int64) for label in _LABELS}
    errors = {key: list[float]() for key in _UNITS}
    for seed in range(first, first + runs):
        with tempfile.TemporaryDirectory() as place:
            write_recording(Path(place), arrangement, np.random.default_rng([seed, arrangement.stream]))
            scenario = scenario_from_recording(Path(place) / "radars.yaml", Path(place) / "scans.csv", speed=15.0)
            calibration = calibrate(build_problem(scenario.scenario, prior_scale=10.0))
        for each in calibration.estimates:
            truth = TRUTH[each.parameter.name]
            if math.isnan(each.ci_low):
                continue
            label = "biases" if each.parameter.kind == "bias" else each.parameter.label
            counts[label] += each.ci_low <= truth <= each.ci_high, 1
            if each.parameter.name in errors:
                errors[each.parameter.name].append(each.value - truth)
    shares = " | ".join(f"{a} of {b}" if b else "-" for a, b in counts.values())
    covered = _share(*np.sum(list(counts.values()), axis=0).tolist())
    biases = " | ".join(_told(errors[key], runs, unit) for key, unit in _UNITS.items())
    return f"| {name} | {biases} | {shares} | {covered} |"


_LABELS = ("biases", "bearing noise std", "range noise std", "range rate noise std", "detection prob.", "clutter rate")


def _share(covers: int, num: int) -> str:
    """Share in percent, and its interval of 95 % (Wilson 1927)."""
    z, share = 1.96, covers / num
    middle, reach = share + z * z / (2 * num), z * math.sqrt(share * (1.0 - share) / num + z * z / (4 * num * num))
    low, high = ((middle + sign * reach) / (1.0 + z * z / num) for sign in (-1.0, 1.0))
    return f"{100 * share:.0f} % ({100 * low:.0f} to {100 * high:.0f})"


def table(runs: int, first: int) -> str:
    """The table, of that many recordings a row from that seed on."""
    text = [f"| radar | range bias | bearing bias | {' | '.join(_LABELS)} | all |"]
    text += [f"| --- | --- | --- |{' ---: |' * (len(_LABELS) + 1)}"]
    text += [row(name, runs, first) for name in ARRANGEMENTS]
    return "\n".join([*text, f"\n{runs} recordings of {SECONDS:.0f} s of each."])


_UNITS = {"range": "m", "bearing_deg": "deg"}


def _told(errors: list[float], num: int, unit: str) -> str:
    error = f", error {np.sqrt(np.mean(np.square(errors))):.2g} {unit}" if errors else ""
    return f"{len(errors)} of {num}{error}"


if __name__ == "__main__":
    table_of_scenes(__doc__, "calibrating_one_place.py", table)
