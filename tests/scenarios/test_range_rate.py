"""Range rates from a scenario to tracks: simulated, recorded, in lines, and calibrated."""

from __future__ import annotations

import csv
import json
import math
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vedette.calibration import calibrate
from vedette.errors import InputError, ScenarioError
from vedette.evaluation.metrics.point_ospa import ospa_of_run
from vedette.evaluation.scans import scan_table
from vedette.kernels.base.types import OWN_VELOCITY
from vedette.live import build_live_loop
from vedette.live.messages import read_message
from vedette.recorded import Conventions, RecordedSensor, parse_scans
from vedette.recorded.tables import Table
from vedette.scenarios import Scenario, parse_scenario
from vedette.scenarios.build import build_experiment, build_planner, build_sensors
from vedette.scenarios.calibration import build_problem
from vedette.scenarios.from_recording import scenario_from_recording, scenario_from_sensors
from vedette.scenarios.recorded_data import recorded_sensors
from vedette.simulation import simulate

KNOT = 1852.0 / 3600.0  # m/s
SENSORS: list[dict[str, Any]] = [
    {"name": "still", "position": [-900.0, 0.0]},
    {
        "name": "boat",
        "position": [0.0, -900.0],
        "heading_deg": 90.0,
        "stationary_until_first_decision": False,
        "platform": {"kind": "heading", "speed": 8.0, "headings_deg": [90.0]},
    },
]


def scenario(**changes: Any) -> Scenario:
    data: dict[str, Any] = {
        "format": 1,
        "name": "doppler",
        "time": {"num_steps": 12, "step_period": 2.0, "start": 2.0},
        "region": {"x_min": -1000.0, "x_max": 1000.0, "y_min": -1000.0, "y_max": 1000.0},
        "motion": {"kind": "constant_velocity", "sigma_v": 0.2},
        "survival": {"kind": "constant", "probability": 0.99},
        "birth": {"from_measurements": {"expected": 0.2, "max_existence": 0.1, "std": [60.0, 60.0, 15.0, 15.0]}},
        "targets": {
            "kind": "scripted",
            "tracks": [{"state": [100.0, 300.0, -9.0, 4.0]}, {"state": [-300.0, 100.0, 3.0, 12.0]}],
        },
        "sensor_defaults": {
            "measurement": {"kind": "bearing_range_rate"},
            "noise": {"kind": "range_dependent", "sigma_range": 8.0, "sigma_bearing_deg": 0.5, "sigma_range_rate": 0.3},
            "detection": {"kind": "constant", "probability": 0.95},
            "clutter": {"kind": "region", "rate": 1.0, "max_range_rate": 30.0},
        },
        "sensors": SENSORS,
        "fusion": {"kind": "central"},
        **changes,
    }
    return Scenario(parse_scenario(json.dumps(data)), Path("doppler.yaml"))


@pytest.fixture(scope="module")
def run() -> tuple[Any, Scenario]:
    made = scenario()
    score = partial(ospa_of_run, cutoff=100.0, order=1.0)
    return simulate(build_experiment(made), build_planner(made, "random", 1), seed=3, run=0, score=score), made


def test_a_run_tracks_positions_and_velocities(run: tuple[Any, Scenario]) -> None:
    record, _ = run
    first, last = record.truth.states[-2:], record.estimates[-1]
    assert last.num_targets == 2
    gaps = np.hypot(*(first[:, None, :2] - last.means[None, :, :2]).transpose(2, 0, 1))
    assert gaps.min(axis=1).max() < 30.0
    assert np.abs(last.means[gaps.argmin(axis=1), 2:] - first[:, 2:]).max() < 1.0


def test_a_platform_that_moves_gives_its_velocity(run: tuple[Any, Scenario]) -> None:
    record, _ = run
    np.testing.assert_allclose(record.poses[1:, 1, OWN_VELOCITY:], np.tile([0.0, 8.0], (11, 1)), atol=1e-6)
    np.testing.assert_array_equal(record.poses[:, 0, 3:], 0.0)


def test_scans_that_are_written_are_read_again(run: tuple[Any, Scenario]) -> None:
    record, made = run
    table = scan_table(record, made)
    assert list(table)[2:] == [
        *("bearing_rad", "range_m", "range_rate_mps"),
        *("own_x_m", "own_y_m", "own_heading_rad", "own_vx_mps", "own_vy_mps"),
    ]
    read = parse_scans(
        Table(table, range(1, len(table["time"]) + 1), "scans"),
        recorded_sensors(made.model),
        Conventions({}, {}, "east"),
    )
    np.testing.assert_array_equal(read.poses, record.poses)
    assert (read.unused, read.notes) == ((), ())
    assert {scan.shape[1] for s in range(read.poses.shape[1]) for scan in read.measured(s)} == {3}


def test_a_moving_sensor_without_velocity_is_reported() -> None:
    site = RecordedSensor("a", "bearing_range_rate", (0.0,) * 8)
    cells = {"time": [0.0, 1.0], "bearing_rad": [0.1, 0.1], "range_m": [50.0, 51.0], "range_rate_kn": [1.0, -2.0]}
    cells |= {"own_x": [0.0, 3.0], "own_y": [0.0, 0.0]}
    read = parse_scans(Table(cells, [1, 2], "scans"), [site], Conventions({}, {}, "east"))
    np.testing.assert_allclose(
        np.concatenate([scan for scan in read.scans[0] if scan is not None]), [[0.1, 50.0, KNOT]]
    )
    assert read.notes == (
        "a measures range rates and moves, but its velocity is not given: they are taken as relative to the ground "
        "(columns own_vx, own_vy)",
    )
    told = cells | {"own_vx": [3.0, 3.0], "own_vy": [0.5, 0.5]}
    read = parse_scans(Table(told, [1, 2], "scans"), [site], Conventions({}, {}, "east"))
    assert read.poses[:, 0, OWN_VELOCITY:].tolist() == [[3.0, 0.5]] * 2
    with pytest.raises(
        InputError, match=r"column 'own_vx': expected a column of own_vy beside it, as a velocity has both"
    ):
        parse_scans(Table(cells | {"own_vx": [3.0, 3.0]}, [1, 2], "scans"), [site], Conventions({}, {}, "east"))


def test_a_line_has_a_range_rate_and_the_velocity_of_its_sensor() -> None:
    sites = [
        RecordedSensor("a", "bearing_range_rate", (0.0,) * 8),
        RecordedSensor("b", "bearing_range", (0.0, 0.0, 0.0)),
    ]
    said = {
        "sensor": "a",
        "time": 3.0,
        "measurements": [[0.1, 50.0, -4.0]],
        "pose": [5.0, 6.0, 0.2],
        "velocity": [7, -8],
    }
    scan = read_message(json.dumps(said).encode(), "line 1", sites, Conventions({}, {})).scan
    assert scan.measurements.tolist() == [[0.1, 50.0, -4.0]]
    assert scan.pose.tolist() == [5.0, 6.0, 0.2, 0.0, 0.0, 0.0, 7.0, -8.0]
    for change, words in (
        ({"velocity": [1.0]}, r"line 1, velocity: expected numbers \[vx, vy\]"),
        ({"measurements": [[0.1, 50.0]]}, r"measurements\[0\]: expected numbers \[bearing, range, range_rate\]"),
        (
            {"sensor": "b", "measurements": []},
            r"line 1, velocity: expected none, as sensor 'b' measures no range rates",
        ),
    ):
        with pytest.raises(InputError, match=words):
            read_message(json.dumps(said | change).encode(), "line 1", sites, Conventions({}, {}))


def test_lines_become_tracks_with_velocities(tmp_path: Path) -> None:
    (tmp_path / "radars.yaml").write_text(
        "region: {x_min: -1000.0, x_max: 1000.0, y_min: -1000.0, y_max: 1000.0}\nsensor_defaults:\n"
        "  measurement: {kind: bearing_range_rate}\n  noise: {kind: constant, std: [0.005, 5.0, 0.2]}\n"
        "  detection: {kind: constant, probability: 0.95}\n  clutter: {kind: region, rate: 0.1}\n"
        "sensors:\n  - {name: a, position: [-900.0, 0.0]}\n",
        "utf-8",
    )
    live = build_live_loop(scenario_from_sensors(tmp_path / "radars.yaml", speed=15.0))
    state = live.initial()
    for k in range(4):
        rows = [[0.0, 900.0 - 14.0 * k, -7.0], [0.0, 5000.0, 0.0]]
        line = {"sensor": "a", "time": 2.0 * k, "measurements": rows, "pose": [-900.0, 0.0, 0.0]}
        state, answers = live.process(state, json.dumps(line).encode())
    (answer,) = answers
    assert answer["beyond"] == 1
    assert [round(each["vx"]) for each in answer["tracks"]] == [-7]


def test_a_constraint_on_visits_has_no_room_for_velocities() -> None:
    revisit = {"kind": "revisit", "places": [[0.0, 0.0]], "radius": 50.0, "every": 60.0}
    with pytest.raises(ScenarioError, match=r"expected no range rate, beside revisit"):
        scenario(control={"decision_every": 4, "constraints": [revisit]})


def folded(most: float = 4.0, **clutter: Any) -> Scenario:
    """The scene, with range rates folded at far less than those of its targets."""
    defaults = scenario().model.model_dump(mode="json", exclude_none=True)["sensors"][0]
    own = {
        "measurement": {"kind": "bearing_range_rate", "max_unambiguous_range_rate": most},
        "clutter": {"kind": "region", "rate": 1.0, **clutter},
        "noise": defaults["noise"],
        "detection": defaults["detection"],
    }
    return scenario(sensor_defaults=own, time={"num_steps": 25, "step_period": 2.0, "start": 2.0})


def test_a_run_with_folded_range_rates_finds_the_velocities() -> None:
    made = folded()
    score = partial(ospa_of_run, cutoff=100.0, order=1.0)
    record = simulate(build_experiment(made), build_planner(made, "random", 1), seed=3, run=0, score=score)
    rates = np.abs([rate for rate in scan_table(record, made)["range_rate_mps"] if rate is not None])
    assert 3.5 < rates.max() <= 4.0
    truth, last = record.truth.states[-2:], record.estimates[-1]
    assert last.num_targets == 2
    nearest = np.hypot(*(last.means[:, None, :2] - truth[:, :2]).transpose(2, 0, 1)).argmin(axis=1)
    np.testing.assert_allclose(last.means[:, 2:4], truth[nearest, 2:4], atol=1.5)


def test_clutter_of_folded_range_rates_is_uniform_over_the_interval() -> None:
    (clutter, *_) = (sensor.filter.sensor.clutter for sensor in build_sensors(folded()))
    level = clutter.log_intensity_at([[0.5, 200.0, 3.9], [0.5, 200.0, -1.0]], np.array([-900.0, 0.0, 0.0]))
    assert level == pytest.approx([math.log(200.0 / 4e6 / 8.0)] * 2)
    with pytest.raises(ScenarioError, match=r"expected at most 4, where range rates are folded, got 30"):
        folded(max_range_rate=30.0)


@pytest.mark.slow
@pytest.mark.parametrize("most", [None, 6.0])
def test_calibrate_finds_bias_and_noise_of_range_rates(tmp_path: Path, most: float | None) -> None:
    rows, rng = [], np.random.default_rng(4)
    places, biases, stds = {"a": [-4000.0, 0.0], "b": [0.0, -4000.0]}, {"a": 3.0, "b": -1.5}, [0.004, 15.0, 0.6]
    tracks = [[-1500.0, 0.0, 8.0, 3.0], [900.0, -900.0, -4.0, 9.0], [0.0, 1500.0, 2.0, -10.0], [500.0, 700.0, 9.0, 5.0]]
    for k in range(40):
        for name, place in places.items():
            for state in np.array(tracks):
                at, v = state[:2] + 5.0 * k * state[2:] - place, state[2:]
                measured = [math.atan2(at[1], at[0]), math.hypot(*at), at @ v / math.hypot(*at) + biases[name]]
                bearing, distance, rate = (np.array(measured) + stds * rng.standard_normal(3)).tolist()
                rate = rate if most is None else math.remainder(rate, 2.0 * most)
                rows.append([5.0 * k, name, bearing, distance, rate])
    with (tmp_path / "scans.csv").open("w", newline="") as file:
        csv.writer(file).writerows([["time", "sensor", "bearing_rad", "range_m", "range_rate_mps"], *rows])
    own = "" if most is None else f", max_unambiguous_range_rate: {most}"
    (tmp_path / "radars.yaml").write_text(
        "motion: {kind: constant_velocity, sigma_v: 0.05}\nrecording: {bearings: east}\nsensor_defaults:\n"
        f"  measurement: {{kind: bearing_range_rate{own}}}\n"
        "  detection: {kind: constant, probability: 0.9}\n"
        "  noise: {kind: range_dependent, sigma_range: 20.0, eta_range: 0.0, sigma_range_rate: 1.0}\n"
        "sensors:\n  - {name: a, position: [-4000.0, 0.0]}\n  - {name: b, position: [0.0, -4000.0]}\n",
        "utf-8",
    )
    made = scenario_from_recording(tmp_path / "radars.yaml", tmp_path / "scans.csv", speed=20.0)
    largest = made.scenario.model.sensors[0].clutter.max_range_rate
    assert largest is None if most is not None else largest > 9.0
    found = {
        (each.parameter.sensor, each.parameter.name): each
        for each in calibrate(build_problem(made.scenario, prior_scale=10.0)).estimates
    }
    for s, bias in enumerate(biases.values()):
        assert found[s, "range_rate"].reason == ""
        assert found[s, "range_rate"].value == pytest.approx(bias, abs=0.3)
        assert found[s, "noise.sigma_range_rate"].value == pytest.approx(0.6, rel=0.15)
    assert found[0, "range_rate"].parameter.label == "range rate bias"
