"""Decisions over several periods against single ones, on the scenes where looking ahead might pay, and where not.

    python benchmarks/lookahead.py                                             # two scenes, 6 runs
    python benchmarks/lookahead.py beyond-the-gap --runs 50 --out lookahead.jsonl
    python benchmarks/lookahead.py two-searchers --only "depth 3, beam" "depth 5, tree 49"
    python benchmarks/lookahead.py paper-a paper-e layout-0 layout-1 layout-2 --runs 40 --seed 0

Runs are paired: at the same number every strategy meets the same truth, and random numbers of the same seed. OSPA and
GOSPA (alpha = 2, under the scene's cutoff and order) are means over scans and runs, with one standard error over the
runs; "gained" is what the single decision ("depth 1", or another strategy: `--against`) has more than the strategy,
paired, with its standard error, and "(none)" where it is less than two of these above zero. Beside the mean OSPA stand
that of the median and of the worst run, and the share of runs that end with a lost target. Times are process
CPU time of planning, the median of a run's decisions and then of the runs, in a process of one thread. With `--out`
each run is written as it ends, and what is there is not run again.

"defaults" are those of `lookahead`. On `paper-a`, `paper-e` and `layout-N`, which decide every ten scans and see
everything, tracks are kept by LMB filters under CLMB fusion and decided on by the expected loss; `layout-N` is
`paper-a` with its targets drawn in a square of 1400 m and its sensors in one of 1800 m.

A single decision is given the time of longer plans in two ways, as more samples cannot better it (the scenes' reward
needs none, and all its joint actions are evaluated): it has more directions to choose from, and "kept" is about courses
that are kept for as long as the deepest plan looks ahead. Budgets and depths of trees are those of the program of arXiv
2511.01045.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import cache, partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from timed_planner import Timed

from vedette.evaluation.metrics.point_ospa import ospa_of_run
from vedette.evaluation.runs import measure_run
from vedette.evaluation.tail_summary import summarise_tail, tail_header
from vedette.internal.processes import end_with_parent
from vedette.kernels.base.types import Floats
from vedette.scenarios import Scenario, load_scenario, replace_fields
from vedette.scenarios.build import build_experiment, build_planner
from vedette.scenarios.sections.deciding import Lookahead
from vedette.simulation import simulate

SCENES = ("beyond-the-gap", "two-searchers")
SPARSE = {
    "filter": {"kind": "lmb"},
    "fusion": {"kind": "clmb", "feedback": False},
    "control.reward": {"kind": "expected_loss", "cutoff": 100.0},
}
SIDE, MARGIN, SPEED, FIRST_LAYOUT = 1400.0, 200.0, 10.0, 1000  # m, m, m/s, seed
STEPS = {"beyond-the-gap": 30.0, "two-searchers": 15.0}  # m, length of a step in a second
DEEPEST = 5
FINE = (48, 96)  # directions
TREES = ((5, 49), (10, 49), (5, 200), (10, 200))  # depth, budget


class Strategy(NamedTuple):
    """A row of the table."""

    name: str
    planner: str
    fields: dict[str, Any]


# Scene, seed, strategy, run.
Key: TypeAlias = tuple[str, int, str, int]


class Score(NamedTuple):
    """What came of one run."""

    ospa: float
    gospa: float
    seconds: float
    ends_lost: float  # 1 where a target has no estimate at the last scored scan, else 0


@cache
def scenario_of(scene: str) -> Scenario:
    """A scenario that comes with the library, on its own or with LMB filters; or a layout."""
    if scene in SCENES:
        return load_scenario(scene)
    if not scene.startswith("layout-"):
        return replace_fields(load_scenario(scene), SPARSE)
    given, rng = scenario_of("paper-a"), np.random.default_rng(FIRST_LAYOUT + int(scene.removeprefix("layout-")))
    places, courses = rng.uniform(0.0, SIDE, (4, 2)), rng.uniform(0.0, 2.0 * np.pi, 4)
    sensors = rng.uniform(-MARGIN, SIDE + MARGIN, (2, 2)).tolist()
    states = np.column_stack([places, SPEED * np.cos(courses), SPEED * np.sin(courses)]).tolist()
    low, high, std = -2.0 * MARGIN, SIDE + 2.0 * MARGIN, given.model.birth.sites[0].std
    layout = {
        "region": {"x_min": low, "x_max": high, "y_min": low, "y_max": high},
        "birth.sites": [{"existence": 0.9, "mean": state, "std": std} for state in states],
        "targets.tracks": [{"state": state} for state in states],
        **{f"sensors.{s}.position": place for s, place in enumerate(sensors)},
    }
    return replace_fields(given, layout)


def ahead(depth: int, discount: float | None) -> dict[str, Any]:
    """Fields of a `lookahead` that has its defaults else."""
    return {"control.lookahead": Lookahead(depth=depth, discount=discount).model_dump()}


def strategies(scene: str) -> tuple[Strategy, ...]:
    """The rows of a scene; the first is what the others are compared with."""
    if scene not in SCENES:
        return (
            Strategy("depth 1", "jdm", {}),
            Strategy("depth 2, defaults", "lookahead", ahead(2, Lookahead().discount)),
            Strategy("depth 3, defaults", "lookahead", {}),
            Strategy("depth 3, discount 0.5", "lookahead", ahead(3, 0.5)),
            Strategy("depth 3, discount 1", "lookahead", ahead(3, 1.0)),
            Strategy("depth 2, only the end", "lookahead", ahead(2, None)),
            Strategy("depth 3, only the end", "lookahead", ahead(3, None)),
        )
    directions = load_scenario(scene).model.sensors[0].platform.model_dump()["directions_deg"]
    rows = [Strategy("depth 1", "jdm", {})]
    for num in FINE:
        many = {"kind": "grid_moves", "length": STEPS[scene], "speed": STEPS[scene], "directions_deg": around(num)}
        rows.append(Strategy(f"depth 1, {num} directions", "jdm", {"sensors.*.platform": many}))
    for headings in (directions, *map(around, FINE)):
        kept = {"kind": "heading", "speeds": [STEPS[scene], 0.0], "headings_deg": list(headings)}
        fields = {"sensors.*.platform": kept, "control.horizon_steps": DEEPEST}
        rows.append(Strategy(f"kept {DEEPEST} s, {len(headings)} directions", "jdm", fields))
    rows.append(Strategy("depth 3, defaults", "lookahead", {"control.lookahead": None}))
    for depth in (2, 3, 4):
        fields = {"control.lookahead.depth": depth, "control.lookahead.method": "beam"}
        rows.append(Strategy(f"depth {depth}, beam", "lookahead", fields))
    for depth, budget in TREES:
        fields = {
            "control.lookahead.depth": depth,
            "control.lookahead.method": "tree",
            "control.lookahead.budget": budget,
        }
        rows.append(Strategy(f"depth {depth}, tree {budget}", "lookahead", fields))
    return tuple(rows)


def around(num: int) -> list[float]:
    """So many directions, in degrees."""
    return [360.0 * i / num for i in range(num)]


def score(scene: str, strategy: Strategy, run: int, seed: int) -> Score:
    """One run."""
    scenario = replace_fields(scenario_of(scene), strategy.fields)
    planner, ospa = build_planner(scenario, strategy.planner, 1), scenario.model.ospa
    assert planner is not None
    timed = Timed(planner)
    ospa_of = partial(ospa_of_run, cutoff=ospa.cutoff, order=ospa.order, components=ospa.components)
    record = simulate(build_experiment(scenario), timed, seed=seed, run=run, score=ospa_of)
    window = slice(ospa.first_scan - 1, ospa.last_scan)
    measures = measure_run(record, scenario)
    return Score(
        ospa=float(record.ospa[window, 0].mean()),
        gospa=float(measures.gospa_m.mean()),
        seconds=float(np.median(timed.seconds)),
        ends_lost=float(measures.num_missed[window][-1] > 0),
    )


def with_error(values: Floats) -> str:
    """Mean and standard error."""
    error = values.std(ddof=1) / np.sqrt(len(values)) if len(values) > 1 else np.nan
    return f"{values.mean():.2f} ± {error:.2f}"


def gain(gains: Floats) -> str:
    """Mean and standard error, and whether that is anything."""
    error = gains.std(ddof=1) / np.sqrt(len(gains)) if len(gains) > 1 else np.inf
    return with_error(gains) + ("" if gains.mean() > 2.0 * error else " (none)")


def table(scene: str, rows: dict[str, Floats], against: str) -> Iterator[str]:
    """The lines of a scene's table, of scores (num_runs, 4) by strategy."""
    names = ["OSPA (m)", *tail_header("m"), "GOSPA (m)", "CPU ms per decision"]
    names += [f"OSPA gained on {against} (m)", "GOSPA gained (m)"]
    yield "| Strategy | " + " | ".join(names) + " |"
    yield "| --- |" + " ---: |" * len(names)
    single = rows[against]
    for name, scores in rows.items():
        own = [with_error(scores[:, 0]), *summarise_tail(scores[:, 0], scores[:, 3]).cells()]
        own += [with_error(scores[:, 1]), f"{1e3 * np.median(scores[:, 2]):.0f}"]
        gained = ["", ""] if scores is single else [gain(single[:, i] - scores[:, i]) for i in (0, 1)]
        yield "| " + " | ".join([name, *own, *gained]) + " |"
    yield ""
    yield f"{len(single)} paired runs of {scene}."


class Store:
    """Scores by scene, seed, strategy and run; in a file, where there is one."""

    def __init__(self, file: Path | None) -> None:
        self.file = file
        lines = file.read_text().splitlines() if file is not None and file.exists() else []
        self.scores = {tuple(key): Score(*own) for key, own in map(json.loads, lines)}

    def add(self, key: Key, score: Score) -> None:
        """Keep one."""
        self.scores[key] = score
        if self.file is not None:
            with self.file.open("a") as out:
                out.write(json.dumps([key, score]) + "\n")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("scenes", nargs="*", default=SCENES, help=f"of {', '.join(SCENES)}, paper-a, paper-e, layout-N")
    parser.add_argument("--runs", type=int, default=6, help="of each strategy")
    parser.add_argument("--first", type=int, default=0, help="number of the first run")
    parser.add_argument("--seed", type=int, default=5)
    parser.add_argument("--only", nargs="+", default=(), help="of the strategies but the first, these")
    parser.add_argument("--against", default="depth 1", help="the strategy on which gains are measured")
    parser.add_argument("--workers", type=int, default=1, help="processes")
    parser.add_argument("--out", type=Path, help="file of results, which is gone on with")
    given = parser.parse_args()
    store, runs = Store(given.out), range(given.first, given.first + given.runs)
    with ProcessPoolExecutor(given.workers, get_context("spawn"), initializer=end_with_parent) as pool:
        for scene in given.scenes:
            wanted = [
                strategy
                for place, strategy in enumerate(strategies(scene))
                if place == 0 or not given.only or strategy.name in (*given.only, given.against)
            ]
            tasks = {
                pool.submit(score, scene, strategy, run, given.seed): (scene, given.seed, strategy.name, run)
                for run in runs
                for strategy in wanted
                if (scene, given.seed, strategy.name, run) not in store.scores
            }
            for task in as_completed(tasks):
                store.add(tasks[task], task.result())
            rows = {own.name: [store.scores[scene, given.seed, own.name, run] for run in runs] for own in wanted}
            lines = table(scene, {name: np.array(own) for name, own in rows.items()}, given.against)
            print(f"\n## {scene}\n", *lines, sep="\n", flush=True)


if __name__ == "__main__":
    main()
