"""CPU time of one scan of a filter, in the built-in scenario linear-10 or another with one sensor or more.

    python benchmarks/filter_scan.py [--scenario NAME] [--runs N]

Every filter sees the same scans of the first sensor, which stands still. The median is over the scans of all runs, in
CPU time of this process, checks and the conversion of the arguments included. OSPA of the estimates (c = 100 m, p = 1)
stands beside it, since time can be bought with accuracy.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from timing import Measure, Once

from vedette import filters
from vedette.densities import IidCluster, MultiBernoulli, Poisson, map_estimate, unlabelled_estimate
from vedette.evaluation import ospa_of_run
from vedette.filters import CbMemberFilter, CphdFilter, DeltaGlmbFilter, Filter, LmbFilter, PhdFilter
from vedette.models import SensorModel, TargetModel
from vedette.scenarios import load_scenario
from vedette.scenarios.build import build_experiment, build_sensors
from vedette.simulation import Truth, simulate_scan

Run = tuple[Truth, list[np.ndarray]]


def simulated(name: str, num_runs: int) -> tuple[DeltaGlmbFilter, np.ndarray, np.ndarray, list[Run]]:
    """Filter, pose and times of the scenario's first sensor, and truth and scans of each run."""
    experiment = build_experiment(load_scenario(name))
    tracker, pose = build_sensors(load_scenario(name))[0].filter, experiment.poses[0]
    if not isinstance(tracker, DeltaGlmbFilter):
        raise SystemExit(f"{name}: expected a scenario with a delta-GLMB filter")
    runs = []
    for run in range(num_runs):
        rng = np.random.default_rng(run)
        truth = experiment.targets.truth(experiment.times, rng=rng)
        states = [truth.at(k)[1] for k in range(len(experiment.times))]
        runs.append((truth, [simulate_scan(x, pose, tracker.sensor, rng=rng).measurements for x in states]))
    return tracker, pose, experiment.times, runs


def variants(tracker: DeltaGlmbFilter) -> dict[str, Filter]:
    parts = (tracker.targets, tracker.sensor, tracker.limits)
    # Versions that are timed beside this one need not have it.
    newer = {"factored GLMB": filters.FactoredGlmbFilter(*parts)} if hasattr(filters, "FactoredGlmbFilter") else {}
    ranked: Any = "ranked"
    gibbs: Any = "gibbs"
    if hasattr(filters, "BeliefPropagation"):
        ranked, gibbs = filters.RankedAssignment(), filters.Gibbs()
        newer["LMB, belief propagation"] = LmbFilter(*parts, filters.BeliefPropagation())
    return {
        **newer,
        "delta-GLMB, ranked": replace(tracker, assignment=ranked, marginalised=False),
        "delta-GLMB, Gibbs": replace(tracker, assignment=gibbs, marginalised=False),
        "M-delta-GLMB, ranked": replace(tracker, assignment=ranked, marginalised=True),
        "LMB": LmbFilter(*parts),
        "LMB, UKF": LmbFilter(*_unscented(tracker), tracker.limits),
        "PHD": PhdFilter(*parts),
        "CPHD": CphdFilter(*parts),
        "CB-MeMBer": CbMemberFilter(*parts),
    }


def _unscented(tracker: DeltaGlmbFilter) -> tuple[TargetModel, SensorModel]:
    motion = replace(tracker.targets.motion, method="ukf")
    return replace(tracker.targets, motion=motion), replace(tracker.sensor, method="ukf")


def prepared(scenario: str, variant: str) -> Once:
    """What gives the median milliseconds of a scan over a run."""
    tracker, pose, times, ((_, scans),) = simulated(scenario, 1)
    own = variants(tracker)[variant]
    measure(own, pose, times, scans)
    return lambda: 1e3 * float(np.median(measure(own, pose, times, scans)[0]))


def measures() -> Iterator[Measure]:
    """A scan of each filter that decides with labels."""
    for name in ("LMB", "factored GLMB", "delta-GLMB, ranked", "M-delta-GLMB, ranked", "LMB, UKF"):
        yield Measure("scan", f"linear-10, {name.removesuffix(', ranked')}", partial(prepared, "linear-10", name))
    for name in ("LMB", "LMB, UKF"):
        yield Measure("scan", f"polar-10, {name}", partial(prepared, "polar-10", name))


def measure(tracker: Any, pose: Any, times: Any, scans: Any) -> tuple[list[float], list[Any]]:
    """Seconds of each scan, and the estimates."""
    belief, rng, seconds, estimates = tracker.initial(), np.random.default_rng(0), [], []
    for k, scan in enumerate(scans):
        start = time.process_time()
        belief, _ = tracker.step(belief, scan, pose, float(times[1] - times[0]), k + 1, rng=rng)
        seconds.append(time.process_time() - start)
        unlabelled = isinstance(belief, Poisson | IidCluster | MultiBernoulli)
        estimates.append(unlabelled_estimate(belief, k + 1) if unlabelled else map_estimate(belief))
    return seconds, estimates


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenario", default="linear-10")
    parser.add_argument("--runs", type=int, default=5, help="at least 2")
    options = parser.parse_args()
    tracker, pose, times, runs = simulated(options.scenario, options.runs)
    print(f"{'filter':22s}  median ms  95 %  worst   OSPA m (sd)    error of the number: mean, mean size")
    for name, variant in variants(tracker).items():
        measure(variant, pose, times, runs[0][1])  # compiles, or reads the cache
        seconds, ospas, errors = [], [], []
        for truth, scans in runs:
            spent, estimates = measure(variant, pose, times, scans)
            seconds += spent
            ospas.append(ospa_of_run(truth, estimates, cutoff=100.0, order=1.0)[:, 0].mean())
            errors.append([estimate.num_targets for estimate in estimates] - np.diff(truth.offsets))
        median, high, worst = 1e3 * np.percentile(seconds, [50, 95, 100])
        score = (
            f"{np.mean(ospas):6.2f} ({np.std(ospas, ddof=1):.2f})   {np.mean(errors):+.2f} {np.abs(errors).mean():.2f}"
        )
        print(f"{name:22s}  {median:9.2f}  {high:4.1f}  {worst:5.1f}   {score}")


if __name__ == "__main__":
    main()
