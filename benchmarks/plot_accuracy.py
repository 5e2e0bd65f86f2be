"""Plots that bring their own accuracy, signal-to-noise ratio, or no altitude, on scenes drawn at random.

    python benchmarks/plot_accuracy.py                    # 20 scenes a row
    python benchmarks/plot_accuracy.py --first 1000       # others
    python benchmarks/plot_accuracy.py --write docs/evidence/plot-accuracy.md

A scene has six targets of 5 to 25 m/s within 8 km of a radar that scans every 4 s for 240 s; P_D .9, eight false plots
a scan. Each plot has standard deviations of its own, from .002 to .04 rad and from 10 to 300 m, log-uniformly, and a
signal-to-noise ratio: of targets that fluctuate about 16 dB, of noise, both above 10 dB. "Clutter of 3 dB" has twice
the power of the noise; the model knows that (`clutter_db`) or does not. "Own heading" is wrong by another angle in each
scan, for plots of .003 rad and 20 m. Tracked by the radar's mean noise, by each
plot's own, and with the ratios. The last rows are five aircraft at 3 to 9 km seen by one radar whose plots have an
altitude with the given probability. Prints OSPA (c = 500 m) or the mean error of the estimates within 2 km, its worst
scene, the number of tracks that last ten scans (six and five are right), and the median squared error of the position
in units of the belief's covariance, which is 1.39 if it is right (2.37 with a height).
"""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
from heights import Aircraft
from pages import table_of_scenes

from vedette.evaluation import track_recording
from vedette.kernels.base.types import Floats
from vedette.models import SignalModel
from vedette.scenarios.from_recording import scenario_from_recording
from vedette.simulation.records import RunRecord

PERIOD, SCANS, DETECTION, FALSE = 4.0, 60, 0.9, 8.0
STDS = (0.002, 0.04), (10.0, 300.0)
MEAN_STDS = [0.0175, 127.0]  # root mean squares of the log-uniform ones
SIGNAL = SignalModel(16.0, 10.0)
CUTOFF = 500.0
Rows = list[dict[str, float | str]]


class Variant(NamedTuple):
    """A row of the table: what is told of the plots, and the mean power of clutter over noise."""

    words: str
    columns: tuple[str, ...]
    signal: bool = False
    clutter_power: float = 1.0
    known_power_db: float = 0.0
    heading_std: float = 0.0  # rad, of the own heading in each scan, with plots of .003 rad and 20 m


ALL = ("bearing_std_rad", "range_std_m", "snr_db")
VARIANTS = [
    Variant("the radar's mean noise", ()),
    Variant("each plot's noise", ALL[:2]),
    Variant("each plot's noise and ratio", ALL, True),
    Variant("the same, clutter of 3 dB, known", ALL, True, 2.0, 3.0),
    Variant("the same, clutter of 3 dB, taken for noise", ALL, True, 2.0),
    Variant("each plot's noise, clutter of 3 dB", ALL[:2], False, 2.0),
    Variant("own heading off by 1.5 deg, not told", ALL[:2], heading_std=math.radians(1.5)),
    Variant("own heading off by 1.5 deg, told", (*ALL[:2], "own_heading_std_deg"), heading_std=math.radians(1.5)),
]


class Ships:
    """Six targets that move straight on."""

    def __init__(self, rng: np.random.Generator) -> None:
        way, speed = rng.uniform(-math.pi, math.pi, 6), rng.uniform(5.0, 25.0, 6)
        self.starts = rng.uniform(-8e3, 8e3, (6, 2))
        self.velocities = np.column_stack([speed * np.cos(way), speed * np.sin(way)])

    def at(self, time: float) -> Floats:
        """(6, 2) m."""
        return np.asarray(self.starts + time * self.velocities)


def plots(ships: Ships, rng: np.random.Generator, variant: Variant) -> list[dict[str, float]]:
    """All plots of a scene, by columns."""
    heading_std = variant.heading_std
    stds = ((0.003, 0.003), (20.0, 20.0)) if heading_std else STDS
    found = list[dict[str, float]]()
    threshold, mean = 10.0 ** (SIGNAL.threshold_db / 10.0), 10.0 ** (SIGNAL.mean_db / 10.0)
    for k in range(SCANS):
        time = PERIOD * k
        turned = heading_std * rng.normal() if heading_std else 0.0
        true = ships.at(time)[rng.uniform(size=6) < DETECTION]
        false = rng.uniform(-10e3, 10e3, (rng.poisson(FALSE), 2))
        for (x, y), power in [(each, 1.0 + mean) for each in true] + [(each, variant.clutter_power) for each in false]:
            bearing_std, range_std = (math.exp(rng.uniform(*np.log(each))) for each in stds)
            found.append(
                {
                    "time": time,
                    "bearing_rad": math.atan2(y, x) + turned + bearing_std * rng.normal(),
                    "range_m": abs(math.hypot(x, y) + range_std * rng.normal()) + 1.0,
                    "bearing_std_rad": bearing_std,
                    "range_std_m": range_std,
                    "own_heading_std_deg": math.degrees(heading_std),
                    "snr_db": 10.0 * math.log10(threshold + rng.exponential(power)),
                }
            )
    return found


def tracked(
    folder: Path, columns: list[str], rows: list[dict[str, float | str]], sensor: str, speed: float
) -> RunRecord:
    """The record of a recording of one sensor, written as a user has it."""
    lines = [",".join(columns), *(",".join(str(row[name]) for name in columns) for row in rows)]
    (folder / "scans.csv").write_text("\n".join(lines), "utf-8")
    (folder / "radar.yaml").write_text(
        f"recording: {{bearings: east, turns: none}}\nsensors:\n  - {{name: R, position: [0, 0], {sensor}}}\n", "utf-8"
    )
    found = scenario_from_recording(folder / "radar.yaml", folder / "scans.csv", speed=speed)
    return track_recording(found.scenario, found.recording)


def lasting(record: RunRecord) -> int:
    """Tracks of ten scans and more."""
    labels = [tuple(label) for estimate in record.estimates for label in estimate.labels.tolist()]
    return sum(labels.count(label) >= 10 for label in set(labels))


def of_ships(folder: Path, seed: int, variant: Variant) -> Floats:
    """(3,) OSPA, m; number of lasting tracks; median squared error of position."""
    rng = np.random.default_rng(seed)
    ships = Ships(rng)
    rows = [dict[str, float | str](row) for row in plots(ships, rng, variant)]
    powers = f"mean_db: {SIGNAL.mean_db}, threshold_db: {SIGNAL.threshold_db}, clutter_db: {variant.known_power_db}"
    signal = f", signal: {{{powers}}}" * variant.signal
    sensor = (
        f"noise: {{kind: constant, std: {MEAN_STDS}}}, detection: {{kind: constant, probability: {DETECTION}}}, "
        f"clutter: {{kind: region, rate: {FALSE}}}{signal}"
    )
    record = tracked(folder, ["time", "bearing_rad", "range_m", *variant.columns], rows, sensor, 25.0)
    ospa, squares = list[float](), list[float]()
    for time, estimate in zip(record.times.tolist(), record.estimates, strict=True):
        if time < 60.0:
            continue
        off = estimate.means[:, np.newaxis, :2] - ships.at(time)
        distances = np.hypot(off[..., 0], off[..., 1])
        ospa.append(_ospa(distances))
        own = off[np.arange(len(off)), distances.argmin(axis=1)]
        near = distances.min(axis=1) < CUTOFF
        squares += np.einsum("ni,nij,nj->n", own[near], np.linalg.inv(estimate.covs[near, :2, :2]), own[near]).tolist()
    return np.array([np.mean(ospa), lasting(record), np.median(squares or [math.nan])])


def _ospa(distances: Floats) -> float:
    from scipy.optimize import linear_sum_assignment

    num, most = min(distances.shape), max(distances.shape)
    rows, columns = linear_sum_assignment(np.minimum(distances, CUTOFF))
    return float((np.minimum(distances, CUTOFF)[rows, columns].sum() + CUTOFF * (most - num)) / most)


def of_aircraft(folder: Path, seed: int, share: float) -> Floats:
    """(3,) mean error in the plane, m; lasting tracks; median squared error. share: of plots with an altitude."""
    aircraft = Aircraft(np.random.default_rng([seed, 1]))
    rng, rows = np.random.default_rng([seed, 2]), Rows()
    for k in range(SCANS):
        for bearing, distance, altitude in aircraft.scan(
            PERIOD * k, (0.0, 0.0, 0.0), "bearing_range_altitude"
        ).tolist():
            known = altitude if rng.uniform() < share else ""
            rows.append({"time": PERIOD * k, "bearing_rad": bearing, "range_m": distance, "altitude_m": known})
    sensor = "measurement: {kind: bearing_range_altitude}, noise: {kind: constant, std: [0.002, 40.0, 30.0]}, "
    sensor += "detection: {kind: constant, probability: 0.95}"
    record = tracked(folder, ["time", "bearing_rad", "range_m", "altitude_m"], rows, sensor, 250.0)
    errors, squares = list[float](), list[float]()
    for time, estimate in zip(record.times.tolist(), record.estimates, strict=True):
        if time < 60.0:
            continue
        off = estimate.means[:, np.newaxis, [0, 1, 4]] - aircraft.at(time)
        nearest = np.hypot(off[..., 0], off[..., 1]).argmin(axis=1)
        own = off[np.arange(len(off)), nearest]
        near = np.hypot(own[:, 0], own[:, 1]) < 2000.0
        errors += np.hypot(own[near, 0], own[near, 1]).tolist()
        covs = estimate.covs[near][:, [0, 1, 4]][:, :, [0, 1, 4]]
        squares += np.einsum("ni,nij,nj->n", own[near], np.linalg.inv(covs), own[near]).tolist()
    return np.array([np.mean(errors), lasting(record), np.median(squares)])


def table(runs: int, first: int) -> str:
    """As Markdown."""
    columns = "plots are taken by", "error, m", "worst scene, m", "lasting tracks", "squared error"
    lines = [f"| {' | '.join(columns)} |", f"| --- |{' ---: |' * (len(columns) - 1)}"]
    with tempfile.TemporaryDirectory() as name:
        folder, seeds = Path(name), range(first, first + runs)
        rows = [(each.words, [of_ships(folder, seed, each) for seed in seeds]) for each in VARIANTS]
        for share in (1.0, 0.7, 0.3):
            words = f"altitude in {100.0 * share:.0f} of 100 plots"
            rows.append((words, [of_aircraft(folder, seed, share) for seed in seeds]))
    for words, found in rows:
        error, lasts, squared = np.mean(found, axis=0).tolist()
        worst = float(np.max(found, axis=0)[0])
        lines.append(f"| {words} | {error:.1f} | {worst:.1f} | {lasts:.1f} | {squared:.2f} |")
    return "\n".join(lines)


if __name__ == "__main__":
    table_of_scenes(__doc__, "plot_accuracy.py", table)
