"""How long it is from a line to its estimates and to a plan, and how many scans a second a live loop takes.

    python benchmarks/live_scans.py [--sensors N] [--targets N] [--scans N] [--runs N]
    python benchmarks/live_scans.py --write docs/evidence/live-scans.md

Sensors of a generated scene (`vedette generate`) scan every second, all at one time (`together`) or each at its own
part of the second (`apart`); every line is taken by `vedette.live.LiveLoop.process` and its answers made lines, in wall
time of this process, the reading of the JSON included, without pipe or network. A line after which a plan is due is
counted under plans: its time is from the line to the plan, with the explanation; what it took of processors, all
threads together, is more than that on an idle machine, and less on a busy one. The first run is not counted. What is
printed are quantiles over all lines of all runs, and the lines a second that were taken without plans. Sensors see 250
m (`limited`) or all of the region (`full`). Decisions are made to the end, and with the limit of `--planning-timeout`.
"""

from __future__ import annotations

import argparse
import itertools
import json
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from pages import write_between

from vedette.live import LiveLoop, build_live_loop, encode_line
from vedette.scenarios import GeneratedScene, load_scenario, scene_text
from vedette.scenarios.build import build_experiment
from vedette.scenarios.from_recording import scenario_from_sensors
from vedette.simulation.experiment import Experiment
from vedette.simulation.loop import SCANS, TRUTH, run_stream, sensor_streams
from vedette.simulation.scans import simulate_scans

DECIDE_EVERY, WITHIN = 5.0, 0.03  # s
SEED = 5


def scene(
    sensors: int, targets: int, view: Any, folder: Path, within: float | None = None
) -> tuple[Experiment, LiveLoop]:
    """What is simulated, and the loop that takes it."""
    path = folder / "scene.yaml"
    path.write_text(scene_text(GeneratedScene(num_sensors=sensors, num_targets=targets, view=view)), "utf-8")
    known = scenario_from_sensors(path, decide_every=DECIDE_EVERY, plan_within=within)
    return build_experiment(load_scenario(path)), build_live_loop(known, decide_every=DECIDE_EVERY)


def lines(experiment: Experiment, run: int, scans: int, apart: bool) -> Iterator[bytes]:
    """The scans of a run as lines."""
    times = experiment.times[:scans]
    truth = experiment.targets.truth(experiment.times, rng=run_stream(SEED, run, TRUTH))
    rngs, num = sensor_streams(SEED, run, SCANS, experiment.num_sensors), experiment.num_sensors
    for step, now in enumerate(times.tolist()):
        states = truth.at(step)[1]
        found = simulate_scans(states, experiment.poses, experiment.sensors_at(step + 1), rngs=rngs)
        for s, scan in enumerate(found):
            if scan is not None:
                seen = scan.measurements[scan.measurements[:, 1] >= 0.0]  # no radar tells of another range
                told = {"sensor": s + 1, "time": now + (s / num if apart else 0.0)}
                yield json.dumps({**told, "measurements": seen.tolist()}).encode()


def timed(live: LiveLoop, sent: list[bytes]) -> tuple[list[float], list[float], list[float], list[int]]:
    """Milliseconds to estimates and to plans, those of processors, and how many targets were estimated."""
    state = live.initial()
    estimates, plans, processor, tracks = list[float](), list[float](), list[float](), list[int]()
    for line in sent:
        begun, used = time.perf_counter(), time.process_time()
        state, answers = live.process(state, line)
        for answer in answers:
            encode_line(answer)
        spent = 1e3 * (time.perf_counter() - begun)
        if "error" in answers[-1]:
            raise SystemExit(answers[-1]["error"])
        (plans if "plan" in answers[-1] else estimates).append(spent)
        if "plan" in answers[-1]:
            processor.append(1e3 * (time.process_time() - used))
        tracks.append(len(answers[0]["tracks"]))
    return estimates, plans, processor, tracks


def table(sensors: int, targets: int, scans: int, runs: int) -> Iterator[str]:
    """The lines of the table."""
    names = ("to estimates, p50, ms", "p99", "to a plan, p50, ms", "p99", "of processors, p50, ms", "p99")
    yield "| view, scans, limit | targets found | " + " | ".join([*names, "scans a second"]) + " |"
    yield "| --- |" + " ---: |" * 8
    for view, apart, within in itertools.product(("limited", "full"), (False, True), (None, WITHIN)):
        with tempfile.TemporaryDirectory() as folder:
            experiment, live = scene(sensors, targets, view, Path(folder), within)
        found = [timed(live, list(lines(experiment, run, scans, apart))) for run in range(runs + 1)][1:]
        estimates, plans, processor, tracks = ([value for each in found for value in each[i]] for i in range(4))
        limit = "none" if within is None else f"{within:g} s"
        cells = [f"{view}, {'apart' if apart else 'together'}, {limit}", f"{np.median(tracks):.0f}"]
        cells += [f"{np.quantile(values, q):.1f}" for values in (estimates, plans, processor) for q in (0.5, 0.99)]
        yield "| " + " | ".join([*cells, f"{1e3 * len(estimates) / sum(estimates):.0f}"]) + " |"
    yield ""
    yield f"{sensors} sensors, {targets} targets, {runs} runs of {scans} s, a plan every {DECIDE_EVERY:g} s."


def main() -> None:
    """Read the arguments and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sensors", type=int, default=4)
    parser.add_argument("--targets", type=int, default=20)
    parser.add_argument("--scans", type=int, default=50)
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--write", type=Path)
    given = parser.parse_args()
    text = "\n".join(table(given.sensors, given.targets, given.scans, given.runs))
    print(text)
    if given.write is not None:
        write_between(given.write, "live_scans.py", text)


if __name__ == "__main__":
    main()
