"""How well biases that drift are followed while scans come in.

    python benchmarks/drifting.py [--scene ships|aircraft] [--redraws N] [--first S] [--window S] [--every S]
    python benchmarks/drifting.py --write docs/evidence/drifting-biases.md

The radars of benchmarks/calibrating.py, whose biases change by 0.5 m/s, and of two by 0.1 degrees a minute, too. They
are calibrated by their first scans; the others come one by one to an `OnlineBiasEstimator`, and without biases to a
tracker that knows the noise, detection and clutter: with biases taken off as they are followed, as found at first, as
they are in truth, and with none taken off. Prints the root mean square error of what is taken off, over radars and
redraws, minute by minute; and mean OSPA from a minute later on. Equal arguments print equal tables, but for the times.
"""

from __future__ import annotations

import argparse
import math
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from calibrating import BIASES, RADARS, SCENES, Scene, write_scans
from pages import write_between

from vedette.calibration import OnlineBiasEstimator, Problem, calibrate, warm_started
from vedette.evaluation import ospa
from vedette.kernels.base.types import Floats
from vedette.models import Bias
from vedette.recorded.scan_times import RecordedScan, remove_bias
from vedette.scenarios.build import build_poses, build_tracking
from vedette.scenarios.calibration import build_problem
from vedette.scenarios.from_recording import scenario_from_recording
from vedette.tracking import OutOfSequenceTracker, SensorScan

DEGREES_A_SECOND = 0.1 / 60.0
DRIFTS = {
    "Calshot": {"range": 0.5},
    "Ryde": {"range": -0.5, "bearing_deg": DEGREES_A_SECOND},
    "boat": {"range": 0.5, "bearing_deg": -DEGREES_A_SECOND},
}
WAYS = ("none", "once", "followed", "truth")


class Outcome(NamedTuple):
    """Of one redraw.

    times: (n,) s, of the scans after the first ones. range_errors, bearing_errors: (n, ways) m and degrees. ospa:
    (ways,) m. seconds: CPU s of all calibrations. num: how many they were.
    """

    times: Floats
    range_errors: Floats
    bearing_errors: Floats
    ospa: Floats
    seconds: float
    num: int


def true_bias(sensor: int, at: float) -> Bias:
    """Of a sensor at a time."""
    name = list(RADARS)[sensor]
    now = {key: value + at * DRIFTS[name].get(key, 0.0) for key, value in BIASES[name].items()}
    return Bias(now["range"], math.radians(now["bearing_deg"]), now.get("clock", 0.0))


def redraw(folder: Path, scene: Scene, seconds: float, seed: int, first: float, window: float, every: float) -> Outcome:
    """One recording whose scans come in one by one."""
    ships = write_scans(folder, scene, seconds, seed, drifts=DRIFTS)
    told = scenario_from_recording(folder / "told.yaml", folder / "scans.csv", speed=scene.speed).scenario
    true = scenario_from_recording(folder / "true.yaml", folder / "scans.csv", speed=scene.speed).scenario
    problem, tracking = build_problem(told, prior_scale=10.0), build_tracking(true)
    at_first = calibrate(replace(problem, recording=problem.recording.between(0.0, first)))
    problem = warm_started(problem, at_first)
    once = problem.with_biases(np.array([each.start for each in problem.parameters]))
    late = OutOfSequenceTracker(tracking.tracker, build_poses(true), window=5.0)
    follower, spent = OnlineBiasEstimator(problem, window, every), 0.0
    state = follower.initial()
    timelines, rows, scores = [late.initial()] * len(WAYS), list[tuple[float, ...]](), list[list[float]]()
    for scan in problem.recording.arrivals():
        if scan.time < first - window:
            continue
        begun = time.process_time()
        state, _ = follower.process(state, scan)
        spent += time.process_time() - begun
        if state.num_estimates == 0:
            continue
        now = problem.with_biases(follower.biases(state, scan.time))[scan.sensor].bias
        truth = true_bias(scan.sensor, scan.time + problem.recording.start)
        biases = [Bias(), once[scan.sensor].bias, now, truth]
        errors = [abs(bias.range - truth.range) for bias in biases[:-1]]
        turns = [math.degrees(abs(bias.bearing - truth.bearing)) for bias in biases[:-1]]
        rows.append((scan.time, *errors, *turns))
        scores.append([])
        for w, bias in enumerate(biases):
            timelines[w], _ = late.process(timelines[w], [without(scan, problem, bias)])
            belief = timelines[w].state
            assert belief.time is not None
            found = tracking.estimate(belief.fused, belief.step).means[:, :2]
            there = np.array([x + v * (belief.time + problem.recording.start) for x, v in ships])
            scores[-1].append(float(ospa(found, there, cutoff=scene.cutoff, order=1.0).total))
    table = np.array(rows)
    settled = table[:, 0] > first + 60.0  # tracks have to begin
    num = len(WAYS) - 1
    parts = table[:, 0], table[:, 1 : num + 1], table[:, num + 1 :]
    return Outcome(*parts, np.array(scores)[settled].mean(axis=0), spent, state.num_estimates)


def without(scan: SensorScan, problem: Problem, bias: Bias) -> SensorScan:
    """A scan without a bias."""
    site, recorded_scan = (
        replace(problem.sites[scan.sensor], bias=bias),
        RecordedScan(scan.time, scan.sensor, scan.measurements, scan.pose),
    )
    found = remove_bias(recorded_scan, site, problem.recording.bearings[scan.sensor])
    return SensorScan(scan.sensor, found.time, found.scan, found.pose)


def table(outcomes: list[Outcome], seconds: float) -> Iterator[str]:
    """The lines of the tables."""
    yield "| s | range, m: none | once | followed | bearing, degrees: none | once | followed |"
    yield "| ---: | ---: | ---: | ---: | ---: | ---: | ---: |"
    times = np.concatenate([each.times for each in outcomes])
    errors = np.concatenate([np.hstack([each.range_errors, each.bearing_errors]) for each in outcomes])
    for low in np.arange(60.0, seconds, 60.0).tolist():
        own = errors[(times >= low) & (times < low + 60.0)]
        if len(own):
            rms = np.sqrt(np.mean(own**2, axis=0))
            cells = [f"{value:.3g}" for value in rms]
            yield f"| {low:.0f} to {low + 60.0:.0f} | " + " | ".join(cells) + " |"
    yield ""
    scores = np.array([each.ospa for each in outcomes])
    means, spreads = scores.mean(axis=0), scores.std(axis=0, ddof=1) / math.sqrt(len(scores))
    cells = [f"{way} {mean:.1f} ± {spread:.1f}" for way, mean, spread in zip(WAYS, means, spreads, strict=True)]
    yield f"OSPA, m: {', '.join(cells)}."
    num = sum(each.num for each in outcomes)
    yield f"CPU time: {sum(each.seconds for each in outcomes) / num:.1f} s each time that biases are found."


def main() -> None:
    """Read the arguments and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", choices=SCENES, default="aircraft")
    parser.add_argument("--redraws", type=int, default=4)
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--first", type=float, default=120.0)
    parser.add_argument("--window", type=float, default=60.0)
    parser.add_argument("--every", type=float, default=30.0)
    parser.add_argument("--write", type=Path)
    given = parser.parse_args()
    outcomes = list[Outcome]()
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(given.redraws):
            times = given.first, given.window, given.every
            outcomes.append(redraw(Path(folder), SCENES[given.scene], given.seconds, seed, *times))
    what = f"{len(outcomes)} recordings of {given.seconds:g} s of {given.scene}, calibrated at {given.first:g} s"
    what += f", followed in windows of {given.window:g} s, every {given.every:g} s."
    lines = [*table(outcomes, given.seconds), "", what]
    print("\n".join(lines))
    if given.write is not None:
        write_between(given.write, f"drifting.py --scene {given.scene}", "\n".join(lines))


if __name__ == "__main__":
    main()
