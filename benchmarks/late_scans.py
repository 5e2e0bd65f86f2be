"""What late scans cost, and what it costs to drop them.

    python benchmarks/late_scans.py [--scenario NAME] [--runs N] [--delay S] [--window S]
    python benchmarks/late_scans.py --scenario paper-a --write docs/evidence/late-scans.md

The sensors of a scenario stand still and scan as it says; a share of their scans arrives late, uniformly by up to
`--delay` seconds, each scan by itself. After every scan time the estimate is read off what has arrived by then,
predicted to now. Prints for each share late the OSPA distance, with its standard error over the runs, where what is
late is put in its place (`OutOfSequenceTracker`) and where it is dropped; how many steps were worked for each scan; the
CPU time of a scan; and the memory that a second of window holds (instants as pickled). A second table has the mean OSPA
of the median and of the worst run, and the share of runs that end with a lost target. Runs are paired: the truth and
the scans are the same in every line. Equal arguments print equal tables, but for the times.
"""

from __future__ import annotations

import argparse
import pickle
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pages import write_between

from vedette.evaluation import match_run, ospa_of_run
from vedette.evaluation.tail_summary import summarise_tail, tail_header
from vedette.scenarios import load_scenario
from vedette.scenarios.build import build_experiment
from vedette.simulation.experiment import Experiment
from vedette.simulation.loop import SCANS, TRUTH, run_stream, sensor_streams
from vedette.simulation.scans import simulate_scans
from vedette.simulation.truth import Truth
from vedette.tracking import OutOfSequenceTracker, SensorScan, Timeline

SHARES = (0.0, 0.1, 0.2, 0.3, 0.5)
WAYS = ("put in place", "dropped")
SEED = 11
_DROPS = 1e-9  # s; a window in which nothing is late


class Outcome(NamedTuple):
    """Of one run: mean OSPA, m; steps a scan; CPU ms a scan; bytes held a second of window."""

    ospa: float
    ends_lost: float  # 1 where a target has no estimate at the last scan, else 0
    steps: float
    milliseconds: float
    held: float


def run(experiment: Experiment, number: int, share: float, delay: float, window: float) -> Outcome:
    """One run of which a share of the scans is late."""
    truth = experiment.targets.truth(experiment.times, rng=run_stream(SEED, number, TRUTH))
    arrivals = sorted(arriving(experiment, truth, number, share, delay), key=lambda pair: pair[0])
    late = OutOfSequenceTracker(experiment.tracker, experiment.poses, window)
    timeline, estimates, steps, spent, place = late.initial(), [], 0, 0.0, 0
    for step, now in enumerate(experiment.times.tolist(), start=1):
        begun = time.process_time()
        while place < len(arrivals) and arrivals[place][0] <= now:
            timeline, info = late.process(timeline, [arrivals[place][1]])
            steps, place = steps + len(info.steps), place + 1
        spent += time.process_time() - begun
        estimates.append(experiment.estimate(late.state_at(timeline, now).fused, step))
    cutoff = load_scenario(experiment.name).model.ospa.cutoff
    ospa = float(ospa_of_run(truth, estimates, cutoff=cutoff, order=1.0)[:, 0].mean())
    lost = match_run(truth, estimates, cutoff=cutoff, order=1.0).num_missed[-1] > 0
    return Outcome(ospa, float(lost), steps / place, 1e3 * spent / place, held(timeline))


def arriving(
    experiment: Experiment, truth: Truth, number: int, share: float, delay: float
) -> Iterator[tuple[float, SensorScan]]:
    """Every scan and when it arrives."""
    rngs, luck = sensor_streams(SEED, number, SCANS, experiment.num_sensors), np.random.default_rng((SEED, number))
    for step, now in enumerate(experiment.times.tolist()):
        scans = simulate_scans(truth.at(step)[1], experiment.poses, experiment.sensors_at(step + 1), rngs=rngs)
        for s, scan in enumerate(scans):
            waits = delay * luck.random() if luck.random() < share else 0.0
            if scan is not None:
                yield now + waits, SensorScan(s, now, scan.measurements, experiment.poses[s])


def held(timeline: Timeline) -> float:
    """Bytes for each second between the first and the last instant that are kept."""
    if len(timeline.entries) < 2:
        return 0.0
    seconds = timeline.entries[-1].time - timeline.entries[0].time
    return len(pickle.dumps(timeline.entries)) / seconds


def table(name: str, runs: int, delay: float, window: float) -> Iterator[str]:
    """The lines of the table."""
    experiment = build_experiment(load_scenario(name))
    run(experiment, 0, 0.5, delay, window)  # compiles
    yield "| late | put in place, OSPA, m | dropped, m | steps per scan | ms per scan | kB per second of window |"
    yield "| ---: | ---: | ---: | ---: | ---: | ---: |"
    tails = []
    for share in SHARES:
        whole = [run(experiment, number, share, delay, window) for number in range(runs)]
        dropped = [run(experiment, number, share, delay, _DROPS) for number in range(runs)]
        tails += [
            [f"{share:.0%}", way, *tail_cells(runs_of)] for way, runs_of in zip(WAYS, (whole, dropped), strict=True)
        ]
        means = np.mean([each[2:] for each in whole], axis=0)
        cells = [f"{share:.0%}", with_error(whole), with_error(dropped), f"{means[0]:.2f}", f"{means[1]:.2f}"]
        yield "| " + " | ".join([*cells, f"{means[2] / 1e3:.1f}"]) + " |"
    yield ""
    yield f"`{name}`, {runs} paired runs, late by up to {delay:g} s, window {window:g} s."
    yield ""
    yield "| " + " | ".join(["late", "late scans are", *tail_header("m")]) + " |"
    yield "| ---: | --- | ---: | ---: | ---: |"
    yield from ("| " + " | ".join(row) + " |" for row in tails)


def tail_cells(outcomes: list[Outcome]) -> tuple[str, str, str]:
    """Median, worst run, and share of runs that end with a lost target."""
    return summarise_tail([outcome.ospa for outcome in outcomes], [outcome.ends_lost for outcome in outcomes]).cells()


def with_error(outcomes: list[Outcome]) -> str:
    """Mean and standard error."""
    values = np.array([outcome.ospa for outcome in outcomes])
    return f"{values.mean():.2f} ± {values.std(ddof=1) / np.sqrt(len(values)):.2f}"


def main() -> None:
    """Read the arguments and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenario", default="three-positions")
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--delay", type=float, default=5.0)
    parser.add_argument("--window", type=float, default=10.0)
    parser.add_argument("--write", type=Path)
    given = parser.parse_args()
    lines = list(table(given.scenario, given.runs, given.delay, given.window))
    print("\n".join(lines))
    if given.write is not None:
        write_between(given.write, "late_scans.py", "\n".join(lines))


if __name__ == "__main__":
    main()
