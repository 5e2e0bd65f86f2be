"""How long a campaign takes, what of it is not the runs themselves, and how long its report takes.

    python benchmarks/campaign.py             # overhead of the machinery, one process, paired with plain runs
    python benchmarks/campaign.py --full      # also 100 runs x 3 strategies of paper-a with two workers, and its report
    python benchmarks/campaign.py --workers-of 30 100 --against ../other/src   # one worker and two, turn about

The overhead compares the same runs done by `run_campaign` (metrics, encoding, store, tables) and by a plain loop over
`run_scenario`, turn about, in CPU and in wall seconds; medians of the ratios. The full campaign and its report are the
commands of the program, each in a process of its own, with kernels that are compiled already.

`--workers-of` runs the campaign of so many runs a strategy with one worker and with two: seconds to the first run that
has landed and to the end, and CPU seconds of all processes that it starts (Linux). On a machine that others use compare
CPU seconds; `others` is how many processors these kept busy.
"""

from __future__ import annotations

import argparse
import os
import sqlite3
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from functools import partial
from pathlib import Path
from typing import Any

from timing import Measure, Once, wall_seconds

import vedette
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


_TICK = 1.0 / os.sysconf("SC_CLK_TCK") if hasattr(os, "sysconf") else 0.01


def workers_of(num_runs: int, source: Path, workers: int) -> str:
    """A line on one campaign, done by the library of `source`."""
    with tempfile.TemporaryDirectory() as place:
        spec, results = Path(place) / "full.toml", Path(place) / "results"
        spec.write_text(_FULL.replace("runs = 100", f"runs = {num_runs}"))
        program = "from vedette.cli import app; app()"
        command = [sys.executable, "-c", program, "campaign", spec, "--out", results, "--workers", workers]
        begin, idle, first = time.perf_counter(), _idle_seconds(), 0.0
        spent: dict[str, float] = {}
        quiet: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "start_new_session": True}
        environment = os.environ | {"PYTHONPATH": str(source)}
        with subprocess.Popen(list(map(str, command)), env=environment, **quiet) as process:
            while process.poll() is None:
                spent |= _cpu_seconds(process.pid)
                if not first and _has_landed(results / "campaign.sqlite"):
                    first = time.perf_counter() - begin
                time.sleep(0.02)
        wall, cpu = time.perf_counter() - begin, sum(spent.values())
        others = (os.cpu_count() or 1) - (_idle_seconds() - idle + cpu) / wall
    return f"{3 * num_runs:5} {workers:7} {first:9.2f} {wall:8.2f} {cpu:8.2f} {others:7.2f}  {source}"


def _has_landed(database: Path) -> bool:
    try:
        with closing(sqlite3.connect(f"{database.as_uri()}?mode=ro", uri=True)) as runs:
            return runs.execute("SELECT cell FROM runs LIMIT 1").fetchone() is not None
    except sqlite3.Error:  # not made yet
        return False


def _cpu_seconds(session: int) -> dict[str, float]:
    """What each living process of a session has used."""
    found = {}
    for process in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            fields = (process / "stat").read_text().rpartition(")")[2].split()
            if int(fields[3]) == session:
                found[process.name] = _TICK * (int(fields[11]) + int(fields[12]))
    return found


def _idle_seconds() -> float:
    """Of all processors since the system started."""
    return float(Path("/proc/uptime").read_text().split()[1])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--full", action="store_true", help="also a whole campaign and its report")
    parser.add_argument("--runs", type=int, default=10, help="runs of each strategy for the overhead")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--workers", type=int, default=2, help="of the full campaign")
    parser.add_argument("--workers-of", type=int, nargs="+", metavar="RUNS", help="one worker and two, nothing else")
    parser.add_argument("--against", type=Path, help="the `src` folder of another checkout, for --workers-of")
    options = parser.parse_args()
    if options.workers_of:
        sources = [Path(vedette.__file__).parents[1], *([options.against.resolve()] if options.against else [])]
        print(" runs workers first run      all      CPU  others")
        for num_runs in options.workers_of:
            for _ in range(options.repeats):
                for source in sources:
                    for workers in (1, 2):
                        print(workers_of(num_runs, source, workers), flush=True)
        return
    overhead(options.runs, options.repeats)
    if options.full:
        full(options.workers)


if __name__ == "__main__":
    main()
