"""A single estimate that is far off for its covariance is told, however small the mean over all is."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

import numpy as np
import pytest

from reports.examples import campaign_of, results_of
from vedette.evaluation import RunMetrics
from vedette.evaluation.ensembles import build_ensemble
from vedette.evaluation.runs import measure_run
from vedette.reports.groups import Group, Strategy, comparison_groups
from vedette.reports.health import failed_checks, strategy_diagnostics
from vedette.reports.tables import measure_table, nees_spread
from vedette.simulation.records import RunRecord

TIMES = 25.0  # how much longer an error becomes


@pytest.fixture(scope="module")
def group(tmp_path_factory: pytest.TempPathFactory) -> Group:
    settings = {"time.num_steps": 30, "ospa.first_scan": 12, "ospa.last_scan": 30}
    campaign = campaign_of(planners=["stationary", "random"], seed=4, set=settings)
    (found,) = comparison_groups(results_of(tmp_path_factory.mktemp("consistency") / "results", campaign))
    return found


def off_once(record: RunRecord, step: int) -> RunRecord:
    """The run with one estimate of a scan much surer of itself than it has a right to be."""
    estimate = record.estimates[step - 1]
    covs = estimate.covs.copy()
    covs[0] /= TIMES**2
    changed = (*record.estimates[: step - 1], replace(estimate, covs=covs), *record.estimates[step:])
    return replace(record, estimates=changed)


def with_runs(group: Group, label: str, runs: Iterable[tuple[RunRecord, RunMetrics]]) -> Group:
    """The group with other runs of a strategy."""
    ensemble = build_ensemble((record.summary(), metrics) for record, metrics in runs)
    others = [replace(each, ensemble=ensemble) if each.label == label else each for each in group.strategies]
    return replace(group, strategies=tuple(others))


def runs_of(strategy: Strategy) -> Iterator[tuple[RunRecord, RunMetrics]]:
    for run in strategy.ensemble.runs.tolist():
        record = strategy.record(run)
        yield record, measure_run(record, strategy.cell.scenario)


def rows_of(group: Group) -> Mapping[str, tuple[str, ...]]:
    table = measure_table(group)
    assert table is not None
    assert len(table.rows) == len(table.notes)
    return {row[0]: row[1:] for row in table.rows}


def test_the_worst_estimate_is_named_with_its_run(group: Group) -> None:
    strategy = group.strategies[1]
    before = nees_spread(strategy)
    assert before is not None
    assert before.is_by_chance
    worse = off_once(strategy.record(1), 20)
    off = with_runs(
        group, "random", [*list(runs_of(strategy))[:1], (worse, measure_run(worse, strategy.cell.scenario))]
    )
    spread = nees_spread(off.strategies[1])
    assert spread is not None
    assert (spread.run, spread.time, spread.is_by_chance) == (1, 20.0, False)
    assert spread.median == pytest.approx(before.median, rel=0.05)
    worst = f"Largest NEES / 2: {spread.largest:.4g} in run 1 at 20 s"
    assert worst in failed_checks(tuple(strategy_diagnostics(off.strategies[1])))
    for fine in (*group.strategies, off.strategies[0]):
        assert not any("Largest NEES" in each for each in failed_checks(tuple(strategy_diagnostics(fine))))
    rows = rows_of(off)
    assert rows["  largest"][1] == f"{spread.largest:.4g} (run 1, 20 s)"
    assert rows["  median"][1] == f"{spread.median:.2f}"


def test_the_largest_is_that_of_a_pair_of_a_counted_scan(group: Group) -> None:
    strategy = group.strategies[0]
    spread, counted = nees_spread(strategy), strategy.counted
    assert spread is not None
    largest = np.array([metrics.position_nees_max for _, metrics in runs_of(strategy)])
    assert spread.largest == np.nanmax(largest[:, counted]) / 2.0
    late = largest / 2.0
    late[:, ~counted] = np.nan
    assert late[spread.run, int(spread.time) - 1] == spread.largest


def test_without_an_estimate_there_is_no_spread(group: Group) -> None:
    strategy = group.strategies[0]
    none = [
        (record, replace(metrics, position_nees_max=np.full(metrics.num_scans, np.nan)))
        for record, metrics in runs_of(strategy)
    ]
    bare = with_runs(group, strategy.label, none).strategies[0]
    assert nees_spread(bare) is None
    assert rows_of(replace(group, strategies=(bare,)))["  largest"] == ("\N{EN DASH}",)
