"""Recordings, simulations and outputs of targets with heights."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from heights import KINDS, Aircraft, scene, track, write

from vedette.errors import ScenarioError
from vedette.evaluation import run_scenario, track_recording
from vedette.evaluation.scans import scan_table, scans_of_record
from vedette.evaluation.track_table import table_of_run, write_tracks
from vedette.kernels.base.types import OWN_HEIGHT
from vedette.live.messages import read_message
from vedette.recorded import Conventions, parse_scans
from vedette.recorded.files import read_table
from vedette.recorded.tables import Table
from vedette.scenarios import load_scenario
from vedette.scenarios.from_recording import scenario_from_recording, scenario_from_sensors
from vedette.scenarios.loading import Scenario, parse_scenario
from vedette.scenarios.recorded_data import recorded_sensors
from vedette.scenarios.sensors_file import check_sensors_file

SOLID = [kind for kind in KINDS if kind != "bearing_range"]


@pytest.mark.parametrize(("kind", "num_radars"), [(SOLID[0], 2), (SOLID[1], 1), (SOLID[2], 2)])
@pytest.mark.parametrize("seed", [11, 12])
def test_aircraft_are_tracked_with_their_heights(tmp_path: Path, kind: str, num_radars: int, seed: int) -> None:
    error, height, share, squared = scene(tmp_path, seed, kind, num_radars).tolist()
    assert error < 100.0
    assert height < (300.0 if kind == "bearing_slant_range" else 100.0)
    assert share > 0.97
    assert 0.8 < squared < 4.7  # 2.37 is right


@pytest.mark.parametrize(("kind", "num_radars"), [(kind, num) for kind in SOLID for num in (1, 2)])
@pytest.mark.parametrize("name", ["lmb", "delta_glmb"])
def test_other_filters_start_tracks_at_heights(tmp_path: Path, name: str, kind: str, num_radars: int) -> None:
    aircraft = Aircraft(np.random.default_rng(3))
    write(tmp_path, aircraft, kind, num_radars)
    sensors = tmp_path / "radars.yaml"
    sensors.write_text(f"filter: {{kind: {name}}}\n{sensors.read_text('utf-8')}", "utf-8")
    error, _, share, _ = track(tmp_path, aircraft).tolist()
    assert error < (1000.0 if (kind, num_radars) == ("bearing_slant_range", 1) else 100.0)
    assert share > 0.97


def test_slant_ranges_in_the_plane_are_far_off(tmp_path: Path) -> None:
    """The mistake that heights cure: were it small, the tests above would say little."""
    assert scene(tmp_path, 11, "bearing_range", 2)[0] > 400.0


SIMULATED = """
name: air
time: {num_steps: 6, step_period: 4.0}
region: {x_min: -30000, x_max: 30000, y_min: -30000, y_max: 30000}
motion: {kind: constant_velocity_height, sigma_v: 2.0, sigma_climb: 0.5}
survival: {kind: constant, probability: 0.99}
birth: {sites: [{existence: 0.1, mean: [-15000, 9000, 200, 0, 8000, 0], std: [500, 500, 20, 20, 500, 5]}]}
targets: {kind: scripted, tracks: [{state: [-15000, 9000, 200, 0, 8000, 5], std: [0, 0, 0, 0, 0, 0], start_step: 1}]}
sensor_defaults:
  height: 100.0
  measurement: {kind: bearing_range_altitude}
  noise: {kind: range_dependent, sigma_range: 40.0, eta_range: 0.0, sigma_bearing_deg: 0.1, sigma_altitude: 30.0}
  clutter: {kind: region, rate: 2.0, max_height: 12000.0}
  detection: {kind: constant, probability: 0.95}
sensors:
  - {name: ship, position: [0, -5000], platform: {kind: heading, speed: 10.0, headings_deg: [0, 90, 180]}}
  - {name: hill, position: [20000, 0]}
control: {decision_steps: [3]}
origin: {lon: 10.0, lat: 50.0}
"""


def test_a_scene_with_heights_is_simulated_decided_and_written(tmp_path: Path) -> None:
    scenario = Scenario(parse_scenario(SIMULATED, "air.yaml"))
    record = run_scenario(scenario, "jdm", seed=1)
    assert (record.poses[:, :, OWN_HEIGHT] == 100.0).all()
    assert len(record.decisions) == 1
    last = record.estimates[-1]
    true = record.truth.at(5)[1]
    assert len(last.means) == 1
    assert np.hypot(*(last.means[0, :2] - true[0, :2])) < 150.0
    assert abs(last.means[0, 4] - true[0, 4]) < 100.0
    table = table_of_run(record, scenario)
    assert table["z_m"][-1] == pytest.approx(last.means[0, 4])
    assert table["std_vz_mps"][-1] == pytest.approx(np.sqrt(last.covs[0, 5, 5]))
    write_tracks(tmp_path / "tracks.geojson", table)
    (feature,) = json.loads((tmp_path / "tracks.geojson").read_text("utf-8"))["features"]
    assert feature["geometry"]["coordinates"][-1][2] == pytest.approx(last.means[0, 4], abs=0.06)
    write_tracks(tmp_path / "tracks.czml", table)
    packet = json.loads((tmp_path / "tracks.czml").read_text("utf-8"))[1]
    assert packet["position"]["cartographicDegrees"][-1] == pytest.approx(last.means[0, 4], abs=0.06)


def test_written_scans_are_read_again() -> None:
    text = SIMULATED.replace("altitude}", "elevation}").replace("altitude: 30.0", "elevation_deg: 0.3")
    scenario = Scenario(parse_scenario(text, "air.yaml"))
    record = run_scenario(scenario, "stationary", seed=2)
    table = scan_table(record, scenario)
    assert set(table["own_height_m"]) == {100.0}
    read = parse_scans(
        Table(table, range(1, len(table["time"]) + 1), "scans"),
        recorded_sensors(scenario.model),
        Conventions({}, {}, "east"),
        None,
    )
    for given, found in zip(scans_of_record(record, scenario), read.scans, strict=True):
        for one, other in zip(given, found, strict=True):
            assert one is not None
            assert isinstance(other, np.ndarray)
            np.testing.assert_allclose(other, one.measurements, atol=1e-9)


def test_detection_is_decided_where_was_measured_and_a_search_counts_what_is_unexplained() -> None:
    text = SIMULATED.replace("  height: 100.0\n", "  height: 100.0\n  true_parameters: {detection_of: measurement}\n")
    measured = "{sites: [], from_measurements: {expected: 0.5, max_existence: 0.1, std: [500, 500, 200, 200, 3000, 5]}}"
    text = re.sub(
        r"^birth: .*$",
        f"birth: {measured}\nundetected: {{cell_size: 5000.0, expected: 1.0, speed: 200.0}}",
        text,
        flags=re.M,
    )
    text = f"{text}filter: {{kind: lmb}}\n"
    record = run_scenario(Scenario(parse_scenario(text, "air.yaml")), "stationary", seed=1)
    assert abs(record.estimates[-1].means[0, 4] - record.truth.at(5)[1][0, 4]) < 100.0


def test_flight_levels_and_feet_are_read_and_a_moving_height(tmp_path: Path) -> None:
    rows = "time,sensor,bearing_deg,range_nmi,altitude_fl,own_height_ft\n0,R,90,10,330,1000\n4,R,90,10,331,1100\n"
    (tmp_path / "scans.csv").write_text(rows, "utf-8")
    (tmp_path / "radars.yaml").write_text(
        "sensors:\n  - {name: R, position: [0, 0], height: 5, compass: true, measurement: "
        "{kind: bearing_range_altitude}, noise: {kind: constant, std: [0.002, 40, 30]}, detection: {kind: constant, "
        "probability: 0.9}}\n",
        "utf-8",
    )
    assert "altitude" in check_sensors_file(tmp_path / "radars.yaml").summary
    recording = scenario_from_recording(tmp_path / "radars.yaml", tmp_path / "scans.csv").recording
    assert recording.unused == ()
    scan = recording.scans[0][0]
    assert isinstance(scan, np.ndarray)
    np.testing.assert_allclose(scan, [[0.0, 18520.0, 330 * 30.48]], atol=1e-9)
    np.testing.assert_allclose(recording.poses[:, 0, OWN_HEIGHT], [304.8, 335.28])


def test_lines_of_a_radar_with_elevations(tmp_path: Path) -> None:
    write(tmp_path, Aircraft(np.random.default_rng(0)), "bearing_range_elevation", 1)
    sensors = tmp_path / "radars.yaml"
    region = "region: {x_min: -30000, x_max: 30000, y_min: -30000, y_max: 30000}\n"
    sensors.write_text(region + sensors.read_text("utf-8"), "utf-8")
    told = scenario_from_sensors(sensors)
    line = b'{"sensor": "R", "time": 1.0, "measurements": [[0.5, 10000.0, 0.25]]}'
    found = read_message(line, "line 1", recorded_sensors(told.scenario.model), told.conventions)
    np.testing.assert_allclose(found.scan.measurements, [[0.5, 1e4, 0.25]])
    assert found.scan.pose[OWN_HEIGHT] == 30.0


FAULTS = [
    ("motion: {kind: constant_velocity_height, sigma_v: 2.0, sigma_climb: 0.5}", "motion: {kind: constant_velocity}"),
    ("sigma_altitude: 30.0", "eta_bearing: 0.0"),
    ("kind: bearing_range_altitude", "kind: bearing_range"),
    (
        "clutter: {kind: region, rate: 2.0, max_height: 12000.0}",
        "clutter: {kind: around_sensor, rate: 2.0, radius: 9.0}",
    ),
]
WANTED = [
    "sensor_defaults.measurement.kind: expected one of bearing_range, bearing_range_rate, bearing_only, range_only, "
    "position, or a motion with pz (as targets have px, py, vx, vy); got",
    "noise.sigma_altitude: expected a number above 0, as altitudes are measured; got none",
    "height: expected 0, as a bearing_range measurement does not depend on heights; got 100.0",
    "clutter: expected region, measurement_space or custom clutter for a bearing_range_altitude measurement; got",
]


@pytest.mark.parametrize(("change", "wanted"), list(zip(FAULTS, WANTED, strict=True)))
def test_settings_incompatible_with_heights_are_reported(change: tuple[str, str], wanted: str) -> None:
    text = SIMULATED.replace(*change)
    assert text != SIMULATED
    with pytest.raises(ScenarioError) as error:
        parse_scenario(text, "f.yaml")
    found = "\n".join(error.value.faults).replace(", got", "; got")
    assert wanted in found, found


def test_a_recording_with_heights_has_them_in_its_record(tmp_path: Path) -> None:
    write(tmp_path, Aircraft(np.random.default_rng(3)), "bearing_range_altitude", 1)
    assert "altitude_m" in read_table(tmp_path / "scans.csv").columns
    found = scenario_from_recording(tmp_path / "radars.yaml", tmp_path / "scans.csv", speed=250.0)
    assert "also in height" in found.assumed["motion"]
    record = track_recording(found.scenario, found.recording)
    assert table_of_run(record, found.scenario)["z_m"]
    assert "pz" not in load_scenario("paper-a").model.motion.components
