"""Accuracy and cost of the factored filter by its dial, beside the delta-GLMB and the LMB filter.

    python benchmarks/factored.py [--runs N] [--layouts N] [--errors E ...] [--more-hypotheses]

Prints a Markdown table: mean OSPA (c = 100 m, p = 1) over the scans of `--runs` runs of linear-10 and polar-10, of one
sensor that stands still, estimates by existence above 1/2; and over the 11th to 40th scan of `--layouts` layouts of
still sensors: four targets drawn in a square of 1,400 m, at 10 m/s, two of paper-a's sensors that lie anywhere in it,
births of existence 0.02 at the first scan alone, GCI of the beliefs, map estimates. The time is the median of a scan on
linear-10, checks included. `--more-hypotheses` adds the delta-GLMB filter with 20,000 hypotheses.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from filter_scan import simulated

from vedette.densities import LMB, Estimate, map_estimate, marginal_estimate
from vedette.evaluation import ospa
from vedette.filters import DeltaGlmbFilter, FactoredGlmbFilter, Filter, Limits, LmbFilter
from vedette.fusion import Clmb, CmDeltaGlmb
from vedette.models import BirthModel, SensorModel, TargetModel
from vedette.scenarios import load_scenario
from vedette.scenarios.build import build_sensors
from vedette.simulation import simulate_scan
from vedette.tracking import Distributed

SQUARE, SPEED, NUM_SCANS, FROM_SCAN, FIRST_SEED = 1400.0, 10.0, 40, 10, 200

Make = Callable[[TargetModel, SensorModel, Limits], Filter]


class Layout(NamedTuple):
    """Targets, sensors and their scans."""

    targets: TargetModel
    sensor: SensorModel
    poses: np.ndarray  # (2, 3)
    states: np.ndarray  # (num_scans, 4, 4)
    scans: list[list[np.ndarray]]


def variants(errors: list[float], more: bool) -> dict[str, Make]:
    found: dict[str, Make] = {"delta-GLMB": DeltaGlmbFilter, "LMB": LmbFilter}
    if more:
        found["delta-GLMB, 20,000"] = lambda t, s, c: DeltaGlmbFilter(t, s, replace(c, max_hypotheses=20_000))
    for error in errors:
        found[f"factored, {error:g}"] = partial(FactoredGlmbFilter, max_split_error=error)
    return found


def _error(estimate: Estimate, states: np.ndarray) -> float:
    return ospa(estimate.means[:, :2], states[:, :2], cutoff=100.0, order=1.0).total


def on_scenario(name: str, num_runs: int, make: Make) -> tuple[float, float]:
    """Mean OSPA, and median milliseconds of a scan."""
    own, pose, times, runs = simulated(name, num_runs)
    tracker, rng, errors, seconds = make(own.targets, own.sensor, own.limits), np.random.default_rng(0), [], []
    for truth, scans in runs:
        belief = tracker.initial()
        for k, scan in enumerate(scans):
            dt, start = float(times[k] - times[k - 1]) if k else 1.0, time.process_time()
            belief, _ = tracker.step(belief, scan, pose, dt, k + 1, rng=rng)
            seconds.append(time.process_time() - start)
            errors.append(_error(marginal_estimate(belief), truth.at(k)[1]))
    return float(np.mean(errors)), 1e3 * float(np.median(seconds))


def layout_of(seed: int, given: Any) -> Layout:
    rng, own = np.random.default_rng(seed), given.targets
    turns = rng.uniform(0.0, SQUARE, (4, 2)), rng.uniform(0.0, 2.0 * np.pi, 4)
    start = np.column_stack([turns[0], SPEED * np.cos(turns[1]), SPEED * np.sin(turns[1])])
    birth = BirthModel(np.full(4, 0.02), start, np.stack([own.birth.covs[0]] * 4), frozenset({1}))
    poses = np.column_stack([rng.uniform(0.0, SQUARE, (2, 2)), np.zeros(2)])
    moved = [np.column_stack([start[:, :2] + k * start[:, 2:], start[:, 2:]]) for k in range(1, NUM_SCANS + 1)]
    scans = [[simulate_scan(x, pose, given.sensor, rng=rng).measurements for pose in poses] for x in moved]
    return Layout(TargetModel(own.motion, own.survival, birth), given.sensor, poses, np.stack(moved), scans)


def on_layout(layout: Layout, limits: Limits, make: Make) -> float:
    filters = tuple(make(layout.targets, layout.sensor, limits) for _ in layout.poses)
    fusion = (Clmb if isinstance(filters[0].initial(), LMB) else CmDeltaGlmb)((0.5, 0.5))
    tracker, errors = Distributed(filters, fusion), []
    state, rngs = tracker.initial(), [np.random.default_rng(0)] * 2
    for k, scans in enumerate(layout.scans):
        state, _ = tracker.step(state, scans, layout.poses, float(k + 1), rngs=rngs)
        if k >= FROM_SCAN:
            errors.append(_error(map_estimate(state.fused), layout.states[k]))
    return float(np.mean(errors))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=4)
    parser.add_argument("--layouts", type=int, default=240)
    parser.add_argument("--errors", type=float, nargs="+", default=[0.01, 0.1, 0.3, 0.7, 1.0])
    parser.add_argument("--more-hypotheses", action="store_true")
    options = parser.parse_args()
    given = build_sensors(load_scenario("paper-a"))[0].filter
    layouts = [layout_of(FIRST_SEED + k, given) for k in range(options.layouts)]
    print("| filter | linear-10, m | polar-10, m | still sensors, m | ± paired to LMB | ms a scan |")
    print("|---|---:|---:|---:|---:|---:|")
    made = variants(options.errors, options.more_hypotheses)
    of_lmb = np.array([on_layout(layout, Limits(), made["LMB"]) for layout in layouts])
    for name, make in made.items():
        (linear, milliseconds), (polar, _) = (
            on_scenario(each, options.runs, make) for each in ("linear-10", "polar-10")
        )
        still = np.array([on_layout(layout, Limits(), make) for layout in layouts])
        spread = (still - of_lmb).std(ddof=1) / np.sqrt(len(still)) if len(still) > 1 else np.nan
        print(
            f"| {name} | {linear:.2f} | {polar:.2f} | {still.mean():.2f} | {spread:.2f} | {milliseconds:.2f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
