"""The default filter where births are rare next to clutter, compared with a long delta-GLMB filter.

    python benchmarks/rare_births.py [--scenes FIRST LAST] [--runs N] [--workers N] [--out FILE]
    python benchmarks/rare_births.py --table FILE                     # the table of an earlier run

The scenes are numbered, and a number always gives the same scene. Drawn over decades are: births a scan (1e-5 to 1, at
sites, anywhere, or anywhere at a learnt rate), false measurements a scan (.1 to 1,000), the probability of detection
(.4 to 1), the side of the region (100 m to 300 km), noise and speed relative to it, one to three sensors and the scan
rate (1 to 30 a second). Two targets appear in each run. Both filters receive the same scans.

Of each scene the table has the mean difference, default minus delta-GLMB with 1,000 hypotheses, and its standard error
over runs, of: scans from the appearance of a target until an estimate is first within a quarter of the cutoff; OSPA in
percent of the cutoff; log score of the number of targets. Equal arguments give equal tables, except for times.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from compared import Timed
from scenes import decades, own, site, track

from vedette.densities import cardinality_distribution
from vedette.errors import VedetteError
from vedette.evaluation import ospa_of_run
from vedette.internal.unit_warnings import suppress_unit_warnings
from vedette.scenarios import Scenario
from vedette.scenarios.build import build_experiment
from vedette.simulation import SimulationRun

NUM_SCANS, SEED, STREAM = 40, 1, 7402
NEVER_SURER = 1e-6  # least probability of a number of targets in the log score
FILTERS: dict[str, dict[str, Any]] = {
    "default": {},
    "delta-GLMB 1,000": {"filter.kind": "delta_glmb", "filter.limits.max_hypotheses": 1000},
}
MEASURES = ("scans until tracked", "OSPA, % of cutoff", "log score", "ms")


def drawn_fields(number: int, run: int) -> tuple[str, dict[str, Any]]:
    """Return the name of a scene and its fields; the targets depend on the run."""
    rng = np.random.default_rng([STREAM, number])
    kind = ("sites", "anywhere", "learnt")[number % 3]
    births, clutter, detection = decades(rng, 1e-5, 1.0), decades(rng, 0.1, 1000.0), float(rng.uniform(0.4, 1.0))
    side, rate = decades(rng, 100.0, 3e5), decades(rng, 1.0, 30.0)
    noise = side * decades(rng, 5e-4, 5e-3)
    step = noise * decades(rng, 0.1, 4.0)  # of a target between two scans
    sensors, polar = int(rng.choice([1, 1, 2, 3])), bool(rng.integers(2))
    places = rng.uniform(-0.35 * side, 0.35 * side, (int(rng.integers(1, 5)), 2))
    bearing = math.degrees(noise / (0.5 * side))
    fields: dict[str, Any] = {
        "time": {"num_steps": NUM_SCANS, "step_period": 1.0 / rate},
        "region": {"x_min": -side / 2, "x_max": side / 2, "y_min": -side / 2, "y_max": side / 2},
        "motion": {"kind": "constant_velocity", "sigma_v": 0.1 * step * rate**1.5, "noise_model": "continuous_white"},
        "survival.probability": 0.995,
        "ospa.cutoff": 20.0 * noise,
        "sensors": [_sensor(s, rng.uniform(-0.6 * side, 0.6 * side, 2), polar, noise, bearing) for s in range(sensors)],
        "sensors.*.detection.probability": detection,
        "sensors.*.clutter.rate": clutter,
    }
    spread = [2.0 * noise] * 2 + [step * rate] * 2
    if kind == "sites":
        existence = min(births / len(places), 0.9)
        fields["birth"] = {"sites": [site(p, 2.0 * noise, existence, step * rate) for p in places.tolist()]}
    else:
        expected = births if kind == "anywhere" else "learnt"
        fields["birth"] = {"sites": [], "from_measurements": {"expected": expected, "std": spread}}
    targets = np.random.default_rng([STREAM, number, run])
    chosen = places[targets.integers(0, len(places), 2)]
    starts = chosen if kind == "sites" else targets.uniform(-0.35 * side, 0.35 * side, (2, 2))
    states = np.hstack([starts + targets.normal(0.0, noise, (2, 2)), targets.normal(0.0, 0.7 * step * rate, (2, 2))])
    first = targets.integers(2, NUM_SCANS // 3, 2)
    fields["targets.tracks"] = [track(state, int(at)) for state, at in zip(states.tolist(), first, strict=True)]
    scene = f"{number}: {kind} {births:.1e}, clutter {clutter:.2g}, P_D {detection:.2f}, side {side:.2g} m"
    return f"{scene}, {sensors} at {rate:.2g}/s", fields


def _sensor(index: int, place: np.ndarray, polar: bool, noise: float, bearing: float) -> dict[str, Any]:
    by_range = {"kind": "range_dependent", "sigma_range": noise, "sigma_bearing_deg": bearing}
    by_range |= {"eta_range": 0.0, "eta_bearing": 0.0}
    return {
        "name": f"sensor {index + 1}",
        "position": place.tolist(),
        "measurement": {"kind": "bearing_range" if polar else "position"},
        "noise": by_range if polar else {"kind": "constant", "std": [noise, noise]},
        "detection": {"kind": "constant", "probability": 0.9},
        "clutter": {"kind": "region", "rate": 1.0},
    }


def scenario_of(number: int, run: int, fields: dict[str, Any]) -> tuple[str, Scenario]:
    """Return the scene of a run with the fields of a filter."""
    name, drawn = drawn_fields(number, run)
    if fields and drawn["birth"].get("from_measurements", {}).get("expected") == "learnt":
        drawn["birth"]["from_measurements"]["expected"] = 0.5  # a learnt rate needs the intensity
    fusion = {"kind": "sequential"} if len(drawn["sensors"]) > 1 else None
    return name, own(name, {**drawn, **fields}, fusion=fusion).scenario(0)


def scores(number: int, run: int, fields: dict[str, Any]) -> list[float]:
    """Return the measures of one run."""
    _, scenario = scenario_of(number, run, fields)
    experiment, cutoff = build_experiment(scenario), scenario.model.ospa.cutoff
    timed = Timed(experiment.tracker, [])
    world = SimulationRun(replace(experiment, tracker=timed), seed=SEED, run=run, moving=False)
    log_score, estimates, truth = 0.0, [], world.truth
    waited, found = {}, {}
    with suppress_unit_warnings():
        while not world.is_over:
            moment = world.step()
            ids, states = truth.at(moment.step - 1)
            chances = cardinality_distribution(moment.state.fused)
            at = float(chances[len(ids)]) if len(ids) < len(chances) else 0.0
            log_score -= math.log(max(at, NEVER_SURER)) / NUM_SCANS
            estimates.append(moment.estimate)
            for one, state in zip(ids, states, strict=True):
                waited[int(one)] = waited.get(int(one), 0) + 1
                away = np.linalg.norm(moment.estimate.means[:, :2] - state[:2], axis=1)
                if len(away) and away.min() < 0.25 * cutoff:
                    found.setdefault(int(one), waited[int(one)])
    ospa = ospa_of_run(truth, estimates, cutoff=cutoff, order=1.0)[:, 0].mean()
    delay = np.mean([found.get(one, NUM_SCANS) for one in waited])
    return [float(delay), 100.0 * float(ospa) / cutoff, log_score, 1e3 * float(np.median(timed.seconds))]


def measured(number: int, runs: int) -> dict[str, Any]:
    """Return the measures of all runs of a scene, by filter; the refusal where a filter is refused."""
    row: dict[str, Any] = {"number": number, "name": scenario_of(number, 0, {})[0]}
    for name, fields in FILTERS.items():
        try:
            row[name] = [scores(number, run, fields) for run in range(runs)]
        except VedetteError as error:
            row[name] = str(error)
    return row


def table(rows: Sequence[dict[str, Any]]) -> Iterator[str]:
    """Return the lines of the table, and which differences are above zero by two standard errors."""
    yield "| scene | " + " | ".join(f"{name}: default, difference" for name in MEASURES) + " |"
    yield "|---|" + "---:|" * len(MEASURES)
    worse: dict[str, list[int]] = {name: [] for name in MEASURES[:-1]}
    for row in rows:
        ours, other = (row[name] for name in FILTERS)
        if isinstance(ours, str) or isinstance(other, str):
            yield f"| {row['name']} | {ours if isinstance(ours, str) else other} |"
            continue
        own_scores, cells = np.array(ours), []
        difference = own_scores - np.array(other)
        error = difference.std(axis=0, ddof=1) / math.sqrt(len(difference))
        for k, name in enumerate(MEASURES):
            mean = difference[:, k].mean()
            cells.append(f"{own_scores[:, k].mean():.2f}, {mean:+.2f} ± {error[k]:.2f}")
            if name in worse and mean > max(2.0 * error[k], 0.005):
                worse[name].append(row["number"])
        yield f"| {row['name']} | " + " | ".join(cells) + " |"
    yield ""
    for name, numbers in worse.items():
        yield f"worse by two standard errors (and .005), {name}: {len(numbers)} of {len(rows)}: {numbers}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, nargs=2, default=(1, 200), help="numbers of the first and last scene")
    parser.add_argument("--runs", type=int, default=6, help="of each scene")
    parser.add_argument("--workers", type=int, default=1, help="processes")
    parser.add_argument("--out", type=Path, help="file of JSON lines that is added to")
    parser.add_argument("--table", type=Path, help="only print the table of such a file")
    options = parser.parse_args()
    if options.table:
        rows = [json.loads(line) for line in options.table.read_text("utf-8").splitlines()]
        print("\n".join(table(sorted(rows, key=lambda row: row["number"]))))
        return
    rows, numbers = [], range(options.scenes[0], options.scenes[1] + 1)
    with ProcessPoolExecutor(options.workers) as pool:
        for row in pool.map(partial(measured, runs=options.runs), numbers):
            rows.append(row)
            if options.out:
                with options.out.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(row) + "\n")
    print("\n".join(table(rows)))


if __name__ == "__main__":
    main()
