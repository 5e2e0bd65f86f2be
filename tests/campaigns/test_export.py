"""The results of a campaign in other tools: Arrow, Parquet, DuckDB, CSV, xarray, NetCDF."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest
import xarray
from pyarrow import parquet

from campaigns.filled import NUM_RUNS, fill, make_campaign, make_run
from vedette.campaigns import results as reading
from vedette.campaigns.export import FORMATS, export_csv, export_netcdf, export_tables
from vedette.campaigns.results import open_results
from vedette.campaigns.tables import concatenated_tables, in_schema, schema_of, tables_of_runs
from vedette.errors import InputError
from vedette.internal.text import spreadsheet_text

KEYS = ["cell", "scenario", "planner", "sensors.*.clutter.rate", "run"]
TABLES = ["runs", "scans", "truth", "tracks", "sensors", "decisions", "actions", "rewards", "timings"]


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """All runs but two."""
    return open_results(fill(tmp_path_factory.mktemp("campaign") / "results", make_campaign(), leave_out=2))


@pytest.fixture(scope="module")
def tables(results):
    return results.tables()


def part(table, cell, run):
    """Columns of one run as lists."""
    rows = [row for row in table.to_pylist() if (row["cell"], row["run"]) == (cell, run)]
    return {name: [row[name] for row in rows] for name in table.column_names}


def test_every_table_tells_which_run_a_row_is_of(results, tables):
    assert list(tables) == TABLES
    finished = [(run.cell, run.record.run) for run in results.runs()]
    for table in tables.values():
        assert table.column_names[: len(KEYS)] == KEYS
        seen = dict.fromkeys(zip(table["cell"].to_pylist(), table["run"].to_pylist(), strict=True))
        if table is tables["rewards"]:
            assert list(seen) == [(cell, run) for cell, run in finished if cell.startswith("jdm")]
        else:
            assert list(seen) == finished
    assert set(tables["scans"]["planner"].to_pylist()) == {"jdm", "random"}
    assert set(tables["scans"]["sensors.*.clutter.rate"].to_pylist()) == {5.0, 10.0}


def test_rows_of_scans_tracks_truth_and_sensors_are_those_of_the_record(tables):
    record, metrics = make_run("jdm", 1)
    scans = part(tables["scans"], "jdm-rate-5.0", 1)
    np.testing.assert_array_equal(scans["ospa_m"], record.ospa[:, 0])
    np.testing.assert_array_equal(scans["time_s"], record.times)
    for name, column in metrics.columns().items():
        np.testing.assert_array_equal(np.array(scans[name], np.float64), column)  # None, or null, becomes NaN
    tracks = part(tables["tracks"], "jdm-rate-5.0", 1)
    np.testing.assert_array_equal(tracks["mean_1"], np.concatenate([e.means[:, 1] for e in record.estimates]))
    np.testing.assert_array_equal(tracks["cov_5"], np.concatenate([e.covs[:, 1, 1] for e in record.estimates]))
    truth = part(tables["truth"], "jdm-rate-5.0", 1)
    np.testing.assert_array_equal(truth["state_3"], record.truth.states[:, 3])
    sensors = part(tables["sensors"], "jdm-rate-5.0", 1)
    np.testing.assert_array_equal(np.array(sensors["heading_rad"]).reshape(40, 2), record.poses[:, :, 2])


def test_rows_of_decisions_actions_and_rewards_are_those_of_the_plans(tables):
    record, _ = make_run("jdm", 2)
    rows = part(tables["decisions"], "jdm-rate-5.0", 2)
    actions = part(tables["actions"], "jdm-rate-5.0", 2)
    rewards = part(tables["rewards"], "jdm-rate-5.0", 2)
    shape = (len(record.decisions), 13, 13)
    reward, chosen = np.array(rewards["reward"]).reshape(shape), np.array(rewards["chosen"]).reshape(shape)
    could = np.array(actions["heading_deg"]).reshape(len(record.decisions), 2, 13)
    did = np.array(actions["chosen"]).reshape(could.shape)
    for index, decision in enumerate(record.decisions):
        plan = decision.plan
        assert (rows["step"][index], rows["time_s"][index]) == (decision.step, decision.time)
        assert rows["num_samples"][index] == 40
        np.testing.assert_array_equal(could[index], [own.values[:, 0] for own in plan.actions])
        np.testing.assert_array_equal(could[index][did[index]], np.ravel(plan.chosen_actions))
        np.testing.assert_array_equal(reward[index], plan.tables[0].mean)
        assert [tuple(place) for place in np.argwhere(chosen[index])] == [plan.chosen]
    assert (rewards["action_0"][14], rewards["action_1"][14]) == (1, 1)
    assert set(rewards["reward_table"]) == {0}


def test_a_measure_without_a_value_is_null_and_leaves_averages_alone(tables):
    import duckdb

    scans = tables["scans"]
    with duckdb.connect() as database:
        answer = database.register("scans", scans).execute("SELECT avg(nees_mean), count(nees_mean) FROM scans")
        ((mean, num),) = answer.fetchall()
    values = scans["nees_mean"].to_numpy()
    assert num == np.isfinite(values).sum() < len(values)
    assert mean == pytest.approx(np.nanmean(values))


@pytest.mark.parametrize("name", ["scans", "truth", "tracks", "sensors", "timings"])
def test_every_table_counts_steps_from_one(results, tables, name):
    rows = tables[name]
    assert "scan" not in rows.column_names
    steps, times = rows["step"].to_numpy(), rows["time_s"].to_numpy()
    record = results.record("jdm-rate-5.0", 0)
    np.testing.assert_array_equal(times, record.times[steps - 1])
    if name != "tracks":
        assert (steps.min(), steps.max()) == (1, record.num_scans)


def test_timings_are_by_stage_and_scan(tables):
    rows = part(tables["timings"], "random-rate-10.0", 1)
    record, _ = make_run("random", 1)
    for stage, seconds in record.timings.items():
        np.testing.assert_array_equal(rows[f"{stage}_s"], seconds)
    assert set(rows["session"]) == {1}


def test_units_are_in_the_metadata(tables):
    schema = tables["sensors"].schema
    assert schema.field("x_m").metadata == {b"unit": b"m"}
    assert schema.field("heading_rad").metadata == {b"unit": b"rad"}
    assert schema.field("sensor").metadata is None
    assert b"trial" in schema.metadata[b"vedette"]


def test_equal_results_are_equal_files_whatever_order_they_came_in(results, tmp_path):
    from campaigns.filled import add
    from vedette.campaigns.store import Store

    campaign = make_campaign()
    with Store.open(tmp_path / "other", campaign) as store:
        for cell, run in reversed(campaign.tasks[:-2]):
            add(store, cell.name, run)
    first = export_tables(results, tmp_path / "first")
    second = export_tables(open_results(tmp_path / "other"), tmp_path / "second")
    assert [path.name for path in first] == [f"{name}.parquet" for name in TABLES]
    for mine, theirs in zip(first, second, strict=True):
        assert mine.read_bytes() == theirs.read_bytes()
    again = export_tables(results, tmp_path / "first")
    assert sorted(path.name for path in (tmp_path / "first").iterdir()) == sorted(path.name for path in again)


def test_cells_of_other_dimensions_share_a_table(results):
    """A sweep over scenarios whose states or sensors differ in number: what a cell lacks is null."""
    first, second = results.run("jdm-rate-5.0", 0), results.run("random-rate-5.0", 0)
    truth = second.record.truth
    wider = replace(truth, states=np.concatenate([truth.states, truth.states[:, :1]], axis=1))
    counts = replace(second.record.decisions[0].plan, counts={"samples": 1, "others": 2})
    decisions = (replace(second.record.decisions[0], plan=counts), *second.record.decisions[1:])
    record = replace(second.record, truth=wider, decisions=decisions)
    tables = tables_of_runs(results.campaign, [first, replace(second, record=record)])
    num = len(first.record.truth.states)
    assert tables["truth"]["state_4"][:num].null_count == num
    np.testing.assert_array_equal(tables["truth"]["state_4"][num:], wider.states[:, 4])
    assert tables["decisions"]["num_others"].to_pylist() == [None, None, None, 2, None, None]


def test_tables_written_part_by_part_are_those_of_all_runs_at_once(results, tables, tmp_path, monkeypatch):
    """Also where a part lacks a table (random control weighs no actions), or a column."""
    (tmp_path / "whole").mkdir()
    whole = export_csv(results, tmp_path / "whole")
    monkeypatch.setattr(reading, "_TOGETHER", 1)
    assert len(list(results.table_parts())) == 10
    for path, in_parts in zip(export_tables(results, tmp_path / "parquet"), results.tables().values(), strict=True):
        written = parquet.read_table(path)
        assert written.schema.equals(tables[path.stem].schema, check_metadata=True)
        assert written.to_pylist() == in_parts.to_pylist() == tables[path.stem].to_pylist()
    for mine, theirs in zip(whole, export_csv(results, tmp_path / "parts"), strict=True):
        assert mine.read_bytes() == theirs.read_bytes()


def test_what_a_part_lacks_is_null(results):
    first, second = results.run("jdm-rate-5.0", 0), results.run("random-rate-5.0", 0)
    counts = replace(second.record.decisions[0].plan, counts={"samples": 1, "others": 2})
    decisions = (replace(second.record.decisions[0], plan=counts), *second.record.decisions[1:])
    runs = [first, replace(second, record=replace(second.record, decisions=decisions))]
    whole = tables_of_runs(results.campaign, runs)
    parts = concatenated_tables(tables_of_runs(results.campaign, [run]) for run in runs)
    schema = schema_of(tables_of_runs(results.campaign, [run])["decisions"].schema for run in runs)
    assert schema.names == whole["decisions"].column_names
    for name, table in whole.items():
        assert parts[name].to_pylist() == table.to_pylist()
    alone = in_schema(tables_of_runs(results.campaign, runs[:1])["decisions"], schema)
    assert alone["num_others"].to_pylist() == [None, None, None]


def test_decisions_that_were_explained_have_tables_of_their_own(results):
    """Of those runs alone; the runs that were kept without have no rows there."""
    from simulation.test_explanation_tables import explained

    first, second = results.run("jdm-rate-5.0", 0), results.run("jdm-rate-5.0", 1)
    assert "explanations" not in tables_of_runs(results.campaign, [first, second])
    tables = tables_of_runs(results.campaign, [first, replace(second, record=explained(second.record))])
    assert tables["explanations"]["run"].to_pylist() == [1, 1]
    assert tables["explanations"]["baseline"].to_pylist() == [0.0, None]
    assert tables["target_gains"]["existence_gain"].to_pylist() == [0.5, -0.25]
    assert tables["sensor_gains"]["sensor"].to_pylist() == [0, 1]


def test_csv_holds_the_same(results, tables, tmp_path):
    import csv

    files = {path.stem: path for path in export_csv(results, tmp_path)}
    with files["decisions"].open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == tables["decisions"].num_rows
    assert [int(row["num_samples"]) for row in rows] == tables["decisions"]["num_samples"].to_pylist()
    with files["scans"].open(newline="") as file:
        values = [float(row["ospa_m"]) for row in csv.DictReader(file)]
    np.testing.assert_array_equal(values, tables["scans"]["ospa_m"].to_numpy())


FORMULAS = ["=1+1", "+cmd", "-rf", "@SUM(A1)", "\tx", "\r=1"]


def test_csv_has_no_cell_that_a_spreadsheet_runs(tmp_path):
    """Names of variants and settings are anybody's text; numbers and texts of numbers stay what they are."""
    import csv

    values = [*FORMULAS[:2], "@SUM(A1)", "-2.5e-3", "plain = x"]
    campaign = make_campaign(grid={"description": values})
    results = open_results(fill(tmp_path / "results", campaign))
    files = {path.stem: path for path in export_csv(results, tmp_path)}
    with files["runs"].open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(dict.fromkeys(row["description"] for row in rows)) == [
        *(f"'{text}" for text in values[:3]),
        *values[3:],
    ]
    assert results.tables()["runs"]["description"].to_pylist()[0] == "=1+1"


@pytest.mark.parametrize("text", FORMULAS)
def test_texts_that_look_like_formulas_get_an_apostrophe(text):
    assert spreadsheet_text(text) == f"'{text}"


@pytest.mark.parametrize("text", ["", "a", "-1", "+.5", "-2.e+10", "a=1", " =1", "sensor 1"])
def test_other_texts_stay_what_they_are(text):
    assert spreadsheet_text(text) == text


def test_the_dataset_has_every_measure_and_gaps_where_runs_are_missing(results):
    dataset = results.dataset()
    assert dict(dataset.sizes) == {"cell": 4, "run": NUM_RUNS, "step": 40}
    record, metrics = make_run("jdm", 1)
    chosen = dataset.sel(cell="jdm-rate-10.0", run=1)
    np.testing.assert_array_equal(chosen["ospa_m"], record.ospa[:, 0])
    np.testing.assert_array_equal(chosen["time_s"], record.times)
    for name, column in metrics.columns().items():
        np.testing.assert_array_equal(chosen[name], column)
    assert bool(dataset["ospa_m"].sel(cell="random-rate-5.0", run=2).isnull().all())
    assert dataset["ospa_m"].attrs["units"] == "m"
    strategies = dataset.groupby("planner").mean()["ospa_m"].mean(("run", "step"))
    assert float(strategies.sel(planner="jdm")) < float(strategies.sel(planner="random"))


def test_netcdf_reads_back(results, tmp_path):
    (path,) = export_netcdf(results, tmp_path)
    with xarray.open_dataset(path, engine="scipy") as read:
        dataset = results.dataset()
        for name in dataset.data_vars:
            np.testing.assert_array_equal(read[name], dataset[name])
        assert list(read["planner"].astype(str).values) == list(dataset["planner"].values)
        assert read.attrs["campaign"] == "trial"


def test_a_missing_xarray_is_named(results, monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(
        InputError, match=r"a dataset needs xarray, which is not installed: pip install 'vedette\[xarray\]'"
    ):
        results.dataset()


@pytest.mark.parametrize("kind", FORMATS)
def test_a_place_that_cannot_be_written_is_named(results, tmp_path, kind):
    (tmp_path / "file").write_text("mine")
    with pytest.raises(InputError, match="expected a file that can be written"):
        FORMATS[kind](results, tmp_path / "file")
    assert (tmp_path / "file").read_text() == "mine"
