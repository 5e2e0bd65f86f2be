"""Recordings and lines whose rows bring their own accuracy and signal, or lack a component."""

from __future__ import annotations

import csv
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import expon

from models.same_rows import assert_same_rows
from vedette.errors import InputError
from vedette.evaluation import track_recording
from vedette.evaluation.scans import scan_table
from vedette.live.messages import read_message
from vedette.models import (
    Bias,
    Region,
    ScanRows,
    SignalModel,
    around_sensor,
    measurement_space_clutter,
    region_clutter,
)
from vedette.models.functions import numbers_at
from vedette.models.pose_noise import PoseStds, pose_noise
from vedette.recorded import Conventions, Origin, RecordedSensor, parse_scans
from vedette.recorded.merging import merged
from vedette.recorded.returns import Extent
from vedette.recorded.tables import as_table
from vedette.scenarios.from_recording import scenario_from_recording

EAST = Conventions({}, {}, "east")
RADAR = RecordedSensor("R", "bearing_range", (0.0, 0.0, 0.0), turn="none")
SIGNAL = SignalModel(16.0, 10.0)
ROWS = {
    "time": [0.0, 0.0, 1.0],
    "bearing_rad": [0.5, 1.0, None],
    "range_km": [1.0, 2.0, None],
    "range_std_km": [0.05, "", None],
    "bearing_std_deg": [1.0, 2.0, None],
}


def scans_of(columns: dict[str, Any], site: RecordedSensor = RADAR, conventions: Conventions = EAST) -> list[Any]:
    recording = parse_scans(as_table(columns), [site], conventions, Origin(0.0, 0.0))
    assert recording.unused == ()
    return [scan for (scan,) in recording.scans]


def test_standard_deviations_of_rows_are_read_in_their_units() -> None:
    first, second = scans_of(ROWS)
    stds = [[math.radians(1.0), 50.0], [math.radians(2.0), 0.0]]
    assert_same_rows(first, ScanRows([[0.5, 1000.0], [1.0, 2000.0]], stds))
    assert second.shape == (0, 2)


def test_positions_have_correlations_and_degrees_have_metres() -> None:
    accuracy = {"x_std_m": [3.0, 3.0], "y_std_m": [4.0, 4.0], "xy_correlation": [-0.5, None]}
    covs = [[[9.0, -6.0], [-6.0, 16.0]], [[9.0, 0.0], [0.0, 16.0]]]
    place = replace(RADAR, kind="position")
    (scan,) = scans_of({"time": [0.0, 0.0], "x": [1.0, 2.0], "y": [5.0, 6.0], **accuracy}, place)
    assert_same_rows(scan, ScanRows([[1.0, 5.0], [2.0, 6.0]], covs))
    (scan,) = scans_of({"time": [0.0, 0.0], "lon": [0.0, 0.001], "lat": [0.0, 0.0], **accuracy}, place)
    np.testing.assert_allclose(scan.noise, covs)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"range_std_km": [-0.05, "", None]}, "row 1, column .range_std_km.: expected a standard deviation above 0"),
        ({"range_std_km": ["x", "", None]}, "row 1, column .range_std_km.: expected a finite number"),
        ({"bearing_std_deg": [400.0, 2.0, None]}, "row 1, column .bearing_std_deg.: expected a number from"),
    ],
)
def test_bad_standard_deviations_are_named(change: dict[str, Any], expected: str) -> None:
    with pytest.raises(InputError, match=expected):
        scans_of(ROWS | change)


def test_a_correlation_of_one_is_refused() -> None:
    columns = {"time": [0.0], "x": [1.0], "y": [5.0], "x_std": [3.0], "y_std": [4.0], "xy_correlation": [1.0]}
    with pytest.raises(InputError, match=r"column .xy_correlation.: expected a correlation above -1 and below 1"):
        scans_of(columns, replace(RADAR, kind="position"))


def test_a_ratio_without_a_signal_is_a_column_that_is_not_read() -> None:
    columns = ROWS | {"snr_db": [12.0, 20.0, None]}
    assert parse_scans(as_table(columns), [RADAR], EAST).unused == ("snr_db",)
    first, _ = scans_of(columns, replace(RADAR, signal=SIGNAL))
    np.testing.assert_allclose(first.log_ratios, [SIGNAL.log_likelihood_ratio(each) for each in (12.0, 20.0)])


@pytest.mark.parametrize("snr", [10.0, 11.0, 12.5])
@pytest.mark.parametrize("clutter", [0.0, 3.0])
def test_a_likelihood_ratio_is_that_of_the_densities(snr: float, clutter: float) -> None:
    """But for one false measurement in a thousand that is as strong as targets are."""
    power, threshold = 10.0 ** (snr / 10.0), 10.0
    target = expon.pdf(power - threshold, scale=1.0 + 10.0**1.6)
    false = 0.999 * expon.pdf(power - threshold, scale=10.0 ** (clutter / 10.0)) + 0.001 * target
    found = SignalModel(16.0, 10.0, clutter).log_likelihood_ratio(snr)
    assert found == pytest.approx(math.log(target / false), rel=1e-12)


def test_a_likelihood_ratio_is_bounded() -> None:
    assert SIGNAL.log_likelihood_ratio(60.0) == pytest.approx(math.log(1000.0))
    assert SIGNAL.log_likelihood_ratio(-60.0) == SIGNAL.log_likelihood_ratio(10.0)


def test_a_bias_is_removed_and_the_accuracy_stays() -> None:
    first, _ = scans_of(ROWS, replace(RADAR, bias=Bias(range=100.0)))
    plain, _ = scans_of(ROWS)
    assert_same_rows(first, ScanRows(plain.values - [0.0, 100.0], plain.noise))


def test_rows_of_one_target_are_merged_with_their_mean_covariance() -> None:
    columns = ROWS | {"bearing_rad": [0.5, 0.501, None], "range_km": [1.0, 1.01, None]}
    recording = parse_scans(as_table(columns), [RADAR], EAST)
    (scan,) = merged(recording, [RADAR], [Extent(30.0, "as given")]).scans[0]
    assert scan is not None
    before: Any = recording.scans[0][0]
    places = before.values[:, 1:2] * np.column_stack([np.cos(before.values[:, 0]), np.sin(before.values[:, 0])])
    mean, noise = before.values.mean(axis=0), before.noise.mean(axis=0)
    variance = ((places - mean[1] * np.array([math.cos(mean[0]), math.sin(mean[0])])) ** 2).mean()
    grown = noise + np.diag([variance / mean[1] ** 2, variance])
    assert_same_rows(scan, ScanRows([mean], [grown]))


def test_rows_may_lack_an_altitude() -> None:
    site = replace(RADAR, kind="bearing_range_altitude")
    columns = {"time": [0.0, 0.0], "bearing_rad": [0.5, 1.0], "range_m": [9e3, 8e3], "altitude_fl": [100.0, None]}
    (scan,) = scans_of(columns, site)
    assert_same_rows(scan, ScanRows([[0.5, 9e3, 3048.0], [1.0, 8e3, np.nan]]))
    with pytest.raises(InputError, match=r"row 2, column .range_m.: expected a finite number"):
        scans_of(columns | {"range_m": [9e3, None]}, site)


def line(**more: Any) -> bytes:
    return json.dumps({"sensor": "R", "time": 5.0, "measurements": [[0.5, 1000.0], [1.0, 2000.0]], **more}).encode()


def test_lines_have_standard_deviations_and_ratios() -> None:
    site = replace(RADAR, signal=SIGNAL)
    given = line(stds=[[0.01, 50.0], [None, 20.0]], snr_db=[12.0, None])
    scan = read_message(given, "line 1", [site], Conventions({}, {})).scan.measurements
    ratios = [SIGNAL.log_likelihood_ratio(12.0), 0.0]
    expected = ScanRows([[0.5, 1000.0], [1.0, 2000.0]], [[0.01, 50.0], [0.0, 20.0]], log_ratios=ratios)
    assert_same_rows(scan, expected)


@pytest.mark.parametrize(
    ("more", "expected"),
    [
        ({"stds": [[0.01, 50.0]]}, "stds: expected for each of 2 measurements"),
        ({"stds": [[0.01, 50.0], [0.01, -1.0]]}, "stds: expected for each of 2 measurements"),
        ({"stds": 3}, "stds: expected for each of 2 measurements"),
        ({"snr_db": [1.0, 2.0]}, "snr_db: expected none, as the sensors file gives no `signal`"),
    ],
)
def test_bad_accuracy_in_lines_is_named(more: dict[str, Any], expected: str) -> None:
    with pytest.raises(InputError, match=expected):
        read_message(line(**more), "line 1", [RADAR], Conventions({}, {}))


def test_a_line_may_lack_an_altitude_and_no_range() -> None:
    site = replace(RADAR, kind="bearing_range_altitude")
    scan = read_message(line(measurements=[[0.5, 9e3, None]]), "line 1", [site], Conventions({}, {})).scan
    assert_same_rows(scan.measurements, ScanRows([[0.5, 9e3, np.nan]]))
    with pytest.raises(InputError, match="numbers"):
        read_message(line(measurements=[[0.5, None, 100.0]]), "line 1", [site], Conventions({}, {}))


def test_a_sensors_file_reads_accuracy_and_signal(tmp_path: Path) -> None:
    (tmp_path / "radar.yaml").write_text(
        "recording: {bearings: east}\nsensors:\n"
        "  - {name: R, position: [0, 0], signal: {mean_db: 16.0, threshold_db: 10.0, clutter_db: 3.0}}\n"
    )
    rows = "".join(f"{k},{0.5 + 0.001 * k},1000,50,1.0,{11 + k % 3}\n" for k in range(12))
    (tmp_path / "scans.csv").write_text("time,bearing_rad,range_m,range_std_m,bearing_std_deg,snr_db\n" + rows)
    found = scenario_from_recording(tmp_path / "radar.yaml", tmp_path / "scans.csv", speed=10.0).recording
    scans = [scan for (scan,) in found.scans if scan is not None]
    assert all(isinstance(scan, ScanRows) and len(scan.noise) == len(scan.log_ratios) == 1 for scan in scans)


@pytest.mark.parametrize(
    ("clutter", "without"),
    [
        (
            measurement_space_clutter(2.0, [-1.0, 0.0, -50.0], [1.0, 100.0, 50.0]),
            measurement_space_clutter(2.0, [-1.0, 0.0], [1.0, 100.0]),
        ),
        (
            around_sensor(2.0, radius=100.0, kind="bearing_range_rate"),
            around_sensor(2.0, radius=100.0, kind="bearing_range"),
        ),
        (
            region_clutter(2.0, Region(-90.0, 90.0, -90.0, 90.0), "position_altitude"),
            region_clutter(2.0, Region(-90.0, 90.0, -90.0, 90.0), "position"),
        ),
    ],
)
def test_clutter_of_rows_without_a_component_has_the_density_of_the_others(clutter: Any, without: Any) -> None:
    scan = np.array([[0.5, 20.0], [-0.3, 70.0], [0.9, 120.0]])
    rows = np.column_stack([scan, np.full(3, np.nan)])
    found = numbers_at(clutter.log_intensity, rows, np.zeros(3), clutter.params)
    np.testing.assert_allclose(found, without.log_intensity_at(scan, np.zeros(3)), rtol=1e-12)


POSES = ROWS | {
    "own_x_std_m": [30.0, 30.0, None],
    "own_y_std_km": [0.04, "", None],
    "own_heading_std_deg": [1.5, 1.5, 1.5],
}


def test_errors_of_the_own_pose_add_to_the_noise() -> None:
    first, _ = scans_of(POSES)
    stds = [[math.radians(1.0), 50.0], [math.radians(2.0), 0.0]]
    measured = [[0.5, 1000.0], [1.0, 2000.0]]
    poses = [PoseStds(30.0, 40.0, math.radians(1.5)), PoseStds(30.0, 0.0, math.radians(1.5))]
    added = [
        pose_noise(row, ("bearing", "range"), (0.0, 0.0, 0.0), own) for row, own in zip(measured, poses, strict=True)
    ]
    assert_same_rows(first, ScanRows(measured, stds, added_noise=added), rtol=1e-12)
    # By hand, of the first row: along and across the line of sight.
    along = math.hypot(30.0 * math.cos(0.5), 40.0 * math.sin(0.5))
    covs = first.covs(np.zeros((2, 2, 2)))
    assert covs[0, 1, 1] == pytest.approx(50.0**2 + along**2)
    across = math.hypot(30.0 * math.sin(0.5), 40.0 * math.cos(0.5)) / 1000.0
    assert covs[0, 0, 0] == pytest.approx(math.radians(1.0) ** 2 + math.radians(1.5) ** 2 + across**2)


def test_bad_accuracy_of_the_own_pose_is_named() -> None:
    with pytest.raises(InputError, match=r"row 1, column .own_x_std_m.: expected a standard deviation above 0"):
        scans_of(POSES | {"own_x_std_m": [-1.0, 30.0, None]})
    with pytest.raises(InputError, match=r"row 1, column .own_heading_std_deg.: expected a number from"):
        scans_of(POSES | {"own_heading_std_deg": [200.0, 1.5, None]})
    place = {"time": [0.0], "x": [1.0], "y": [5.0], "own_x_std_m": [4.0]}
    recording = parse_scans(as_table(place), [replace(RADAR, kind="position")], EAST)
    assert recording.unused == ("own_x_std_m",)


def test_lines_have_standard_deviations_of_the_pose() -> None:
    given = line(pose_stds={"x": 30.0, "heading_deg": 1.5})
    scan = read_message(given, "line 1", [RADAR], Conventions({}, {})).scan.measurements
    measured, own = [[0.5, 1000.0], [1.0, 2000.0]], PoseStds(x=30.0, heading=math.radians(1.5))
    added = [pose_noise(row, ("bearing", "range"), (0.0, 0.0, 0.0), own) for row in measured]
    assert_same_rows(scan, ScanRows(measured, added_noise=added), rtol=1e-12)
    empty = line(pose_stds={"x": 30.0}, measurements=[])
    assert len(read_message(empty, "line 1", [RADAR], Conventions({}, {})).scan.measurements) == 0


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({"heading": 1.5}, "pose_stds: expected keys among heading_deg, x, y"),
        ({"x": 0.0}, "pose_stds.x: expected a number above 0"),
        ({"x": "3"}, "pose_stds.x: expected a number above 0"),
        (3.0, "pose_stds: expected keys among"),
    ],
)
def test_bad_standard_deviations_of_the_pose_are_named(given: Any, expected: str) -> None:
    with pytest.raises(InputError, match=expected):
        read_message(line(pose_stds=given), "line 1", [RADAR], Conventions({}, {}))
    place = replace(RADAR, kind="position")
    with pytest.raises(InputError, match="pose_stds: expected none, as measurements of 'R' do not depend on its pose"):
        read_message(line(pose_stds=given), "line 1", [place], Conventions({}, {}))


def test_scans_that_are_written_again_have_their_accuracy(tmp_path: Path) -> None:
    """Of two sensors with other columns, of rows with empty cells, and of a turn: equal in every bit."""
    (tmp_path / "radars.yaml").write_text(
        "recording: {bearings: east}\nregion: {x_min: -3e4, x_max: 3e4, y_min: -3e4, y_max: 3e4}\n"
        "sensor_defaults: {clutter: {kind: region, rate: 1.0}}\nsensors:\n"
        "  - {name: R, position: [0, 0], measurement: {kind: bearing_range_altitude}, turn: {period: 8.0},\n"
        "     noise: {kind: constant, std: [0.01, 40.0, 50.0]}, signal: {mean_db: 16.0, threshold_db: 10.0}}\n"
        "  - {name: P, position: [0, 0], measurement: {kind: position_altitude},\n"
        "     noise: {kind: constant, std: [20.0, 20.0, 30.0]}}\n",
        "utf-8",
    )
    rng, rows = np.random.default_rng(3), list[list[Any]]()
    for k in range(12):
        bearing = 0.4 - 2.0 * math.pi * (8.0 * k + 1.0) / 8.0
        std = "" if k == 3 else rng.uniform(20.0, 60.0)
        altitude = "" if k in (2, 5) else 4000.0 + 10.0 * k
        plot = [math.remainder(bearing, 2.0 * math.pi), 9000.0 + k, altitude, "", "", std, 1.1, "", "", 11.0 + k]
        rows.append([8.0 * k + 1.0, "R", *plot, 0.7, 12.5])
        place = ["", "", 4000.0, 8000.0 + k, 900.0, "", "", *rng.uniform(5.0, 9.0, 2), "", "", ""]
        rows.append([8.0 * k + 2.0, "P", *place])
    names = ["bearing_rad", "range_m", "altitude_m", "x", "y", "range_std_m", "bearing_std_deg", "x_std_m", "y_std_m"]
    header = ["time", "sensor", *names, "snr_db", "own_heading_std_deg", "own_x_std_m"]
    with (tmp_path / "scans.csv").open("w", newline="") as file:
        csv.writer(file).writerows([header, *rows])
    found = scenario_from_recording(tmp_path / "radars.yaml", tmp_path / "scans.csv", speed=100.0)
    table = scan_table(track_recording(found.scenario, found.recording), found.scenario)
    radar = [k for k, name in enumerate(table["sensor"]) if name == "R"]
    assert [table["snr_db"][k] for k in radar] == [11.0 + k for k in range(12)]
    assert [number for number, k in enumerate(radar) if table["altitude_m"][k] is None] == [2, 5]
    with (tmp_path / "again.csv").open("w", newline="") as file:
        csv.writer(file).writerows([list(table), *zip(*table.values(), strict=True)])
    again = scenario_from_recording(tmp_path / "radars.yaml", tmp_path / "again.csv", speed=100.0).recording
    for one, other in zip(found.recording.scans, again.scans, strict=True):
        for scan, same in zip(one, other, strict=True):
            assert (scan is None) == (same is None)
            if scan is not None:
                assert isinstance(same, ScanRows)
                assert_same_rows(scan, same, rtol=0.0)
    assert again.unused == found.recording.unused
