"""Comparison of strategies, over runs that share their random numbers."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vedette.errors import InputError
from vedette.evaluation.ensembles import PARTS, Choice, Ensemble, build_ensemble, rounded_choice
from vedette.evaluation.metrics.run import RunMetrics
from vedette.evaluation.statistics import PairedDifference, Summary, holm, paired_difference, summarise
from vedette.internal.representation import SummaryRepr
from vedette.internal.text import elided, pluralise
from vedette.kernels.base.types import Bools, Floats
from vedette.scenarios import Scenario
from vedette.simulation.records import RunRecord

_MAX_LISTED = 4


@dataclass(frozen=True, slots=True, repr=False)
class Comparison(SummaryRepr):
    """OSPA and other measures of several strategies on one scenario, paired run by run.

    A `part` is "total", "localisation" or "cardinality", of OSPA, or the name of a measure.

    Attributes:
        strategies: their names. The others are compared with the first.
        ensembles: the runs of each strategy. The n-th runs of all share their random numbers.
        since, until: scans after `since` (s) and up to `until` (s) count in the mean over time.
        unit: of OSPA: "m", or none ("") if it compares whole states.
    """

    strategies: tuple[str, ...]
    ensembles: tuple[Ensemble, ...]
    since: float
    until: float
    unit: str = "m"

    def _summary(self) -> str:
        return f"of {pluralise(self.num_runs, 'run')} on {elided(self.scenario)}"

    def _detail(self) -> str:
        means = [f"{elided(name)} {float(self.summary(name).mean):.4g}" for name in self.strategies[:_MAX_LISTED]]
        num_others = len(self.strategies) - len(means)
        return "mean OSPA: " + "; ".join(means + ([f"{num_others} more"] if num_others else []))

    @property
    def scenario(self) -> str:
        """Name of the scenario."""
        return self.ensembles[0].scenario

    @property
    def num_runs(self) -> int:
        """Number of runs of each strategy."""
        return self.ensembles[0].num_runs

    @property
    def times(self) -> Floats:
        """Times of the scans, (num_scans,) s."""
        return self.ensembles[0].times

    @property
    def decision_times(self) -> Floats:
        """Times of the decisions of all strategies together, (num_decisions,) s."""
        return np.unique(np.concatenate([ensemble.decision_times for ensemble in self.ensembles]))

    @property
    def measures(self) -> tuple[str, ...]:
        """Names of the measures that all runs have."""
        first, *others = (ensemble.measures for ensemble in self.ensembles)
        return tuple(name for name in first if all(name in other for other in others))

    @property
    def counted(self) -> Bools:
        """True for each scan that counts in the mean over time, (num_scans,)."""
        return np.asarray((self.times > self.since) & (self.times <= self.until))

    def run_means(self, strategy: str, part: str = "total") -> Floats:
        """Return the mean of each run over the counted scans that have a value, (num_runs,), or NaN if none has one."""
        return mean_of_known(self.values(strategy, part)[:, self.counted])

    def summary(self, strategy: str, part: str = "total") -> Summary:
        """Return the mean over runs of `run_means`."""
        return summarise(self.run_means(strategy, part))

    def curve(self, strategy: str, part: str = "total") -> Summary:
        """Return the mean over runs at each scan: arrays of shape (num_scans,)."""
        return summarise(self.values(strategy, part))

    def difference(self, strategy: str, reference: str | None = None, part: str = "total") -> PairedDifference:
        """Return the difference of a strategy from the reference (default: the first strategy), run by run."""
        return paired_difference(self.run_means(strategy, part), self.run_means(reference or self.strategies[0], part))

    def p_values(self) -> Floats:
        """Return p-values of each strategy's `difference` from the first, (num_strategies,), by Holm's method.

        NaN for the first strategy, and for single runs.
        """
        uncorrected = [self.difference(strategy).p_value for strategy in self.strategies[1:]]
        return np.concatenate([[np.nan], holm(np.array(uncorrected, np.float64))])

    def decision_shares(self, strategy: str, decision: int) -> dict[Choice, float]:
        """Return the share of the runs in which each combination of actions was chosen, the most frequent first."""
        chosen = Counter(run[decision] for run in self._ensemble(strategy).choices if decision < len(run))
        return {choice: count / self.num_runs for choice, count in chosen.most_common()}

    def values(self, strategy: str, part: str = "total") -> Floats:
        """Return the values of a strategy, (num_runs, num_scans)."""
        if part not in (*PARTS, *self.measures):
            raise InputError(f"part: expected one of {', '.join((*PARTS, *self.measures))}; got {part!r}")
        return self._ensemble(strategy).values(part)

    def _ensemble(self, strategy: str) -> Ensemble:
        if strategy not in self.strategies:
            raise InputError(f"strategy: expected one of {', '.join(self.strategies)}; got {strategy!r}")
        return self.ensembles[self.strategies.index(strategy)]


def compare(
    runs: Mapping[str, Sequence[RunRecord]],
    metrics: Mapping[str, Sequence[RunMetrics]] | None = None,
    *,
    since: float | None = None,
    until: float = np.inf,
    unit: str = "m",
) -> Comparison:
    """Compare the runs of several strategies.

    Args:
        runs: for each strategy its runs. The n-th runs of all must have the same scenario, seed and run number.
        metrics: measures of the same runs, to be compared as well.
        since: only scans after this time (s) count in the mean over time, by default the time of the first decision,
            before which all strategies are alike, and every scan if no decision was made before the last scan.
        until: only scans up to this time (s) count.
        unit: of OSPA, none ("") if it compares whole states.

    Raises `InputError` if there is no run, or the runs are not paired.
    """
    if not runs or not all(runs.values()):
        raise InputError("runs: expected at least one run of each of one or more strategies")
    measured = {name: [None] * len(records) for name, records in runs.items()} if metrics is None else metrics
    ensembles = {
        name: build_ensemble(
            (record.summary(), metrics_of_run) for record, metrics_of_run in zip(records, measured[name], strict=True)
        )
        for name, records in runs.items()
    }
    return compare_ensembles(ensembles, since=since, until=until, unit=unit)


def compare_ensembles(
    ensembles: Mapping[str, Ensemble], *, since: float | None = None, until: float = np.inf, unit: str = "m"
) -> Comparison:
    """Compare ensembles like `compare`, with the measures that all runs have."""
    strategies, reference = tuple(ensembles), next(iter(ensembles.values()))
    for name, ensemble in ensembles.items():
        _check_paired(name, ensemble, strategies[0], reference)
    compared = Comparison(strategies, tuple(ensembles.values()), -np.inf if since is None else since, until, unit)
    times, decided = compared.times, compared.decision_times
    if since is None and len(decided) and decided[0] < times[-1]:
        compared = replace(compared, since=float(decided[0]))
    if not compared.counted.any():
        window = f"{times[0]} to {times[-1]} s; got {compared.since} to {until}"
        raise InputError(f"since: expected scans after it and up to until, of {window}")
    return compared


def compare_scored_scans(scenario: Scenario, ensembles: Mapping[str, Ensemble]) -> Comparison:
    """Return the comparison over the scans that the scenario counts."""
    window, times = scenario.model.ospa, next(iter(ensembles.values())).times
    since, until = None, np.inf
    if window.first_scan is not None:  # a run that stopped earlier has no such scan
        since = np.inf if window.first_scan > len(times) else float(np.nextafter(times[window.first_scan - 1], -np.inf))
    if window.last_scan is not None:
        until = float(times[min(window.last_scan, len(times)) - 1])
    return compare_ensembles(ensembles, since=since, until=until, unit=window.unit)


def counted_scans(record: RunRecord, scenario: Scenario | None) -> Bools:
    """Return whether each scan of a run counts in its mean error, (num_scans,).

    The scans are those that `compare_scored_scans` counts, or without a scenario, those after the first decision. All
    count if the run stopped before the first of them.
    """
    runs = {record.planner: build_ensemble([(record.summary(), None)])}
    try:
        return (compare_ensembles(runs) if scenario is None else compare_scored_scans(scenario, runs)).counted
    except InputError:
        return np.ones(record.num_scans, bool)


def mean_of_known(values: Floats) -> Floats:
    """Return the mean of each row over its numbers, (num_runs,), or NaN if it has none."""
    known = ~np.isnan(values)
    if known.all():
        return np.asarray(values.mean(axis=1))
    sums, counts = np.where(known, values, 0.0).sum(axis=1), known.sum(axis=1)
    return np.where(counts > 0, sums / np.maximum(counts, 1), np.nan)


def typical_run(comparison: Comparison, strategy: str) -> int:
    """Return the index of a strategy's run with the median mean OSPA (for an even number, the better of two)."""
    means = comparison.run_means(strategy)
    return int(np.argsort(means, kind="stable")[(len(means) - 1) // 2])


def decided_actions(record: RunRecord) -> tuple[Choice, ...]:
    """Return the choices of all decisions of a run, rounded."""
    return tuple(rounded_choice(decision.plan) for decision in record.decisions)


def _check_paired(name: str, ensemble: Ensemble, other: str, reference: Ensemble) -> None:
    if ensemble.num_runs != reference.num_runs:
        raise InputError(
            f"runs[{name!r}]: expected {reference.num_runs} runs, as of {other!r}; got {ensemble.num_runs}"
        )
    differs = (ensemble.seeds != reference.seeds) | (ensemble.runs != reference.runs)
    if ensemble.scenario != reference.scenario or differs.any():
        index = int(differs.argmax())
        expected, got = (
            (each.scenario, int(each.seeds[index]), int(each.runs[index])) for each in (reference, ensemble)
        )
        raise InputError(f"runs[{name!r}]: expected scenario, seed and run {expected}; got {got}")
    if not np.array_equal(ensemble.times, reference.times):
        raise InputError(f"runs[{name!r}]: expected the scan times of {other!r}; its runs have others")
