"""GOSPA of the estimators on the same beliefs of the default filter.

    python benchmarks/estimators.py [--runs N] [--scenes WORD ...]

A position sensor (noise 10 m, clutter 10) sees all of a square of a kilometre for 40 scans. Targets start at 5, 10 or
20 sites, or five start side by side, 25 m apart, and move in parallel. They are scripted (each lives to the end), or
drawn from the model that the filter has. A scene is taken if any of the words is in its name.

Prints a Markdown table for each order p of GOSPA (c = 100 m, alpha = 2): the mean of `least_ospa` over runs, and the
paired differences of the others from it, with standard errors. The value of a run is the p-th root of the mean of
GOSPA^p over its scans from the fifth.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from prior_targets import PriorTargets
from scenes import Scene, own, site, track

from vedette.densities import Estimate, least_gospa_estimate, least_ospa_estimate, marginal_estimate
from vedette.evaluation import gospa_of_run, summarise
from vedette.scenarios.build import build_experiment
from vedette.simulation import SimulationRun

CUTOFF, FIRST_SCAN, NUM_SCANS, SEED = 100.0, 5, 40, 1
ESTIMATORS = ("least_ospa", "marginal .5", "marginal .4", "least_gospa")


def scenes() -> Iterator[tuple[Scene, bool]]:
    """Each scene, and whether its targets are drawn from the filter's model."""
    for probability in (0.7, 0.9):
        sensor = {"sensors.*.detection.probability": probability, "sensors.*.clutter.rate": 10.0}
        abreast = [[-250.0, 25.0 * (i - 2.5)] for i in range(5)]
        fields = {
            **sensor,
            "targets.tracks": [track((*place, 12.0, 0.0)) for place in abreast],
            "birth.sites": [site(place, 15.0, 0.05, 10.0) for place in abreast],
        }
        yield own(f"parallel, P_D {probability}", fields), False
        for num in (5, 10, 20):
            rng = np.random.default_rng(1000 + num)
            places, courses = rng.uniform(-450.0, 450.0, (num, 2)), rng.uniform(0.0, 2.0 * math.pi, num)
            speeds = 6.0 * np.column_stack([np.cos(courses), np.sin(courses)])
            starts = rng.integers(1, 16, num).tolist()
            fields = {
                **sensor,
                "targets.tracks": [track((*a, *b), k) for a, b, k in zip(places, speeds, starts, strict=True)],
                "birth.sites": [site(place.tolist(), 20.0, 0.03, 8.0) for place in places],
            }
            yield own(f"{num} scripted, P_D {probability}", fields), False
            yield own(f"{num} sites, drawn, P_D {probability}", fields), True


def estimates_of(belief: Any, order: float) -> tuple[Estimate, ...]:
    """Those of `ESTIMATORS`."""
    return (
        least_ospa_estimate(belief),
        marginal_estimate(belief),
        marginal_estimate(belief, 0.4),
        least_gospa_estimate(belief, CUTOFF, order),
    )


def measured(scene: Scene, drawn: bool, run: int) -> np.ndarray:
    """(2, num_estimators) GOSPA of a run for p = 1 and p = 2."""
    experiment = build_experiment(scene.scenario(run))
    if drawn:
        experiment = replace(experiment, targets=PriorTargets(experiment.tracker.targets))
    world, beliefs = SimulationRun(experiment, seed=SEED, run=run), []
    while not world.is_over:
        beliefs.append(world.step().state.fused)
    found = []
    for order in (1.0, 2.0):
        several = zip(*(estimates_of(belief, order) for belief in beliefs), strict=True)
        totals = [gospa_of_run(world.truth, own, cutoff=CUTOFF, order=order).total for own in several]
        found.append([np.mean(total[FIRST_SCAN - 1 :] ** order) ** (1.0 / order) for total in totals])
    return np.array(found)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=24, help="at least 2")
    parser.add_argument("--scenes", nargs="*", default=[""], metavar="WORD")
    options = parser.parse_args()
    tables: list[list[str]] = [[], []]
    for scene, drawn in scenes():
        if not any(word in scene.name for word in options.scenes):
            continue
        values = np.array([measured(scene, drawn, run) for run in range(options.runs)])
        for p, lines in enumerate(tables):
            first = values[:, p, 0]
            others = [summarise(values[:, p, e] - first) for e in range(1, len(ESTIMATORS))]
            cells = [f"{first.mean():.2f}", *(f"{one.mean:+.2f} ± {one.standard_error:.2f}" for one in others)]
            lines.append(f"| {scene.name} | " + " | ".join(cells).replace("-", "\N{MINUS SIGN}") + " |")
            print(f"p = {p + 1}: {lines[-1]}", flush=True)
    for p, lines in enumerate(tables):
        print(f"\np = {p + 1}, {options.runs} runs:\n\n| scene | " + " | ".join(ESTIMATORS) + " |")
        print("| --- |" + " ---: |" * len(ESTIMATORS), *lines, sep="\n")


if __name__ == "__main__":
    main()
