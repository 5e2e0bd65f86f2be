"""How long a user waits: a whole run of paper-a, and the start of the command line, warm and from nothing.

    python benchmarks/whole_run.py            # CPU seconds of whole runs on one core, and warm starts
    python benchmarks/whole_run.py --cold     # also the first start ever, in an empty kernel cache (about a minute)

Medians; runs in this process use one thread.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from functools import partial
from itertools import count

from timing import Figures, Measure, Once, cpu_seconds, wall_seconds

from vedette.evaluation.runs import run_scenario
from vedette.scenarios import load_scenario

_FIRST_SCAN = (
    "from vedette.scenarios import load_scenario, build\n"
    "from vedette.evaluation.runs import run_scenario\n"
    "from dataclasses import replace\n"
    "scenario = load_scenario('paper-a')\n"
    "model = scenario.model\n"
    "short = model.model_copy(update={'time': model.time.model_copy(update={'num_steps': 1}),\n"
    "    'control': model.control.model_copy(update={'decision_steps': ()})})\n"
    "run_scenario(replace(scenario, model=short), 'stationary', seed=0, num_threads=1)\n"
)


def prepared(planner: str) -> Once:
    """What gives the CPU milliseconds of a run of paper-a in this process, each time of another one."""
    scenario, numbers = load_scenario("paper-a"), count()

    def once() -> float:
        run = next(numbers)
        return 1e3 * cpu_seconds(lambda: run_scenario(scenario, planner, seed=1, run=run, num_threads=1))

    once()
    return once


def measures() -> Iterator[Measure]:
    """A run of each strategy."""
    for planner in ("jdm", "idm", "random"):
        yield Measure("whole run", f"paper-a, {planner}", partial(prepared, planner), rounds=5)


def wall_of_start(code: str, repeats: int, cache: str | None = None) -> float:
    """Median wall seconds of a fresh interpreter that runs `code`."""
    environment = os.environ | ({"VEDETTE_CACHE_DIR": cache} if cache else {})
    start = partial(subprocess.run, [sys.executable, "-c", code], check=True, env=environment)
    return Figures.of([wall_seconds(start) for _ in range(repeats)]).median


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cold", action="store_true", help="also the first start ever")
    parser.add_argument("--repeats", type=int, default=9)
    options = parser.parse_args()
    for planner in ("jdm", "idm", "random"):
        once = prepared(planner)
        median = Figures.of([once() for _ in range(options.repeats)]).median
        print(f"whole run of paper-a, {planner:6s}: {median / 1e3:6.3f} s of CPU")
    print(f"warm start to the first scan  : {wall_of_start(_FIRST_SCAN, 5):6.2f} s of wall time")
    if options.cold:
        whole = "from vedette.cli import app; app(['run', 'paper-a', '--planner', 'jdm'])"
        with tempfile.TemporaryDirectory() as cache:
            print(f"first start ever, whole JDM run: {wall_of_start(whole, 1, cache):6.1f} s of wall time")


if __name__ == "__main__":
    main()
