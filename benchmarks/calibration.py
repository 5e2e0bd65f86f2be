"""Whether beliefs are true: what they state of labels, places and the number of targets, compared with the truth.

`benchmarks/beliefs.py` prints it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from compared import Fields, Timed, compared
from numpy.typing import NDArray
from places import expected_in_cells, true_in_cells
from prior_targets import Names, PriorTargets
from scenes import Scene

from vedette.densities import LabelledDensity, cardinality_distribution
from vedette.errors import ScenarioError
from vedette.evaluation import ospa_of_run
from vedette.internal.unit_warnings import suppress_unit_warnings
from vedette.models import CellGrid
from vedette.scenarios import Scenario, replace_fields
from vedette.scenarios.build import build_experiment
from vedette.simulation import SimulationRun

Floats = NDArray[np.float64]

EXISTENCES = np.array([0.0, 0.05, 0.2, 0.5, 0.7, 0.9, 0.99, 0.999, 1.0])  # bounds of bins
NUMBERS = np.array([0.0, 0.01, 0.05, 0.2, 0.5, 0.8, 0.95, 1.05, np.inf])  # of targets in a cell, bounds of bins
CELL = 100.0  # m, side of a cell
ENOUGH = 500  # values in a bin, above which it is judged
ALLOWED = 0.05  # difference of the means of a bin
NEVER_SURER = 1e-6  # least probability of a number of targets in the log score
CUTOFF, ORDER = 100.0, 1.0  # of OSPA; m, -


@dataclass(frozen=True)
class Bins:
    """Believed and true values of some runs, summed by bins of the believed value.

    Attributes:
        bounds: (num_bins + 1,) of the bins.
        sums: (num_runs, num_bins, 3) number of values, sum of the believed ones, sum of the true ones.
    """

    bounds: Floats
    sums: Floats

    def rows(self) -> Floats:
        """(num_bins, 4) number of values, mean believed, mean true, standard error of their difference.

        The values of a run depend on each other, and runs do not: the error is that of a mean over runs. NaN in a bin
        without values.
        """
        number, believed, true = self.sums.sum(axis=0).T
        excess, num_runs = self.sums[:, :, 2] - self.sums[:, :, 1], len(self.sums)
        spread = np.sqrt(num_runs * excess.var(axis=0, ddof=1)) if num_runs > 1 else np.full(len(number), np.nan)
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.column_stack([number, believed / number, true / number, spread / number])

    def judged(self) -> tuple[Floats, Floats]:
        """(n,) differences of believed and true means, without sign, of the bins with enough values; their errors."""
        rows = self.rows()
        rows = rows[rows[:, 0] > ENOUGH]
        return np.abs(rows[:, 1] - rows[:, 2]), rows[:, 3]

    @property
    def worst(self) -> tuple[float, float]:
        """Largest difference of the bins with enough values, and its standard error; NaN where there is no such bin."""
        differences, errors = self.judged()
        if not len(differences):
            return float("nan"), float("nan")
        place = int(np.argmax(differences))
        return float(differences[place]), float(errors[place])

    @property
    def verdict(self) -> str:
        """The word "pass": no difference above `ALLOWED`; "fail": one by two standard errors; else "unclear"."""
        differences, errors = self.judged()
        if not (differences > ALLOWED).any():
            return "pass"
        return "fail" if (differences - 2.0 * errors > ALLOWED).any() else "unclear"


@dataclass(frozen=True)
class Calibration:
    """Scores of the beliefs of a filter in the runs of a scene.

    Attributes:
        labels: existence probabilities of labels; None of a filter without labels.
        places: numbers of targets in cells.
        numbers: (num_runs, num_scans, 4) rank of the true number of targets in its distribution, 0 to 1; log score of
            the true number; error of the mean; OSPA, m.
        milliseconds: median CPU time of a scan.
    """

    labels: Bins | None
    places: Bins
    numbers: Floats
    milliseconds: float

    @property
    def rank_deviation(self) -> float:
        """Largest distance of the distribution function of the ranks from that of the uniform distribution."""
        ranks = np.sort(self.numbers[:, :, 0].ravel())
        steps = np.arange(len(ranks) + 1) / len(ranks)
        return float(max((steps[1:] - ranks).max(), (ranks - steps[:-1]).max()))

    @property
    def log_score(self) -> float:
        """Mean over runs and scans of minus the log of the probability of the true number."""
        return float(self.numbers[:, :, 1].mean())

    @property
    def bias(self) -> float:
        """Mean of the believed mean number less the true number."""
        return float(self.numbers[:, :, 2].mean())

    @property
    def rms_error(self) -> float:
        """Root mean squared error of the mean number."""
        return float(np.sqrt((self.numbers[:, :, 2] ** 2).mean()))

    @property
    def ospa(self) -> float:
        """Mean OSPA in m."""
        return float(self.numbers[:, :, 3].mean())

    @property
    def verdict(self) -> str:
        """The worse one of the verdicts on labels and on places."""
        verdicts = [bins.verdict for bins in (self.labels, self.places) if bins is not None]
        return next(verdict for verdict in ("fail", "unclear", "pass") if verdict in verdicts)


@dataclass(frozen=True)
class Case:
    """A filter, and how it takes several sensors.

    Attributes:
        name: by which it is asked for.
        fields: of a scenario.
        fusion: section of a scenario for scenes of several sensors; None: that of the scene, sequential.
    """

    name: str
    fields: Fields
    fusion: Fields | None = None

    @property
    def has_labels(self) -> bool:
        """Whether its beliefs name targets."""
        return self.fields["filter.kind"] not in ("phd", "cphd", "cb_member")

    def fits(self, scene: Scene) -> bool:
        """Whether it can be run there.

        Fusion needs several sensors, filters without labels need one; a delta-GLMB is refused where it cuts births.
        """
        several = len(scene.scenario(0).model.sensors) > 1
        if not (several if self.fusion is not None else self.has_labels or not several):
            return False
        try:
            self.in_scene(scene)
        except ScenarioError:
            return False
        return True

    def in_scene(self, scene: Scene) -> Scenario:
        """The scenario of the scene's first run with this filter. Raises `ScenarioError` where it is refused."""
        fields = self.fields if self.fusion is None else {**self.fields, "fusion": self.fusion}
        return replace_fields(scene.scenario(0), fields)


def cases(errors: Iterable[float] = ()) -> Iterator[Case]:
    """Return every filter, and every way to combine two sensors. errors: further split errors of the default."""
    filters = compared(errors)
    del filters["delta-GLMB 1,000"]
    filters["delta-GLMB 300"] = {"filter.kind": "delta_glmb"}
    unlabelled = {"PHD": "phd", "CPHD": "cphd", "CB-MeMBer": "cb_member"}
    filters |= {name: {"filter.kind": kind} for name, kind in unlabelled.items()}
    filters["default, detection at centres"] = {**filters["default"], "filter.detection_at": "centre"}
    for name, fields in filters.items():
        yield Case(name, fields)
    yield Case("central, LMB", filters["LMB"], {"kind": "central"})
    for name in ("default", "LMB", "delta-GLMB 300", "M-delta-GLMB"):
        kind = "clmb" if name == "LMB" else "cm_delta_glmb"
        yield Case(f"{kind}, {name}", filters[name], {"kind": kind})
    for kind, name in (("clmb", "LMB"), ("cm_delta_glmb", "default")):
        yield Case(f"{kind} with feedback, {name}", filters[name], {"kind": kind, "feedback": True})
    for kind, name in (("arithmetic_average", "LMB"), ("arithmetic_average", "default"), ("parallel", "LMB")):
        yield Case(f"{kind}, {name}", filters[name], {"kind": kind})


def calibration(scene: Scene, case: Case, seeds: Iterable[int], num_runs: int, first_run: int = 0) -> Calibration:
    """Run a filter on a scene and score its beliefs.

    Targets and scans depend on the scene, the seed and the number of the run alone, and not on the filter.

    Args:
        scene: where; its targets are replaced by ones drawn from its model.
        case: the filter.
        seeds: of the random numbers.
        num_runs: number of runs of each seed.
        first_run: number of the first of them.
    """
    experiment = build_experiment(case.in_scene(scene))
    targets, timed = PriorTargets(experiment.tracker.targets), Timed(experiment.tracker, [])
    experiment = replace(experiment, targets=targets, tracker=timed)
    region = scene.scenario(0).model.region.build()
    grid = CellGrid.covering(region, CELL)
    scores = [
        _Scores(
            grid, SimulationRun(experiment, seed=seed, run=run, moving=False), np.random.default_rng([seed, run])
        ).scored()
        for seed in seeds
        for run in range(first_run, first_run + num_runs)
    ]
    labels, places, numbers = (np.array(part) for part in zip(*scores, strict=True))
    milliseconds = 1e3 * float(np.median(timed.seconds))
    of_labels = Bins(EXISTENCES, labels) if case.has_labels else None
    return Calibration(of_labels, Bins(NUMBERS, places), numbers, milliseconds)


@dataclass
class _Scores:
    """The scores of one run. rng: breaks ties of ranks."""

    grid: CellGrid
    world: SimulationRun
    rng: np.random.Generator

    def scored(self) -> tuple[Floats, Floats, Floats]:
        """Run to the end; return `Bins.sums` of labels and places, and `Calibration.numbers`, of this run."""
        world, truth = self.world, self.world.truth
        names = Names(world.experiment.tracker.targets.birth)
        labels, places = np.zeros((len(EXISTENCES) - 1, 3)), np.zeros((len(NUMBERS) - 1, 3))
        numbers, estimates = np.zeros((truth.num_scans, 4)), []
        with suppress_unit_warnings():
            while not world.is_over:
                moment = world.step()
                ids, states = truth.at(moment.step - 1)
                belief = moment.state.fused
                names.take(moment.step, moment.scans)
                if isinstance(belief, LabelledDensity):
                    labels += binned(EXISTENCES, *names.label_scores(belief, ids))
                expected, true = expected_in_cells(belief, self.grid), true_in_cells(states, self.grid)
                places += binned(NUMBERS, expected, true)
                numbers[moment.step - 1, :3] = self._number_scores(cardinality_distribution(belief), len(ids))
                estimates.append(moment.estimate)
        numbers[:, 3] = ospa_of_run(truth, estimates, cutoff=CUTOFF, order=ORDER)[:, 0]
        return labels, places, numbers

    def _number_scores(self, chances: Floats, number: int) -> tuple[float, float, float]:
        """Rank of the true number in a distribution, uniform if that is right; log score; error of the mean."""
        below, at = float(chances[:number].sum()), float(chances[number : number + 1].sum())
        mean = float(chances @ np.arange(len(chances)))
        return below + at * self.rng.random(), -float(np.log(max(at, NEVER_SURER))), mean - number


def binned(bounds: Floats, believed: Floats, true: Floats) -> Floats:
    """Return the (num_bins, 3) number of values in each bin, and the sums of the believed and of the true ones."""
    num = len(bounds) - 1
    place = np.clip(np.searchsorted(bounds, believed, side="right") - 1, 0, num - 1)
    return np.column_stack([np.bincount(place, part, num) for part in (np.ones(len(place)), believed, true)])
