"""Recorded and live scans of sensors whose errors last: the time between scans, and rows with their own accuracy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vedette.errors import InputError
from vedette.models.correlation import independent_share
from vedette.models.scan_rows import ScanRows
from vedette.scenarios.build import build_tracking
from vedette.scenarios.from_recording import scenario_from_recording, scenario_from_sensors

SENSORS = """recording: {bearings: east}
sensors:
  - name: radar
    position: [0.0, 0.0]
    measurement: {kind: bearing_range}
    noise: {kind: constant, std: [0.01, 5.0]}
    detection: {kind: constant, probability: 0.9}
  - name: lidar
    position: [0.0, 0.0]
    measurement: {kind: bearing_range}
    noise: {kind: constant, std: [0.01, 2.0]}
    detection: {kind: constant, probability: 0.8}
    correlation: {noise_s: 3.0}
"""
REGION = "region: {x_min: -900.0, x_max: 900.0, y_min: -900.0, y_max: 900.0}\n"


def files(folder: Path, accuracy: str = "", sensors: str = SENSORS) -> tuple[Path, Path]:
    """A radar every 2 s and a lidar every half second, of one target."""
    rows = ["time,sensor,range_m,bearing_rad" + (",range_std_m" if accuracy else "")]
    for k in range(80):
        extra = f",{accuracy}" if accuracy else ""
        rows += [
            f"{0.5 * k},{name},{200 + k},0.3{extra}" for name in ("radar", "lidar") if name == "lidar" or k % 4 == 0
        ]
    scans, file = folder / "scans.csv", folder / "sensors.yaml"
    scans.write_text("\n".join(rows), "utf-8")
    file.write_text(sensors, "utf-8")
    return file, scans


def test_the_time_between_scans_is_that_of_the_sensor_in_the_recording(tmp_path):
    recorded = scenario_from_recording(*files(tmp_path))
    assert [own.correlation.interval_s for own in recorded.scenario.model.sensors] == [None, 0.5]
    radar, lidar = build_tracking(recorded.scenario, recorded.recording).tracker.sensors
    assert radar.noise.params.tolist() == [0.01, 5.0]
    np.testing.assert_allclose(lidar.noise.params, np.array([0.01, 2.0]) / np.sqrt(independent_share(0.5, 3.0)))


def test_a_time_that_is_given_stays(tmp_path):
    given = SENSORS.replace("{noise_s: 3.0}", "{noise_s: 3.0, interval_s: 0.25}")
    recorded = scenario_from_recording(*files(tmp_path, sensors=given))
    assert recorded.scenario.model.sensors[1].correlation.interval_s == 0.25


def test_the_accuracy_of_rows_is_counted_for_less_too(tmp_path):
    recorded = scenario_from_recording(*files(tmp_path, accuracy="7.0"))
    tracking = build_tracking(recorded.scenario, recorded.recording)
    before, after = recorded.recording.scans[0], tracking.recording.scans[0]
    assert isinstance(before[0], ScanRows)
    assert isinstance(after[0], ScanRows)
    assert isinstance(after[1], ScanRows)
    np.testing.assert_array_equal(after[0].noise, before[0].noise)
    assert after[1].noise[0, 1, 1] == pytest.approx(49.0 / independent_share(0.5, 3.0))


def test_live_scans_need_the_time_between_them(tmp_path):
    file, _ = files(tmp_path, sensors=REGION + SENSORS)
    with pytest.raises(InputError, match=r"correlation\.interval_s: expected the time between two scans, in s"):
        scenario_from_sensors(file)
    file.write_text(file.read_text("utf-8").replace("{noise_s: 3.0}", "{noise_s: 3.0, interval_s: 0.5}"), "utf-8")
    assert scenario_from_sensors(file).scenario.model.sensors[1].correlation.interval_s == 0.5
