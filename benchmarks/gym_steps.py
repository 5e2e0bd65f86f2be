"""What a step of a world costs, and a decision in an environment, by stage, on one core.

    python benchmarks/gym_steps.py [--repeats 15]

Runs of paper-a, 40 scans of two sensors with three decisions, sensors sent at random: with LMB filters, and with the
scenario's own. CPU seconds, medians of the repeats; stages by the wall clock inside them, as shares of their sum.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
from timing import Figures, Measure, Once, cpu_seconds

from vedette.gym import ScenarioEnv
from vedette.scenarios import Scenario, load_scenario, replace_fields
from vedette.simulation import SimulationRun
from vedette.tracking import StageTimer

FILTERS: dict[str, dict[str, Any]] = {
    "lmb": {"filter": {"kind": "lmb"}, "fusion": {"kind": "sequential"}},
    "delta_glmb": {},
}


def scene(kind: str) -> Scenario:
    """Paper-a, with filters of a kind."""
    return replace_fields(load_scenario("paper-a"), FILTERS[kind])


def walked(env: ScenarioEnv, run: int, stages: StageTimer | None = None) -> int:
    """All scans of a run, by `SimulationRun.step` alone; how many."""
    experiment = env.episodes.built.experiment
    world, rng = SimulationRun(experiment, seed=1, run=run), np.random.default_rng(run)
    while not world.is_over:
        moment = world.step(stages=stages)
        if moment.step in experiment.decision_steps:
            platforms = zip(experiment.platforms, moment.poses, strict=True)
            rows = [platform.actions(pose) for platform, pose in platforms]
            world.follow([own[rng.integers(len(own))] for own in rows])
    return len(experiment.times)


def decided(env: ScenarioEnv, run: int) -> int:
    """All decisions of a run in an environment; how many."""
    env.reset(seed=1, options={"run": run})
    rng, over, num = np.random.default_rng(run), False, 0
    while not over:
        *_, over, _ = env.step(rng.integers(env.action_space.nvec))  # type: ignore[attr-defined]
        num += 1
    return num


def prepared(kind: str, work: Any = walked) -> Once:
    """What gives the steps a CPU second of ten runs."""
    env = ScenarioEnv(scene(kind))
    work(env, 0)

    def once() -> float:
        counts: list[int] = []
        spent = cpu_seconds(lambda: counts.extend(work(env, run) for run in range(10)))
        return sum(counts) / spent

    return once


def measures() -> Iterator[Measure]:
    """Steps of worlds."""
    for kind in FILTERS:
        yield Measure("gym", f"steps of paper-a, {kind}", partial(prepared, kind), unit="1/s")


def shares(kind: str) -> dict[str, float]:
    """Of the time of all scans of ten runs, with what an observation takes each time."""
    env, stages = ScenarioEnv(scene(kind)), StageTimer()
    for run in range(10):
        walked(env, run, stages)
    env.reset(seed=1)
    context, start = env.episodes.context, time.perf_counter()
    for _ in range(30):
        env.episodes.built.encoder.decision_context(context.state, context.poses)
    spent = stages.seconds | {"observation": time.perf_counter() - start}
    return {name: seconds / sum(spent.values()) for name, seconds in spent.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=15)
    repeats = parser.parse_args().repeats
    for kind in FILTERS:
        steps, decisions = (
            Figures.of([once() for _ in range(repeats)]).median for once in (prepared(kind), prepared(kind, decided))
        )
        told = ", ".join(f"{name} {share:.0%}" for name, share in shares(kind).items())
        print(f"{kind:10s}: {steps:6.0f} world steps and {decisions:5.0f} decisions a CPU second; {told}", flush=True)


if __name__ == "__main__":
    main()
