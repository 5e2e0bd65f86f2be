"""What a scan of a crowd costs by the number of targets, at one density: `vedette.scenarios.GeneratedCrowd`.

    python benchmarks/crowd.py [--targets N ...] [--density D] [--repeats N] [--figure FILE]

Prints a Markdown table. Of each filter and size, all scans of one run, from the sixth on, when the targets that were
there at first are found: the median CPU time of a scan of the filter, and of the tracker with births from measurements
and all checks, over up to `--repeats` passes of which each scan's least counts (none begins after 20 s); OSPA
(c = 25 m, p = 1, an average over targets) and the error of the number; and how much memory the process needs more than
before its first scan, at most, in a process of its own and with the estimates of all scans. The LMB and the factored
GLMB filter are measured up to 100,000 targets, the delta-GLMB filter up to 1,000. `--figure` draws time and OSPA
against the number.
"""

from __future__ import annotations

import argparse
import multiprocessing
import resource
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from timing import Measure, Once

from vedette.densities import Estimate
from vedette.evaluation import ospa
from vedette.filters import PredictUpdateFilter
from vedette.internal.processes import end_with_parent
from vedette.models import SensorModel, TargetModel
from vedette.scenarios import GeneratedCrowd, Scenario, crowd_text, parse_scenario, replace_fields
from vedette.scenarios.build import build_experiment
from vedette.simulation import Experiment, Truth, simulate_scan

SIZES = (10, 30, 100, 300, 1000, 3000, 10_000)
MOST = {"lmb": 100_000, "factored_glmb": 100_000, "delta_glmb": 1000}
NAMES = {"lmb": "LMB", "factored_glmb": "factored GLMB", "delta_glmb": "delta-GLMB"}
FROM_STEP, CUTOFF = 6, 25.0
_NO_MORE_AFTER = 20.0  # s


@dataclass(frozen=True)
class Row:
    """Medians over the scans of a run from `FROM_STEP` on."""

    filter: str
    num_targets: int
    filter_ms: float
    tracker_ms: float
    ospa: float
    number_error: float
    megabytes: float

    @property
    def microseconds(self) -> float:
        """Of the filter, a target and scan."""
        return 1e3 * self.filter_ms / self.num_targets


def prepared(crowd: GeneratedCrowd, kind: str, seed: int = 0) -> tuple[Experiment, Truth, list[np.ndarray]]:
    """The experiment, the true targets and the scans."""
    scenario = replace_fields(Scenario(parse_scenario(crowd_text(crowd))), {"filter.kind": kind})
    experiment = build_experiment(scenario)
    rng = np.random.default_rng(seed)
    truth = experiment.targets.truth(experiment.times, rng=rng)
    sensor, pose = experiment.tracker.sensors[0], experiment.poses[0]
    scans = [simulate_scan(truth.at(k)[1], pose, sensor, rng=rng).measurements for k in range(truth.num_scans)]
    return experiment, truth, scans


@dataclass(frozen=True)
class TimedFilter:
    """A filter that notes the CPU seconds of its steps."""

    inner: PredictUpdateFilter
    seconds: list[float]

    @property
    def targets(self) -> TargetModel:
        return self.inner.targets

    @property
    def sensor(self) -> SensorModel:
        return self.inner.sensor

    @property
    def starts_tracks(self) -> bool:
        return getattr(self.inner, "starts_tracks", False)

    def initial(self) -> Any:
        return self.inner.initial()

    def step(self, *arguments: Any, **options: Any) -> Any:
        start = time.process_time()
        found = self.inner.step(*arguments, **options)
        self.seconds.append(time.process_time() - start)
        return found

    def predict(self, *arguments: Any, **options: Any) -> Any:
        return self.inner.predict(*arguments, **options)

    def update(self, *arguments: Any, **options: Any) -> Any:
        return self.inner.update(*arguments, **options)


def tracked(experiment: Experiment, scans: Sequence[np.ndarray]) -> tuple[list[float], list[float], list[Estimate]]:
    """CPU seconds of the filter and of the whole tracker at each scan, and the estimates from `FROM_STEP` on."""
    timed = TimedFilter(experiment.tracker.filters[0], [])
    tracker, rngs = replace(experiment.tracker, filters=(timed,)), [np.random.default_rng(0)]
    state, seconds, estimates = tracker.initial(), [], []
    for k, scan in enumerate(scans):
        start = time.process_time()
        state, _ = tracker.step(state, [scan], experiment.poses, float(experiment.times[k]), rngs=rngs)
        seconds.append(time.process_time() - start)
        if k + 1 >= FROM_STEP:
            estimates.append(experiment.estimate(state.fused, k + 1))
    return timed.seconds, seconds, estimates


def measured(crowd: GeneratedCrowd, kind: str, repeats: int) -> Row:
    """One row, in this process."""
    warm, _, few = prepared(GeneratedCrowd(num_targets=30, num_steps=8), kind)
    tracked(warm, few)  # compiles, or reads the cache
    experiment, truth, scans = prepared(crowd, kind)
    before, start = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.process_time()
    of_filter, of_tracker, estimates = tracked(experiment, scans)
    after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for _ in range(repeats - 1):
        if time.process_time() - start > _NO_MORE_AFTER:
            break
        again = tracked(experiment, scans)
        of_filter, of_tracker = list(map(min, of_filter, again[0])), list(map(min, of_tracker, again[1]))
    true = [truth.at(k)[1] for k in range(FROM_STEP - 1, truth.num_scans)]
    return Row(
        kind,
        crowd.num_targets,
        1e3 * float(np.median(of_filter[FROM_STEP - 1 :])),
        1e3 * float(np.median(of_tracker[FROM_STEP - 1 :])),
        float(np.mean([_ospa(estimate, states) for estimate, states in zip(estimates, true, strict=True)])),
        float(np.mean([abs(e.num_targets / len(states) - 1.0) for e, states in zip(estimates, true, strict=True)])),
        (after - before) / 1024.0,
    )


def passes(num_targets: int, kind: str) -> Once:
    """What gives the median milliseconds of a scan of the filter over a run."""
    experiment, _, scans = prepared(GeneratedCrowd(num_targets=num_targets, num_steps=FROM_STEP + 6), kind)
    tracked(experiment, scans)
    return lambda: 1e3 * float(np.median(tracked(experiment, scans)[0][FROM_STEP - 1 :]))


def measures() -> Iterator[Measure]:
    """A scan of each filter that is made for crowds; `NAMES` with `MOST` says which."""
    for kind in NAMES:
        for number in (num for num in (100, 1000, 10_000) if num <= MOST[kind]):
            slow = number > 1000 or (kind == "delta_glmb" and number > 100)
            yield Measure(
                "crowd", f"{number:,} targets, {NAMES[kind]}", partial(passes, number, kind), rounds=5, long=slow
            )


def _ospa(estimate: Estimate, states: np.ndarray) -> float:
    return ospa(estimate.means[:, :2], states[:, :2], cutoff=CUTOFF, order=1.0).total


def table(rows: Sequence[Row]) -> str:
    """As Markdown."""
    lines = [
        "| filter | targets | ms per scan | µs per target and scan | with births, ms | OSPA, m | cardinality error |"
        " memory, MB |",
        "|---|---:|---:|---:|---:|---:|---:|---:|",
    ]
    lines += [
        f"| {NAMES[row.filter]} | {row.num_targets:,} | {row.filter_ms:.2f} | {row.microseconds:.1f} "
        f"| {row.tracker_ms:.2f} | {row.ospa:.2f} | {100.0 * row.number_error:.1f} % | {row.megabytes:.0f} |"
        for row in rows
    ]
    return "\n".join(lines)


def draw(rows: Sequence[Row], density: float, path: Path) -> None:
    """Time a target and scan, and OSPA, against the number of targets."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(7.0, 6.0), layout="constrained")
    for kind, marker in zip(NAMES, "o^s", strict=True):
        own = [row for row in rows if row.filter == kind]
        numbers = [row.num_targets for row in own]
        above.plot(numbers, [row.microseconds for row in own], marker=marker, label=NAMES[kind])
        below.plot(numbers, [row.ospa for row in own], marker=marker, label=NAMES[kind])
    above.set(xscale="log", yscale="log", ylabel="filter, CPU µs a target and scan")
    below.set(xlabel=f"targets, {density:g} a km²", ylabel="OSPA (c = 25 m, p = 1), m")
    below.set_ylim(0.0, 1.1 * max(row.ospa for row in rows))
    for axes in (above, below):
        axes.grid(True, which="major", alpha=0.4)
        axes.legend()
    figure.savefig(path, dpi=110)
    print(f"wrote {path}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--targets", type=int, nargs="+", default=SIZES)
    parser.add_argument("--density", type=float, default=GeneratedCrowd().density, help="targets a km^2")
    parser.add_argument("--filters", nargs="+", default=tuple(NAMES), choices=tuple(NAMES))
    parser.add_argument("--repeats", type=int, default=5, help="passes over each run")
    parser.add_argument("--steps", type=int, default=20, help=f"scans of a run, more than {FROM_STEP}")
    parser.add_argument("--figure", type=Path, help="file to draw")
    options = parser.parse_args()
    wanted = [(kind, num) for kind in options.filters for num in options.targets if num <= MOST[kind]]
    rows = []
    for kind, num in wanted:
        crowd = GeneratedCrowd(num_targets=num, density=options.density, num_steps=options.steps)
        # Memory is that of a process's whole life: each row has one of its own.
        with multiprocessing.get_context("spawn").Pool(1, end_with_parent) as pool:
            rows.append(pool.apply(measured, (crowd, kind, options.repeats)))
    print(table(rows))
    if options.figure:
        draw(rows, options.density, options.figure)


if __name__ == "__main__":
    main()
