"""Sensors and targets with a no-go zone between them: walls, a ring with one gap, two zones that overlap.

    python benchmarks/ways_round.py                                       # all kinds, 10 runs, jdm
    python benchmarks/ways_round.py --kinds wall-80 ring --planners jdm nearest --runs 20 --out after.jsonl
    python benchmarks/ways_round.py --against before.jsonl --out after.jsonl

Each run has a layout of its own, drawn from its number: two sensors that see 60 m and step 20 m after every scan, and
three targets, on the two sides of the zone. Runs are paired: at the same number all planners and versions of the code
meet the same layout, truth and random numbers. The table has the mean OSPA (cutoff 60 m, order 1) over scans and runs
of the first planner with one standard error, and its CPU seconds of a run. For each other planner it has the paired
difference to the first; negative is better than the first, and a star marks more than two standard errors. With
`--against`, a file that another version of the code wrote by `--out`, it has the paired difference of the first planner
to that as well. `--seed` draws other layouts.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from hand_rules import RULES
from pages import write_between

from vedette.evaluation.metrics.point_ospa import ospa_of_run
from vedette.kernels.base.types import Floats
from vedette.scenarios import Scenario, load_scenario, replace_fields
from vedette.scenarios.build import build_experiment, build_planner
from vedette.simulation import simulate

STEPS, STEP, DEEP, SEED = 60, 20.0, 20.0, 7  # scans, m, m
Key = tuple[str, str, int]


def box(x_min: float, x_max: float, y_min: float, y_max: float) -> dict[str, Any]:
    """A rectangle that is forbidden."""
    return {"kind": "keep_out", "region": {"x_min": x_min, "x_max": x_max, "y_min": y_min, "y_max": y_max}}


def ring(inner: float, outer: float, gap: float) -> dict[str, Any]:
    """A square ring with one gap, in the north, so wide."""
    half = gap / 2.0
    outside = [[-half, outer], [-outer, outer], [-outer, -outer], [outer, -outer], [outer, outer], [half, outer]]
    inside = [[half, inner], [inner, inner], [inner, -inner], [-inner, -inner], [-inner, inner], [-half, inner]]
    return {"kind": "keep_out", "polygon": outside + inside}


# Of walls (length): how far from their middle, along them, sensors and targets are, and the farthest target beyond, m.
SPREADS = {80: (10.0, 10.0, 90.0), 160: (20.0, 20.0, 105.0), 240: (20.0, 30.0, 150.0)}
SCENES: dict[str, list[dict[str, Any]]] = {
    **{f"wall-{size}": [box(0.0, DEEP, -size / 2.0, size / 2.0)] for size in SPREADS},
    "ring": [ring(90.0, 110.0, 60.0)],
    "overlap": [box(0.0, DEEP, -80.0, 80.0), box(-60.0, 10.0, 60.0, 80.0)],
}


def scenario_of(scene: str, run: int) -> Scenario:
    """The scene with the layout of one run."""
    rng = np.random.default_rng([SEED, run])
    if scene == "ring":
        targets, sensors = rng.uniform(-50.0, 50.0, (3, 2)), rng.uniform(-60.0, 60.0, (2, 2)) - [0.0, 180.0]
    elif scene == "overlap":
        targets = np.column_stack([rng.uniform(80.0, 140.0, 3), rng.uniform(-60.0, 60.0, 3)])
        sensors = np.column_stack([rng.uniform(-70.0, -20.0, 2), rng.uniform(-30.0, 30.0, 2)])
    else:
        of_sensors, of_targets, farthest = SPREADS[int(scene.removeprefix("wall-"))]
        targets = np.column_stack([rng.uniform(75.0, farthest, 3), rng.uniform(-of_targets, of_targets, 3)])
        # Whole steps from 4 m before the wall.
        before = -4.0 - STEP * rng.integers(1, 4, 2)
        sensors = np.column_stack([before, rng.uniform(-of_sensors, of_sensors, 2)])
    states = np.column_stack([targets, np.zeros((3, 2))]).tolist()
    fields: dict[str, Any] = {
        "name": f"{scene}-{run}",
        "time.num_steps": STEPS,
        "birth.sites": [{"existence": 0.9, "mean": own, "std": [10.0, 10.0, 1.0, 1.0]} for own in states],
        "targets.tracks": [{"state": own, "process_noise": True} for own in states],
        "sensors.*.platform": {"kind": "grid_moves", "length": STEP, "speed": STEP},
        **{f"sensors.{s}.position": own for s, own in enumerate(sensors.tolist())},
        "control.constraints": SCENES[scene],
    }
    return replace_fields(load_scenario("beyond-the-gap"), fields)


def measured(scenario: Scenario, planner: str, run: int) -> tuple[float, float]:
    """Mean OSPA, m, and CPU seconds of one run."""
    experiment, ospa = build_experiment(scenario), scenario.model.ospa
    score = partial(ospa_of_run, cutoff=ospa.cutoff, order=ospa.order, components=ospa.components)
    made = RULES[planner](scenario) if planner in RULES else build_planner(scenario, planner, 1)
    began = time.process_time()
    record = simulate(experiment, made, seed=SEED, run=run, score=score)
    return float(record.ospa[:, 0].mean()), time.process_time() - began


def with_error(values: Floats, sign: str = "") -> str:
    """Mean and standard error."""
    return f"{values.mean():{sign}.1f} ± {values.std(ddof=1) / np.sqrt(len(values)):.1f}".replace("-", "\u2212")


def difference(values: Floats) -> str:
    """A paired difference, with a star if it is negative by more than two standard errors."""
    star = values.mean() < -2.0 * values.std(ddof=1) / np.sqrt(len(values))
    return with_error(values, "+") + (" *" if star else "")


def kept(file: Path | None) -> dict[Key, tuple[float, float]]:
    """What a file holds."""
    if file is None or not file.exists():
        return {}
    rows = map(json.loads, file.read_text("utf-8").splitlines())
    return {(row["scene"], row["planner"], row["run"]): (row["ospa"], row["seconds"]) for row in rows}


def main(
    description: str | None, script: str, kinds: list[str], scene_of: Callable[[str, int], Scenario], usual: list[str]
) -> None:
    """Run, and print the table. usual: planners unless others are named."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kinds", nargs="+", choices=kinds, default=kinds, metavar="KIND", help=", ".join(kinds))
    parser.add_argument("--planners", nargs="+", default=usual)
    parser.add_argument("--runs", type=int, default=10, help="of each kind, at least 2")
    parser.add_argument("--seed", type=int, default=0, help="of the layouts")
    parser.add_argument("--out", type=Path, help="file of results, which is continued")
    parser.add_argument("--against", type=Path, help="file of results of another version of the code")
    parser.add_argument("--write", type=Path, metavar="PAGE", help="Markdown page with a place for the table")
    given = parser.parse_args()
    found, before = kept(given.out), kept(given.against)
    first, runs = given.planners[0], range(1000 * given.seed, 1000 * given.seed + given.runs)
    heads = [f"{first}, m", "CPU, s", *given.planners[1:], *(["to before"] if before else [])]
    lines = [f"| Kind | {' | '.join(heads)} |", f"| --- |{' ---: |' * len(heads)}"]
    print(*lines, sep="\n")
    means = []
    for kind in given.kinds:
        rows = {planner: values_of(found, given.out, scene_of, kind, planner, runs) for planner in given.planners}
        cells = [with_error(rows[first][:, 0]), f"{rows[first][:, 1].mean():.1f}"]
        cells += [difference(rows[planner][:, 0] - rows[first][:, 0]) for planner in given.planners[1:]]
        pairs = [
            found[kind, first, run][0] - before[kind, first, run][0] for run in runs if (kind, first, run) in before
        ]
        cells += [difference(np.array(pairs)) if len(pairs) > 1 else ""] if before else []
        lines.append(f"| {kind} | {' | '.join(cells)} |")
        print(lines[-1], flush=True)
        means.append([rows[planner][:, 0].mean() - rows[first][:, 0].mean() for planner in given.planners[1:]])
    if len(means) > 1 and len(given.planners) > 1:
        more = [with_error(column, "+") for column in np.transpose(means)]
        lines.append(f"| **mean of kinds** | | | {' | '.join([*more, *([''] if before else [])])} |")
        print(lines[-1])
    if given.write is not None:
        write_between(given.write, script, "\n".join(lines))


def values_of(
    found: dict[Key, tuple[float, float]],
    out: Path | None,
    scene_of: Callable[[str, int], Scenario],
    kind: str,
    planner: str,
    runs: Iterable[int],
) -> Floats:
    """(num_runs, 2) mean OSPA, m, and CPU seconds; what is not in `found` is run, and added to it and to a file."""
    for key in [(kind, planner, run) for run in runs]:
        if key not in found:
            found[key] = measured(scene_of(kind, key[2]), planner, key[2])
            row = dict(zip(("scene", "planner", "run", "ospa", "seconds"), (*key, *found[key]), strict=True))
            if out is not None:
                with out.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(row) + "\n")
    return np.array([found[kind, planner, run] for run in runs])


if __name__ == "__main__":
    main(__doc__, "ways_round.py", list(SCENES), scenario_of, ["jdm"])
