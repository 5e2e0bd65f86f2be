"""Runs gathered into arrays: the same whatever they are read by and in whatever parts."""

from __future__ import annotations

import multiprocessing
import sqlite3
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from campaigns.filled import fill, make_campaign
from evaluation.synthetic import ACTIONS, make_record
from vedette.campaigns import aggregation, open_results
from vedette.errors import InputError, VedetteError
from vedette.evaluation import ensembles
from vedette.evaluation.ensembles import Ensemble, build_ensemble, concatenate_ensembles
from vedette.evaluation.health import add_health_sums, health_sums
from vedette.evaluation.rewards import RewardSums
from vedette.platforms import Actions
from vedette.simulation.records import Decision, RunRecord, RunSummary
from waiting import PATIENCE

NUM_RUNS = 10
CELL = "jdm-rate-5.0"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return fill(tmp_path_factory.mktemp("gathering") / "results", make_campaign(runs=NUM_RUNS))


@pytest.fixture
def small_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(aggregation, "_A_PART", 4)


def plain(value: Any) -> Any:
    """What a container holds, to be compared bit by bit."""
    if isinstance(value, np.ndarray):
        return value.dtype.str, value.shape, value.tobytes()
    if isinstance(value, dict):
        return {name: plain(each) for name, each in value.items()}
    if isinstance(value, RewardSums):
        return [plain(each) for each in value[1:]]
    if isinstance(value, tuple):
        return [plain(each) for each in value]
    return value


def contents(ensemble: Ensemble) -> dict[str, Any]:
    return {each.name: plain(getattr(ensemble, each.name)) for each in fields(ensemble)}


@pytest.mark.usefixtures("small_parts")
def test_any_number_of_processes_reads_the_same(folder: Path) -> None:
    alone, together = (open_results(folder, num_workers=number).ensemble(CELL) for number in (1, 2))
    assert alone.runs.tolist() == list(range(NUM_RUNS))
    assert contents(alone) == contents(together)


@pytest.mark.usefixtures("small_parts")
def test_it_holds_what_the_records_do(folder: Path) -> None:
    results, wanted = open_results(folder), (1, 3, 4, 6, 7, 9)
    ensemble = results.ensemble(CELL, list(np.array(wanted)))
    runs = [results.run(CELL, run) for run in wanted]
    records = [run.record for run in runs]
    assert ensemble.runs.tolist() == list(wanted)
    np.testing.assert_array_equal(ensemble.ospa, [record.ospa for record in records])
    np.testing.assert_array_equal(ensemble.num_targets, [np.diff(record.truth.offsets) for record in records])
    for name in runs[0].metrics.columns():
        np.testing.assert_array_equal(ensemble.values(name), [run.metrics.columns()[name] for run in runs])
    spent = np.concatenate([record.timings["filter"] for record in records])
    np.testing.assert_array_equal(ensemble.seconds["filter"], spent.astype(np.float32))
    decided = [record.timings["planning"][each.step - 1] for record in records for each in record.decisions]
    np.testing.assert_array_equal(ensemble.seconds["planning"], np.array(decided, np.float32))
    counts = [each.plan.counts["samples"] for record in records for each in record.decisions]
    assert ensemble.counts["samples"].tolist() == counts
    assert ensemble.choices[2] == tuple(
        tuple((("heading_deg", heading),) for heading in np.ravel(each.plan.chosen_actions).tolist())
        for each in records[2].decisions
    )


def test_a_summary_is_the_same_from_the_record_and_from_its_bytes(folder: Path) -> None:
    results = open_results(folder)
    ((read, metrics),) = results.summaries(CELL, [2])
    run = results.run(CELL, 2)
    of_record = run.record.summary()
    for each in fields(RunSummary):
        if each.name not in ("decisions", "health", "timings"):
            assert plain(np.asarray(getattr(read, each.name))) == plain(np.asarray(getattr(of_record, each.name)))
    assert contents(build_ensemble([(read, metrics)])) == contents(build_ensemble([(of_record, run.metrics)]))


@pytest.mark.usefixtures("small_parts")
@pytest.mark.parametrize("num_workers", [1, 2])
def test_a_damaged_run_is_named_whoever_reads_it(folder: Path, tmp_path: Path, num_workers: int) -> None:
    damaged = fill(tmp_path / "results", make_campaign(runs=NUM_RUNS))
    with sqlite3.connect(damaged / "campaign.sqlite") as database:
        database.execute("UPDATE runs SET payload = substr(payload, 9) WHERE cell = ? AND run = 6", (CELL,))
    database.close()
    with pytest.raises(InputError, match=rf"campaign\.sqlite: cell {CELL}, run 6: expected the run as it was written"):
        open_results(damaged, num_workers=num_workers).ensemble(CELL)


@pytest.mark.usefixtures("small_parts")
def test_readers_of_a_script_without_a_guarded_main_say_so(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(multiprocessing.current_process(), "_inheriting", True, raising=False)
    with pytest.raises(VedetteError, match='needs `if __name__ == "__main__":` around the call'):
        open_results(folder, num_workers=2).ensemble(CELL)


@pytest.mark.usefixtures("small_parts")
def test_a_reader_that_dies_is_told(folder: Path, tmp_path: Path) -> None:
    script = tmp_path / "unguarded.py"
    script.write_text(
        "from vedette.campaigns import aggregation, open_results\n"
        f"aggregation._A_PART = 4\nopen_results({str(folder)!r}, num_workers=2).ensemble({CELL!r})\n"
    )
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert done.returncode == 1
    assert "a script that reads with workers needs" in done.stderr
    assert "one has died: for want of memory, or, in a script of your own" in done.stderr


def test_no_run_and_runs_that_are_not_there_are_refused(folder: Path) -> None:
    results = open_results(folder)
    with pytest.raises(InputError, match="at least one run"):
        results.ensemble(CELL, [])
    with pytest.raises(InputError, match="run 11: expected a finished run"):
        results.ensemble(CELL, [3, 11])


def test_runs_of_other_scenarios_and_times_are_refused() -> None:
    first, other = ((make_record("jdm", run).summary(), None) for run in (0, 1))
    elsewhere = replace(other[0], scenario="elsewhere"), None
    later = replace(other[0], times=other[0].times + 1.0), None
    for wrong, message in ((elsewhere, "run 1 is of elsewhere"), (later, "same scan times in every run; run 1")):
        with pytest.raises(InputError, match=message):
            build_ensemble([first, wrong])
        with pytest.raises(InputError, match=message):
            concatenate_ensembles([build_ensemble([first]), build_ensemble([wrong])])


def test_health_adds_up_whatever_the_parts() -> None:
    healths = [make_record("jdm", run).health for run in range(5)]
    healths[3].truncation_error_bound[:] = np.nan
    whole, parts = health_sums(healths), add_health_sums([health_sums(healths[:3]), health_sums(healths[3:])])
    for mine, theirs in zip(whole, parts, strict=True):
        np.testing.assert_allclose(np.asarray(mine), np.asarray(theirs), rtol=1e-13)
    with pytest.raises(InputError, match="equally many sensors"):
        health_sums([healths[0], replace(healths[1], num_tracks=np.zeros((40, 3), np.int64))])


def turned(record: RunRecord, angle: float) -> Decision:
    """The first decision of a run, of sensors that headed elsewhere and could take the same turns."""
    first = record.decisions[0]
    actions = (Actions(("heading_deg",), ACTIONS.values + np.degrees(angle)),) * 2
    return replace(first, poses=first.poses + np.array([0.0, 0.0, angle]), plan=replace(first.plan, actions=actions))


def test_rewards_add_up_whatever_the_parts() -> None:
    made = [make_record("idm", run).decisions[0] for run in range(7)]
    gapped = made[4].plan.tables[0].mean.copy()
    gapped[:3] = np.nan
    tables = (replace(made[4].plan.tables[0], mean=gapped), made[4].plan.tables[1])
    made[4] = replace(made[4], plan=replace(made[4].plan, tables=tables))
    whole = RewardSums.from_decisions(0, made).mean()
    for cuts in ([3], [1, 2, 6]):
        few = np.split(np.array(made, object), cuts)
        parts = RewardSums.combine([RewardSums.from_decisions(0, list(part)) for part in few]).mean()
        assert parts.num_runs == whole.num_runs == 7
        for mine, theirs in zip(parts.tables, whole.tables, strict=True):
            np.testing.assert_allclose(mine.mean, theirs.mean, rtol=1e-13)
            np.testing.assert_allclose(mine.standard_error, theirs.standard_error, rtol=1e-11)
        np.testing.assert_allclose(parts.shares, whole.shares)


def test_no_more_rewards_are_held_than_memory_has_room_for(monkeypatch: pytest.MonkeyPatch) -> None:
    summaries = [make_record("jdm", run).summary() for run in range(5)]
    whole = build_ensemble((each, None) for each in summaries)
    monkeypatch.setattr(ensembles, "_MAX_BATCH_REWARDS", 2 * 3 * 169)  # two runs of three decisions
    held: list[int] = []

    def noted(parts: Sequence[Ensemble]) -> Ensemble:
        held.extend(each.num_runs for each in parts)
        return concatenate_ensembles(parts)

    monkeypatch.setattr(ensembles, "concatenate_ensembles", noted)
    parts = build_ensemble((each, None) for each in summaries)
    assert held == [2, 2, 1]
    np.testing.assert_array_equal(parts.ospa, whole.ospa)
    np.testing.assert_allclose(parts.rewards[1].mean().tables[0].mean, whole.rewards[1].mean().tables[0].mean)


def test_rewards_of_parts_are_over_turns_where_headings_differ() -> None:
    records = [make_record("idm", run) for run in range(3)]
    made = [turned(record, angle) for record, angle in zip(records, (0.0, 0.5, 1.1), strict=True)]
    whole = RewardSums.from_decisions(0, made)
    parts = RewardSums.combine([RewardSums.from_decisions(0, [each]) for each in made])
    for found in (whole, parts):
        assert (found.is_absolute, found.is_relative) == (False, True)
        assert found.mean().actions[0].columns == ("turn_deg",)
    other = RewardSums.from_decisions(0, [make_record("jdm", 1).decisions[0]])
    with pytest.raises(InputError, match="tables of one shape"):
        RewardSums.combine([whole, other]).mean()
    bare = RewardSums.from_decisions(0, [make_record("random", 1).decisions[0]])
    with pytest.raises(InputError, match="with rewards at decision 0; got none"):
        RewardSums.combine([whole, bare]).mean()
