"""Tasks of a campaign: the unit of work of a worker, its outcome, and the order of tasks."""

import heapq
import math
import time
from collections import defaultdict, deque
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TypeAlias

from vedette.campaigns.cells import Campaign, Cell
from vedette.campaigns.codec import encode
from vedette.campaigns.rows import Row, row_of
from vedette.errors import VedetteError
from vedette.evaluation.metrics.serialization import encode_metrics
from vedette.evaluation.runs import custom_metrics, measure_run, run_scenario
from vedette.scenarios.sections.planners import STRATEGIES
from vedette.simulation.serialization import encode_timings
from vedette.simulation.storage import versions

# Shorter tasks cost more to hand out than they save.
MIN_TASK_SECONDS = 0.1
_HANDED_OUT_SECONDS = 0.005  # upper estimate of the time to hand out a task


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """Some runs of one cell."""

    cell: Cell  # what to run
    seed: int
    runs: tuple[int, ...]
    # versions of the packages that determine the bytes of a result. A worker with other versions refuses
    versions: Mapping[str, str]

    def alone(self) -> "Iterator[Task]":
        """Yield one task for each run."""
        return (replace(self, runs=(run,)) for run in self.runs)


@dataclass(frozen=True, slots=True)
class CompletedRun:
    """A finished run.

    Attributes:
        row: the run as stored: encoded by `vedette.campaigns.codec`, with metrics and timings as Arrow files.
        ospa: mean over the scans, m.
        seconds: wall time of the run, s.
    """

    row: Row
    ospa: float
    seconds: float

    @property
    def cell(self) -> str:
        """Name of the cell."""
        return self.row.cell

    @property
    def run(self) -> int:
        """Number of the run."""
        return self.row.run


@dataclass(frozen=True, slots=True)
class FailedRun:
    """A run that could not be finished, and the reason."""

    cell: str
    run: int
    message: str


# Outcome of a task: one entry per run.
TaskOutcome: TypeAlias = tuple[CompletedRun | FailedRun, ...]


@dataclass(frozen=True, slots=True)
class WorkerDied:
    """Replaces the outcome of a task whose workers died."""


def perform(task: Task) -> TaskOutcome:
    """Execute a task in a worker. An error in a run is an outcome of its own and does not affect other runs.

    Raises:
        VedetteError: this worker has other versions than the campaign.
    """
    here = versions()
    wrong = [
        f"{name} {here.get(name)} (not {wanted})" for name, wanted in task.versions.items() if here.get(name) != wanted
    ]
    if wrong:
        raise VedetteError(f"a worker has other versions than the campaign: {', '.join(wrong)}")
    return tuple(_one(task.cell, task.seed, run) for run in task.runs)


def _one(cell: Cell, seed: int, run: int) -> CompletedRun | FailedRun:
    start = time.perf_counter()
    try:
        record = run_scenario(cell.scenario, cell.planner, seed=seed, run=run, num_threads=1)
        metrics = encode_metrics(measure_run(record, cell.scenario, custom_metrics(cell.scenario)))
        row = row_of(cell.name, run, encode(record), encode_timings(record), metrics)
    except VedetteError as error:
        return FailedRun(cell.name, run, str(error))
    except Exception as error:  # raised around a run: one failure must not end the campaign
        return FailedRun(cell.name, run, f"{type(error).__name__}: {error}")
    mean = float(record.ospa[:, 0].mean())
    return CompletedRun(row, mean, time.perf_counter() - start)


class TaskQueue:
    """Queue of the remaining runs, handed out as tasks of a tenth of a second or more.

    Runs with equal numbers come together, so that strategies can be compared early. The first run of each set of
    kernels comes before the others that need it, so that kernels are compiled once and not once per worker. The
    duration of a cell's runs is estimated by the fastest finished run. The grouping into tasks does not change results.
    """

    def __init__(self, campaign: Campaign, finished: Collection[tuple[str, int]]) -> None:
        self._cells = campaign.cells
        self._seed = campaign.seed
        self._versions = versions()
        self._fastest: dict[str, float] = {}
        self._todo = [
            deque(run for run in campaign.runs(place) if (cell.name, run) not in finished)
            for place, cell in enumerate(campaign.cells)
        ]
        self._num_left = sum(map(len, self._todo))
        # Cells that are ready, by their next run, and cells that wait until another run has compiled their kernels.
        self._ready = [(runs[0], place) for place, runs in enumerate(self._todo) if runs]
        heapq.heapify(self._ready)
        self._kernels = {cell.name: _kernels(cell) for cell in campaign.cells}
        self._compiled: dict[tuple[object, ...], bool] = {}  # False: a task in progress compiles them
        self._waiting: defaultdict[tuple[object, ...], list[int]] = defaultdict(list)

    def __len__(self) -> int:
        """Number of runs not yet handed out."""
        return self._num_left

    def note_outcome(self, task: Task, outcome: TaskOutcome) -> TaskOutcome:
        """Record that a task has ended and how long its runs took, and return its outcome."""
        kernels = self._kernels[task.cell.name]
        self._compiled[kernels] = True
        for place in self._waiting.pop(kernels, ()):
            self._put_back(place)
        for result in outcome:
            if isinstance(result, CompletedRun):
                self._fastest[result.cell] = min(self._fastest.get(result.cell, math.inf), result.seconds)
        return outcome

    def take(self, room: int = 1) -> Task | None:
        """Return the next task. None if all runs are handed out, or wait for another run to compile their kernels.

        Args:
            room: number of tasks that may be in progress. With more room each task is longer, so that handing out keeps
                up, but not so long that other workers have nothing left.
        """
        while self._ready:
            _, place = heapq.heappop(self._ready)
            kernels = self._kernels[self._cells[place].name]
            if self._compiled.get(kernels, True):
                self._compiled.setdefault(kernels, False)
                return self._taken(place, room)
            self._waiting[kernels].append(place)
        return None

    def _taken(self, place: int, room: int) -> Task:
        """Return a task of some runs of the cell at that place."""
        cell, runs = self._cells[place], self._todo[place]
        seconds = self._fastest.get(cell.name, MIN_TASK_SECONDS)
        num_runs = math.ceil(max(MIN_TASK_SECONDS, room * _HANDED_OUT_SECONDS) / seconds)
        share = -(-self._num_left // room)
        taken = tuple(runs.popleft() for _ in range(min(max(1, min(num_runs, share)), len(runs))))
        self._num_left -= len(taken)
        self._put_back(place)
        return Task(cell, self._seed, taken, self._versions)

    def _put_back(self, place: int) -> None:
        """Queue the cell at that place again if it has runs left."""
        if self._todo[place]:
            heapq.heappush(self._ready, (self._todo[place][0], place))


def _kernels(cell: Cell) -> tuple[object, ...]:
    """Return a key that is equal for two cells if they need the same kernels."""
    model = cell.scenario.model
    kinds = {sensor.measurement.kind for sensor in model.sensors}
    strategy = STRATEGIES.get(cell.planner)
    plans = cell.planner if strategy is None or strategy.needs_labels else ""
    return plans, model.filter.kind, model.fusion.kind, model.motion.kind, frozenset(kinds)
