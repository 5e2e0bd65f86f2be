"""Said against found: what beliefs say of labels and of their number, where the truth is drawn from the model.

`benchmarks/beliefs.py` prints it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from compared import Fields, Timed, compared
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
