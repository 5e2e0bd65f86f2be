"""Recorded targets with altitudes: states with heights, from reports to the error in space."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from vedette.cli import app
from vedette.errors import InputError, ScenarioError
from vedette.evaluation import track_recording
from vedette.recorded import RecordedTargets
from vedette.scenarios import load_scenario
from vedette.scenarios.from_recording import scenario_from_recording
from vedette.scenarios.recorded_data import recorded_targets

REPORTS: dict[str, Any] = {
    "time": [0.0, 10.0, 30.0],
    "id": ["a", "a", "a"],
    "x": [0.0, 1000.0, 3000.0],
    "y": [0.0, 0.0, 0.0],
}
RNG = np.random.default_rng(0)


@pytest.mark.parametrize(("name", "unit"), [("altitude_m", 1.0), ("altitude_ft", 0.3048), ("altitude_fl", 30.48)])
def test_heights_change_steadily_between_reports(name: str, unit: float) -> None:
    altitudes = [1000.0 / unit, 1100.0 / unit, 1000.0 / unit]
    source = RecordedTargets.from_columns(REPORTS | {name: altitudes})
    assert source.truth([0.0, 10.0], rng=RNG).at(0)[1].shape == (1, 4)
    truth = RecordedTargets(source.reports, with_height=True).truth([0.0, 5.0, 20.0, 30.0], rng=RNG)
    states = np.array([truth.at(step)[1][0] for step in range(4)])
    np.testing.assert_allclose(states[:, 4:], [[1000.0, 10.0], [1050.0, 10.0], [1050.0, -5.0], [1000.0, -5.0]])
    np.testing.assert_allclose(states[:, 0], [0.0, 500.0, 2000.0, 3000.0], atol=1e-9)
    assert source.reports.unused == ()


def test_heights_that_are_wanted_must_be_recorded() -> None:
    source = RecordedTargets.from_columns(REPORTS)
    with pytest.raises(InputError, match="expected a column altitude_m of every report"):
        RecordedTargets(source.reports, with_height=True)


def test_a_gap_in_altitudes_leaves_targets_in_the_plane() -> None:
    assert RecordedTargets.from_columns(REPORTS | {"altitude_m": [1.0, None, 2.0]}).reports.altitudes is None
    with pytest.raises(InputError, match=r"row 2, column .height.: expected a finite number"):
        RecordedTargets.from_columns(REPORTS | {"height": [1.0, None, 2.0]}, columns={"altitude": "height"})


def recording(folder: Path, altitude: str) -> Path:
    """A radar of altitudes above one aircraft, its true flight, and an error in space; the sensors file."""
    (folder / "radar.yaml").write_text(
        "recording: {bearings: east, turns: none}\nospa: {components: position_and_height, cutoff: 500.0}\nsensors:\n"
        "  - {name: R, position: [0, 0], measurement: {kind: bearing_range_altitude},\n"
        "     noise: {kind: constant, std: [0.001, 10.0, 10.0]}}\n"
    )
    rng, rows, true = np.random.default_rng(1), ["time,bearing_rad,range_m,altitude_m"], [f"time,id,x,y,{altitude}"]
    for time in np.arange(0.0, 80.0, 4.0).tolist():
        x, y, z = -6000.0 + 150.0 * time, 8000.0, 3000.0 + 5.0 * time
        noise = rng.normal(0.0, [0.001, 10.0, 10.0])
        seen = np.array([np.arctan2(y, x), np.sqrt(x * x + y * y + z * z), z]) + noise
        rows.append(f"{time},{','.join(map(str, seen))}")
        true.append(f"{time},a,{x},{y},{z}")
    (folder / "scans.csv").write_text("\n".join(rows))
    (folder / "truth.csv").write_text("\n".join(true))
    return folder / "radar.yaml"


def test_errors_in_space_are_those_of_recorded_heights(tmp_path: Path) -> None:
    sensors = recording(tmp_path, "altitude_m")
    found = scenario_from_recording(sensors, tmp_path / "scans.csv", truth=tmp_path / "truth.csv", speed=250.0)
    record = track_recording(found.scenario, found.recording)
    assert record.ospa[10:-1, 0].max() < 60.0  # at the last scan the target has left the region


def test_a_truth_without_altitudes_has_no_error_in_space(tmp_path: Path) -> None:
    sensors = recording(tmp_path, "depth")
    with pytest.raises(ScenarioError, match="expected a column altitude_m of every report"):
        scenario_from_recording(sensors, tmp_path / "scans.csv", truth=tmp_path / "truth.csv", speed=250.0)


def test_sensors_of_heights_measure_recorded_targets_that_have_them(tmp_path: Path) -> None:
    recording(tmp_path, "altitude_m")
    (tmp_path / "scenario.yaml").write_text(
        "name: heights\ntime: {num_steps: 20, step_period: 4.0}\nmotion: {kind: constant_velocity_height}\n"
        "region: {x_min: -1e4, x_max: 1e4, y_min: -1e4, y_max: 1e4}\n"
        "birth: {from_measurements: {std: [50, 50, 100, 100, 4000, 10], expected: 0.1}}\n"
        "targets: {kind: recorded, path: truth.csv}\nsensors:\n"
        "  - {position: [0, 0], measurement: {kind: bearing_range_altitude},\n"
        "     noise: {kind: constant, std: [0.001, 10.0, 10.0]}}\n"
    )
    scenario = load_scenario(tmp_path / "scenario.yaml")
    assert recorded_targets(scenario.model, tmp_path).with_height


def test_the_replay_of_a_recording_has_heights(tmp_path: Path) -> None:
    sensors = recording(tmp_path, "altitude_m")
    words = ["track", str(tmp_path / "scans.csv"), "--sensors", str(sensors), "--truth", str(tmp_path / "truth.csv")]
    out = tmp_path / "out"
    for command in ([*words, "--max-target-speed", "250", "--out", str(out)], ["report", str(out)]):
        result = CliRunner().invoke(app, command)
        assert result.exit_code == 0, result.output
    page = (out / "report.html").read_text(encoding="utf-8")
    found = re.search(r'<script[^>]*id="runs"[^>]*>(.*?)</script>', page, re.DOTALL)
    assert found is not None
    heights = json.loads(found.group(1))[0]["heights"]
    assert heights["truth"][10] == [3200.0]
    ((height, std),) = heights["estimates"][10]
    assert abs(height - 3200.0) < 5.0 * std < 200.0
