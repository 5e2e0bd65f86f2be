"""How long a campaign takes, what of it is not the runs themselves, and how long its report takes.

    python benchmarks/campaign.py             # overhead of the machinery, one process, paired with plain runs
    python benchmarks/campaign.py --full      # also 100 runs x 3 strategies of paper-a with two workers, and its report

The overhead compares the same runs done by `run_campaign` (metrics, encoding, store, tables) and by a plain loop over
`run_scenario`, turn about, in CPU and in wall seconds; medians of the ratios. The full campaign and its report are the
commands of the program, each in a process of its own, with kernels that are compiled already.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from timing import Measure, Once, wall_seconds

from vedette.campaigns import CampaignSpec, open_results, resolve, run_campaign
from vedette.evaluation.runs import run_scenario

_PLANNERS = ("jdm", "idm", "random")
_FULL = 'name = "full"\nscenarios = ["paper-a"]\nplanners = ["jdm", "idm", "random"]\nruns = 100\n'


def overhead(num_runs: int, repeats: int) -> None:
    """Print by how much a campaign of one process takes longer than its runs alone."""
    campaign = resolve(CampaignSpec(name="x", scenarios=("paper-a",), planners=_PLANNERS, runs=num_runs))
    for cell in campaign.cells:  # loads the kernels
        run_scenario(cell.scenario, cell.planner, seed=0, num_threads=1)
    cpu, wall = [], []
    for _ in range(repeats):
        plain = _spent(
            lambda: [run_scenario(c.scenario, c.planner, seed=0, run=n, num_threads=1) for c, n in campaign.tasks]
        )
        with tempfile.TemporaryDirectory() as folder:
            whole = _spent(lambda: run_campaign(campaign, Path(folder) / "results"))
        cpu.append(whole[0] / plain[0] - 1.0)
        wall.append(whole[1] / plain[1] - 1.0)
        print("  plain {:6.2f} s CPU {:6.2f} s wall; campaign {:6.2f} s CPU {:6.2f} s wall".format(*plain, *whole))
    print(f"overhead of the machinery: {statistics.median(cpu):.1%} of CPU, {statistics.median(wall):.1%} of wall time")


def _spent(work: Callable[[], object]) -> tuple[float, float]:
    cpu, wall = time.process_time(), time.perf_counter()
    work()
    return time.process_time() - cpu, time.perf_counter() - wall


def program(*arguments: object) -> None:
    """Run `vedette` as another process, with the library that this one has."""
    given = [sys.executable, "-c", "from vedette.cli import app; app()", *map(str, arguments)]
    subprocess.run(given, check=True, stdout=sys.stderr, env=os.environ)


def prepared(num_runs: int) -> Once:
    """What gives the wall seconds of so many runs of each strategy with two workers."""

    def once() -> float:
        with tempfile.TemporaryDirectory() as place:
            spec = Path(place) / "full.toml"
            spec.write_text(_FULL.replace("runs = 100", f"runs = {num_runs}"))
            return wall_seconds(lambda: program("campaign", spec, "--out", Path(place) / "results", "--workers", 2))

    return once


def measures() -> Iterator[Measure]:
    """The campaign that is spoken of, and one that is over as soon as it has begun."""
    for num_runs, rounds in ((2, 2), (100, 1)):
        name = f"paper-a, {num_runs} runs x 3 strategies, two workers"
        yield Measure("campaign", name, partial(prepared, num_runs), unit="s", rounds=rounds, long=True)


def full(workers: int) -> None:
    """Print the wall time of the whole campaign by the command line, and of its report."""
    with tempfile.TemporaryDirectory() as place:
        spec, results, page = Path(place) / "full.toml", Path(place) / "results", Path(place) / "report.html"
        spec.write_text(_FULL)
        wall = wall_seconds(lambda: program("campaign", spec, "--out", results, "--workers", workers))
        opened = open_results(results)
        spent = sum(float(sum(stage.sum() for stage in run.record.timings.values())) for run in opened.runs())
        print(f"100 runs x 3 strategies of paper-a, {workers} workers: {wall:.1f} s of wall time")
        print(f"  of the workers' time in runs: {spent / (workers * wall):.0%}")
        wall = wall_seconds(lambda: program("report", results, "--out", page))
        print(f"report: {wall:.1f} s of wall time, {page.stat().st_size / 1e6:.1f} MB")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--full", action="store_true", help="also a whole campaign and its report")
    parser.add_argument("--runs", type=int, default=10, help="runs of each strategy for the overhead")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--workers", type=int, default=2, help="of the full campaign")
    options = parser.parse_args()
    overhead(options.runs, options.repeats)
    if options.full:
        full(options.workers)


if __name__ == "__main__":
    main()
