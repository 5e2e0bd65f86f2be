"""Whether what filters and fusions believe is true: said against found, where the truth is drawn from the very model.

    python benchmarks/beliefs.py [--detection P ...] [--runs N] [--cases WORD ...] [--errors E ...] [--summary]
    python benchmarks/beliefs.py --summary --write docs/filters.md

Four sites give birth with probability 0.06 at each of 25 scans; targets live on with 0.95 and are detected with P by
each position sensor, among 10 false measurements a scan. Each run draws targets from just this, so each of the 100
labels (step, site) exists or not at each scan, and the number of targets is a draw from its posterior where that is
right.

Prints of each filter, and of each way to take two sensors' scans or beliefs together, a Markdown table: the labels and
scans of which an existence between two bounds was said, the mean that was said, and the share that exists with its
standard error (runs are independent, scans of a run are not). Labels that a belief does not hold are said not to exist.

Then a table of a line each: the largest difference of said and found over the bins of more than 500, with its standard
error; the log loss and Brier score of the labels, summed over them, a scan, existences held in 1e-6 to 1 - 1e-6; what
the ranks of the true number in its posterior distribution (ties broken at random) differ from uniform, as the largest
distance of the distribution functions, 0 to 1; OSPA (c = 100 m, p = 1); CPU milliseconds a scan. Filters without labels
have the number alone. And what share exists of what was said, a line each. Equal arguments print equal tables, but for
the times.
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
from all import write_between
from defaults import Fields, Timed, compared
from numpy.typing import ArrayLike, NDArray
from scenes import own, site

from vedette.densities import Estimate, Estimator, Labelled, cardinality_distribution, existence_probabilities
from vedette.evaluation import ospa_of_run
from vedette.models import TargetModel
from vedette.scenarios.build import build_experiment
from vedette.simulation import Truth, simulate
from vedette.simulation.truth import moved_states

SEED, NUM_STEPS = 1, 25
BOUNDS = np.array([0.0, 0.05, 0.2, 0.5, 0.7, 0.9, 0.99, 0.999, 1.0])
ENOUGH = 500  # in a bin, to judge it
_NEVER_SURER = 1e-6

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class PriorTargets:
    """Targets drawn from the model that the filters have.

    The id of the target of label (step, site) is (step - 1) * num_sites + site.
    """

    model: TargetModel

    def truth(self, times: ArrayLike, *, rng: np.random.Generator) -> Truth:
        """Births and lives, scan after scan."""
        scans, birth = np.asarray(times, np.float64), self.model.birth
        factors = np.linalg.cholesky(birth.covs)
        ids, states = np.empty(0, np.int64), np.empty((0, birth.state_dim))
        alive: list[NDArray[np.int64]] = []
        rows: list[Floats] = []
        for k in range(len(scans)):
            if k > 0:
                dt = float(scans[k] - scans[k - 1])
                lives = rng.random(len(ids)) < self.model.survival.prob(states, dt)
                ids, states = ids[lives], states[lives]
                noise = rng.standard_normal(states.shape)
                states = moved_states(self.model.motion, states, dt, noise, np.ones(len(ids), np.bool_))
            born = np.flatnonzero(rng.random(birth.num_sites) < birth.existence)
            starts = birth.means + (factors @ rng.standard_normal(birth.means.shape)[:, :, None])[:, :, 0]
            ids = np.concatenate([ids, k * birth.num_sites + born])
            states = np.concatenate([states, starts[born]])
            alive.append(ids)
            rows.append(states)
        offsets = np.concatenate([[0], np.cumsum([len(own_ids) for own_ids in alive])])
        return Truth(scans, offsets.astype(np.int64), np.concatenate(alive), np.concatenate(rows))


@dataclass
class Listener:
    """An estimator that writes down what each density says: existence by label, and the distribution of the number."""

    estimate: Estimator
    num_sites: int
    existence: list[Floats]
    numbers: list[Floats]

    def __call__(self, density: Any, step: int) -> Estimate:
        said = np.zeros(NUM_STEPS * self.num_sites)
        if isinstance(density, Labelled):
            labels, existence = existence_probabilities(density)
            said[(labels[:, 0] - 1) * self.num_sites + labels[:, 1]] = existence
        self.existence.append(said)
        self.numbers.append(cardinality_distribution(density))
        return self.estimate(density, step)


@dataclass(frozen=True)
class Calibration:
    """What was said and what was found in some runs.

    Attributes:
        said, found: (num_runs, num_scans, num_labels) existence said of each label, and whether it exists.
        ranks: (num_runs, num_scans) of the true number in its posterior, 0 to 1.
        ospa: m, mean over scans and runs.
        milliseconds: of CPU a scan.
    """

    said: Floats
    found: NDArray[np.bool_]
    ranks: Floats
    ospa: float
    milliseconds: float

    @cached_property
    def possible(self) -> NDArray[np.bool_]:
        """(num_scans, num_labels) labels that may have been born by then."""
        num_sites = self.said.shape[2] // NUM_STEPS
        return np.arange(self.said.shape[2]) // num_sites <= np.arange(NUM_STEPS)[:, None]

    def bins(self) -> Floats:
        """(num_bins, 4) labels and scans in each bin, mean said, share found, standard error of their difference."""
        rows = np.full((len(BOUNDS) - 1, 4), np.nan)
        place = np.clip(np.searchsorted(BOUNDS, self.said, side="right") - 1, 0, len(BOUNDS) - 2)
        for index, row in enumerate(rows):
            inside = (place == index) & self.possible
            row[0] = number = np.count_nonzero(inside)
            if number:
                excess = ((self.found - self.said) * inside).sum(axis=(1, 2))
                row[1:] = (
                    self.said[inside].mean(),
                    self.found[inside].mean(),
                    np.sqrt(len(excess) * excess.var(ddof=1)) / number if len(excess) > 1 else np.nan,
                )
        return rows

    @property
    def worst(self) -> tuple[float, float]:
        """Largest difference of said and found over the bins that hold enough, and its standard error."""
        rows = self.bins()
        rows = rows[rows[:, 0] > ENOUGH]
        differences = np.abs(rows[:, 1] - rows[:, 2])
        place = int(np.argmax(differences))
        return float(differences[place]), float(rows[place, 3])

    @property
    def log_loss(self) -> float:
        """Of all labels together, a scan."""
        held = np.clip(self.said, _NEVER_SURER, 1.0 - _NEVER_SURER)
        losses = -np.log(np.where(self.found, held, 1.0 - held)) * self.possible
        return float(losses.sum(axis=2).mean())

    @property
    def brier(self) -> float:
        """Of all labels together, a scan."""
        return float(((self.said - self.found) ** 2).sum(axis=2).mean())

    @property
    def rank_deviation(self) -> float:
        """Largest distance of the distribution function of the ranks from that of the uniform distribution."""
        ranks = np.sort(self.ranks.ravel())
        steps = np.arange(len(ranks) + 1) / len(ranks)
        return float(max((steps[1:] - ranks).max(), (ranks - steps[:-1]).max()))


@dataclass(frozen=True)
class Case:
    """A filter, and how the scans or beliefs of several sensors become one."""

    name: str
    fields: Fields
    num_sensors: int = 1
    fusion: Fields | None = None

    @property
    def labels(self) -> bool:
        """Whether its targets have names."""
        return self.fields["filter.kind"] not in ("phd", "cphd", "cb_member")


def cases(errors: Iterable[float] = ()) -> Iterator[Case]:
    """Every filter, and every way to take two sensors together."""
    filters = compared(errors)
    del filters["delta-GLMB 1,000"]
    filters["delta-GLMB 300"] = {"filter.kind": "delta_glmb"}
    unlabelled = {"PHD": "phd", "CPHD": "cphd", "CB-MeMBer": "cb_member"}
    filters |= {name: {"filter.kind": kind} for name, kind in unlabelled.items()}
    for name, fields in filters.items():
        yield Case(name, fields)
    labelled = {"default": filters["default"], "LMB": filters["LMB"], "delta-GLMB 300": filters["delta-GLMB 300"]}
    labelled["M-delta-GLMB"] = filters["M-delta-GLMB"]
    for name, fields in labelled.items():
        yield Case(f"sequential, {name}", fields, 2, {"kind": "sequential"})
    yield Case("central, LMB", labelled["LMB"], 2, {"kind": "central"})
    for name, fields in labelled.items():
        kind = "clmb" if name == "LMB" else "cm_delta_glmb"
        yield Case(f"{kind}, {name}", fields, 2, {"kind": kind})
    for kind, name in (("clmb", "LMB"), ("cm_delta_glmb", "default")):
        yield Case(f"{kind} with feedback, {name}", labelled[name], 2, {"kind": kind, "feedback": True})
    for kind, name in (("arithmetic_average", "LMB"), ("arithmetic_average", "default"), ("parallel", "LMB")):
        yield Case(f"{kind}, {name}", labelled[name], 2, {"kind": kind})


def calibration(case: Case, detection: float, num_runs: int) -> Calibration:
    """What a case said and what was so, over runs of seeds that are always the same."""
    places = [(200.0, 200.0), (-200.0, 200.0), (200.0, -200.0), (-200.0, -200.0)]
    scene = own(
        "prior",
        {
            "time.num_steps": NUM_STEPS,
            "motion.sigma_v": 2.0,
            "survival.probability": 0.95,
            "birth.sites": [site(place) for place in places],
            "sensors.*.detection.probability": detection,
            "sensors.*.clutter.rate": 10.0,
            **case.fields,
        },
        case.num_sensors,
        case.fusion,
    )
    experiment = build_experiment(scene.scenario(0))
    targets, timed = PriorTargets(experiment.tracker.targets), Timed(experiment.tracker, [])
    score, found, ranks, ospa = partial(ospa_of_run, cutoff=100.0, order=1.0), [], [], []
    listener = Listener(experiment.estimate, len(places), [], [])
    experiment = replace(experiment, targets=targets, tracker=timed, estimate=listener)
    for run in range(num_runs):
        truth, rng = (record := simulate(experiment, None, seed=SEED, run=run, score=score)).truth, _tie_breaks(run)
        exists = np.zeros((NUM_STEPS, len(places) * NUM_STEPS), np.bool_)
        exists[np.repeat(np.arange(NUM_STEPS), np.diff(truth.offsets)), truth.ids] = True
        found.append(exists)
        said = listener.numbers[-NUM_STEPS:]
        ranks.append([_rank(p, n, rng) for p, n in zip(said, np.diff(truth.offsets).tolist(), strict=True)])
        ospa.append(record.ospa[:, 0].mean())
    existence = np.array(listener.existence).reshape(num_runs, NUM_STEPS, -1)
    milliseconds = 1e3 * float(np.median(timed.seconds))
    return Calibration(existence, np.array(found), np.array(ranks), float(np.mean(ospa)), milliseconds)


def _tie_breaks(run: int) -> np.random.Generator:
    return np.random.default_rng([SEED, run])


def _rank(chances: Floats, number: int, rng: np.random.Generator) -> float:
    """Where the true number stands in its distribution: uniform if that is right."""
    below, at = chances[:number].sum(), chances[number : number + 1].sum()
    return float(below + at * rng.random())


def bin_table(found: Calibration) -> Iterator[str]:
    """Said against found."""
    yield "| said from | to | labels and scans | said | exist |"
    yield "|---:|---:|---:|---:|---:|"
    for low, high, (number, said, true, error) in zip(BOUNDS[:-1], BOUNDS[1:], found.bins(), strict=True):
        if number:
            yield f"| {low:g} | {high:g} | {number:.0f} | {said:.3f} | {true:.3f} ± {error:.3f} |"


def summary_table(told: Sequence[tuple[Case, Calibration]]) -> Iterator[str]:
    """A line each: the scores."""
    yield "| beliefs | largest difference | log loss | Brier | ranks | OSPA, m | ms |"
    yield "|---|---:|---:|---:|---:|---:|---:|"
    for case, found in told:
        labels = " | | "
        if case.labels:
            worst, error = found.worst
            labels = f"{worst:.3f} ± {error:.3f} | {found.log_loss:.3f} | {found.brier:.3f}"
        yield f"| {case.name} | {labels} | {found.rank_deviation:.3f} | {found.ospa:.2f} | {found.milliseconds:.2f} |"


def shares_table(told: Sequence[tuple[Case, Calibration]]) -> Iterator[str]:
    """A line each: what share exists of what was said, in brackets where that is too few to judge by."""
    yield "| beliefs | " + " | ".join(f"{low:g} to {high:g}" for low, high in itertools.pairwise(BOUNDS)) + " |"
    yield "|---|" + "---:|" * (len(BOUNDS) - 1)
    for case, found in told:
        if case.labels:
            yield f"| {case.name} | " + " | ".join(_share(*row[:3]) for row in found.bins()) + " |"


def _share(number: float, said: float, true: float) -> str:
    if not number:
        return ""
    return f"{true:.3f} of {said:.3f}" if number > ENOUGH else f"({true:.3f} of {said:.3f})"


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--detection", type=float, nargs="+", default=[0.7, 0.95], help="of each sensor")
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--cases", nargs="+", default=[""], help="words in their names; all")
    parser.add_argument(
        "--errors", type=float, nargs="*", default=[], help="further split errors of the factored filter"
    )
    parser.add_argument("--summary", action="store_true", help="without the tables of each")
    parser.add_argument("--write", type=Path, metavar="PAGE", help="Markdown page with a place for the tables of all")
    options = parser.parse_args(arguments)
    texts = []
    for detection in options.detection:
        title = f"P_D {detection:g}, {options.runs} runs, seed {SEED}"
        print(f"\n## {title}", flush=True)
        told = []
        for case in cases(options.errors):
            if any(word in case.name for word in options.cases):
                told.append((case, calibration(case, detection, options.runs)))
                if case.labels and not options.summary:
                    print("\n".join(["", f"### {case.name}", "", *bin_table(told[-1][1])]), flush=True)
        texts.append("\n".join([f"{title}:", "", *summary_table(told), "", *shares_table(told)]))
        print(f"\n{texts[-1]}", flush=True)
    if options.write:
        write_between(options.write, "beliefs.py", "\n\n".join(texts))


if __name__ == "__main__":
    main()
