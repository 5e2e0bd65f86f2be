"""Modes learnt from recordings: stays and noises that `calibrate` estimates, and OSPA with the old and the new file.

    python benchmarks/learnt_modes.py --scenes 10 [--first 0]

Four targets for 200 scans, one a second, change between two modes at random: `cruise` (process noise 1 % of the speed,
mean stay 30 s) and `changes` (20 %, 10 s). The file has stays and noises that are wrong by random factors of up to
three. Noise, clutter and the probability of detection are right, and not estimated. OSPA has order 1 and a cutoff of
ten times the noise, and is in units of the noise.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from stiff_motion import Scene, written

from vedette.calibration import calibrate
from vedette.evaluation.metrics.point_ospa import ospa
from vedette.evaluation.runs import track_recording
from vedette.internal.unit_warnings import suppress_unit_warnings
from vedette.kernels.base.types import Floats
from vedette.scenarios.calibration import build_problem, calibrated_text
from vedette.scenarios.from_recording import scenario_from_recording

STREAM, NUM_SCANS, SPEED, HALF = 6102, 200, 10.0, 2500.0
TRUE = {"cruise": (0.01 * SPEED, 30.0), "changes": (0.2 * SPEED, 10.0)}


def scene(number: int) -> Scene:
    """Return a scene, the same for a number."""
    rng = np.random.default_rng([STREAM, number])
    noise, detection, clutter = SPEED * rng.uniform(0.1, 0.4), float(rng.uniform(0.8, 0.98)), 5.0
    courses = []
    for _ in range(4):
        heading = rng.uniform(-math.pi, math.pi)
        state = np.array([*rng.uniform(-1000.0, 1000.0, 2), SPEED * math.cos(heading), SPEED * math.sin(heading)])
        mode, left, places = "cruise", rng.exponential(TRUE["cruise"][1]), []
        for _ in range(NUM_SCANS):
            pushed = rng.normal(0.0, TRUE[mode][0], 2)
            state = np.concatenate([state[:2] + state[2:] + 0.5 * pushed, state[2:] + pushed])
            places.append(state[:2])
            left -= 1.0
            if left <= 0.0:
                mode = "changes" if mode == "cruise" else "cruise"
                left = rng.exponential(TRUE[mode][1])
        courses.append(places)
    truth, rows = np.array(courses), list[dict[str, Any]]()
    for k in range(NUM_SCANS):
        false = rng.uniform(-HALF, HALF, (rng.poisson(clutter), 2))
        base = {"time": f"{k:.6f}", "sensor": "camera"}
        places = [*(place + rng.normal(0.0, noise, 2) for place in truth[rng.random(4) < detection, k]), *false]
        rows += [{**base, "x_m": x, "y_m": y} for x, y in places] or [base]
    modes = {
        name: {
            "motion": {"kind": "constant_velocity", "sigma_v": float(sigma * 3.0 ** rng.uniform(-1.0, 1.0))},
            "stay_s": float(stay * 3.0 ** rng.uniform(-1.0, 1.0)),
        }
        for name, (sigma, stay) in TRUE.items()
    }
    sensor = {
        "name": "camera",
        "position": [0.0, 0.0],
        "measurement": {"kind": "position"},
        "noise": {"kind": "constant", "std": [float(noise)] * 2},
        "detection": {"kind": "constant", "probability": detection},
        "clutter": {"kind": "region", "rate": clutter},
        "extent": 0.0,
    }
    region = {"x_min": -HALF, "x_max": HALF, "y_min": -HALF, "y_max": HALF}
    file = {"region": region, "motion": {"kind": "modes", "modes": modes}, "sensors": [sensor]}
    return Scene(truth, rows, file, SPEED, noise)


def mean_ospa(own: Scene, folder: Path, text: str | None = None) -> float:
    """Return the mean OSPA of the tracks, in units of the noise."""
    made = scenario_from_recording(folder / "sensors.yaml", folder / "scans.csv", speed=own.speed, text=text)
    record = track_recording(made.scenario, made.recording)
    return float(
        np.mean(
            [
                ospa(estimate.means[:, :2], own.courses[:, k], cutoff=10.0 * own.noise, order=1.0).total / own.noise
                for k, estimate in enumerate(record.estimates)
            ]
        )
    )


def row(number: int) -> tuple[list[str], Floats]:
    """Return the lines of a scene, and OSPA before and after, and how many intervals hold the truth, and how many."""
    own, lines, inside, num = scene(number), list[str](), 0, 0
    with suppress_unit_warnings(), tempfile.TemporaryDirectory() as path:
        folder = Path(path)
        recorded = written(own, folder)
        problem = build_problem(recorded.scenario, biases=False)
        found = calibrate(problem, only=[each for each in problem.parameters if each.kind == "motion"])
        for each in found.estimates:
            _, name, *_, field = each.parameter.name.split(".")
            true = TRUE[name][field == "stay_s"]
            is_inside = each.ci_low <= true <= each.ci_high
            num, inside = num + (not math.isnan(each.ci_low)), inside + is_inside
            interval = f"{each.value:.3g} ({each.ci_low:.3g} to {each.ci_high:.3g})"
            lines.append(
                f"  {each.parameter.label:24} {each.parameter.start:.3g} -> {interval}, true {true:.3g} "
                f"{each.reason or each.kept}"
            )
        text = calibrated_text(recorded.scenario, folder / "sensors.yaml", found, None)
        before, after = mean_ospa(own, folder), mean_ospa(own, folder, text)
        true_file = yaml.safe_load(text)
        for name, (sigma, stay) in TRUE.items():
            true_file["motion"]["modes"][name] |= {"stay_s": stay}
            true_file["motion"]["modes"][name]["motion"] |= {"sigma_v": sigma}
        best = mean_ospa(own, folder, yaml.safe_dump(true_file))
    gained = found.log_likelihood - found.initial_log_likelihood
    lines.append(
        f"{number}: log likelihood {gained:+.1f}, OSPA {before:.3f} -> {after:.3f}, with the true values {best:.3f}"
    )
    return lines, np.array([before, after, best, inside, num])


def main() -> None:
    """Read the arguments and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--scenes", type=int, default=10)
    given = parser.parse_args()
    results = []
    for number in range(given.first, given.first + given.scenes):
        lines, result = row(number)
        results.append(result)
        print(*lines, sep="\n", flush=True)
    before, after, best, inside, num = np.array(results).T
    ratio = after / before
    error = ratio.std(ddof=1) / math.sqrt(len(ratio)) if len(ratio) > 1 else math.nan
    print(f"OSPA {before.mean():.3f} -> {after.mean():.3f}, with the true values {best.mean():.3f}")
    print(
        f"ratio {ratio.mean():.3f} ± {error:.3f}; intervals with the true value: {inside.sum():.0f} of {num.sum():.0f}"
    )


if __name__ == "__main__":
    main()
