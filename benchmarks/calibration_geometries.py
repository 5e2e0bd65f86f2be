"""How often the intervals of a calibration cover the truth, by where the radars stand.

    python benchmarks/calibration_geometries.py [--redraws N]
    python benchmarks/calibration_geometries.py --write docs/evidence/calibration.md

Two or three radars in five arrangements see four to six ships of up to 8 m/s for five minutes. They have biases of up
to 100 m and 1.5 degrees, and noise, detection and clutter are told wrongly. Each redraw is a separate recording:
other ships, noise, clutter. For each arrangement prints how many searches converged, how many of their intervals of
95 % cover the truth, and those of biases alone. A search that did not converge has no intervals. Equal arguments print
equal tables.
"""

from __future__ import annotations

import argparse
import csv
import math
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pages import write_between

from vedette.calibration import Calibration, calibrate
from vedette.scenarios.calibration import build_problem
from vedette.scenarios.from_recording import scenario_from_recording

BIASES = ((60.0, -0.5), (-40.0, 0.8), (100.0, 1.5))  # m, degrees
PERIODS = (5.0, 7.0, 9.0)  # s
SECONDS, HALF_SIDE = 300.0, 6000.0  # of a recording; m, of clutter
STDS, DETECTED = (20.0, 0.012), 0.9  # m, rad
TOLD = """recording: {bearings: north}
motion: {kind: constant_velocity, sigma_v: 0.05, noise_model: continuous_white}
sensor_defaults:
  measurement: {kind: bearing_range}
  noise: {kind: range_dependent, sigma_range: 30, eta_range: 0.0, sigma_bearing_deg: 1.0, eta_bearing: 0.0}
  detection: {kind: constant, probability: 0.8}
  clutter: {kind: region, rate: 6}
sensors:
"""


class Geometry(NamedTuple):
    """m, where radars stand; false measurements per scan; ships, and where: all around, on a lane or to the north."""

    places: tuple[tuple[float, float], ...]
    clutter: float
    ships: int
    where: str


GEOMETRIES = {
    "two, 1 km apart, clutter 10": Geometry(((0.0, 0.0), (1000.0, 0.0)), 10, 5, "all"),
    "two, 5 km apart, a lane": Geometry(((0.0, 0.0), (5000.0, -500.0)), 2, 4, "lane"),
    "two, 10 km apart": Geometry(((-5000.0, 0.0), (5000.0, 0.0)), 4, 6, "all"),
    "three, a triangle": Geometry(((-3000.0, -3000.0), (3500.0, -2500.0), (0.0, 3500.0)), 4, 6, "all"),
    "two, 3 km apart, ships on one side": Geometry(((0.0, 0.0), (3000.0, 0.0)), 4, 5, "north"),
}


def ship(where: str, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Place half way, m, and velocity, m/s."""
    if where == "all":
        return rng.uniform(-4000, 4000, 2), rng.uniform(-8, 8, 2)
    if where == "lane":
        place = np.array([rng.uniform(-1000, 6000), rng.uniform(2500, 4000)])
        return place, np.array([rng.choice([-1, 1]) * rng.uniform(4, 8), rng.uniform(-0.5, 0.5)])
    return np.array([rng.uniform(-2000, 5000), rng.uniform(3000, 6000)]), rng.uniform(-8, 8, 2)


def write_scans(folder: Path, geometry: Geometry, rng: np.random.Generator) -> dict[tuple[int, str], float]:
    """scans.csv and radars.yaml; returns the truth of each sensor's parameters."""
    ships, text, truth = [ship(geometry.where, rng) for _ in range(geometry.ships)], TOLD, {}
    rows = list[tuple[float, str, float, float]]()
    for s, (place, (far, turned), period) in enumerate(zip(geometry.places, BIASES, PERIODS, strict=False)):
        own = np.array(place)
        text += f"  - {{name: s{s}, position: [{place[0]}, {place[1]}]}}\n"
        for at in np.arange(rng.uniform(0, period), SECONDS, period).tolist():
            offsets = [x + v * (at - SECONDS / 2) - own for x, v in ships if rng.random() < DETECTED]
            false = [rng.uniform(-HALF_SIDE, HALF_SIDE, 2) - own for _ in range(rng.poisson(geometry.clutter))]
            for i, (dx, dy) in enumerate([*offsets, *false]):
                noise = rng.normal(0, STDS) if i < len(offsets) else np.zeros(2)
                reach = max(math.hypot(dx, dy) + noise[0] + far, 0.0)
                rows.append((at, f"s{s}", reach, (math.degrees(math.atan2(dx, dy) + noise[1]) + turned) % 360.0))
        truth |= {(s, "range"): far, (s, "bearing_deg"): turned, (s, "clock"): 0.0, (s, "noise.sigma_range"): STDS[0]}
        truth |= {(s, "noise.sigma_bearing_deg"): math.degrees(STDS[1]), (s, "detection.probability"): DETECTED}
        truth[s, "clutter.rate"] = geometry.clutter
    with (folder / "scans.csv").open("w", newline="") as file:
        csv.writer(file).writerows(
            [("time", "sensor", "range_m", "bearing_deg"), *sorted(rows, key=lambda row: row[0])]
        )
    (folder / "radars.yaml").write_text(text, "utf-8")
    return truth


def redraw(name: str, seed: int) -> tuple[Calibration, dict[tuple[int, str], float]]:
    """One recording, calibrated; and the truth."""
    with tempfile.TemporaryDirectory() as place:
        folder, rng = Path(place), np.random.default_rng([seed, list(GEOMETRIES).index(name)])
        truth = write_scans(folder, GEOMETRIES[name], rng)
        scenario = scenario_from_recording(folder / "radars.yaml", folder / "scans.csv", speed=8.0).scenario
        return calibrate(build_problem(scenario, prior_scale=10.0)), truth


def lines(redraws: int) -> Iterator[str]:
    """The table."""
    yield "| radars | converged | intervals that cover | of biases |"
    yield "| --- | ---: | ---: | ---: |"
    total = np.zeros((2, 2), np.int64)
    for name in GEOMETRIES:
        counts, converged = np.zeros((2, 2), np.int64), 0
        for seed in range(redraws):
            calibration, truth = redraw(name, seed)
            converged += calibration.converged
            for each in calibration.estimates:
                value = truth[each.parameter.sensor, each.parameter.name]
                if not math.isnan(each.ci_low):
                    covers = each.ci_low <= value <= each.ci_high
                    counts += np.outer([1, each.parameter.kind == "bias"], [covers, 1])
        total += counts
        shares = " | ".join(f"{own[0]} of {own[1]}" for own in counts)
        yield f"| {name} | {converged} of {redraws} | {shares} |"
    share = 100.0 * total[0, 0] / max(total[0, 1], 1)
    yield f"\nOf all, {total[0, 0]} of {total[0, 1]} cover the truth, {share:.1f} %."
    yield f"\n{redraws} recordings of {SECONDS:.0f} s of each."


def main() -> None:
    """See the top of the file."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--redraws", type=int, default=6)
    parser.add_argument("--write", type=Path, metavar="PAGE")
    given = parser.parse_args()
    text = "\n".join(lines(given.redraws))
    print(text)
    if given.write:
        write_between(given.write, "calibration_geometries.py", text)


if __name__ == "__main__":
    main()
