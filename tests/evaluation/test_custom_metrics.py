"""Custom metrics: a column in every table of measures, stored, computed later, compared and reported."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pyarrow import parquet

from campaigns.filled import fill, make_campaign, make_run
from evaluation.synthetic import make_record
from simulation.test_storage import assert_same
from vedette.campaigns.cells import resolve
from vedette.campaigns.codec import encode
from vedette.campaigns.results import open_results
from vedette.campaigns.rows import row_of
from vedette.campaigns.running import run_campaign
from vedette.campaigns.spec import spec_from_data
from vedette.campaigns.store import Store
from vedette.errors import InputError, VedetteError
from vedette.evaluation.metrics import serialization
from vedette.evaluation.metrics.run import Metric, measure
from vedette.evaluation.metrics.serialization import decode_metrics, encode_metrics
from vedette.reports import write_report
from vedette.reports.groups import comparison_groups
from vedette.reports.saving import write_summary
from vedette.reports.tables import measure_table
from vedette.scenarios import load_scenario
from vedette.scenarios.dumping import dump_scenario
from vedette.simulation.records import RunRecord
from vedette.simulation.serialization import encode_timings

LIMITS: dict[str, Any] = {"cutoff": 100.0, "order": 1.0, "window": 10}


def farthest(record: RunRecord) -> Any:
    return np.hypot(record.poses[..., 0], record.poses[..., 1]).max(axis=1)


def since_third(record: RunRecord) -> Any:
    return np.where(record.times > 3.0, np.array([len(each.labels) for each in record.estimates]), np.nan)


OWN = (Metric("farthest_m", farthest), Metric("estimates", since_third))


def test_a_custom_metric_is_a_column_and_is_stored() -> None:
    record = make_record()
    metrics = measure(record, **LIMITS, custom=OWN)
    assert list(metrics.columns())[-2:] == ["farthest_m", "estimates"]
    np.testing.assert_array_equal(metrics.columns()["farthest_m"], farthest(record))
    again, own = decode_metrics(encode_metrics(metrics), 40)
    assert_same(again, metrics)
    assert_same(own, metrics.custom)


@pytest.mark.parametrize(
    ("name", "got"), [("gospa_m", "no column has"), ("ospa_m", "no column has"), ("run", "no column"), ("a b", "ident")]
)
def test_names_that_no_column_can_have(name: str, got: str) -> None:
    with pytest.raises(InputError, match=rf"metric\.name: expected a .*{got}"):
        Metric(name, farthest)


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (lambda record: 3.0, r"metric mine: expected .*40"),
        (lambda record: record.times[1:], r"metric mine: expected .*40"),
        (lambda record: ["x"] * 40, "metric mine: expected"),
        (lambda record: np.full(40, np.inf), "metric mine: expected finite numbers, or NaN"),
        (lambda record: record.nothing, "metric mine: AttributeError: 'RunRecord' object has no attribute 'nothing'"),
    ],
)
def test_metrics_without_one_number_per_scan_are_rejected(function: Any, message: str) -> None:
    with pytest.raises(VedetteError, match=message):
        Metric("mine", function).evaluate(make_record())


def test_a_new_metric_is_computed_for_an_old_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of an earlier version, with fewer measures, and one that kept none: the same as this version keeps."""
    campaign = make_campaign(grid={}, runs=2)
    record, metrics = make_run("jdm", 0)
    with monkeypatch.context() as earlier:
        earlier.setattr(serialization, "_SET", "0 gospa_m")
        fill(tmp_path / "results", campaign, leave_out=2)
    with Store.open(tmp_path / "results", campaign) as store:
        other = make_run("jdm", 1)[0]
        store.add(row_of("jdm", 1, encode(other), encode_timings(other)))
    results = open_results(tmp_path / "results")
    assert_same(replace(results.metrics("jdm", 0), custom={}), metrics)
    assert_same(results.metrics("jdm", 1), make_run("jdm", 1)[1])
    assert_same(results.record("jdm", 0), record)


MINE = """
import numpy as np

def farthest(record):
    return np.hypot(record.poses[..., 0], record.poses[..., 1]).max(axis=1)
"""


def test_a_new_metric_of_a_scenario_continues_the_campaign(tmp_path: Path) -> None:
    """The finished runs are measured again when the campaign goes on, and nothing else of the folder changes."""
    (tmp_path / "mine.py").write_text(MINE)
    text = dump_scenario(load_scenario("paper-a").model)
    (tmp_path / "scene.yaml").write_text(text)
    spec = {"name": "x", "scenarios": ["scene.yaml"], "planners": ["jdm"], "runs": 2, "seed": 7}
    folder = fill(tmp_path / "results", resolve(spec_from_data(spec), tmp_path))
    before = {run.record.run: run.checksum for run in open_results(folder).runs()}
    gains = "metrics: {farthest_m: {kind: custom, function: mine.py:farthest}}"
    assert "metrics: {}" in text
    (tmp_path / "scene.yaml").write_text(text.replace("metrics: {}", gains))
    outcome = run_campaign(resolve(spec_from_data(spec), tmp_path), folder)
    assert (outcome.num_existing, outcome.num_completed) == (2, 0)
    for run in open_results(folder).runs():
        assert run.checksum == before[run.record.run]
        np.testing.assert_array_equal(run.metrics.custom["farthest_m"], farthest(run.record))
    assert "farthest_m" in parquet.read_schema(folder / "tables" / "scans.parquet").names


@pytest.mark.usefixtures("quick_figures")
def test_tables_comparisons_and_reports_have_its_column(tmp_path: Path) -> None:
    folder = fill(tmp_path / "results", make_campaign(grid={}))
    results = open_results(folder, metrics=OWN)
    scans = results.tables()["scans"].to_pandas()
    chosen = scans[(scans["cell"] == "jdm") & (scans["run"] == 1)]
    record = make_run("jdm", 1)[0]
    np.testing.assert_array_equal(chosen["farthest_m"], farthest(record))
    assert chosen["estimates"].isna().sum() == 3
    np.testing.assert_array_equal(results.dataset()["farthest_m"].sel(cell="jdm", run=1), farthest(record))
    (group,) = results.comparisons()
    compared = group.comparison
    assert compared.run_means("jdm", "farthest_m")[1] == pytest.approx(farthest(record)[compared.counted].mean())
    assert compared.difference("random", part="gospa_m").summary.mean > 0.0
    with pytest.raises(
        InputError, match=r"part: expected one of total, localisation, cardinality, gospa_m, .*; got 'x'"
    ):
        compared.curve("jdm", "x")
    (gathered,) = comparison_groups(results)
    table = measure_table(gathered)
    assert table is not None
    assert [row[0] for row in table.rows if row[0] in ("farthest_m", "estimates")] == ["farthest_m", "estimates"]
    write_summary(results, tmp_path / "summary")
    with (tmp_path / "summary" / "summary.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert float(rows[0]["farthest_m_mean"]) == pytest.approx(compared.summary("jdm", "farthest_m").mean)
    write_report(results, tmp_path / "report.html")
    assert "farthest_m" in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert json.loads((folder / "manifest.json").read_text())["format_version"] == 7
