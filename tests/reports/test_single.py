"""The report of a single run: recorded scans are shown as they were recorded, errors only where targets are known."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from recordings import write_recording
from reports.test_page import Words
from vedette.cli import app
from vedette.evaluation.runs import run_scenario
from vedette.models.scan_rows import values_of
from vedette.reports import write_run_report
from vedette.reports.groups import group_of_run
from vedette.reports.replay import replay_data
from vedette.scenarios import Scenario
from vedette.scenarios.from_recording import RecordingScenario, scenario_from_recording
from vedette.scenarios.overrides import replace_fields
from vedette.simulation.records import RunRecord


def tracked(folder: Path, truth: bool) -> tuple[RecordingScenario, RunRecord]:
    write_recording(folder, seconds=60.0)
    found = scenario_from_recording(
        folder / "radars.yaml", folder / "scans.csv", folder / "truth.csv" if truth else None
    )
    return found, run_scenario(found.scenario, "stationary", seed=0)


def data_of(record: RunRecord, scenario: Scenario) -> dict[str, Any]:
    group = group_of_run(record, scenario)
    return replay_data(group.strategies[0], record, group.title, trust=False)


def words_of(record: RunRecord, scenario: Scenario, folder: Path) -> str:
    write_run_report(record, scenario, folder / "page.html")
    return Words((folder / "page.html").read_text("utf-8")).words


def test_measurements_are_those_of_the_recording(tmp_path: Path) -> None:
    (scenario, recording, _), record = tracked(tmp_path, truth=True)
    data = data_of(record, scenario)
    assert data["recorded"]
    assert data["known"]
    shown = [row for sensors in data["scans"] for rows in sensors for row in rows]
    assert len(shown) == recording.num_measurements
    assert {row[0] for row in shown} == {-1}
    for scans, poses, rows in zip(recording.scans, recording.poses, data["scans"], strict=True):
        for scan, pose, of_sensor in zip(scans, poses, rows, strict=True):
            assert len(of_sensor) == (0 if scan is None else len(scan))
            for (bearing, distance), (_, x, y) in zip(() if scan is None else values_of(scan), of_sensor, strict=True):
                place = pose[:2] + distance * np.array([math.cos(bearing), math.sin(bearing)])
                np.testing.assert_allclose([x, y], place, atol=1.0)


def test_errors_are_shown_if_targets_are_known(tmp_path: Path) -> None:
    (scenario, *_), record = tracked(tmp_path, truth=True)
    words = words_of(record, scenario, tmp_path)
    for part in (
        "Run report",
        "Recorded scans, scans.csv: ",
        "OSPA against time",
        "GOSPA (m)",
        "those of the recording",
    ):
        assert part in words
    assert "No errors are shown" not in words
    assert "drawn again" not in words


def test_without_true_targets_there_are_no_errors(tmp_path: Path) -> None:
    (scenario, *_), record = tracked(tmp_path, truth=False)
    data = data_of(record, scenario)
    assert (data["known"], data["ospa"]) == (False, [])
    assert not any(math.isnan(value) for rows in data["estimates"] for row in rows for value in row[1:])
    words = words_of(record, scenario, tmp_path)
    assert "No errors are shown: nobody knows the targets." in words
    assert "Independence error" in words
    assert "GOSPA" not in words


def test_a_recording_that_is_another_now_is_not_shown(tmp_path: Path) -> None:
    (scenario, *_), record = tracked(tmp_path, truth=False)
    lines = (tmp_path / "scans.csv").read_text("utf-8").splitlines()
    (tmp_path / "scans.csv").write_text("\n".join(lines[:1] + lines[9:]), "utf-8")
    assert data_of(record, scenario)["scans"] == []


def test_an_unknown_heading_is_not_drawn(tmp_path: Path) -> None:
    """Sensors that see all round, and of which the recording has no headings."""
    (scenario, *_), record = tracked(tmp_path, truth=False)
    data = data_of(record, scenario)
    for s, sensor in enumerate(data["sensors"]):
        assert {poses[s][2] for poses in data["poses"]} == {sensor["unturned"]}
    turned = replace_fields(
        scenario,
        {
            "sensors.0.detection": {
                "kind": "limited_sector",
                "probability": 0.9,
                "max_range": 5000.0,
                "half_width_deg": 60.0,
            }
        },
    )
    assert ["unturned" in sensor for sensor in data_of(record, turned)["sensors"]] == [False, True]


def report(*words: object) -> Result:
    return CliRunner().invoke(app, ["report", *map(str, words)])


def test_the_command_takes_a_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_recording(tmp_path, seconds=40.0)
    monkeypatch.chdir(tmp_path)
    made = CliRunner().invoke(app, ["track", "scans.csv", "--sensors", "radars.yaml", "--out", "run"])
    assert made.exit_code == 0, made.output
    result = report("run", "--figures", "figures", "--json")
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["page"] == "run/report.html"
    assert {"tracks-recorded.pdf", "tracks-recorded.png", "tracks-recorded.svg"} <= {
        path.name for path in (tmp_path / "figures").iterdir()
    }
    first = (tmp_path / "run/report.html").read_bytes()
    assert report("run").exit_code == 0
    assert (tmp_path / "run/report.html").read_bytes() == first
    assert CliRunner().invoke(app, ["results", "run"]).exit_code == 0  # the page does no harm to the folder
    chosen = report("run", "--runs", "jdm:0")
    assert chosen.exit_code == 2
    assert "holds a single run" in chosen.output
    (tmp_path / "run/scenario.yaml").unlink()
    assert report("run").output.startswith("run/scenario.yaml: no such file")
