"""Errors of filtered and smoothed tracks, and the time that smoothing takes.

    python benchmarks/smoothing.py [--runs N] [--first SEED] [--write docs/evidence/smoothing.md]

The sensors of a built-in scene stand still. The last row is the recording of `examples/recording`, once. Two of the
scenes are made here: two targets that cross at a small angle between scans 10 and 20 of 30, and the same two far apart.
RMSE is over the matched estimates of all runs, OSPA(2) the mean over scans and runs, by the settings of the scene. The
smoothed columns with a lag use scans of five more scan periods. Equal arguments print equal tables, but for the times.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pages import write_between

from vedette import models
from vedette.densities import Estimate, best_estimate
from vedette.evaluation import match_run, ospa2_of_run, track_recording
from vedette.filters import FactoredGlmbFilter, common_target_model
from vedette.scenarios import load_scenario
from vedette.scenarios.build import build_experiment, build_sensors
from vedette.scenarios.from_recording import scenario_from_recording
from vedette.simulation import simulate_scan
from vedette.simulation.loop import SimulationRun
from vedette.simulation.truth import Truth
from vedette.tracking import Distributed, TraceEntry, smooth

RECORDING = Path(__file__).resolve().parents[1] / "examples" / "recording"
BUILTIN = ("linear-10", "polar-10", "solent")
KINDS = ("filtered", "lag", "smoothed")
REPEATS = 5


class Run(NamedTuple):
    """A trace with the true targets, and settings of OSPA."""

    truth: Truth
    trace: Sequence[TraceEntry]
    targets: models.TargetModel
    cutoff: float
    order: float
    window: int


def built_in(name: str, seed: int) -> Run:
    """A run of a scene whose sensors stand still."""
    scenario = load_scenario(name)
    experiment, ospa = build_experiment(scenario), scenario.model.ospa
    world, trace = SimulationRun(experiment, seed=seed, moving=False), list[TraceEntry]()
    while not world.is_over:
        outcome = world.step()
        trace.append(TraceEntry(outcome.time, outcome.state.fused, outcome.estimate))
    return Run(world.truth, trace, experiment.tracker.targets, ospa.cutoff, ospa.order, ospa.window)


def two_targets(apart: float, seed: int) -> Run:
    """Two targets that meet at scan 15, at a difference of 4 m/s across, or pass at a distance `apart`, m."""
    rng, num = np.random.default_rng(seed), 30
    start = np.array([[-150.0, -30.0, 10.0, 2.0], [-150.0, 30.0 + apart, 10.0, -2.0]])
    bound = np.full(2, 1000.0)
    camera = models.SensorModel(
        models.position(),
        models.constant_noise([10.0, 10.0]),
        models.constant_detection(0.9),
        models.measurement_space_clutter(5.0, -bound, bound),
    )
    covs = np.tile(np.diag([100.0, 100.0, 4.0, 4.0]), (2, 1, 1))
    birth = models.BirthModel(np.array([0.9, 0.9]), start, covs, frozenset({1}))
    targets = models.TargetModel(models.constant_velocity(0.5), models.constant_survival(0.999), birth)
    tracker, pose = Distributed((FactoredGlmbFilter(targets, camera),)), np.zeros((1, 3))
    state, trace, states = tracker.initial(), list[TraceEntry](), []
    for k in range(num):
        own = start + k * np.concatenate([start[:, 2:], np.zeros((2, 2))], axis=1)
        states.append(own)
        scan = simulate_scan(own, pose[0], camera, rng=rng).measurements
        state, _ = tracker.step(state, [scan], pose, k + 1.0, rngs=[rng])
        trace.append(TraceEntry(k + 1.0, state.fused, best_estimate(state.fused, state.step)))
    truth = Truth(np.arange(1.0, num + 1.0), 2 * np.arange(num + 1), np.tile([0, 1], num), np.concatenate(states))
    return Run(truth, trace, targets, 100.0, 1.0, 10)


def example(seed: int) -> Run:
    """The example recording."""
    files = (RECORDING / name for name in ("radars.yaml", "scans.csv", "truth.csv"))
    found, trace = scenario_from_recording(*files), list[TraceEntry]()
    record, ospa = track_recording(found.scenario, found.recording, seed=seed, trace=trace), found.scenario.model.ospa
    targets = common_target_model([sensor.filter for sensor in build_sensors(found.scenario)])
    return Run(record.truth, trace, targets, ospa.cutoff, ospa.order, ospa.window)


def errors(run: Run, estimates: Sequence[Estimate]) -> tuple[float, int, float]:
    """Sum of squared distances, their number, and mean OSPA(2)."""
    matching = match_run(run.truth, estimates, cutoff=run.cutoff, order=run.order)
    track = ospa2_of_run(run.truth, estimates, cutoff=run.cutoff, order=run.order, window=run.window)
    return float(np.sum(matching.distances**2)), len(matching.distances), float(track[:, 0].mean())


def row(name: str, make: Callable[[int], Run], seeds: Sequence[int]) -> str:
    """A row of the table."""
    sums = {kind: np.zeros(3) for kind in KINDS}
    times = []
    for seed in seeds:
        run = make(seed)
        scans = np.array([entry.time for entry in run.trace])
        smooth(run.trace[:3], run.targets)  # compiled
        begin = time.process_time()
        whole = smooth(run.trace, run.targets)
        times.append((time.process_time() - begin) / len(scans))
        lagged = smooth(run.trace, run.targets, 5.0 * float(np.median(np.diff(np.unique(scans)))))
        for kind, found in zip(KINDS, ([entry.estimate for entry in run.trace], lagged, whole), strict=True):
            sums[kind] += errors(run, found)
    rmse = {kind: float(np.sqrt(total[0] / total[1])) for kind, total in sums.items()}
    ospa2 = {kind: float(total[2] / len(seeds)) for kind, total in sums.items()}
    words = [
        " | ".join([*(f"{own[kind]:.1f}" for kind in KINDS), f"{own['smoothed'] / own['filtered']:.2f}"])
        for own in (rmse, ospa2)
    ]
    return f"| {name} | {len(seeds)} | {' | '.join(words)} | {1e3 * statistics.median(times):.1f} |"


def cost_of_traces() -> str:
    """A sentence about the time that keeping a trace takes."""
    files = (RECORDING / name for name in ("radars.yaml", "scans.csv", "truth.csv"))
    found = scenario_from_recording(*files)
    took: dict[bool, list[float]] = {False: [], True: []}
    for number in range(2 * REPEATS):
        kept = number % 2 == 1
        begin = time.process_time()
        track_recording(found.scenario, found.recording, trace=[] if kept else None)
        took[kept].append(time.process_time() - begin)
    without, kept_s = (min(took[kept]) / len(found.recording.times) for kept in (False, True))
    return (
        f"Time of a scan of the example recording: {1e3 * without:.2f} ms without a trace, {1e3 * kept_s:.2f} ms with "
        f"one ({100.0 * (kept_s / without - 1.0):+.1f} %; CPU, least of {REPEATS})."
    )


def table(runs: int, first: int) -> Iterator[str]:
    """The table, and the sentence below it."""
    seeds = range(first, first + runs)
    columns = ("scene", "runs", "RMSE, m: filtered", "lag", "smoothed", "ratio")
    more = ("OSPA(2), m: filtered", "lag", "smoothed", "ratio", "ms")
    yield f"| {' | '.join(columns + more)} |"
    yield "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |"
    for name in BUILTIN:
        yield row(f"`{name}`", lambda seed, name=name: built_in(name, seed), seeds)
    yield row("crossing", lambda seed: two_targets(0.0, seed), seeds)
    yield row("apart", lambda seed: two_targets(500.0, seed), seeds)
    yield row("example recording", example, [0])
    yield f"\n{cost_of_traces()}"


def main() -> None:
    """Print the table, or write it into a page as well."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=10, help="of each scene")
    parser.add_argument("--first", type=int, default=0, help="seed of the first")
    parser.add_argument("--write", type=Path, help="page to write the table into")
    given = parser.parse_args()
    lines = []
    for line in table(given.runs, given.first):
        print(line, flush=True)
        lines.append(line)
    if given.write is not None:
        write_between(given.write, "smoothing.py", "\n".join(lines))


if __name__ == "__main__":
    main()
