"""The results folder opened to read: records, comparisons, damage, and the command that prints it."""

from __future__ import annotations

import json
import os
import shutil
import sqlite3
import stat
from contextlib import closing, suppress
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from campaigns.filled import NUM_RUNS, add, fill, make_campaign, make_run
from simulation.test_storage import assert_same
from vedette import __version__
from vedette.campaigns.codec import encode
from vedette.campaigns.manifest import contents_checksum
from vedette.campaigns.results import open_results
from vedette.campaigns.rows import row_of
from vedette.campaigns.store import Store
from vedette.cli import app
from vedette.errors import InputError
from vedette.evaluation.comparison import compare_scored_scans
from vedette.evaluation.ensembles import build_ensemble
from vedette.simulation.serialization import encode_timings


@pytest.fixture(scope="module")
def campaign():
    return make_campaign()


@pytest.fixture(scope="module")
def whole(tmp_path_factory, campaign):
    """A folder with all runs but two; not to be written to."""
    return fill(tmp_path_factory.mktemp("results"), campaign, leave_out=2)


@pytest.fixture
def folder(whole, tmp_path):
    """A copy that a test may harm."""
    return shutil.copytree(whole, tmp_path / "results")


def test_runs_are_read_back_bit_for_bit(whole):
    results = open_results(whole)
    record, metrics = make_run("jdm", 1)
    assert_same(results.record("jdm-rate-10.0", 1), record)
    assert_same(results.metrics("jdm-rate-10.0", 1), metrics)
    finished = results.run("jdm-rate-10.0", 1)
    assert (finished.cell, finished.session) == ("jdm-rate-10.0", 1)
    assert encode(finished.record) == encode(record)


def test_the_campaign_is_read_back_from_the_manifest(whole, campaign):
    read = open_results(whole).campaign
    for field in ("name", "seed", "num_runs", "axes", "compare", "spec"):
        assert getattr(read, field) == getattr(campaign, field)
    for mine, theirs in zip(read.cells, campaign.cells, strict=True):
        assert (mine.name, mine.planner, mine.settings) == (theirs.name, theirs.planner, theirs.settings)
        assert mine.scenario.model == theirs.scenario.model
    assert read.digest() == campaign.digest()


def test_a_run_may_be_named_by_any_whole_number(whole):
    assert open_results(whole).record("jdm-rate-5.0", np.int64(1)).run == 1


def test_what_is_finished_and_missing(whole):
    results = open_results(whole)
    assert results.finished("jdm-rate-5.0") == (0, 1, 2)
    assert results.finished("random-rate-5.0") == (0, 1)
    assert results.missing("random-rate-5.0") == (2,)
    order = [(run.cell, run.record.run) for run in results.runs()]
    assert order == [(cell.name, run) for cell in results.campaign.cells for run in results.finished(cell.name)]
    with pytest.raises(InputError, match=r"campaign\.sqlite: cell random-rate-5\.0, run 2: expected a finished run"):
        results.record("random-rate-5.0", 2)
    for ask in (results.finished, lambda cell: results.record(cell, 0)):
        with pytest.raises(InputError, match=r"cell: expected one of jdm-rate-5\.0"):
            ask("constant")


def test_strategies_are_compared_over_the_runs_that_all_have(whole, campaign):
    groups = open_results(whole).comparisons()
    assert [group.settings["sensors.*.clutter.rate"] for group in groups] == [5.0, 10.0]
    group = groups[0]
    assert group.settings.keys() == {"scenario", "sensors.*.clutter.rate"}
    assert group.labels == group.comparison.strategies == ("jdm", "random")
    assert [cell.name for cell in group.cells] == ["jdm-rate-5.0", "random-rate-5.0"]
    runs = {planner: [make_run(planner, run) for run in range(2)] for planner in ("jdm", "random")}
    ensembles = {
        name: build_ensemble((record.summary(), metrics) for record, metrics in of) for name, of in runs.items()
    }
    assert_same(group.comparison, compare_scored_scans(campaign.cells[0].scenario, ensembles))


def test_another_axis_than_the_planner_is_compared(tmp_path):
    campaign = make_campaign(compare="sensors.*.clutter.rate", planners=["random"])
    (group,) = open_results(fill(tmp_path / "results", campaign)).comparisons()
    assert group.labels == ("5.0", "10.0")
    assert group.settings == {"scenario": "paper-a", "planner": "random"}
    np.testing.assert_array_equal(group.comparison.run_means("5.0"), group.comparison.run_means("10.0"))


def test_a_campaign_that_has_just_begun_has_nothing_to_show(tmp_path, campaign):
    results = open_results(fill(tmp_path / "results", campaign, leave_out=len(campaign.tasks)))
    assert results.comparisons() == ()
    assert results.tables() == {}
    assert list(results.runs()) == []
    assert results.dataset().sizes == {"cell": 4, "run": NUM_RUNS, "step": 0}


def test_results_are_read_while_they_are_written(tmp_path, campaign):
    with Store.open(tmp_path, campaign) as store:
        results = open_results(tmp_path)
        for number, (cell, run) in enumerate(campaign.tasks[:3]):
            assert len(list(results.runs())) == number
            add(store, cell.name, run)


@pytest.mark.skipif(os.name == "nt", reason="folders are always writable there")
def test_a_folder_that_may_not_be_written_is_read(folder):
    for path in (*folder.iterdir(), folder):
        path.chmod(path.stat().st_mode & ~(stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH))
    before = sorted(path.name for path in folder.iterdir())
    assert len(open_results(folder).comparisons()) == 2
    assert sorted(path.name for path in folder.iterdir()) == before
    folder.chmod(0o700)


def execute(folder, statement: str, *values) -> None:
    with closing(sqlite3.connect(folder / "campaign.sqlite")) as database, database:
        database.execute(statement, values)


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE runs SET payload = substr(payload, 1, 1000) WHERE cell = 'jdm-rate-5.0' AND run = 1",
        "UPDATE runs SET payload = x'00' || substr(payload, 2) WHERE cell = 'jdm-rate-5.0' AND run = 1",
        "UPDATE runs SET payload = 'text' WHERE cell = 'jdm-rate-5.0' AND run = 1",
        "UPDATE runs SET timings = payload WHERE cell = 'jdm-rate-5.0' AND run = 1",
        "UPDATE runs SET metrics = timings WHERE cell = 'jdm-rate-5.0' AND run = 1",
        "UPDATE runs SET payload_sha256 = '' WHERE cell = 'jdm-rate-5.0' AND run = 1",
        "UPDATE runs SET run = 1 - run WHERE cell = 'jdm-rate-5.0' AND run < 2",
    ],
)
def test_a_run_that_was_altered_is_named(folder, statement):
    if "1 - run" in statement:  # swapped runs, by way of a third number
        execute(folder, "UPDATE runs SET run = 9 WHERE cell = 'jdm-rate-5.0' AND run = 1")
        execute(folder, "UPDATE runs SET run = 1 WHERE cell = 'jdm-rate-5.0' AND run = 0")
    else:
        execute(folder, statement)
    results = open_results(folder)
    message = (
        r"campaign\.sqlite: cell jdm-rate-5\.0, run 1: expected the runs? .* written|runs of the campaign; got .* run 9"
    )
    for ask in (lambda: results.record("jdm-rate-5.0", 1), results.comparisons, results.tables, results.dataset):
        with pytest.raises(InputError, match=message):
            ask()
    assert results.record("jdm-rate-5.0", 2).run == 2


def test_a_payload_of_another_run_or_of_none_is_named(folder, campaign):
    record, _ = make_run("random", 0)
    timings = encode_timings(record)
    with Store.open(folder, campaign) as store:
        store.add(row_of("random-rate-5.0", 2, encode(record), timings))
        store.add(row_of("random-rate-10.0", 2, b"no run", timings))
    results = open_results(folder)
    for cell, message in (("random-rate-5.0", "expected the number 2; got 0"), ("random-rate-10.0", "got others")):
        with pytest.raises(InputError, match=rf"campaign\.sqlite: cell {cell}, run 2: run: .*{message}"):
            results.record(cell, 2)


def test_bytes_changed_anywhere_in_the_file_are_never_read_as_results(folder):
    database = folder / "campaign.sqlite"
    whole = database.read_bytes()
    expected = {(run.cell, run.record.run): run.checksum for run in open_results(folder).runs()}
    rng = np.random.default_rng(5)
    for place in rng.integers(0, len(whole), 40).tolist():
        broken = bytearray(whole)
        broken[place] ^= 0xFF
        database.write_bytes(broken)
        with suppress(InputError):
            found = {(run.cell, run.record.run): run.checksum for run in open_results(folder).runs()}
            assert found.items() <= expected.items()


@pytest.mark.parametrize("length", [0, 50, 4096, 20_000, -4096, -100])
def test_a_file_cut_short_is_named(folder, length):
    database = folder / "campaign.sqlite"
    database.write_bytes(database.read_bytes()[:length])
    with pytest.raises(InputError, match=r"campaign\.sqlite: .*(cut short or altered|as they were written)"):
        list(open_results(folder).runs())


def test_what_is_no_results_folder_is_named(folder, tmp_path):
    (folder / "campaign.sqlite").rename(tmp_path / "away")
    with pytest.raises(InputError, match=r"campaign\.sqlite: expected the runs of a campaign; got no file"):
        open_results(folder)
    assert not (folder / "campaign.sqlite").exists()
    (folder / "manifest.json").unlink()
    with pytest.raises(InputError, match=r"manifest\.json: no such file; expected the manifest of a results folder"):
        open_results(folder)
    with pytest.raises(InputError, match="no such folder; expected the results folder of a campaign"):
        open_results(folder / "nowhere")
    with pytest.raises(InputError, match="a file; expected the results folder"):
        open_results(tmp_path / "away")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format": "photo album"}, "got another file"),
        (
            {"format_version": 9},
            "expected format 7; got 9, written by a later version of this program: run it again, or read it with",
        ),
        ({"seed": 8}, r"campaign\.sqlite: expected the runs of the manifest beside it"),
        ({"cells": []}, "the manifest was altered"),
        ({"digest": None}, "altered: digest: Field required"),
    ],
)
def test_an_altered_manifest_is_named(folder, change, message):
    path = folder / "manifest.json"
    manifest = {**json.loads(path.read_text()), **change}
    path.write_text(json.dumps({name: value for name, value in manifest.items() if value is not None}))
    with pytest.raises(InputError, match=message):
        open_results(folder)


def test_a_folder_of_an_earlier_version_is_named_with_what_reads_it(folder):
    path = folder / "manifest.json"
    manifest = json.loads(path.read_text())
    manifest["sessions"][-1]["versions"]["vedette"] = "0.1.dev1"
    for number, which in ((2, "an earlier"), (8, "a later")):
        path.write_text(json.dumps({**manifest, "format_version": number}))
        message = rf"manifest\.json: expected format 7; got {number}, written by {which} version .* vedette 0\.1\.dev1"
        with pytest.raises(InputError, match=message):
            open_results(folder)
    path.write_text(json.dumps({"format": "vedette-campaign", "format_version": 2}))
    with pytest.raises(InputError, match="run it again, or read it with the version that wrote it"):
        open_results(folder)


def test_a_manifest_that_agrees_with_its_runs_and_is_no_campaign_is_named(folder):
    path = folder / "manifest.json"
    cell = {"name": "a", "settings": {}, "scenario": "x: [", "planner": "jdm"}
    faults: tuple[dict[str, Any], ...] = ({"cells": [{}]}, {"axes": 3}, {"cells": [cell]})
    for fault in faults:
        manifest = {**json.loads(path.read_text()), **fault}
        path.write_text(json.dumps(manifest))
        execute(folder, "UPDATE campaign SET contents = ?", contents_checksum(manifest))
        with pytest.raises(InputError, match=r"manifest\.json: expected a campaign; it is cut short or altered"):
            open_results(folder)
    path.write_text("{")
    with pytest.raises(InputError, match="cut short or altered"):
        open_results(folder)


def call(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def test_the_command_prints_the_comparisons_and_what_is_missing(whole):
    result = call("results", whole)
    assert result.exit_code == 0, result.output
    for part in (
        "sensors.*.clutter.rate 5.0:",
        "sensors.*.clutter.rate 10.0:",
        "OSPA (m)",
        "jdm     joint decisions, CS divergence",
        "trial, seed 7: 10 of 12 runs are finished",
        "missing: 1 run of random-rate-5.0",
    ):
        assert part in result.output
    assert "jdm at 10 s" in call("results", whole, "--verbose").output
    assert "run of jdm" not in result.output
    assert "scenario paper-a" not in result.output


def test_the_command_exports(whole, tmp_path):
    result = call("results", whole, "--export", tmp_path / "out", "--format", "csv", "--format", "netcdf")
    assert result.exit_code == 0, result.output
    assert "scans.csv" in result.output
    assert (tmp_path / "out" / "scans.nc").stat().st_size > 10_000
    assert call("results", whole, "--export", tmp_path / "plain").exit_code == 0
    assert (tmp_path / "plain" / "rewards.parquet").exists()


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        (("nowhere",), 1, "no such folder"),
        ((".", "--format", "excel"), 2, "expected one of 'parquet', 'csv', 'netcdf'; got 'excel'"),
        ((".", "--format", "csv"), 2, "--export"),
    ],
)
def test_mistakes(arguments, status, message):
    result = call("results", *arguments)
    assert result.exit_code == status
    assert message in result.output
    assert "Traceback" not in result.output


@pytest.mark.parametrize("table", ["runs", "campaign", "failures"])
def test_a_table_that_was_dropped_is_damage_and_not_a_fresh_start(folder, campaign, table):
    execute(folder, f"DROP TABLE {table}")
    for ask in (lambda: open_results(folder).finished("jdm-rate-5.0"), lambda: Store.open(folder, campaign)):
        with pytest.raises(InputError, match=r"campaign\.sqlite: expected the tables of a campaign"):
            ask()


def test_latex_tables_say_what_they_are_of(whole, campaign, tmp_path):
    assert CliRunner().invoke(app, ["results", str(whole), "--tex", str(tmp_path / "t.tex")]).exit_code == 0
    lines = (tmp_path / "t.tex").read_text("utf-8").splitlines()
    said = [line for line in lines if line.startswith("% ")]
    digest = open_results(whole).manifest["digest"][:12]
    assert len(said) == len(campaign.groups())
    assert all(line.endswith(f": seed 7, vedette {__version__}, {digest}") for line in said)
