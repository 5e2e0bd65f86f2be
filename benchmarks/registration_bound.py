"""How well biases can be known at best: the Cramer-Rao bound of the recordings of benchmarks/calibrating.py.

    python benchmarks/registration_bound.py [--redraws N] [--write docs/evidence/calibration.md]

Of each measurement its target is known, noise and motion are known, and there is no clutter: a Kalman filter of all
targets and biases together, linearised at the truth, has the inverse of the Fisher information as its covariance.
Prints its root mean square over the recordings, with targets that move straight and with the motion that is told.
"""

from __future__ import annotations

import argparse
import csv
import math
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from calibrating import BIASES, MODELS, RADARS, SCENES, write_scans
from pages import write_between

from vedette.kernels.base.types import Floats

NAMES = [(radar, name) for radar in RADARS for name in ("range", "bearing_deg", "clock")]
NAMES.remove(("Calshot", "clock"))  # with which the others are compared
UNKNOWN = {"range": 1000.0, "bearing_deg": math.radians(10.0), "clock": 5.0}
TOLD = 0.05  # m/s^2, of the motion that benchmarks/calibrating.py tells


def bound(scene: str, seed: int, seconds: float, sigma: float) -> Floats:
    """(8,) standard deviations of `NAMES` in SI units, of targets with accelerations held between scans."""
    rng = np.random.default_rng((seed, 1))
    with tempfile.TemporaryDirectory() as folder:
        ships = write_scans(Path(folder), SCENES[scene], seconds, seed)
        with (Path(folder) / "scans.csv").open(newline="") as file:
            rows = list(csv.DictReader(file))
    scans = {(float(row["time"]) - BIASES[row["sensor"]].get("clock", 0.0), row["sensor"]): row for row in rows}
    num, first = len(NAMES), [len(NAMES) + 4 * i for i in range(len(ships))]
    cov = np.diag([UNKNOWN[name] ** 2 for _, name in NAMES] + [1e8, 1e8, 900.0, 900.0] * len(ships))
    noise = np.diag([MODELS["noise.sigma_range"] ** 2, math.radians(MODELS["noise.sigma_bearing_deg"]) ** 2])
    last = 0.0
    for (time, radar), row in sorted(scans.items(), key=lambda each: each[0][0]):
        moved, held = np.eye(4), np.kron([(time - last) ** 2 / 2.0, time - last], np.eye(2)).reshape(2, 4).T * sigma
        moved[0, 2] = moved[1, 3] = time - last
        step = np.eye(len(cov))
        step[num:, num:] = np.kron(np.eye(len(ships)), moved)
        cov = step @ cov @ step.T
        cov[num:, num:] += np.kron(np.eye(len(ships)), held @ held.T)
        last, own = time, np.array([float(row["own_x"]), float(row["own_y"])])
        for (x, v), at in zip(ships, first, strict=True):
            if rng.random() > MODELS["detection.probability"]:
                continue
            (dx, dy), place = x + v * time - own, np.zeros((2, len(cov)))
            distance = math.hypot(dx, dy)
            slopes = np.array([[dx / distance, dy / distance], [dy / distance**2, -dx / distance**2]])
            place[:, at : at + 2] = slopes
            place[[0, 1], [NAMES.index((radar, "range")), NAMES.index((radar, "bearing_deg"))]] = 1.0
            if (radar, "clock") in NAMES:
                place[:, NAMES.index((radar, "clock"))] = -slopes @ v
            gain = cov @ place.T @ np.linalg.inv(place @ cov @ place.T + noise)
            cov = cov - gain @ place @ cov
            cov = 0.5 * (cov + cov.T)
    return np.asarray(np.sqrt(np.diag(cov)[:num]))


def table(redraws: int, seconds: float) -> Iterator[str]:
    """The lines of the table."""
    yield "| bias | ships: straight | with process noise | aircraft: straight | with process noise |"
    yield "| --- | ---: | ---: | ---: | ---: |"
    columns = []
    for scene in SCENES:
        for sigma in (0.0, TOLD):
            stds = np.array([bound(scene, seed, seconds, sigma) for seed in range(redraws)])
            columns.append(np.sqrt(np.mean(stds**2, axis=0)))
    for (radar, name), *own in zip(NAMES, *columns, strict=True):
        scale = math.degrees(1.0) if name == "bearing_deg" else 1.0
        yield f"| {radar}, {name} | " + " | ".join(f"{scale * value:.2g}" for value in own) + " |"
    yield ""
    yield f"{redraws} recordings of {seconds:g} s."


def main() -> None:
    """Read the arguments and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--redraws", type=int, default=6)
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--write", type=Path)
    given = parser.parse_args()
    lines = list(table(given.redraws, given.seconds))
    print("\n".join(lines))
    if given.write is not None:
        write_between(given.write, "registration_bound.py", "\n".join(lines))


if __name__ == "__main__":
    main()
