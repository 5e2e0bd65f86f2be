"""Where should the sensors go? Rewards, rules of thumb and true targets on many scenes (docs/evidence/strategies.md).

    python benchmarks/deciding.py --runs 5 --write docs/evidence/strategies.md
    python benchmarks/deciding.py --strategies all --runs 100 --workers 2 --out benchmarks/results/deciding.csv
    python benchmarks/deciding.py --scenes paper-a --runs 100

Runs are paired: at the same number every strategy meets the same truth, and the same luck where it sees it. A scene is
taken if any of the words is in its name. With `--out` each run is written as it ends, and what is there is not run
again, so that it goes on after a Ctrl-C; `--runs 0` prints the tables of the file alone.

A table a scene. "more" is the paired mean difference to the first strategy, joint decisions by the expected loss, with
its standard error; it is marked * where Holm's correction over the scene's strategies leaves it told from zero at 95 %.
"won" is the share of runs in which the first strategy is better. Then come the mean OSPA of the median and of the worst
run, and the share of runs that end with a lost target. "lost" is the part of OSPA that is of lost and false targets.
"score" is (rule - plan) / (rule - floor), with its standard error: 0 for the best rule of thumb, 1 for the floor, joint
decisions on the true targets; none where these are less than two standard errors apart. "short" is how far the choices
may be from the best joint ones, by the plans' own bounds. "ms" is CPU time of a decision on one thread, the mean over
decisions and runs.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

import numpy as np
from deciding_scenes import RULES, Scene, scenes, strategies
from pages import write_between
from timed_planner import Timed

from vedette.evaluation.metrics.matching import match_run
from vedette.evaluation.metrics.point_ospa import ospa_of_run
from vedette.evaluation.statistics import paired_difference, summarise
from vedette.evaluation.tail_summary import summarise_tail, tail_header
from vedette.internal.processes import end_with_parent
from vedette.kernels.base.types import Floats
from vedette.scenarios import Scenario, replace_fields
from vedette.scenarios.build import build_experiment, build_planner
from vedette.simulation import simulate

SEED, FIRST, FLOOR, LEVEL = 0, "jdm loss", "true targets", 0.05
BEFORE = ("random", "constant")
LEAST_GAP = 0.02  # m, between a rule of thumb and the floor: below it there is nothing to score
COLUMNS = (FLOOR, "oracle 1", "idm stay", "best rule")
REST = ("lost (m)", "score", "short", "ms", "runs")
USUAL = (FIRST, FLOOR, "oracle 1", "idm stay", "rule")


class Score(NamedTuple):
    """What came of one run."""

    ospa: float  # mean over the scored scans
    lost: float  # its part of lost and false targets
    milliseconds: float  # of a decision
    short: float  # how far the choices may be from the best, relative; NaN where plans do not say
    ends_lost: float  # 1 where a target has no estimate at the last scored scan, else 0


Runs = dict[str, dict[int, Score]]  # by strategy and run


def prepared(scene: Scene) -> Scenario:
    """The scenario with all strategies in it."""
    given = scene.scenario()
    return replace_fields(given, {"planners": strategies(given), "control.explain": False})


def score(scene_name: str, strategy: str, run: int) -> Score:
    """One run."""
    [scene] = [own for own in scenes() if own.name == scene_name]
    scenario = prepared(scene)
    planner, ospa = build_planner(scenario, strategy, 1), scenario.model.ospa
    assert planner is not None
    timed = Timed(planner)
    ospa_of = partial(ospa_of_run, cutoff=ospa.cutoff, order=ospa.order, components=ospa.components)
    record = simulate(build_experiment(scenario), timed, seed=SEED, run=run, score=ospa_of)
    first = ospa.first_scan or (scenario.model.decision_steps[0] + 1 if scenario.model.decision_steps else 1)
    scored = slice(first - 1, ospa.last_scan)
    total, _, lost = record.ospa[scored].mean(axis=0).tolist()
    short = float(np.mean(timed.short)) if timed.short else np.nan
    missed = match_run(record.truth, record.estimates, cutoff=ospa.cutoff, order=ospa.order).num_missed[scored]
    return Score(total, lost, 1e3 * float(np.mean(timed.seconds)), short, float(missed[-1] > 0))


class Store:
    """Scores by scene, strategy and run; in a CSV file, where there is one."""

    def __init__(self, file: Path | None) -> None:
        self.file, self.found = file, dict[str, Runs]()
        if file is None or not file.exists():
            return
        with file.open(newline="", encoding="utf-8") as lines:
            for scene, strategy, run, *numbers in csv.reader(lines):
                self._keep(scene, strategy, int(run), Score(*map(float, numbers)))

    def has(self, scene: str, strategy: str, run: int) -> bool:
        """Whether it has been run."""
        return run in self.found.get(scene, {}).get(strategy, {})

    def add(self, scene: str, strategy: str, run: int, score: Score) -> None:
        """Keep one."""
        self._keep(scene, strategy, run, score)
        if self.file is not None:
            self.file.parent.mkdir(parents=True, exist_ok=True)
            with self.file.open("a", newline="", encoding="utf-8") as out:
                csv.writer(out).writerow([scene, strategy, run, *(f"{number:.6g}" for number in score)])

    def _keep(self, scene: str, strategy: str, run: int, score: Score) -> None:
        self.found.setdefault(scene, {}).setdefault(strategy, {})[run] = score


def holm(p_values: Sequence[float]) -> list[bool]:
    """Which hypotheses are rejected at `LEVEL` for the whole family (Holm 1979)."""
    order, rejected = np.argsort(p_values), [False] * len(p_values)
    for rank, place in enumerate(order.tolist()):
        if p_values[place] > LEVEL / (len(p_values) - rank):
            break
        rejected[place] = True
    return rejected


def p_value(differences: Floats) -> float:
    """Of Student's t test, two-sided, that the mean is zero."""
    from scipy.stats import ttest_1samp

    if len(differences) < 2 or not differences.any():
        return 1.0
    return float(ttest_1samp(differences, 0.0).pvalue)


def paired(runs: Runs, strategy: str, other: str) -> tuple[Floats, Floats]:
    """(num,) OSPA of two strategies in the runs that both have."""
    both = sorted(runs.get(strategy, {}).keys() & runs.get(other, {}).keys())
    return (np.array([runs[name][run].ospa for run in both]) for name in (strategy, other))  # type: ignore[return-value]


def best_rule(runs: Runs) -> str | None:
    """The rule of thumb, of those that ask for no luck, of least mean error."""
    known = [f"rule {rule}" for rule in RULES if runs.get(f"rule {rule}")]
    return min(known, key=lambda name: mean(runs, name), default=None)


def place(runs: Runs, name: str) -> str:
    """Where a strategy stands between the best rule of thumb, 0, and the floor, 1, with its standard error."""
    rule = best_rule(runs)
    both = sorted(set.intersection(*(set(runs.get(own or "", {})) for own in (rule, name, FLOOR))))
    if len(both) < 2:
        return ""
    rules, plans, floors = (np.array([runs[own or ""][run].ospa for run in both]) for own in (rule, name, FLOOR))
    gap = summarise(rules - floors)
    if gap.mean <= max(LEAST_GAP, 2.0 * gap.standard_error):
        return ""
    share = float((rules - plans).mean() / gap.mean)
    error = summarise(rules - plans - share * (rules - floors)).standard_error / gap.mean  # of a ratio of means
    return f"{share:.2f} ± {error:.2f}"


def mean(runs: Runs, name: str) -> float:
    """Mean OSPA of a strategy."""
    return float(np.mean([own.ospa for own in runs[name].values()]))


def shortfall(runs: Runs, name: str) -> str:
    """How far the choices of a strategy may be from the best, by its plans' own bounds."""
    short = np.array([own.short for own in runs[name].values()])
    return f"{np.nanmean(short):.1%}" if np.isfinite(short).any() else ""


def table(runs: Runs) -> Iterator[str]:
    """The table of one scene."""
    yield "| " + " | ".join(["Strategy", "OSPA (m)", "more (m)", "won", *tail_header("m"), *REST]) + " |"
    yield "| --- |" + " ---: |" * 11
    names = [name for name in runs if len(runs[name]) > 1]
    differences = {name: np.subtract(*paired(runs, name, FIRST)) for name in names}
    clear = dict(zip(names, holm([p_value(own) for own in differences.values()]), strict=True))
    for name in sorted(names, key=lambda name: mean(runs, name)):
        scores = np.array(list(runs[name].values()))
        total = summarise(scores[:, 0])
        more = summarise(differences[name]) if len(differences[name]) > 1 else None
        cells = [name, f"{total.mean:.2f} ± {total.standard_error:.2f}"]
        if name == FIRST or more is None:
            cells += ["", ""]
        else:
            star = "*" if clear[name] else ""
            cells += [f"{more.mean:+.2f} ± {more.standard_error:.2f}{star}", f"{np.mean(differences[name] > 0):.0%}"]
        cells += [
            *summarise_tail(scores[:, 0], scores[:, 4]).cells(),
            f"{scores[:, 1].mean():.2f}",
            place(runs, name),
            shortfall(runs, name),
        ]
        cells += [f"{scores[:, 2].mean():.1f}", str(len(scores))]
        yield "| " + " | ".join(cells) + " |"


def overview(found: dict[str, Runs], names: Iterable[str]) -> Iterator[str]:
    """One row a scene: the first strategy, its score, how far from the best it may be, how much more others have."""
    yield f"| Scene | {FIRST} | score | short | " + " | ".join(COLUMNS) + " | runs |"
    yield "| --- |" + " ---: |" * (len(COLUMNS) + 4)
    for name in names:
        runs = found[name]
        if len(runs.get(FIRST, {})) < 2:
            continue
        total = summarise([own.ospa for own in runs[FIRST].values()])
        cells = [name, f"{total.mean:.2f} ± {total.standard_error:.2f}", place(runs, FIRST), shortfall(runs, FIRST)]
        for column in COLUMNS:
            own = best_rule(runs) if column == "best rule" else column
            first, second = paired(runs, own or "", FIRST)
            if len(first) < 2:
                cells.append("")
                continue
            more = paired_difference(first, second).summary
            word = f" ({own.removeprefix('rule ')})" if column == "best rule" and own else ""
            cells.append(f"{more.mean:+.2f} ± {more.standard_error:.2f}{word}")
        yield "| " + " | ".join([*cells, str(total.num_runs)]) + " |"


def wanted(given: argparse.Namespace, store: Store) -> Iterator[tuple[str, str, int]]:
    """What is to be run: of all scenes the first runs first."""
    usual = [own for own in scenes() if not own.group.startswith("generated")]
    taken = [own for own in scenes() if any(word in own.name for word in given.scenes)] if given.scenes else usual
    for scene in taken:
        names = [*strategies(scene.scenario()), *BEFORE]
        for run in range(max(round(given.runs * scene.share), min(given.runs, 2))):
            for name in names:
                chosen = "all" in given.strategies or any(name.startswith(word) for word in given.strategies)
                if chosen and not name.startswith(tuple(given.without)) and not store.has(scene.name, name, run):
                    yield scene.name, name, run


def run_all(given: argparse.Namespace, store: Store) -> None:
    """Run what is wanted; what fails is told, and the rest goes on."""
    with ProcessPoolExecutor(given.workers, get_context("spawn"), initializer=end_with_parent) as pool:
        futures = {pool.submit(score, *task): task for task in wanted(given, store)}
        try:
            for done in as_completed(futures):
                try:
                    store.add(*futures[done], done.result())
                except Exception as error:
                    print(f"failed: {futures[done]}: {error}", flush=True)
        except KeyboardInterrupt:
            pool.shutdown(cancel_futures=True)
            raise


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--scenes", nargs="+", default=(), help="words in their names; without, all but the generated")
    parser.add_argument("--strategies", nargs="+", default=USUAL, help="beginnings of their names, or all")
    parser.add_argument("--without", nargs="+", default=("pair",), help="beginnings of names that are left out")
    parser.add_argument("--runs", type=int, default=50, help="of each strategy; scenes that take long have a share")
    parser.add_argument("--workers", type=int, default=1, help="processes")
    parser.add_argument("--out", type=Path, help="CSV file of results, which is gone on with")
    parser.add_argument("--write", type=Path, help="page of the documentation whose table is replaced")
    given = parser.parse_args()
    store = Store(given.out)
    known = sorted({name for scene in scenes() for name in (*strategies(scene.scenario()), *BEFORE)})
    for word in given.strategies:
        if word != "all" and not any(name.startswith(word) for name in known):
            parser.error(f"--strategies: expected the beginning of one of {', '.join(known)}; got {word!r}")
    run_all(given, store)
    names = [scene.name for scene in scenes() if scene.name in store.found]
    for name in names:
        print(f"\n### {name}\n", *table(store.found[name]), sep="\n", flush=True)
    lines = "\n".join(overview(store.found, names))
    print(f"\n{lines}")
    if given.write is not None:
        write_between(given.write, "deciding.py", lines)


if __name__ == "__main__":
    main()
