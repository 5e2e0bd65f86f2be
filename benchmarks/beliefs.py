"""Whether the beliefs of filters are true, on scenes drawn at random.

    python benchmarks/beliefs.py [--scenes N] [--seeds S ...] [--runs N] [--filters NAME ...] [--workers N]
    python benchmarks/beliefs.py --write docs/evidence/existence-probabilities.md
    python benchmarks/beliefs.py --scene 3 --bins              # one scene, with a table of bins for each filter
    python benchmarks/beliefs.py --four-sites --filters all    # a fixed scene, and all filters and fusions

The scenes are numbered from 1, and a number always gives the same scene (`random_scenes.py`). The targets of a run are
drawn from the model that the filters have, so that an exact filter is calibrated; they and the scans depend on the
scene, the seed and the run alone. Three kinds of statements are compared with the truth:

- labels: the existence probability of each label that a belief could hold. A label (step, site) exists if the target
  born at that step and site is alive. In a belief with an intensity of undetected targets (`belief.undetected`), a
  label that begins with a measurement exists if that was the first measurement of a target that is alive.
- places: the mean number of targets in each cell of 100 m of the region, undetected ones included.
- number: the distribution of the number of targets.

For labels and places the table gives the largest difference of the believed and the true mean over the bins (of the
believed value) that hold more than 500 values, with its standard error over runs. The verdict is "pass" where no
difference of either is above .05, "fail" where one is above it by more than two standard errors, and "unclear" where
more runs are needed. "Ranks" is the distance of the ranks of the true number in its distribution from uniform, 0 to 1;
"log score" is the mean of minus the log of the probability of the true number; "rms error" and "bias" are those of the
mean of the number; OSPA has c = 100 m, p = 1; "ms" is CPU time of a scan. Equal arguments give equal tables, except for
times.
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pages import write_between
from random_scenes import four_sites, random_scene
from scenes import Scene

from calibration import ALLOWED, ENOUGH, EXISTENCES, NUMBERS, Bins, Calibration, Case, calibration, cases

FILTERS = ("default", "default, detection at centres", "LMB", "delta-GLMB 300")
VERDICTS = ("pass", "unclear", "fail")
RUNS_OF_A_SCENE = 100_000  # numbers of runs are unlike in different scenes, so that their targets are


@dataclass(frozen=True)
class Task:
    """A filter on a scene. scene: number of a random scene, or detection probability and sensors of the four sites."""

    scene: int | tuple[float, int]
    case: Case
    seeds: tuple[int, ...]
    runs: int

    @property
    def made_scene(self) -> Scene:
        """The scene."""
        return random_scene(self.scene) if isinstance(self.scene, int) else four_sites(*self.scene)

    def run(self) -> Calibration:
        """Return its scores."""
        first = RUNS_OF_A_SCENE * self.scene if isinstance(self.scene, int) else 0
        return calibration(self.made_scene, self.case, self.seeds, self.runs, first)


Result = tuple[Task, Calibration]


def results(tasks: Sequence[Task], workers: int) -> Iterator[Result]:
    """Return the scores of each task, in their order."""
    if workers == 1:
        yield from ((task, task.run()) for task in tasks)
        return
    with ProcessPoolExecutor(workers) as pool:
        yield from zip(tasks, pool.map(Task.run, tasks), strict=True)


def scene_header() -> Iterator[str]:
    """The head of the table of scenes."""
    names = ("labels", "places", "ranks", "log score", "rms error", "bias", "OSPA, m", "ms", "verdict")
    yield f"| scene | filter | {' | '.join(names)} |"
    yield f"|---|---|{'---:|' * (len(names) - 1)}---|"


def scene_row(task: Task, found: Calibration) -> str:
    """One line of the table of scenes."""
    number = f"{found.rank_deviation:.3f} | {found.log_score:.3f} | {found.rms_error:.3f} | {found.bias:+.3f}"
    worst = f"{_worst(found.labels)} | {_worst(found.places)}"
    times = f"{found.ospa:.2f} | {found.milliseconds:.2f}"
    return f"| {task.made_scene.name} | {task.case.name} | {worst} | {number} | {times} | {found.verdict} |"


def _worst(bins: Bins | None) -> str:
    if bins is None:
        return ""
    difference, error = bins.worst
    return "" if np.isnan(difference) else f"{difference:.3f} ± {error:.3f}"


def by_filter(found: Sequence[Result]) -> dict[str, list[Calibration]]:
    """The scores of all scenes of each filter."""
    names = dict.fromkeys(task.case.name for task, _ in found)
    return {name: [scores for task, scores in found if task.case.name == name] for name in names}


def summary_table(found: Sequence[Result]) -> Iterator[str]:
    """A line for each filter: verdicts, and means over scenes."""
    yield f"| filter | {' | '.join(VERDICTS)} | log score | rms error | bias | OSPA, m | ms |"
    yield f"|---|{'---:|' * (len(VERDICTS) + 5)}"
    for name, scores in by_filter(found).items():
        counts = " | ".join(str(sum(one.verdict == verdict for one in scores)) for verdict in VERDICTS)
        columns = [(one.log_score, one.rms_error, one.bias, one.ospa, one.milliseconds) for one in scores]
        means = "{:.3f} | {:.3f} | {:+.3f} | {:.2f} | {:.2f}".format(*np.mean(columns, axis=0))
        yield f"| {name} | {counts} | {means} |"


def shares_table(found: Sequence[Result], what: str) -> Iterator[str]:
    """A line for each filter: the true mean of what was believed, by bins, of the runs of all scenes.

    what: "labels" or "places". A bin with too few values to be judged is in brackets.
    """
    bounds = EXISTENCES if what == "labels" else NUMBERS
    yield f"| {what} | " + " | ".join(f"{low:g} to {high:g}" for low, high in itertools.pairwise(bounds)) + " |"
    yield "|---|" + "---:|" * (len(bounds) - 1)
    for name, scores in by_filter(found).items():
        parts = [bins.sums for one in scores if (bins := getattr(one, what)) is not None]
        if parts:
            rows = Bins(bounds, np.concatenate(parts)).rows()
            yield f"| {name} | " + " | ".join(_share(*row[:3]) for row in rows) + " |"


def _share(number: float, believed: float, true: float) -> str:
    if not number:
        return ""
    return f"{true:.3f} of {believed:.3f}" if number > ENOUGH else f"({true:.3f} of {believed:.3f})"


def bin_table(name: str, bins: Bins) -> Iterator[str]:
    """Believed and true means of each bin."""
    yield f"| {name} from | to | values | believed | true |"
    yield "|---:|---:|---:|---:|---:|"
    for low, high, (number, believed, true, error) in zip(bins.bounds[:-1], bins.bounds[1:], bins.rows(), strict=True):
        if number:
            yield f"| {low:g} | {high:g} | {number:.0f} | {believed:.4f} | {true:.4f} ± {error:.4f} |"


def tasks_of(options: argparse.Namespace) -> list[Task]:
    """All filters that were asked for, on all scenes that they fit."""
    known = {case.name: case for case in cases(options.errors)}
    extra = [name for name in known if name.startswith("factored ")]
    names = list(known) if options.filters == ["all"] else [*options.filters, *extra]
    if unknown := [name for name in names if name not in known]:
        raise SystemExit(f"--filters: expected some of {', '.join(known)}, or all; got {unknown[0]}")
    scenes: Iterable[int | tuple[float, int]] = options.scene or range(1, options.scenes + 1)
    if options.four_sites:
        scenes = itertools.product((0.7, 0.95), (1, 2))
    tasks = [Task(scene, known[name], tuple(options.seeds), options.runs) for scene in scenes for name in names]
    return [task for task in tasks if task.case.fits(task.made_scene)]


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=20, help="number of random scenes")
    parser.add_argument("--scene", type=int, nargs="+", help="numbers of random scenes, instead of --scenes")
    parser.add_argument("--four-sites", action="store_true", help="a fixed scene instead of random ones")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2], help="of targets and scans")
    parser.add_argument("--runs", type=int, default=20, help="of each scene and seed")
    parser.add_argument("--filters", nargs="+", default=list(FILTERS), help="names, or all")
    parser.add_argument("--errors", type=float, nargs="*", default=[], help="more split errors of the default filter")
    parser.add_argument("--bins", action="store_true", help="a table of bins for each scene and filter")
    parser.add_argument("--workers", type=int, default=1, help="processes")
    parser.add_argument("--write", type=Path, metavar="PAGE", help="Markdown page with a place for the tables")
    options = parser.parse_args(arguments)
    rows, found = list(scene_header()), []
    print("\n".join(rows), flush=True)
    for task, scores in results(tasks_of(options), options.workers):
        found.append((task, scores))
        rows.append(scene_row(task, scores))
        print(rows[-1], flush=True)
        if options.bins:
            tables = [bin_table(what, bins) for what in ("labels", "places") if (bins := getattr(scores, what))]
            print("", *itertools.chain(*((*table, "") for table in tables)), sep="\n", flush=True)
    seeds = ", ".join(map(str, options.seeds))
    title = f"{options.runs} runs of each scene and seed, seeds {seeds}; verdicts at a difference of {ALLOWED:g}:"
    shares = [shares_table(found, what) for what in ("labels", "places")]
    parts = [[title], rows, summary_table(found), *shares]
    text = "\n\n".join("\n".join(part) for part in parts)
    print("", *text.split("\n\n")[2:], sep="\n\n", flush=True)
    if options.write:
        write_between(options.write, "beliefs.py" + (" --four-sites" if options.four_sites else ""), text)


if __name__ == "__main__":
    main()
