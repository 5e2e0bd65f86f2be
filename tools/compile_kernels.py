#!/usr/bin/env python3
"""Compile what scenarios need into the cache, by running them: python tools/compile_kernels.py [SCENARIO ...]

`python dev.py release` runs this with a cache of its own, for each level of processor.
"""

from __future__ import annotations

import sys

from vedette.evaluation.precompile import precompile
from vedette.evaluation.runs import run_scenario
from vedette.scenarios import load_scenario

# Between them, every filter and fusion that `vedette init` and the README begin with.
_SCENARIOS = ("paper-a", "paper-e", "linear-10", "polar-10", "two-views-1", "shore-radar", "eight-mobile", "crowd")


def main(names: list[str]) -> None:
    """Compile for these built-in scenarios, or for those that people begin with."""
    for name in names or _SCENARIOS:
        print(f"compiling for {name} ...", file=sys.stderr, flush=True)
        scenario = load_scenario(name)
        precompile(scenario)
        run_scenario(scenario, "jdm" if len(scenario.model.sensors) > 1 else "stationary", seed=0)


if __name__ == "__main__":
    main(sys.argv[1:])
