"""The runs of one strategy as arrays over runs and scans, for comparisons and reports."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from vedette.control import Plan
from vedette.errors import InputError
from vedette.evaluation.actions import Row, rounded
from vedette.evaluation.health import HealthSums, add_health_sums, health_sums
from vedette.evaluation.metrics.run import RunMetrics
from vedette.evaluation.rewards import RewardSums
from vedette.internal.representation import SummaryRepr
from vedette.internal.text import elided, pluralise
from vedette.kernels.base.types import Floats, Ints
from vedette.simulation.records import RunSummary

PARTS = ("total", "localisation", "cardinality")
# The choice at one decision, one row for each sensor.
Choice: TypeAlias = tuple[Row, ...]
# A run with its measures, if it has any.
Measured: TypeAlias = tuple[RunSummary, RunMetrics | None]

# Largest numbers of runs, and of entries of their reward tables, that are in memory at once.
MAX_BATCH_RUNS, _MAX_BATCH_REWARDS = 256, 2**22


@dataclass(frozen=True, slots=True, repr=False)
class Ensemble(SummaryRepr):
    """The runs of one strategy on one scenario, in a twentieth of the memory of their records.

    Attributes:
        scenario: name of the scenario.
        seeds, runs: (num_runs,) seed and number of each run.
        times: (num_scans,) s.
        ospa: (num_runs, num_scans, 3) total, localisation and cardinality parts.
        num_targets: (num_runs, num_scans) number of true targets, in the smallest type that holds it.
        measures: (num_runs, num_scans) for each measure that all runs have, by the name of its column. Whole numbers in
            the smallest type that holds them: `values` returns them as floats.
        choices: for each run, the choices of its decisions. Equal ones are one object.
        decision_times: (num_decisions,) s, of all runs together, increasing.
        health: sums of the reports of filters and fusion.
        rewards: for each decision, in order, sums of the rewards.
        seconds: for each stage, the wall time at all scans of all runs, s, in single precision, with `planning` only at
            the decisions.
        counts: for each count of the plans, its number in every decision that has it.
    """

    scenario: str
    seeds: Ints
    runs: Ints
    times: Floats
    ospa: Floats
    num_targets: NDArray[Any]
    measures: Mapping[str, NDArray[Any]]
    choices: tuple[tuple[Choice, ...], ...]
    decision_times: Floats
    health: HealthSums
    rewards: tuple[RewardSums, ...]
    seconds: Mapping[str, NDArray[np.float32]]
    counts: Mapping[str, NDArray[Any]]

    def _summary(self) -> str:
        return (
            f"of {pluralise(self.num_runs, 'run')} on {elided(self.scenario)}, "
            f"{pluralise(len(self.times), 'scan')} each"
        )

    @property
    def num_runs(self) -> int:
        """Number of runs."""
        return len(self.runs)

    def values(self, part: str) -> Floats:
        """Return a part of OSPA or a measure, (num_runs, num_scans). Raises `InputError` for an unknown name."""
        if part in PARTS:
            return np.asarray(self.ospa[:, :, PARTS.index(part)])
        if part not in self.measures:
            raise InputError(f"part: expected one of {', '.join((*PARTS, *self.measures))}; got {part!r}")
        return np.asarray(self.measures[part], np.float64)

    def num_pairs(self) -> Ints:
        """Return the number of targets that have an estimate within the cutoff, (num_runs, num_scans)."""
        return np.asarray(self.num_targets.astype(np.int64) - self.measures["num_missed"])


def build_ensemble(runs: Iterable[Measured]) -> Ensemble:
    """Return the ensemble of some runs, with their measures if they have any.

    Runs may come from a stream: at most a few hundred are in memory at a time.

    Raises `InputError` for no run, and for runs of other scenarios or scan times than the first.
    """
    return concatenate_ensembles([_build_batch(batch) for batch in _batches(runs)])


def concatenate_ensembles(parts: Sequence[Ensemble]) -> Ensemble:
    """Return the runs of several ensembles, one after the other. Raises like `build_ensemble`."""
    if not parts:
        raise InputError("runs: expected at least one run of each of one or more strategies")
    if len(parts) == 1:
        return parts[0]
    first = parts[0]
    for part in parts[1:]:
        _check_alike(first.scenario, first.times, part.scenario, part.times, int(part.runs[0]))
    names = [name for name in first.measures if all(name in part.measures for part in parts)]
    unique: dict[Choice, Choice] = {}
    return Ensemble(
        scenario=first.scenario,
        seeds=np.concatenate([part.seeds for part in parts]),
        runs=np.concatenate([part.runs for part in parts]),
        times=first.times,
        ospa=np.concatenate([part.ospa for part in parts]),
        num_targets=np.concatenate([part.num_targets for part in parts]),
        measures={name: np.concatenate([part.measures[name] for part in parts]) for name in names},
        choices=tuple(
            tuple(unique.setdefault(choice, choice) for choice in run) for part in parts for run in part.choices
        ),
        decision_times=np.unique(np.concatenate([part.decision_times for part in parts])),
        health=add_health_sums([part.health for part in parts]),
        rewards=tuple(map(RewardSums.combine, _columns([part.rewards for part in parts]))),
        seconds=_concatenate_by_name([part.seconds for part in parts]),
        counts=_concatenate_by_name([part.counts for part in parts]),
    )


def rounded_choice(plan: Plan) -> Choice:
    """Return the choice of a plan, rounded."""
    return tuple(rounded(actions.columns, row) for actions, row in zip(plan.actions, plan.chosen_actions, strict=True))


def _batches(runs: Iterable[Measured]) -> Iterator[list[Measured]]:
    batch, room = list[Measured](), _MAX_BATCH_REWARDS
    for run in runs:
        batch.append(run)
        room -= sum(table.mean.size for decision in run[0].decisions for table in decision.plan.tables)
        if len(batch) == MAX_BATCH_RUNS or room <= 0:
            yield batch
            batch, room = [], _MAX_BATCH_REWARDS
    if batch:
        yield batch


def _build_batch(runs: Sequence[Measured]) -> Ensemble:
    summaries, first = [run for run, _ in runs], runs[0][0]
    for summary in summaries[1:]:
        _check_alike(first.scenario, first.times, summary.scenario, summary.times, summary.run)
    columns = [{} if metrics is None else metrics.columns() for _, metrics in runs]
    names = [name for name in columns[0] if all(name in run_columns for run_columns in columns)]
    decisions_by_index = _columns([summary.decisions for summary in summaries])
    return Ensemble(
        scenario=first.scenario,
        seeds=np.array([summary.seed for summary in summaries], np.int64),
        runs=np.array([summary.run for summary in summaries], np.int64),
        times=first.times,
        ospa=np.array([summary.ospa for summary in summaries]),
        num_targets=_smallest_ints(np.array([summary.num_targets for summary in summaries])),
        measures={name: _smallest_ints(np.array([run_columns[name] for run_columns in columns])) for name in names},
        choices=tuple(tuple(rounded_choice(decision.plan) for decision in summary.decisions) for summary in summaries),
        decision_times=np.unique([decision.time for summary in summaries for decision in summary.decisions]),
        health=health_sums([summary.health for summary in summaries]),
        rewards=tuple(
            RewardSums.from_decisions(number, decisions) for number, decisions in enumerate(decisions_by_index)
        ),
        seconds={
            stage: values.astype(np.float32)
            for stage, values in _concatenate_by_name(list(map(_seconds, summaries))).items()
        },
        counts={name: _smallest_ints(np.array(values, np.int64)) for name, values in _counts(summaries).items()},
    )


def _columns(rows: Sequence[Sequence[Any]]) -> list[list[Any]]:
    """Return, for every n, the n-th entries of all rows that have one."""
    return [[row[n] for row in rows if n < len(row)] for n in range(max(map(len, rows)))]


def _check_alike(scenario: str, times: Floats, other: str, other_times: Floats, run: int) -> None:
    if other != scenario:
        raise InputError(f"runs: expected runs of {scenario}; run {run} is of {other}")
    if not np.array_equal(other_times, times):
        raise InputError(f"runs: expected the same scan times in every run; run {run} has others")


def _smallest_ints(values: NDArray[Any]) -> NDArray[Any]:
    """Return whole numbers in the smallest signed type that holds them, and other arrays unchanged."""
    if values.dtype != np.int64:
        return values
    return values.astype(np.min_scalar_type(-1 - int(np.abs(values).max(initial=0))))


def _concatenate_by_name(parts: Sequence[Mapping[str, NDArray[Any]]]) -> dict[str, NDArray[Any]]:
    """Return the arrays of each name, concatenated."""
    names = dict.fromkeys(name for part in parts for name in part)
    return {name: np.concatenate([part[name] for part in parts if name in part]) for name in names}


def _seconds(summary: RunSummary) -> dict[str, Floats]:
    indices = np.array([decision.step - 1 for decision in summary.decisions], np.int64)
    return {stage: seconds[indices] if stage == "planning" else seconds for stage, seconds in summary.timings.items()}


def _counts(summaries: Sequence[RunSummary]) -> dict[str, list[int]]:
    counts: dict[str, list[int]] = {}
    for decision in (decision for each in summaries for decision in each.decisions):
        for name, number in decision.plan.counts.items():
            counts.setdefault(name, []).append(number)
    return counts
