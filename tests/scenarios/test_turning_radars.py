"""Recordings of turning radars: turns that their rows show, scans of a turn, and tracks as if all were of one time."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from turning_radars import STD, Flights, track, write

from vedette.errors import InputError, ScenarioError
from vedette.evaluation import run_scenario, track_recording
from vedette.evaluation.scans import scan_table, scans_of_record
from vedette.kernels.base.types import Floats
from vedette.live.messages import read_message
from vedette.models.turns import Turn, is_turn, lags
from vedette.recorded import Conventions, RecordedScans, RecordedSensor, parse_scans
from vedette.recorded.tables import Table
from vedette.recorded.turns import found_turn, swept
from vedette.scenarios import load_scenario
from vedette.scenarios.from_recording import scenario_from_recording, scenario_from_sensors
from vedette.scenarios.recorded_data import recorded_sensors
from vedette.scenarios.recording_warnings import recording_warnings


@pytest.mark.parametrize(("period", "clockwise", "num_radars"), [(2.5, True, 1), (4.0, False, 2), (12.0, True, 2)])
def test_turning_radars_track_as_radars_that_see_all_at_once(
    tmp_path: Path, period: float, clockwise: bool, num_radars: int
) -> None:
    errors = dict[bool, float]()
    places = {"R": (0.0, 0.0), "S": (9000.0, -7000.0)} if num_radars == 2 else {"R": (0.0, 0.0)}
    for sweeps in (True, False):
        flights = Flights(np.random.default_rng(int(10 * period)), 6, 0.0)
        turns = [Turn(period, clockwise), Turn(1.1 * period, clockwise)]
        firsts = zip(places.items(), turns, (0.3, 2.0), strict=False)
        write(tmp_path, {name: flights.rows(at, turn, first, sweeps) for (name, at), turn, first in firsts}, places)
        errors[sweeps], squared, num = track(tmp_path, flights)
        assert num > 5.0
        assert 0.5 < squared < 2.8  # chi-squared of two degrees of freedom: 1.39
    assert errors[True] < 1.15 * errors[False]


@pytest.mark.parametrize("seed", range(12))
def test_a_turn_is_found(seed: int) -> None:
    rng = np.random.default_rng(seed)
    turn, place = Turn(float(rng.uniform(0.8, 20.0)), clockwise=bool(rng.integers(2))), (500.0, -800.0)
    rows = np.array(Flights(rng, int(rng.integers(3, 12)), 0.0).rows(place, turn, float(rng.uniform(-3.0, 3.0)), True))
    found = found_turn(rows[:, 0], rows[:, 1])
    assert found is not None
    assert found.clockwise == turn.clockwise
    assert found.period == pytest.approx(turn.period, rel=2e-3)


@pytest.mark.parametrize("seed", range(8))
def test_no_turn_is_found_where_nothing_turns(seed: int) -> None:
    rng = np.random.default_rng(seed)
    at_once = np.array(Flights(rng, 6, 0.0).rows((0.0, 0.0), Turn(4.0), 0.0, False))
    assert found_turn(at_once[:, 0], at_once[:, 1]) is None
    times = np.sort(rng.uniform(0.0, 300.0, 200))
    assert found_turn(times, rng.uniform(-math.pi, math.pi, 200)) is None
    assert found_turn(times, rng.normal(0.5, 0.01, 200)) is None  # a camera that stares
    drifting = 0.01 * at_once[:, 0] + np.where(np.arange(len(at_once)) % 2, 0.2, -0.2)
    assert found_turn(at_once[:, 0], drifting) is None  # two targets that pass by together
    assert found_turn(times[:10], rng.uniform(-math.pi, math.pi, 10)) is None


@pytest.mark.parametrize(("gather", "warned"), [(4.0, True), (0.0, False), (0.1, False)])
def test_rows_grouped_over_too_long_a_time_warn(tmp_path: Path, gather: float, warned: bool) -> None:
    flights = Flights(np.random.default_rng(4), 6, 0.0)
    write(tmp_path, {"R": flights.rows((0.0, 0.0), Turn(4.0), 0.0, True)}, {"R": (0.0, 0.0)})
    sensors = tmp_path / "radars.yaml"
    text = sensors.read_text("utf-8").replace("east}", f"east, turns: none, scan_window: {gather}}}")
    sensors.write_text(text, "utf-8")
    found = scenario_from_recording(sensors, tmp_path / "scans.csv", speed=250.0)
    told = [words for path, words in recording_warnings(found.scenario) if path == ("recording", "scan_window")]
    assert bool(told) is warned
    if warned:
        assert re.match(r"R: rows of one scan are [23]\.\d+ s apart \(median\), in which a target of 250 m/s", told[0])


def test_a_line_of_a_turning_radar_may_have_its_velocity(tmp_path: Path) -> None:
    (tmp_path / "radars.yaml").write_text(
        "region: {x_min: -9000, x_max: 9000, y_min: -9000, y_max: 9000}\nsensors:\n"
        "  - {name: R, position: [0, 0], turn: {period: 4.0}, noise: {kind: constant, std: [0.01, 20]}}\n",
        "utf-8",
    )
    told = scenario_from_sensors(tmp_path / "radars.yaml")
    line = b'{"sensor": "R", "time": 10.0, "velocity": [3, -4], "times": [9.0], "measurements": [[0.5, 4000.0]]}'
    pose = read_message(line, "line 1", recorded_sensors(told.scenario.model), told.conventions).scan.pose
    np.testing.assert_array_equal(pose[6:8], [3.0, -4.0])
    assert is_turn(pose)
    np.testing.assert_allclose(lags(np.array([0.5]), pose), [-1.0], atol=1e-12)
    for time in (5.9, 14.1):
        with pytest.raises(InputError, match=r"line 1, times: expected times within a turn \(4 s\) of `time`; got"):
            read_message(
                line.replace(b"[9.0]", f"[{time}]".encode()),
                "line 1",
                recorded_sensors(told.scenario.model),
                told.conventions,
            )


def test_every_row_is_in_one_turn_and_its_time_that_of_the_beam() -> None:
    flights, turn = Flights(np.random.default_rng(2), 7, 0.0), Turn(5.0)
    rows = np.array(flights.rows((0.0, 0.0), turn, 1.0, True))
    gone = np.flatnonzero((rows[:, 0] < 100.0) | (rows[:, 0] > 113.0))  # two turns and more without a row
    rows = rows[gone]
    poses = np.column_stack([10.0 * rows[:, 0], -4.0 * rows[:, 0], np.zeros(len(rows))])
    scans = swept(rows[:, 0], rows[:, 1], poses, turn, rows[[0, -1], 0])
    assert sorted(np.concatenate([scan.rows for scan in scans]).tolist()) == list(range(len(rows)))
    assert any(len(scan.rows) == 0 for scan in scans)
    for scan in scans:
        np.testing.assert_allclose(scan.pose[:2], [10.0 * scan.time, -4.0 * scan.time], atol=1e-6)
        np.testing.assert_allclose(scan.time + lags(rows[scan.rows, 1], scan.pose), rows[scan.rows, 0], atol=0.02)
        if len(scan.rows):
            np.testing.assert_allclose(scan.pose[6:8], [10.0, -4.0], atol=1e-6)
    assert np.diff([scan.time for scan in scans]) == pytest.approx(5.0, abs=0.02)


def parsed(rows: Floats, **site: object) -> RecordedScans:
    columns = {"time": rows[:, 0].tolist(), "bearing": rows[:, 1].tolist(), "range": rows[:, 2].tolist()}
    table = Table(columns, range(1, len(rows) + 1), "scans.csv")
    given = RecordedSensor("R", "bearing_range", (0.0, 0.0, 0.0), **site)  # type: ignore[arg-type]
    return parse_scans(table, [given], Conventions({}, {"bearing": "rad"}, "east"))


def test_a_turn_that_is_given_needs_few_rows_and_none_can_be_ruled_out() -> None:
    rows = np.array(Flights(np.random.default_rng(5), 4, 0.0).rows((0.0, 0.0), Turn(5.0), 1.0, True))
    few = rows[rows[:, 0] < 11.0]
    assert not any(is_turn(poses[0]) for poses in parsed(few[:9]).poses)
    assert all(is_turn(poses[0]) for poses in parsed(few[:9], turn=Turn(5.0)).poses)
    assert len(parsed(rows, turn="none").times) == len(np.unique(rows[:, 0]))
    assert len(parsed(rows).times) < 60


def test_times_of_measurements_give_the_rotation_of_a_line() -> None:
    rows = np.array(Flights(np.random.default_rng(6), 8, 0.0).rows((0.0, 0.0), Turn(5.0), 1.0, True))
    recording, site = parsed(rows), RecordedSensor("R", "bearing_range", (0.0, 0.0, 0.0), turn=Turn(5.0))
    still, how = (
        [RecordedSensor("R", "bearing_range", (0.0, 0.0, 0.0), turn="none")],
        Conventions({}, {"bearing": "rad"}, "east"),
    )
    for k in range(5, 20):
        time, scan, poses = recording.times[k] + recording.start, recording.scans[k][0], recording.poses[k]
        assert isinstance(scan, np.ndarray)
        times = (time + lags(scan[:, 0], poses[0])).tolist()
        line = {"sensor": "R", "time": float(time), "measurements": scan.tolist(), "times": times}
        pose = read_message(json.dumps(line).encode(), "line", [site], how).scan.pose
        np.testing.assert_allclose(pose[:3], poses[0, :3], atol=1e-9)
        np.testing.assert_allclose(pose[8:], poses[0, 8:], rtol=1e-2, atol=2e-2)
        line["times"] = times[1:]
        with pytest.raises(InputError, match="times: expected a list of"):
            read_message(json.dumps(line).encode(), "line", [site], how)
        with pytest.raises(InputError, match=r"times: expected none, as the sensors file gives no `turn`"):
            read_message(json.dumps({**line, "times": times}).encode(), "line", still, how)


def test_a_sensors_file_gives_a_turn_of_any_period(tmp_path: Path) -> None:
    write(tmp_path, {}, {"R": (0.0, 0.0)})
    file = tmp_path / "radars.yaml"
    text = file.read_text("utf-8").replace("name: R,", "name: R, turn: {period: 5.0},")
    file.write_text(f"region: {{x_min: -60000, x_max: 60000, y_min: -60000, y_max: 60000}}\n{text}", "utf-8")
    (site,) = recorded_sensors(scenario_from_sensors(file, speed=250.0).scenario.model)
    assert site.turn == Turn(5.0)


def test_a_radar_that_moves_in_its_turn(tmp_path: Path) -> None:
    rng, turn, velocity = np.random.default_rng(8), Turn(2.5), np.array([20.0, 6.0])
    buoys = rng.uniform(-2500.0, 2500.0, (6, 2))
    lines = ["time,sensor,bearing_rad,range_m,own_x,own_y"]
    for time in np.arange(0.0, 120.0, 0.002).tolist():
        own = np.array([-1000.0, 300.0]) + velocity * time
        off = buoys - own
        ahead = np.abs(
            np.remainder(np.arctan2(off[:, 1], off[:, 0]) - turn.rate * time + math.pi, 2.0 * math.pi) - math.pi
        )
        for i in np.flatnonzero(ahead <= abs(turn.rate) * 0.001):
            bearing = math.atan2(off[i, 1], off[i, 0]) + rng.normal(0.0, 0.0026)
            far = math.hypot(*off[i]) + rng.normal(0.0, 8.0)
            lines.append(f"{time!r},B,{math.remainder(bearing, 2.0 * math.pi)!r},{far},{own[0]},{own[1]}")
    write(tmp_path, {}, {"B": (0.0, 0.0)})
    (tmp_path / "scans.csv").write_text("\n".join(lines), "utf-8")
    text = (tmp_path / "radars.yaml").read_text("utf-8").replace(f"[{STD[0]}, {STD[1]}]", "[0.0026, 8.0]")
    (tmp_path / "radars.yaml").write_text(text, "utf-8")
    found = scenario_from_recording(tmp_path / "radars.yaml", tmp_path / "scans.csv")
    assert found.assumed["turn"] == "B once in 2.5 s, clockwise (found from bearings and times; a scan is one turn)"
    record = track_recording(found.scenario, found.recording)
    last = record.estimates[-2].means[:, :2]
    assert len(last) == 6
    apart = np.hypot(*(last[:, np.newaxis] - buoys).transpose(2, 0, 1)).min(axis=1)
    assert apart.mean() < 6.0


SIMULATED = """\
name: turning
time: {num_steps: 40, step_period: 5.0}
region: {x_min: -30000.0, x_max: 30000.0, y_min: -30000.0, y_max: 30000.0}
motion: {kind: constant_velocity, sigma_v: 1.0}
survival: {kind: constant, probability: 0.99}
birth:
  sites:
    - {existence: 0.03, mean: [8000.0, 9000.0, 0.0, 0.0], std: [500.0, 500.0, 150.0, 150.0]}
    - {existence: 0.03, mean: [-9000.0, 4000.0, 0.0, 0.0], std: [500.0, 500.0, 150.0, 150.0]}
targets:
  kind: scripted
  tracks: [{state: [8000.0, 9000.0, -180.0, 20.0]}, {state: [-9000.0, 4000.0, 150.0, -90.0]}]
sensors:
  - position: [0.0, 0.0]
    turn: {period: 5.0}
    platform: {kind: heading, speed: 30.0, headings_deg: [0.0, 90.0, 180.0, 270.0]}
    noise: {kind: constant, std: [0.002, 40.0]}
    detection: {kind: constant, probability: 0.95}
    clutter: {kind: region, rate: 2.0}
filter: {kind: lmb}
control: {decision_steps: [10, 20, 30], horizon_steps: 5}
planners: {p: {kind: joint}}
"""


def test_a_simulated_radar_turns_and_decides(tmp_path: Path) -> None:
    errors = []
    for turns in (True, False):
        text = SIMULATED if turns else SIMULATED.replace("    turn: {period: 5.0}\n", "")
        (tmp_path / "s.yaml").write_text(text, "utf-8")
        record = run_scenario(load_scenario(tmp_path / "s.yaml"), "p", seed=3)
        assert len(record.decisions) == 3
        assert is_turn(record.poses[-1, 0]) is turns
        off = [
            estimate.means[:, np.newaxis, :2] - record.truth.at(k)[1][:, :2]
            for k, estimate in enumerate(record.estimates)
            if k > 8
        ]
        errors.append(np.mean([np.hypot(*own.transpose(2, 0, 1)).min(axis=1).mean() for own in off]))
    assert errors[0] < 1.5 * errors[1]


def test_scans_of_a_simulated_radar_are_written_with_the_times_of_the_beam(tmp_path: Path) -> None:
    (tmp_path / "s.yaml").write_text(SIMULATED, "utf-8")
    scenario = load_scenario(tmp_path / "s.yaml")
    record = run_scenario(scenario, "p", seed=3)
    columns = scan_table(record, scenario)
    order = np.argsort(columns["time"])
    table = Table({name: [column[i] for i in order] for name, column in columns.items()}, range(len(order)), "scans")
    read = parse_scans(table, recorded_sensors(scenario.model), Conventions({}, {}, "east"))
    drawn = [scan for (scan,) in scans_of_record(record, scenario) if scan is not None and len(scan.measurements)]
    assert sum(len(scan.measurements) for scan in drawn) == read.num_measurements
    for time, (scan,), poses in zip(read.start + read.times, read.scans, read.poses, strict=True):
        k = int(np.abs(record.times - time).argmin())
        assert isinstance(scan, np.ndarray)
        off = lags(scan[:, 0], poses[0]) + time - record.times[k] - lags(scan[:, 0], record.poses[k, 0])
        assert np.abs(np.remainder(off + 2.5, 5.0) - 2.5).max(initial=0.0) < 0.01


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "turn: {period: 5.0}",
            "turn: {period: 6.0}",
            "turn.period: expected at most the time from one scan",
        ),
        ("turn: {period: 5.0}", "turn: {period: 0.0}", "turn.period: expected a number above 0"),
        ("turn: {period: 5.0}", "turn: {period: 5.0}\n    measurement: {kind: range_only}", "turn: expected none"),
    ],
)
def test_invalid_rotations_are_reported(tmp_path: Path, old: str, new: str, message: str) -> None:
    (tmp_path / "s.yaml").write_text(SIMULATED.replace(old, new), "utf-8")
    with pytest.raises(ScenarioError, match=re.escape(message)):
        load_scenario(tmp_path / "s.yaml")
