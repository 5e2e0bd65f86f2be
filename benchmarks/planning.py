"""CPU time of one decision of paper-a: joint and independent, by kind of belief, on one thread.

    python benchmarks/planning.py [--repeats 9]
    python benchmarks/planning.py --one-by-one    # how much longer with a reward that is a plain function

Medians over repeated decisions from the same beliefs after ten scans. An independent, straightforward program took
119 ms (joint, GLMB), 111 ms (independent, GLMB) and 16 ms (LMB) on a machine of the kind this was written on.
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from itertools import count
from typing import Any

import numpy as np
from timing import Figures, Measure, Once, cpu_seconds, repeated

from vedette.control import CauchySchwarzReward
from vedette.errors import SlowRewardWarning
from vedette.scenarios import Scenario, load_scenario
from vedette.scenarios.build import build_experiment, build_planner
from vedette.simulation.loop import run_stream
from vedette.simulation.scans import simulate_scans

KINDS = {
    "delta-GLMB": ("delta_glmb", "cm_delta_glmb"),
    "M-delta-GLMB": ("m_delta_glmb", "cm_delta_glmb"),
    "LMB": ("lmb", "clmb"),
}


def variant(kind: str) -> Scenario:
    """paper-a with another local filter and the fusion that goes with it."""
    scenario = load_scenario("paper-a")
    local, fusion = KINDS[kind]
    model = scenario.model
    changed = model.model_copy(
        update={
            "filter": model.filter.model_copy(update={"kind": local}),
            "fusion": model.fusion.model_copy(update={"kind": fusion}),
        }
    )
    return replace(scenario, model=changed)


def after_ten_scans(scenario: Scenario):  # type: ignore[no-untyped-def]
    """What is believed, and the poses, when the first decision is due."""
    experiment = build_experiment(scenario)
    truth = experiment.targets.truth(experiment.times, rng=run_stream(1, 0))
    tracker, poses = experiment.tracker, experiment.poses
    state, rngs = tracker.initial(), [run_stream(1, 1)] * experiment.num_sensors
    for step in range(10):
        scans = simulate_scans(truth.at(step)[1], poses, tracker.sensors, rngs=rngs)
        measurements = [scan.measurements for scan in scans]
        state, _ = tracker.step(state, measurements, poses, float(experiment.times[step]), rngs=rngs)
    return state, poses


def prepared(kind: str, name: str) -> Once:
    """What gives the CPU milliseconds of a decision, each time of other samples."""
    scenario = variant(kind)
    state, poses = after_ten_scans(scenario)
    planner: Any = build_planner(scenario, name, num_threads=1)
    numbers = count(1)
    planner.plan(state, poses, rng=np.random.default_rng(0))
    return lambda: 1e3 * cpu_seconds(lambda: planner.plan(state, poses, rng=np.random.default_rng(next(numbers))))


def measures() -> Iterator[Measure]:
    """A decision of each kind of belief."""
    for kind in KINDS:
        for name in ("jdm", "idm"):
            yield Measure("decision", f"paper-a, {kind}, {name}", partial(prepared, kind, name), rounds=9)


def as_a_function(predicted: Any, updated: Any) -> float:
    """Cauchy-Schwarz, in a form that cannot be laid out."""
    return CauchySchwarzReward()(predicted, updated)


def _planned(planner: Any, state: Any, poses: Any) -> None:
    planner.plan(state, poses, rng=np.random.default_rng(0))


def one_by_one() -> None:
    """How many times as long a decision of few samples takes where each reward is a call of a function."""
    warnings.simplefilter("ignore", SlowRewardWarning)
    for kind in KINDS:
        scenario = variant(kind)
        state, poses = after_ten_scans(scenario)
        for name in ("jdm", "idm"):
            planner: Any = build_planner(scenario, name, num_threads=1)
            few = replace(planner, settings=replace(planner.settings, num_samples=8))
            seconds = []
            for each in (few, replace(few, reward=as_a_function)):
                seconds.append(repeated(partial(_planned, each, state, poses), 1).least)
            print(f"{kind:12s} {name}: {seconds[1] / seconds[0]:5.1f} times as long")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("--one-by-one", action="store_true")
    asked = parser.parse_args()
    if asked.one_by_one:
        one_by_one()
        return
    for kind in KINDS:
        for name in ("jdm", "idm"):
            once = prepared(kind, name)
            least, median = Figures.of([once() for _ in range(asked.repeats)])
            print(f"{kind:12s} {name}: median {median:6.1f} ms of CPU, least {least:6.1f} ms")


if __name__ == "__main__":
    main()
