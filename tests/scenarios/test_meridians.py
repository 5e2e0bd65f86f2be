"""True north away from the origin: bearings and headings by compass, against geodesics of the ellipsoid."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reference.geodesy import inverse
from vedette.evaluation.runs import run_scenario
from vedette.evaluation.scans import scan_table, scans_of_record
from vedette.live import LiveLoop, build_live_loop
from vedette.platforms import PlaneCompass
from vedette.recorded import Conventions, Origin, RecordedSensor, as_table, parse_scans
from vedette.scenarios import load_scenario
from vedette.scenarios.from_recording import scenario_from_recording, scenario_from_sensors
from vedette.scenarios.overrides import replace_fields
from vedette.scenarios.recorded_data import recorded_sensors

FAR = Origin(-1.05, 50.7)
RADARS = {"A": (-1.05, 50.7), "B": (0.35, 50.7)}  # 98.9 km apart on one latitude
SHIP = (-0.35, 50.75)
SENSORS = """origin: {lon: -1.05, lat: 50.7}
recording: {bearings: north}
sensor_defaults:
  noise: {kind: range_dependent, sigma_range: 20.0, eta_range: 0.0, sigma_bearing_deg: 0.1, eta_bearing: 0.0}
  detection: {kind: constant, probability: 0.95}
  clutter: {kind: region, rate: 0.1}
sensors: [{name: A, position: {lon: -1.05, lat: 50.7}}, {name: B, position: {lon: 0.35, lat: 50.7}}]
"""


def seen(radar: str, ship: tuple[float, float]) -> tuple[float, float]:
    """What an exact radar tells of a ship: bearing from its own true north, deg, and range, m."""
    distance, azimuth = inverse(RADARS[radar], ship)
    return math.degrees(azimuth) % 360.0, distance


@pytest.mark.parametrize(
    ("reach", "degrees", "metres"), [(1e4, 1e-4, 0.005), (5e4, 0.0015, 0.6), (1e5, 0.006, 5.0), (2e5, 0.025, 40.0)]
)
def test_azimuths_and_distances_are_those_of_geodesics(reach: float, degrees: float, metres: float) -> None:
    rng = np.random.default_rng(1)
    for k in range(200):
        longitude = rng.uniform(-180.0, 180.0) if k % 2 else rng.choice([-179.9, 180.0, 179.8])
        origin = Origin(longitude, rng.uniform(-65.0, 65.0))
        angle = rng.uniform(-math.pi, math.pi)
        place = 0.7 * reach * np.array([math.cos(angle), math.sin(angle)])
        other = place + 0.3 * reach * np.array([math.cos(3.0 * angle + k), math.sin(3.0 * angle + k)])
        here, there = (tuple(each) for each in origin.to_degrees([place, other]).tolist())
        distance, azimuth = inverse(here, there)
        (dx, dy), plane = other - place, float(origin.angle(azimuth, place))
        assert abs(math.remainder(plane - math.atan2(dy, dx), 2.0 * math.pi)) < math.radians(degrees)
        assert abs(math.hypot(dx, dy) - distance) < metres
        assert float(origin.azimuth(plane, place)) == pytest.approx(azimuth, abs=1e-12)
        # At a place of the plane, and at one in degrees.
        east, north = origin.axes([here[0]], [here[1]])[0] @ [math.sin(azimuth), math.cos(azimuth)]
        assert abs(math.remainder(math.atan2(north, east) - plane, 2.0 * math.pi)) < 1e-9


@pytest.mark.parametrize("latitude", [50.7, -50.7, 0.0, 78.0])
@pytest.mark.parametrize(("longitude", "east"), [(-1.05, 0.35), (179.5, -179.1), (-179.1, 179.5), (179.5, 180.9)])
def test_meridians_converge_by_the_sine_of_the_latitude(latitude: float, longitude: float, east: float) -> None:
    origin = Origin(longitude, latitude)
    (place,) = origin.to_plane([east], [latitude])
    off = math.remainder(east - longitude, 360.0)
    # To the east of the origin in the north, true north leans to the left of y.
    turned = math.degrees(float(origin.angle(0.0, place))) - 90.0
    assert turned == pytest.approx(off * math.sin(math.radians(latitude)), abs=2e-4)
    assert math.degrees(float(origin.angle(0.0, [0.0, 0.0]))) == pytest.approx(90.0, abs=1e-12)


def test_two_radars_far_apart_see_a_ship_in_one_place() -> None:
    """Without convergence the places are 915 m apart."""
    sites = [
        RecordedSensor(name, "bearing_range", (*FAR.to_plane([lon], [lat])[0].tolist(), 0.0))
        for name, (lon, lat) in RADARS.items()
    ]
    rows: dict[str, list[Any]] = {"time": [0.0, 1.0], "sensor": list(RADARS)}
    rows["bearing_deg"], rows["range"] = map(list, zip(*(seen(name, SHIP) for name in RADARS), strict=True))
    found = parse_scans(as_table(rows), sites, Conventions({}, {}, "north"), FAR)
    (truth,) = FAR.to_plane([SHIP[0]], [SHIP[1]])
    for s, site in enumerate(sites):
        scan = found.scans[s][s]
        assert isinstance(scan, np.ndarray)
        angle, distance = scan[0]
        place = np.array(site.pose[:2]) + distance * np.array([math.cos(angle), math.sin(angle)])
        assert np.hypot(*(place - truth)) < 5.0
        # What a sensor tells of its measurement is the row that was read.
        own = RecordedSensor(site.name, site.kind, site.pose, compass=True, north=FAR)
        assert own.to_raw(scan)[0] == pytest.approx(seen(site.name, SHIP), abs=1e-9)
        np.testing.assert_allclose(own.from_raw(own.to_raw(scan)), scan, atol=1e-9)


def test_a_ship_between_two_far_radars_is_one_track(tmp_path: Path) -> None:
    lines = ["time,sensor,range_m,bearing_deg"]
    for k in range(60):
        name, ship = "AB"[k % 2], (SHIP[0] + 2e-5 * k, SHIP[1] + 1e-5 * k)
        bearing, distance = seen(name, ship)
        lines.append(f"{2.5 * k},{name},{distance:.1f},{bearing:.4f}")
    (tmp_path / "scans.csv").write_text("\n".join(lines) + "\n", "utf-8")
    (tmp_path / "radars.yaml").write_text(SENSORS, "utf-8")
    made = scenario_from_recording(tmp_path / "radars.yaml", tmp_path / "scans.csv")
    record = run_scenario(made.scenario, "stationary", seed=0)
    last = record.estimates[-1]
    (truth,) = FAR.to_plane([ship[0]], [ship[1]])
    assert len({tuple(label) for estimate in record.estimates for label in estimate.labels.tolist()}) == 1
    assert np.hypot(*(last.means[0, :2] - truth)) < 10.0


def far_loop(folder: Path) -> LiveLoop:
    text = SENSORS + "region: {x_min: -20e3, x_max: 120e3, y_min: -20e3, y_max: 40e3}\n"
    (folder / "live.yaml").write_text(
        text.replace("bearings: north", "bearings: north, units: {bearing: deg}"), "utf-8"
    )
    return build_live_loop(scenario_from_sensors(folder / "live.yaml"), num_threads=1)


def test_lines_and_own_headings_are_from_true_north_at_the_sensor(tmp_path: Path) -> None:
    live = far_loop(tmp_path)
    pose = {"lon": RADARS["B"][0], "lat": RADARS["B"][1], "heading_deg": 30.0}
    line = {"sensor": "B", "time": 0.0, "measurements": [seen("B", SHIP)], "pose": pose}
    timeline = live.process(live.initial(), json.dumps(line).encode())[0].timeline
    x, y, heading = timeline.poses[1][:3]
    turned = 1.4 * math.sin(math.radians(50.7))
    assert math.degrees(heading) == pytest.approx(60.0 + turned, abs=0.005)
    angle, distance = timeline.entries[0].scans[1].measurements[0]
    place = np.array([x, y]) + distance * np.array([math.cos(angle), math.sin(angle)])
    assert np.hypot(*(place - FAR.to_plane([SHIP[0]], [SHIP[1]])[0])) < 5.0


def test_scans_are_written_from_true_north_and_read_back() -> None:
    changes: dict[str, Any] = {
        "origin": {"lon": 179.99, "lat": -60.0},
        "time.num_steps": 5,
        "control.decision_steps": [2],
        "ospa.first_scan": 1,
        "ospa.last_scan": 5,
        "sensors.0.compass": True,
        "sensors.1.compass": True,
    }
    scenario = replace_fields(load_scenario("paper-a"), changes)
    record = run_scenario(scenario, "random", seed=3)
    table = scan_table(record, scenario)
    assert scenario.model.origin is not None
    origin = scenario.model.origin.build()
    found = parse_scans(as_table(table), recorded_sensors(scenario.model), Conventions({}, {}), origin)
    np.testing.assert_allclose(np.cos(found.poses[..., 2] - record.poses[..., 2]), 1.0)
    expected = float(np.degrees(origin.azimuth(record.poses[0, 0, 2], record.poses[0, 0])) % 360.0)
    assert table["own_heading_deg"][0] == pytest.approx(expected, abs=1e-9)
    for scans, drawn in zip(found.scans, scans_of_record(record, scenario), strict=True):
        for scan, one in zip(scans, drawn, strict=True):
            assert isinstance(scan, np.ndarray)
            assert one is not None
            np.testing.assert_allclose(scan, one.measurements, rtol=1e-12, atol=1e-12)


def test_without_an_origin_north_is_along_y() -> None:
    angles = np.linspace(-3.0, 3.0, 13)
    for compass in (PlaneCompass(), RecordedSensor("a", "bearing_only", (9e4, 0.0, 0.0)).north):
        found = compass.angle(angles, [9e4, 0.0])
        expected = math.pi / 2.0 - angles
        np.testing.assert_array_equal(found, expected - 2.0 * math.pi * np.rint(expected / (2.0 * math.pi)))
    site = RecordedSensor("a", "bearing_only", (9e4, 0.0, 0.0))
    rows = {"time": [0.0], "sensor": ["a"], "bearing_deg": [30.0]}
    found_scans = parse_scans(as_table(rows), [site], Conventions({}, {}, "north"))
    assert isinstance(found_scans.scans[0][0], np.ndarray)
    assert found_scans.scans[0][0][0, 0] == math.pi / 2.0 - 30.0 * (math.pi / 180.0)
