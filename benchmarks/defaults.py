"""The default filter beside those that it could be, over scenes of many kinds (`benchmarks/scenes.py`).

    python benchmarks/defaults.py [--scenes WORD ...] [--filters NAME ...] [--errors E ...] [--runs N] [--out FILE]
    python benchmarks/defaults.py --out FILE --write docs/evidence/filter-default.md

Compared are the filter that runs where nothing is said, the LMB filter, the delta-GLMB filter with 1,000 and with
20,000 hypotheses, the M-delta-GLMB filter, and the factored filter with each of `--errors` as its split error. The runs
of a scene are paired: truth and scans are the same for all. A scene is taken if any of the words is in its name.

Prints a Markdown table a scene: runs; mean OSPA with its standard error, over the scans that the scenario scores; that
of the median and of the worst run, and the share of runs that end with a lost target; how much more the mean is than
the first filter's, and its ratio to the best that has five runs, each in the runs that both have, with the standard
error of the difference; OSPA(2) over 10 scans; share of the targets that have an estimate within 0.4 of the cutoff;
label switches a run; CPU milliseconds a scan, the median over the runs. After the second run none begins when a filter
has spent `--seconds` on a scene: slow ones have fewer runs. Then a table of the ratios in all scenes.

`--out` appends a line of JSON for each filter and scene, with the figures of every run. What the file held before is in
the tables, unless it was measured again; `--runs 0` prints the file alone.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from compared import Fields, Timed, compared, with_filter
from pages import write_between
from scenes import Scene, all_scenes

from vedette.errors import VedetteError
from vedette.evaluation import Summary, match_run, measure_run, ospa_of_run, summarise
from vedette.evaluation.tail_summary import summarise_tail, tail_header
from vedette.scenarios import Scenario
from vedette.scenarios.build import build_experiment, build_planner
from vedette.simulation import Experiment, RunRecord, simulate

SEED, NEAR, ENOUGH_RUNS = 1, 0.4, 5


@dataclass(frozen=True)
class Row:
    """What a filter did in a scene, a number a run; `refused` where it could not."""

    scene: str
    filter: str
    ospa: Sequence[float] = ()
    ends_lost: Sequence[float] = ()  # 1 where a target has no estimate at the last scored scan, else 0
    ospa2: Sequence[float] = ()
    near: Sequence[float] = ()
    switches: Sequence[float] = ()
    milliseconds: Sequence[float] = ()
    refused: str = ""


def measured(scene: Scene, name: str, fields: Fields, num_runs: int, seconds: float) -> Row:
    """One filter in one scene."""
    rows: list[tuple[float, ...]] = []
    start = time.process_time()
    for run in range(num_runs):
        if run >= 2 and time.process_time() - start > seconds:
            break
        given = scene.scenario(run)
        try:
            scenario = with_filter(given, fields)
            if run == 0:  # compiles, or reads the cache
                _run(scenario, scene.planner, run, first_scans=4)
                start = time.process_time()
            record, milliseconds = _run(scenario, scene.planner, run)
            rows.append((*_scores(record, scenario), milliseconds))
        except VedetteError as error:
            return Row(scene.name, name, refused=str(error).splitlines()[0])
    return Row(scene.name, name, *np.transpose(rows).tolist())


def _run(scenario: Scenario, planner: str, run: int, first_scans: int | None = None) -> tuple[RunRecord, float]:
    """A run, or its first scans alone, and its CPU milliseconds a scan."""
    experiment, ospa = build_experiment(scenario), scenario.model.ospa
    if first_scans is not None:
        experiment = _shortened(experiment, first_scans)
    timed = Timed(experiment.tracker, [])
    score = partial(ospa_of_run, cutoff=ospa.cutoff, order=ospa.order, components=ospa.components)
    decides = build_planner(scenario, planner, 1)
    record = simulate(replace(experiment, tracker=timed), decides, seed=SEED, run=run, score=score)
    return record, 1e3 * sum(timed.seconds) / len(timed.seconds)


def _scores(record: RunRecord, scenario: Scenario) -> tuple[float, ...]:
    """OSPA, whether a target is lost at the end, OSPA(2), share of targets near an estimate, label switches."""
    scored, cutoff, of_run = _scored(scenario), scenario.model.ospa.cutoff, measure_run(record, scenario)
    near = match_run(record.truth, record.estimates, cutoff=NEAR * cutoff, order=1.0)
    return (
        float(record.ospa[scored, 0].mean()),
        float(of_run.num_missed[scored][-1] > 0),
        float(of_run.ospa2_m[scored].mean()),
        float(near.num_matched[scored].sum() / max(1, near.num_targets[scored].sum())),
        float(of_run.label_switches.sum()),
    )


def _shortened(experiment: Experiment, num_scans: int) -> Experiment:
    steps = tuple(step for step in experiment.decision_steps if step <= num_scans)
    return replace(experiment, times=experiment.times[:num_scans], decision_steps=steps)


def _scored(scenario: Scenario) -> slice:
    """The scans over which the scenario takes its mean."""
    ospa, decisions = scenario.model.ospa, scenario.model.decision_steps
    after = decisions[0] + 1 if decisions else 1
    return slice((ospa.first_scan or after) - 1, ospa.last_scan)


class Ratio(NamedTuple):
    """Of means of OSPA in the runs that two filters have, and the standard error of the numerator."""

    ratio: float
    error: float

    def __str__(self) -> str:
        return f"{self.ratio:.3f} ± {self.error:.3f}"


def table(scene: str, rows: Sequence[Row]) -> Iterator[str]:
    """A scene's rows, compared with the first and with the best."""
    yield f"\n### {scene}\n"
    names = ["runs", "OSPA, m", *tail_header("m"), "more than the first", "to the best"]
    names += ["OSPA(2), m", "near, %", "switches", "ms"]
    yield "| filter | " + " | ".join(names) + " |"
    yield "|---|" + "---:|" * len(names)
    ratios, first = to_the_best(rows), next((row for row in rows if not row.refused), None)
    for row in rows:
        if first is None or row.refused:
            yield f"| {row.filter} | {row.refused} |"
            continue
        ospa, more = summarise(row.ospa), _difference(row, first)
        rest = (np.mean(row.ospa2), 100.0 * np.mean(row.near), np.mean(row.switches), np.median(row.milliseconds))
        yield (
            f"| {row.filter} | {len(row.ospa)} | {ospa.mean:.2f} ± {ospa.standard_error:.2f} | "
            + " | ".join(summarise_tail(row.ospa, row.ends_lost).cells())
            + f" | {more.mean:+.2f} ± {more.standard_error:.2f} | {ratios[row.filter]} | "
            + " | ".join(f"{value:.2f}" for value in rest)
            + " |"
        )


def overview(scenes: dict[str, Sequence[Row]], filters: Sequence[str]) -> Iterator[str]:
    """The ratio of each filter to the best in every scene, and the largest of all."""
    yield "| ratio to the best | " + " | ".join(filters) + " |"
    yield "|---|" + "---:|" * len(filters)
    ratios = {scene: to_the_best(rows) for scene, rows in scenes.items()}
    largest = {
        name: max(found[name] for found in ratios.values() if name in found)
        for name in filters
        if any(name in found for found in ratios.values())
    }
    for scene, found in {**ratios, "largest": largest}.items():
        yield f"| {scene} | " + " | ".join(str(found.get(name, "")) for name in filters) + " |"


def to_the_best(rows: Sequence[Row]) -> dict[str, Ratio]:
    """The largest ratio of each filter's mean to another's, in the runs that both have; not to one of too few."""
    found = [row for row in rows if not row.refused]
    best = {}
    for row in found:
        enough = min(ENOUGH_RUNS, len(row.ospa))
        best[row.filter] = max(_ratio(row, other) for other in found if len(other.ospa) >= enough)
    return best


def _ratio(row: Row, other: Row) -> Ratio:
    num, more = min(len(row.ospa), len(other.ospa)), _difference(row, other)
    mean = float(np.mean(other.ospa[:num]))
    return Ratio(1.0 + float(more.mean) / mean, float(more.standard_error) / mean)


def _difference(row: Row, other: Row) -> Summary:
    """How much more OSPA a filter has in the runs that both have."""
    num = min(len(row.ospa), len(other.ospa))
    return summarise(np.subtract(row.ospa[:num], other.ospa[:num]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="+", default=[""], help="words in their names; all")
    parser.add_argument("--filters", nargs="+", help="names of those compared; all")
    parser.add_argument("--errors", type=float, nargs="*", default=[0.1], help="of the factored filter")
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=2.0, help="CPU time after which no run begins")
    parser.add_argument("--out", type=Path, help="file of JSON lines that is added to")
    parser.add_argument("--write", type=Path, metavar="PAGE", help="Markdown page with a place for the table of ratios")
    options = parser.parse_args()
    filters = compared(options.errors)
    wanted = options.filters or list(filters)
    unknown = set(wanted) - set(filters)
    if unknown:
        parser.error(f"--filters: expected some of {', '.join(filters)}; got {', '.join(sorted(unknown))}")
    lines = options.out.read_text("utf-8").splitlines() if options.out and options.out.exists() else []
    known = {(row.scene, row.filter): row for row in (Row(**json.loads(line)) for line in lines)}
    taken = [scene for scene in all_scenes() if any(word in scene.name for word in options.scenes)]
    shown: dict[str, Sequence[Row]] = {}
    for scene in taken:
        for name in wanted if options.runs else ():
            row = measured(scene, name, filters[name], max(2, round(scene.share * options.runs)), options.seconds)
            known[scene.name, name] = row
            if options.out:
                with options.out.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(asdict(row)) + "\n")
        names = [*filters, *(name for of, name in known if of == scene.name and name not in filters)]
        if rows := [known[scene.name, name] for name in names if (scene.name, name) in known]:
            shown[scene.name] = rows
            print("\n".join(table(scene.name, rows)), flush=True)
    every = dict.fromkeys(row.filter for rows in shown.values() for row in rows)
    text = "\n".join(overview(shown, list(every)))
    print(f"\n{text}")
    if options.write:
        write_between(options.write, "defaults.py", text)


if __name__ == "__main__":
    main()
